"""Render the photo through the flattened mesh: a page of true size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planish.color import LUMINANCE, linear_light
from planish.dpi import MM_PER_INCH, mm_to_px
from planish.errors import InputError
from planish.memory import check_memory
from planish.render.bands import render_bands
from planish.render.blend import Blend, blend, detail
from planish.render.photo_view import PhotoView, photo_views, shrunk
from planish.render.resolution import Resolution, cells, combined_resolution, usual_dpi_for
from planish.settings import RenderSettings
from planish.types import Bools, Floats, Page, Pixels, Scan

Light = NDArray[np.float32]

COARSE_PX, MAX_COARSE_PIXELS = (4, 6), 16_000_000
"""Photos are compared on coarse pages with fewest and most pixels across a cell, and so many in all at most."""
MAX_PIXELS = 1_000_000_000
BYTES_PER_PIXEL = {1: 16.0, 2: 22.0}
"""Of a page, by the bytes of one colour: all its pictures together, drawn, without shade and in black and white."""


@dataclass(frozen=True, eq=False)
class Rendered:
    """A page, and how finely the photo shows it.

    Attributes
    ----------
    page : Page
    resolution : Resolution
        Of the photo that each place was taken from.
    parts : tuple of float
        Of the known page, the part that was taken from each photo.
    """

    page: Page
    resolution: Resolution
    parts: tuple[float, ...] = (1.0,)


def draw(scan: Scan, page_xy: Floats, size_mm: tuple[float, float], settings: RenderSettings | None = None) -> Rendered:
    """Draw the page: for every pixel its place on the sheet, from there its place on the photo, filtered.

    The pixel at row r, column c shows the page at ((c + 0.5), (r + 0.5)) * 25.4 / dpi mm. Parts that the photo did
    not see are left in the colour of the paper and marked in `page.known`.

    Parameters
    ----------
    scan : Scan
        With a photo, and with `photo_xy` or a camera.
    page_xy : (n, 2) float64 [mm]
        x right, y down, origin at the top left corner of the page.
    size_mm : (float, float)
        Width and height of the page.
    settings : RenderSettings, optional

    Raises
    ------
    InputError
        Where the scan has no photo, or none of the sheet falls on it.

    Examples
    --------
    A flat sheet of 2 x 1 cm photographed at 10 pixels a millimetre and drawn at the same resolution:

    >>> from planish.types import Mesh
    >>> sheet = np.array([[0.0, 0, 0], [20, 0, 0], [20, 10, 0], [0, 10, 0]])
    >>> photo = np.random.default_rng(0).integers(0, 256, (100, 200, 3), np.uint8)
    >>> scan = Scan(Mesh(sheet * [1, -1, 1], [[0, 2, 1], [0, 3, 2]]), photo, photo_xy=10 * sheet[:, :2] - 0.5)
    >>> drawn = draw(scan, sheet[:, :2], (20.0, 10.0), RenderSettings(dpi=254))
    >>> bool((drawn.page.pixels == photo).all()), round(drawn.resolution.median_ppi)
    (True, 254)
    """
    return render_page(photo_views(scan, page_xy, size_mm), size_mm, settings, scan.icc)


def render_page(
    views: Sequence[PhotoView],
    size_mm: tuple[float, float],
    settings: RenderSettings | None = None,
    icc: bytes | None = None,
) -> Rendered:
    """Draw the page from photo views that are there already; see `draw`.

    Parameters
    ----------
    views : sequence of PhotoView
        See `photo_views`; the main photo first.
    size_mm : (float, float)
    settings : RenderSettings, optional
    icc : bytes, optional
        Colour profile of the main photo.
    """
    settings = settings or RenderSettings()
    if len(views) == 1:
        dpi = _dpi(views[0].resolution, settings)
        return Rendered(_page(views, None, size_mm, dpi, icc), views[0].resolution)
    mixed = _mixed(views, size_mm)
    best = combined_resolution([view.resolution for view in views], mixed.best)
    return Rendered(_page(views, mixed, size_mm, _dpi(best, settings), icc), best, _parts(mixed.best, len(views)))


def preview(view: PhotoView, size_mm: tuple[float, float], dpi: float, icc: bytes | None = None) -> Page:
    """Draw a coarse page quickly, to look at and not to keep, from one photo made smaller."""
    return _page([shrunk(view, dpi)], None, size_mm, dpi, icc)


def _dpi(found: Resolution, settings: RenderSettings) -> float:
    return float(usual_dpi_for(found.median_ppi) if settings.dpi == "auto" else settings.dpi)


def _page(
    views: Sequence[PhotoView], mixed: Blend | None, size_mm: tuple[float, float], dpi: float, icc: bytes | None
) -> Page:
    pixels, known = render_bands(views, mixed, _shape(size_mm, dpi, views[0].dtype.itemsize), mm_to_px(1, dpi))
    pixels[~known] = _paper(pixels, known)
    return Page.owned(pixels, known, dpi, icc)


def _mixed(views: Sequence[PhotoView], size_mm: tuple[float, float]) -> Blend:
    """How much of each photo the page takes where, from a coarse page of each."""
    cell_mm, (rows, cols) = cells(size_mm)
    finest = max(view.resolution.median_ppi for view in views) * cell_mm / MM_PER_INCH
    across = int(min(np.clip(np.ceil(finest), *COARSE_PX), max(1, (MAX_COARSE_PIXELS / (rows * cols)) ** 0.5)))
    samples = [
        _coarse_sample(shrunk(view, MM_PER_INCH * across / cell_mm), (rows, cols), across, cell_mm) for view in views
    ]
    return blend(views, samples, cell_mm)


def _coarse_sample(
    view: PhotoView, shape_rc: tuple[int, int], across: int, cell_mm: float
) -> tuple[Light, Light, Bools]:
    """Mean light, strength of detail, and whether most of it is known, for every cell."""
    rows, cols = shape_rc
    pixels, known = render_bands([view], None, (rows * across, cols * across), across / cell_mm)
    light = np.where(known[..., None], linear_light(np.iinfo(pixels.dtype).max + 1)[pixels], np.float32(0))
    in_cells = (rows, across, cols, across)
    count = np.maximum(known.reshape(in_cells).sum(axis=(1, 3)), 1).astype(np.float32)
    mean = light.reshape(*in_cells, 3).sum(axis=(1, 3)) / count[..., None]
    strength = detail(light, known).reshape(*in_cells, -1).sum(axis=(1, 3)) / count[..., None]
    return mean, strength, count > across**2 / 2


def _parts(best: NDArray[np.int64], count: int) -> tuple[float, ...]:
    """Of the known page, the part that each photo shows."""
    return tuple(float(n) for n in np.bincount(best[best >= 0], minlength=count) / max(1, int((best >= 0).sum())))


def _shape(size_mm: tuple[float, float], dpi: float, itemsize: int) -> tuple[int, int]:
    cols, rows = (max(1, round(mm_to_px(mm, dpi))) for mm in size_mm)
    page = f"a page of {size_mm[0]:.0f} x {size_mm[1]:.0f} mm at {dpi:g} dpi"
    if rows * cols > MAX_PIXELS:
        raise InputError(
            f"{page} has {rows * cols / 1e9:.1f} thousand million pixels, more than planish draws; is the scan's unit "
            "right?"
        )
    check_memory(rows * cols * BYTES_PER_PIXEL[itemsize], page, "lower {dpi}")
    return rows, cols


def _paper(pixels: Pixels, known: Bools) -> NDArray[np.generic]:
    """The paper's colour: the median of the brighter half of what is known."""
    step = max(1, round((known.size / 200_000) ** 0.5))
    some = pixels[::step, ::step][known[::step, ::step]]
    if not len(some):
        return np.full(3, np.iinfo(pixels.dtype).max, pixels.dtype)
    light = some @ LUMINANCE
    return np.asarray(np.median(some[light >= np.median(light)], axis=0).astype(pixels.dtype))
