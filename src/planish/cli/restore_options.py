"""Options of the whole pipeline, shared by `planish restore` and `planish batch`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
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
    """Options of a restoration.

    Attributes
    ----------
    flatten : FlattenSettings
    render : RenderSettings
    shading : ShadingSettings
    binarize : BinarizeSettings
    rotate : {"auto", "0", "90", "180", "270"}
        auto: upright text; without text, portrait format with the photo's top up. A number: clockwise rotation in
        degrees from the orientation of the photo.
    pages : {"1", "2", "auto"}
        2: split an open book at its spine into a left and a right page, in one TIFF or PDF, or as NAME-1.png and
        NAME-2.png. auto: split only if the surface shows a clear spine and no line of text crosses it. 1: no split.
    sheet : {"auto", "all"} or an image
        auto: leave out the table around the sheet where it is plainly one, with a note. all: keep the whole mesh. An
        image: keep what it shows white, of the photo's size; black is 0.
    pdfa : bool
        Write PDFs as PDF/A-2b, for archives.
    ocr : str, optional
        Add a searchable text layer to PDFs, recognized by Tesseract; the language, such as eng or deu+fra. Needs the
        extra planish[ocr].
    """

    flatten: Annotated[FlattenSettings, Flags] = field(default_factory=FlattenSettings)
    render: Annotated[RenderSettings, Flags] = field(default_factory=RenderSettings)
    shading: Annotated[ShadingSettings, Flags] = field(default_factory=ShadingSettings)
    binarize: Annotated[BinarizeSettings, Flags] = field(default_factory=BinarizeSettings)
    rotate: Rotation = "auto"
    pages: Pages = "1"
    sheet: str = "auto"
    pdfa: Annotated[bool, Parameter(negative="")] = False
    ocr: str | None = None

    def settings(self) -> RestoreSettings:
        """Settings of the pipeline, without the options about files."""
        from dataclasses import replace

        from planish.job.settings_codec import decode_settings

        region = self.sheet if self.sheet in ("auto", "all") else "all"
        return decode_settings(RestoreSettings, replace(self, sheet=region))

    @property
    def sheet_mask(self) -> Path | None:
        """The image given as --sheet."""
        return None if self.sheet in ("auto", "all") else Path(self.sheet)
