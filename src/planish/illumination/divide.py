"""Divide a page by its illumination; paper becomes white, ink black."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planish.color import LUMINANCE, code_values, linear_light
from planish.dpi import mm_to_px
from planish.illumination.cells import Field
from planish.parallel import thread_pool
from planish.types import Bools, Floats, Page, Pixels

ROWS = 64
"""Page rows that a thread takes at a time."""
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
INK = 0.94
"""Of the light that the blackest ink sends back, so much is taken away."""


def divide_illumination(page: Page, gain: Field, side: int) -> tuple[Pixels, Bools]:
    """Multiply the page's light by a gain, and stretch what comes near white and black to white and black.

    Parameters
    ----------
    page : Page
    gain : (rows, cols, 3) float32
        At the middles of cells of side x side page pixels; bilinear between them.
    side : int

    Returns
    -------
    pixels : as the page's
        White where the page is not known.
    clipped : (rows, cols) bool
        Where a channel of the page is at its greatest value.
    """
    source: NDArray[Any] = np.asarray(page.pixels)
    pixels = np.empty_like(source)
    clipped = np.empty(source.shape[:2], bool)
    flat = (*source.shape[:2], -1)
    gain = gain if source.ndim == 3 else (gain @ LUMINANCE)[..., None]
    light = linear_light(np.iinfo(source.dtype).max + 1)
    black = _black(source.reshape(flat), page.known, gain, side, light, page.dpi)
    tone = _tone_curve(np.linspace(0, 1, 65536), black)
    codes = code_values(source.dtype)[np.rint(65535 * tone).astype(int)]
    gain = np.ascontiguousarray(gain)
    with thread_pool() as parallel_for:
        made = pixels.reshape(flat), clipped
        parallel_for(
            _divide, len(source), source.reshape(flat), page.known, gain, side, light, codes, *made, block=ROWS
        )
    return pixels, clipped


def _black(source: NDArray[Any], known: Bools, gain: Field, side: int, light: Field, dpi: float) -> float:
    """Light that the black ink sends back, or 0 where there is no black print."""
    spot = max(1, round(mm_to_px(SPOT_MM, dpi)))
    grey = np.ones((source.shape[0] // spot, source.shape[1] // spot), np.float32)
    with thread_pool() as parallel_for:
        parallel_for(_spots, len(grey), source, known, gain, side, light, spot, grey, block=ROWS)
    ink = grey[grey < DARK]
    if len(ink) <= INKED * grey.size:
        return 0.0
    black = float(np.quantile(ink, 0.02))
    return INK * black if black < BLACKEST else 0.0


@njit(cache=True, nogil=True)
def _spots(begin, end, source, known, gain, side, light, spot, grey):  # type: ignore[no-untyped-def]
    """Mean luminance of squares of pixels, evenly lit; left as it is where one of them is not known."""
    last = source.shape[2] - 1
    for i in range(begin, end):
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


def _tone_curve(light: Floats, black: float) -> Floats:
    """Stretch from black ink up, and from KNEE on so that WHITE becomes 1."""
    light = np.maximum(light - black, 0) / (1 - black)
    return np.minimum(np.where(light < KNEE, light, KNEE + (light - KNEE) * (1 - KNEE) / (WHITE - KNEE)), 1)


@njit(cache=True, nogil=True)
def _divide(begin, end, source, known, gain, side, light, codes, pixels, clipped):  # type: ignore[no-untyped-def]
    """Per pixel: codes[light[source] * gain], the gain bilinear between the middles of the cells."""
    rows, cols = gain.shape[:2]
    channels = source.shape[2]
    half, top = 0.5 * (side - 1), len(light) - 1
    for r in range(begin, end):
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
                shine, factor = light[source[r, q, c]], above + v * (under - above)
                if factor < 1:  # paper shone brighter here than the photo can tell: what is clipped stays white
                    factor += (1 - factor) * shine**3
                value = shine * factor
                full |= source[r, q, c] == top
                pixels[r, q, c] = codes[int(min(value, np.float32(1.0)) * 65535 + 0.5)] if known[r, q] else codes[65535]
            clipped[r, q] = full
