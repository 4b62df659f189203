"""Shading removed from a page: the light found and divided out."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numba import njit, prange
from numpy.typing import NDArray
from scipy import ndimage

from planish.mesh import LUMINANCE, code_values, linear_light
from planish.settings import ShadingSettings
from planish.shading import light as lighting
from planish.shading.cells import Cells, cut
from planish.shading.paper import Field, followed, nearby_range
from planish.shading.shadow import lit
from planish.shading.surface import surface_under
from planish.types import Bools, Floats, Page, Pixels, Scan

ENOUGH_PAPER = 200
"""Cells of quiet paper, 0.5 mm wide, that the light can be found from."""
CLOSING_MM = 6.0
"""What is darker than its surroundings and narrower than this is print to the background method."""
COLOURED = 0.5
"""Paper one of whose channels has less than this of the greatest is coloured, and its colour is kept."""
WHITE = 0.94
"""Light, against the paper's, that becomes white: the paper's own grain is just clipped."""
KNEE = 0.7
"""Light below which nothing is bent to reach that."""
DARK = 0.12
"""Light below which a spot is black print."""
SPOT_MM = 0.25
"""A spot: the core of a stroke, wide enough that a filter's ringing is averaged out."""
INKED = 0.0005
"""Part of the page that must be black print, for it to become black."""
BLACKEST = 0.06
"""Ink that is paler than this is not made black."""
INK = 0.9
"""Of the light that the blackest ink sends back, so much is taken away."""


@dataclass(frozen=True, eq=False)
class ShadingFit:
    """How well the shade was found.

    Attributes
    ----------
    method : str
        "geometry" or "background".
    paper_share : float
        Part of the page that the light was found from.
    unevenness_before, unevenness : float
        From the 10 % to the 90 % quantile of the paper's grey, in parts of white; after removal, before white is
        clipped.
    clipped_share : float
        Part of the page that is clipped in the photo: how bright it was there is not known.
    lamp_mm : (float, float, float) or None
        Place of the lamp in the scan's frame, very far away for daylight.
    ambient : float or None
        Share of the light on the middle of the sheet that comes from all around.
    warnings : tuple of str
    """

    method: str
    paper_share: float
    unevenness_before: float
    unevenness: float
    clipped_share: float
    lamp_mm: tuple[float, float, float] | None = None
    ambient: float | None = None
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Unshaded:
    """A page without shade.

    Attributes
    ----------
    page : Page
    clipped : (rows, cols) bool
        Where the photo has a channel at its greatest value.
    fit : ShadingFit
    """

    page: Page
    clipped: Bools
    fit: ShadingFit


def unshade(
    page: Page, scan: Scan, page_xy: Floats, normals: Floats, settings: ShadingSettings | None = None
) -> Unshaded:
    """Make a page evenly lit and its paper white.

    Parameters
    ----------
    page : Page
        As drawn from the scan's photo, grey or colour, 8 or 16 bit.
    scan : Scan
    page_xy : (n, 2) float64 [mm]
        Place on the page of every point of the scan.
    normals : (n, 3) float64
        Of the surface at every point, away from the printed side.
    settings : ShadingSettings, optional
        With a method other than "none".

    Notes
    -----
    Light is divided in each channel, so that a tint of the light or a yellowed paper goes too and inks keep their hue;
    only the colour of plainly coloured paper is kept.
    """
    s = settings or ShadingSettings()
    cells = cut(page)
    found = _by_geometry(cells, scan, page_xy, normals) if s.shading == "geometry" else None
    warnings: tuple[str, ...] = ()
    if found is None and s.shading == "geometry":
        warnings = (
            "the page shows too little blank paper to find the light from the sheet's shape; its shade was taken from "
            "the background instead",
        )
    field, lamp = found or (_background(cells), None)
    gain = np.exp(-field) * _kept_colour(field, cells)
    pixels, clipped = _divided(page, gain, cells.side_px)
    fit = _quality(cells, field, lamp, float((clipped & page.known).mean()), warnings)
    return Unshaded(Page(pixels, page.known, page.dpi, page.icc), clipped, fit)


def _by_geometry(cells: Cells, scan: Scan, page_xy: Floats, normals: Floats) -> tuple[Field, lighting.Light] | None:
    """Logarithm of the light of paper in each cell, and the lamp; None where there is too little paper."""
    surface = surface_under(cells, scan, page_xy, normals)
    bright = cells.brightness
    quiet = (cells.share > 0.7) & cells.known & surface.known & (cells.clipped < 0.1) & (bright > 0.01)
    if quiet.sum() < ENOUGH_PAPER:
        return None
    some = lighting.chosen(quiet)
    lamp = lighting.fit(
        surface.points[some], surface.normals[some], surface.off_axis[some], bright[some].astype(np.float64)
    )
    share = lit(scan.mesh, lamp.lamp, surface.points, surface.normals)
    bare = _filled(lamp.log_brightness(surface.points, surface.normals, surface.off_axis), surface.known)
    model = _filled(lamp.log_brightness(surface.points, surface.normals, surface.off_axis, share), surface.known)
    bend, edge = (max(1, round(mm / cells.mm)) for mm in (1.5, 4.0))
    doubt = np.maximum(nearby_range(bare, bend), nearby_range(model - bare, edge))
    return followed(cells, model, doubt), lamp


def _background(cells: Cells) -> Field:
    """The same without a shape: what a closing leaves, so that any grey wider than CLOSING_MM goes for shade."""
    light = _filled(cells.light, cells.known)
    side = max(3, round(CLOSING_MM / cells.mm)) | 1
    closed = cv2.morphologyEx(light, cv2.MORPH_CLOSE, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side)))
    smooth = cv2.GaussianBlur(closed, (0, 0), 0.25 * side)
    return np.asarray(np.log(np.maximum(smooth, 1e-4)))


def _filled(field: NDArray[np.floating], known: Bools) -> NDArray[np.floating]:
    """The field with what is not known taken from the nearest cell that is."""
    if known.all() or not known.any():
        return field
    nearest = ndimage.distance_transform_edt(~known, return_distances=False, return_indices=True)
    return np.asarray(field[tuple(nearest)])


def _kept_colour(field: Field, cells: Cells) -> Field:
    """What white paper becomes: white, unless it is plainly coloured."""
    paper = np.exp(np.median(field[cells.known], axis=0)) if cells.known.any() else np.ones(3)
    colour = paper / paper.max()
    return np.asarray(colour if colour.min() < COLOURED else np.ones(3), np.float32)


def _divided(page: Page, gain: Field, side: int) -> tuple[NDArray[np.generic], Bools]:
    """Multiply the page's light by the gain and bend what comes near white to white."""
    source = np.asarray(page.pixels)
    pixels = np.empty_like(source)
    clipped = np.empty(source.shape[:2], bool)
    flat = (*source.shape[:2], -1)
    gain = gain if source.ndim == 3 else (gain @ LUMINANCE)[..., None]
    light = linear_light(np.iinfo(source.dtype).max + 1)
    black = _black(source.reshape(flat), page.known, gain, side, light, page.dpi)
    tone = _toned(np.linspace(0, 1, 65536), black)
    codes = code_values(source.dtype)[np.rint(65535 * tone).astype(int)]
    _divide(
        source.reshape(flat), page.known, np.ascontiguousarray(gain), side, light, codes, pixels.reshape(flat), clipped
    )
    return pixels, clipped


def _black(source: Pixels, known: Bools, gain: Field, side: int, light: Field, dpi: float) -> float:
    """Light that the black ink sends back, or 0 where there is no black print."""
    spot = max(1, round(SPOT_MM * dpi / 25.4))
    grey = _spots(source, known, gain, side, light, spot)
    ink = grey[grey < DARK]
    if len(ink) < INKED * grey.size:
        return 0.0
    black = float(np.quantile(ink, 0.02))
    return INK * black if black < BLACKEST else 0.0


@njit(parallel=True, cache=True)
def _spots(source, known, gain, side, light, spot):  # type: ignore[no-untyped-def]
    """Mean luminance of squares of pixels, evenly lit; 1 where one of them is not known."""
    last = source.shape[2] - 1
    grey = np.ones((source.shape[0] // spot, source.shape[1] // spot), np.float32)
    for i in prange(grey.shape[0]):
        for j in range(grey.shape[1]):
            r, q = i * spot, j * spot
            total, whole = np.float32(0), True
            factor = gain[min(r // side, gain.shape[0] - 1), min(q // side, gain.shape[1] - 1)]
            for y in range(r, r + spot):
                for x in range(q, q + spot):
                    whole &= known[y, x]
                    total += LUMINANCE[0] * light[source[y, x, 0]] * factor[0]
                    total += LUMINANCE[1] * light[source[y, x, min(1, last)]] * factor[min(1, last)]
                    total += LUMINANCE[2] * light[source[y, x, last]] * factor[last]
            if whole:
                grey[i, j] = total / (spot * spot)
    return grey


def _toned(light: Floats, black: float) -> Floats:
    """Stretch from black ink up, and from KNEE on so that WHITE becomes 1."""
    light = np.maximum(light - black, 0) / (1 - black)
    return np.minimum(np.where(light < KNEE, light, KNEE + (light - KNEE) * (1 - KNEE) / (WHITE - KNEE)), 1)


@njit(parallel=True, cache=True)
def _divide(source, known, gain, side, light, codes, pixels, clipped):  # type: ignore[no-untyped-def]
    """Per pixel: codes[light[source] * gain], the gain bilinear between the middles of the cells."""
    rows, cols = gain.shape[:2]
    channels = source.shape[2]
    half, top = 0.5 * (side - 1), len(light) - 1
    for r in prange(source.shape[0]):
        y = min(max((r - half) / side, 0.0), rows - 1.0)
        i = min(int(y), max(rows - 2, 0))
        below = min(i + 1, rows - 1)
        v = np.float32(y - i)
        for q in range(source.shape[1]):
            x = min(max((q - half) / side, 0.0), cols - 1.0)
            j = min(int(x), max(cols - 2, 0))
            right = min(j + 1, cols - 1)
            u = np.float32(x - j)
            full = False
            for c in range(channels):
                above = gain[i, j, c] + u * (gain[i, right, c] - gain[i, j, c])
                under = gain[below, j, c] + u * (gain[below, right, c] - gain[below, j, c])
                value = light[source[r, q, c]] * (above + v * (under - above))
                full |= source[r, q, c] == top
                pixels[r, q, c] = codes[int(min(value, np.float32(1.0)) * 65535 + 0.5)] if known[r, q] else codes[65535]
            clipped[r, q] = full


def _quality(
    cells: Cells, field: Field, lamp: lighting.Light | None, clipped_share: float, warnings: tuple[str, ...]
) -> ShadingFit:
    before = cells.brightness
    after = np.exp(np.log(np.maximum(cells.light, 1e-4)) - field) @ LUMINANCE
    paper = cells.known & (cells.share > 0.9) & (cells.clipped < 0.1) & (np.abs(after - 1) < 0.1)
    return ShadingFit(
        "background" if lamp is None else "geometry",
        float(paper.mean()),
        _range_of_greys(before[paper]),
        _range_of_greys(after[paper]),
        clipped_share,
        None if lamp is None else tuple(float(mm) for mm in lamp.lamp),  # type: ignore[arg-type]
        None if lamp is None else lamp.ambient,
        warnings,
    )


def _range_of_greys(light: NDArray[np.floating]) -> float:
    """From the 10 % to the 90 % quantile, as code values in parts of white."""
    if not len(light):
        return 0.0
    low, high = np.clip(np.quantile(light, [0.1, 0.9]), 0, None) ** (1 / 2.2)
    return float(high - low)
