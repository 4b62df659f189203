"""The flat page, and all that came of a scan."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import DTypeLike, NDArray

from planish.display.html import as_image, html_picture, html_table, small_jpeg, small_png
from planish.dpi import MM_PER_INCH
from planish.errors import MissingExtraError
from planish.types.arrays import Bools, Pixels, freeze
from planish.types.prepared import PreparedScan
from planish.types.report import Report
from planish.types.sheet import Flattening
from planish.types.summary import summary

if TYPE_CHECKING:
    from PIL.Image import Image
    from xarray import DataArray


@dataclass(frozen=True, eq=False)
class Page:
    """An image of the flat page; `numpy.asarray` of it is its pixels.

    Attributes
    ----------
    pixels : (rows, cols) or (rows, cols, 3) uint8 or uint16, or (rows, cols) bool (True is paper)
    known : (rows, cols) bool
        False where no scanned surface was seen.
    dpi : float
        True pixels per 25.4 mm of page.
    icc : bytes or None
        Colour profile of the pixels; sRGB where it is None.

    Examples
    --------
    >>> page = Page(np.full((300, 200), 255, np.uint8), known=np.ones((300, 200), bool), dpi=100.0)
    >>> page
    Page(200 x 300 px of uint8, 100 dpi, 50.8 x 76.2 mm)
    >>> np.asarray(page).shape, page.to_pil().info["dpi"]
    ((300, 200), (100.0, 100.0))
    """

    pixels: Pixels | Bools
    known: Bools
    dpi: float
    icc: bytes | None = None

    def __post_init__(self) -> None:
        freeze(self)

    @property
    def size_mm(self) -> tuple[float, float]:
        """Width and height of the image on paper."""
        rows, cols = self.known.shape
        return cols * MM_PER_INCH / self.dpi, rows * MM_PER_INCH / self.dpi

    def to_pil(self) -> Image:
        """The page as a Pillow image, with its dpi and colour profile; 16 bits are rounded to 8."""
        image = as_image(self.pixels)
        image.info["dpi"] = (self.dpi, self.dpi)
        if self.icc is not None:
            image.info["icc_profile"] = self.icc
        return image

    def to_xarray(self) -> DataArray:
        """The page as an xarray over y and x in millimetres (and channel), with `known` beside it.

        Raises
        ------
        MissingExtraError
            Where xarray is not installed.
        """
        try:
            from xarray import DataArray
        except ImportError:
            raise MissingExtraError("a page as an xarray needs the extra: pip install 'planish[xarray]'") from None

        # the centre of the pixel in column c lies c + 1/2 pixels from the left side
        y, x = ((np.arange(n) + 0.5) * MM_PER_INCH / self.dpi for n in self.known.shape)
        places = {"y": ("y", y, {"units": "mm"}), "x": ("x", x, {"units": "mm"}), "known": (("y", "x"), self.known)}
        return DataArray(self.pixels, places, ("y", "x", "channel")[: self.pixels.ndim], "page", {"dpi": self.dpi})

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray:
        return np.array(self.pixels, dtype=dtype, copy=copy)

    def __repr__(self) -> str:
        rows, cols = self.known.shape
        width, height = self.size_mm
        return f"Page({cols} x {rows} px of {self.pixels.dtype}, {self.dpi:g} dpi, {width:.1f} x {height:.1f} mm)"

    def _repr_png_(self) -> bytes:
        return small_png(self.pixels)


@dataclass(frozen=True, eq=False)
class Restoration:
    """All that came of a scan; a notebook shows its page and its figures.

    Attributes
    ----------
    flattening : Flattening
        With the place on the page of every point of the scan, in the scan's order.
    rendered, unshaded, binary : Page or None
        None where the scan has no photo, or where that stage was not asked for. Of the whole sheet.
    report : Report
        With the place of the spine, along which `planish.split_pages` cuts these pages in two.
    prepared : PreparedScan
        What was flattened and drawn.
    clipped : (rows, cols) bool or None
        Pixels of the page with a channel at its greatest value in the photo, where shade was removed.
    light : (rows, cols, 3) float32 or None
        Linear light that blank paper had in the photo, on a coarse grid over the page, where shade was removed.
    ppi : (rows, cols) float32 [1 / inch] or None
        Photo pixels per inch of page, on a coarse grid over the page; NaN where the photo did not see it.
    """

    flattening: Flattening
    rendered: Page | None
    unshaded: Page | None
    binary: Page | None
    report: Report
    prepared: PreparedScan
    clipped: Bools | None = None
    light: NDArray[np.float32] | None = None
    ppi: NDArray[np.float32] | None = None

    def __post_init__(self) -> None:
        freeze(self)

    def __repr__(self) -> str:
        width, height = self.flattening.size_mm
        error = self.report.flatten.expected_error_mm
        return f"Restoration({width:.1f} x {height:.1f} mm, expected error {error:.3f} mm; {self.report.outcome})"

    def _repr_html_(self) -> str:
        rows = [*summary(self.report), *(("note", str(warning)) for warning in self.report.warnings)]
        page = self.unshaded or self.rendered
        picture = html_picture(small_jpeg(page.pixels), "the restored page") if page else ""
        return f'<div style="display:flex;flex-wrap:wrap;gap:1.5em;align-items:start">{picture}{html_table(rows)}</div>'
