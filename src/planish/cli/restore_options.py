"""Flags of the whole walk from scan to page, which `planish restore` and `planish batch` share."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from cyclopts import Parameter

from planish.settings import (
    BinarizeSettings,
    FlattenSettings,
    Pages,
    RenderSettings,
    RestoreSettings,
    Rotation,
    ShadingSettings,
)

Flags = Parameter(name="*")


@dataclass(frozen=True, kw_only=True)
class RestoreOptions:
    """How a page is made of a scan.

    Attributes
    ----------
    flattening : FlattenSettings
    drawing : RenderSettings
    shading : ShadingSettings
    binarizing : BinarizeSettings
    rotate : {"auto", "0", "90", "180", "270"}
        auto: as the text reads; where there is none, long side upright and the photo's top on top. A number: clockwise
        turn from the photo's way round.
    pages : {"1", "2", "auto"}
        2: the sheet is an open book, and is split at its spine into a left and a right page: of one TIFF or PDF, or
        NAME-1.png and NAME-2.png. auto: only where a spine is plain in the surface and no line of text crosses it.
        1: the sheet stays whole.
    pdfa : bool
        Make PDFs for archives: PDF/A-2b.
    ocr : str, optional
        Lay the text that Tesseract reads under the pages of a PDF, to be searched and copied; its language, as eng
        or deu+fra. Needs the extra planish[ocr].
    """

    flattening: Annotated[FlattenSettings, Flags] = field(default_factory=FlattenSettings)
    drawing: Annotated[RenderSettings, Flags] = field(default_factory=RenderSettings)
    shading: Annotated[ShadingSettings, Flags] = field(default_factory=ShadingSettings)
    binarizing: Annotated[BinarizeSettings, Flags] = field(default_factory=BinarizeSettings)
    rotate: Rotation = "auto"
    pages: Pages = "1"
    pdfa: Annotated[bool, Parameter(negative="")] = False
    ocr: str | None = None

    def settings(self) -> RestoreSettings:
        """Without what is about files."""
        return RestoreSettings(
            flatten=self.flattening,
            render=self.drawing,
            shading=self.shading,
            binarize=self.binarizing,
            rotate=self.rotate,
            pages=self.pages,
        )
