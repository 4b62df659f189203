"""Statistics of a page in cells of half a millimetre: brightness of the paper, share of print, clipping."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy import ndimage

from planish.color import LUMINANCE, linear_light
from planish.dpi import mm_to_px, px_to_mm
from planish.parallel import thread_pool
from planish.types import Bools, Page

Field = NDArray[Any]
"""float32, a value or three for each cell."""

CELL_MM = 0.5
BAND = 0.07
"""Pixels whose light differs by less than so much of it from the cell's bright ones are of the same paper."""
MAX_SAMPLES = 64
"""Pixels of a cell that are sampled."""


@dataclass(frozen=True, eq=False)
class Cells:
    """What the pixels of each cell say.

    Attributes
    ----------
    side_px : int
        Of a cell, in page pixels; the last row and column may reach beyond the page.
    mm : float
        The same in millimetres.
    light : (rows, cols, 3) float32
        Linear light, 1 at the greatest code value, of the brighter pixels: the paper's, where the cell shows any.
    darker : (rows, cols) float32
        How much darker [log] than these an eighth of the cell's pixels are at least: much where there is print.
    share : (rows, cols) float32
        Of the cell's pixels that are as bright as that: 1 in blank paper, less between letters.
    clipped : (rows, cols) float32
        Share of pixels with a channel at its greatest code value, which tell of the light only that there was more.
    known : (rows, cols) bool
        Whether the page is known in most of the cell.
    """

    side_px: int
    mm: float
    light: Field
    darker: Field
    share: Field
    clipped: Field
    known: Bools

    @property
    def brightness(self) -> Field:
        """Luminance of `light`."""
        return np.asarray(self.light @ LUMINANCE)


def cell_statistics(page: Page) -> Cells:
    """Cut a page into cells and measure each.

    Parameters
    ----------
    page : Page
        Colour or grey, 8 or 16 bit.
    """
    side = max(2, round(mm_to_px(CELL_MM, page.dpi)))
    pixels: NDArray[Any] = np.asarray(page.pixels)
    pixels = pixels[..., None] if pixels.ndim == 2 else pixels
    rows, cols = (-(-n // side) for n in pixels.shape[:2])
    light = np.zeros((rows, cols, 3), np.float32)
    darker, share, clipped = np.zeros((3, rows, cols), np.float32)
    known = np.zeros((rows, cols), bool)
    step = max(1, int(np.ceil(side / MAX_SAMPLES**0.5)))
    linear = linear_light(np.iinfo(pixels.dtype).max + 1)
    with thread_pool() as parallel_for:
        parallel_for(
            _measure, rows, pixels, page.known, linear, side, step, light, darker, share, clipped, known, block=16
        )
    return Cells(side, px_to_mm(side, page.dpi), light, darker, share, clipped, known)


def filled(field: Field, known: Bools) -> Field:
    """The field with what is not known taken from the nearest cell that is."""
    if known.all() or not known.any():
        return field
    nearest = ndimage.distance_transform_edt(~known, return_distances=False, return_indices=True)
    return np.asarray(field[tuple(nearest)])


@njit(cache=True, nogil=True)
def _measure(  # type: ignore[no-untyped-def]
    begin, end, pixels, page_known, linear, side, step, light, darker, share, clipped, known
):
    last, top = pixels.shape[2] - 1, len(linear) - 1
    for i in range(begin, end):
        found, sorted_ = np.empty((MAX_SAMPLES, 4), np.float32), np.empty(MAX_SAMPLES, np.float32)
        for j in range(light.shape[1]):
            n, seen, full = 0, 0, 0
            for r in range(i * side, min((i + 1) * side, pixels.shape[0]), step):
                for q in range(j * side, min((j + 1) * side, pixels.shape[1]), step):
                    seen += 1
                    if not page_known[r, q]:
                        continue
                    red, green, blue = pixels[r, q, 0], pixels[r, q, min(1, last)], pixels[r, q, last]
                    full += red == top or green == top or blue == top
                    found[n, 0], found[n, 1], found[n, 2] = linear[red], linear[green], linear[blue]
                    found[n, 3] = LUMINANCE[0] * found[n, 0] + LUMINANCE[1] * found[n, 1] + LUMINANCE[2] * found[n, 2]
                    n += 1
            known[i, j] = n > seen / 2
            if n > 0:
                clipped[i, j] = full / n
                share[i, j] = _mean_of_bright(found[:n], sorted_, light[i, j])
                darker[i, j] = math.log(max(sorted_[(3 * n) // 4], 1e-4) / max(sorted_[n // 8], 1e-4))


@njit(cache=True)
def _mean_of_bright(found, sorted_, light):  # type: ignore[no-untyped-def]
    """Fill in the mean light of the pixels about as bright as the upper quartile; returns their share."""
    n = len(found)
    for k in range(n):
        m = k
        while m > 0 and sorted_[m - 1] > found[k, 3]:
            sorted_[m] = sorted_[m - 1]
            m -= 1
        sorted_[m] = found[k, 3]
    bright = sorted_[(3 * n) // 4]
    alike = 0
    for k in range(n):
        if abs(found[k, 3] - bright) <= BAND * bright:
            alike += 1
            for c in range(3):
                light[c] += found[k, c]
    for c in range(3):
        light[c] /= alike
    return alike / n
