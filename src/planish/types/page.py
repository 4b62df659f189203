"""Page images, and the result of a restoration."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import DTypeLike, NDArray

from planish.display.html import as_image, html_picture, html_table, small_jpeg, small_png
from planish.dpi import MM_PER_INCH
from planish.errors import MissingExtraError, install_command
from planish.types.arrays import Bools, Pixels, freeze, frozen_copy, trusted
from planish.types.prepared import PreparedScan
from planish.types.report import Report
from planish.types.sheet import Flattening
from planish.types.summary import summary

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from PIL.Image import Image
    from xarray import DataArray


@dataclass(frozen=True, eq=False)
class Page:
    """An image of the flat page; `numpy.asarray` of it is its pixels.

    Pixels are copied unless nobody can change them.

    Attributes
    ----------
    pixels : (rows, cols) or (rows, cols, 3) uint8 or uint16, or (rows, cols) bool (True is paper)
    known : (rows, cols) bool
        False where the page has no data.
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
        for name in ("pixels", "known"):
            given = getattr(self, name)
            object.__setattr__(self, name, frozen_copy(np.asarray(given), given))

    @classmethod
    def owned(cls, pixels: Pixels | Bools, known: Bools, dpi: float, icc: bytes | None = None) -> Page:
        """Make a page of arrays that nobody else changes, without a copy."""
        return trusted(cls, pixels=pixels, known=known, dpi=dpi, icc=icc)

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
            raise MissingExtraError(f"a page as an xarray needs the extra: {install_command('xarray')}") from None

        # the centre of the pixel in column c lies c + 1/2 pixels from the left side
        y, x = ((np.arange(n) + 0.5) * MM_PER_INCH / self.dpi for n in self.known.shape)
        places = {"y": ("y", y, {"units": "mm"}), "x": ("x", x, {"units": "mm"}), "known": (("y", "x"), self.known)}
        return DataArray(self.pixels, places, ("y", "x", "channel")[: self.pixels.ndim], "page", {"dpi": self.dpi})

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the page over its millimetres with matplotlib (extra `planish[plot]`).

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw. By default in a new figure.

        Raises
        ------
        MissingExtraError
            Where matplotlib is not installed.
        """
        from planish.display.plot import plot_page

        return plot_page(self, ax)

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
    """Result of restoring a scan; a notebook shows its page and its figures.

    Attributes
    ----------
    flattening : Flattening
        Position on the page of every point of the scan, in the order of the file.
    rendered, unshaded : Page or None
        None where the scan has no photo, or where that stage was not asked for. Of the whole sheet.
    report : Report
        Quality report; its gutter is where `planish.split_pages` cuts these pages in two.
    prepared : PreparedScan
        The repaired scan that was flattened and rendered.
    clipped : (rows, cols) bool or None
        Pixels of the page with a channel at its greatest value in the photo, where shade was removed.
    light : (rows, cols, 3) float32 or None
        Linear light that blank paper had in the photo, on a coarse grid over the page, where shade was removed.
    ppi : (rows, cols) float32 [1 / inch] or None
        Photo pixels per inch of page, on a coarse grid over the page; NaN where the photo did not see it.
    make_binary : callable or None
        () -> Page; what `binary` calls. Computes the page once and keeps it.
    """

    flattening: Flattening
    rendered: Page | None
    unshaded: Page | None
    report: Report
    prepared: PreparedScan
    clipped: Bools | None = None
    light: NDArray[np.float32] | None = None
    ppi: NDArray[np.float32] | None = None
    make_binary: Callable[[], Page] | None = None

    def __post_init__(self) -> None:
        freeze(self)

    @property
    def page(self) -> Page | None:
        """The best page that there is: without shading where that was removed, else as rendered; None without photo."""
        return self.unshaded or self.rendered

    @property
    def binary(self) -> Page | None:
        """The page in black and white, computed when it is first asked for; None without photo or method."""
        return None if self.make_binary is None else self.make_binary()

    def plot(self) -> Figure:
        """Draw the page beside maps of the expected error, the strain and the photo's resolution (matplotlib).

        Raises
        ------
        MissingExtraError
            Where matplotlib is not installed (extra `planish[plot]`).
        """
        from planish.display.plot import plot_restoration

        return plot_restoration(self)

    def __repr__(self) -> str:
        width, height = self.flattening.size_mm
        error = self.report.flatten.expected_error_mm
        return f"Restoration({width:.1f} x {height:.1f} mm, expected error {error:.3f} mm; {self.report.outcome})"

    def _repr_html_(self) -> str:
        rows = [*summary(self.report), *(("note", str(warning)) for warning in self.report.warnings)]
        picture = html_picture(small_jpeg(self.page.pixels), "the restored page") if self.page else ""
        return f'<div style="display:flex;flex-wrap:wrap;gap:1.5em;align-items:start">{picture}{html_table(rows)}</div>'
