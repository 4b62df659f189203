"""The photo drawn through the flattened mesh: a page of true size."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planish.errors import InputError
from planish.mesh import rasterise
from planish.render.chart import Chart, chart
from planish.render.resolution import Resolution, nearest_usual_dpi, resolution
from planish.render.sample import footprints, sample
from planish.render.visibility import seen_faces
from planish.settings import RenderSettings
from planish.types import Bools, Floats, Ints, Page, Pixels, Scan

BAND_PIXELS = 4_000_000
"""So many page pixels are drawn at a time; the working memory is about 12 bytes for each."""
MOST_PIXELS = 1_000_000_000


@dataclass(frozen=True, eq=False)
class Rendered:
    """A page, and how finely the photo shows it.

    Attributes
    ----------
    page : Page
    resolution : Resolution
    """

    page: Page
    resolution: Resolution


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
    settings = settings or RenderSettings()
    if scan.photo is None or (scan.photo_xy is None and scan.camera is None):
        raise InputError(
            "the scan has no photo that could be drawn: neither texture coordinates nor a camera came with it; give "
            "both a photo and its camera, or flatten the mesh alone"
        )
    sheet = chart(scan, page_xy)
    faces = sheet.faces[seen_faces(sheet, scan.camera)]
    found = resolution(sheet, faces, size_mm, scan.photo.shape[:2])
    dpi = float(nearest_usual_dpi(found.median_ppi) if settings.dpi == "auto" else settings.dpi)
    pixels, known = _paint(scan.photo, sheet, faces, _shape(size_mm, dpi), dpi / 25.4)
    pixels[~known] = _paper(pixels, known)
    return Rendered(Page(pixels, known, dpi, scan.icc), found)


def _shape(size_mm: tuple[float, float], dpi: float) -> tuple[int, int]:
    cols, rows = (max(1, round(mm * dpi / 25.4)) for mm in size_mm)
    if rows * cols > MOST_PIXELS:
        raise InputError(
            f"a page of {size_mm[0]:.0f} x {size_mm[1]:.0f} mm at {dpi:g} dpi has {rows * cols / 1e9:.1f} thousand "
            f"million pixels, more than planish draws; is the scan's unit right?"
        )
    return rows, cols


def _paint(
    photo: Pixels, sheet: Chart, faces: Ints, shape_rc: tuple[int, int], px_per_mm: float
) -> tuple[Pixels, Bools]:
    rows, cols = shape_rc
    pixels, known = np.empty((rows, cols, 3), photo.dtype), np.empty((rows, cols), np.bool_)
    pixel_xy, shape = sheet.page_xy * px_per_mm - 0.5, footprints(sheet.jacobian / px_per_mm)
    band = max(1, BAND_PIXELS // cols)
    for top in range(0, rows, band):
        here = slice(top, min(top + band, rows))
        face, weights = rasterise(pixel_xy, faces, (here.stop - top, cols), top=top)
        sample(photo, face, weights, faces, sheet.photo_xy, shape, pixels[here], known[here])
    return pixels, known


def _paper(pixels: Pixels, known: Bools) -> NDArray[np.generic]:
    """The paper's colour: the median of the brighter half of what is known."""
    step = max(1, round((known.size / 200_000) ** 0.5))
    some = pixels[::step, ::step][known[::step, ::step]]
    if not len(some):
        return np.full(3, np.iinfo(pixels.dtype).max, pixels.dtype)
    light = some @ np.array([0.2126, 0.7152, 0.0722])
    return np.asarray(np.median(some[light >= np.median(light)], axis=0).astype(pixels.dtype))
