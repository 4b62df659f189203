"""Resampling filter: Lanczos' windowed sinc with three lobes (Duchon 1979), on a box of linear light.

A box is a part of a photo as a flat float32 array, red green blue, `width` pixels a row. Narrow, upright and skewed
filters have a kernel each; all give the same result to rounding.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

LOBES = 3
STEPS = 2048
"""Of the filter's table to one pixel: its error stays below a tenth of an 8-bit step."""
TAPS, NARROW = 8, 0.3125
"""Photo pixels under a narrow filter, one up to 1 + NARROW wide, as most are: a fixed number, so that the compiler
keeps them in registers."""
WIDTHS, PHASES = 32, 1024
"""Steps of the table of narrow filters to one pixel: it is off its place by 1 / 2048 of a pixel at most."""


def lanczos() -> NDArray[np.float32]:
    """Table of k(0) to k(LOBES), and zeros to twice as far for the filter's rim."""
    x = np.arange(2 * LOBES * STEPS) / STEPS
    return np.where(x < LOBES, np.sinc(x) * np.sinc(x / LOBES), 0).astype(np.float32)


def narrow_filters() -> NDArray[np.float32]:
    """Weights of narrow filters, with sum 1: (widths, places of the first pixel from the filter's rim, TAPS)."""
    width = 1 + np.arange(int(NARROW * WIDTHS) + 1)[:, None, None] / WIDTHS
    place = np.arange(PHASES + 1)[:, None] / PHASES + np.arange(TAPS) - LOBES * width
    weights = np.where(np.abs(place) < LOBES * width, np.sinc(place / width) * np.sinc(place / width / LOBES), 0)
    return (weights / weights.sum(axis=2, keepdims=True)).astype(np.float32)


@njit(cache=True)
def _row_of_weights(at, spread, kernel, w):  # type: ignore[no-untyped-def]
    """Fill w with the filter's weights around `at`, with sum 1; returns the first pixel and how many there are."""
    first, last = int(np.ceil(at - LOBES * spread)), int(np.floor(at + LOBES * spread))
    total = np.float32(0)
    for i in range(last - first + 1):
        w[i] = kernel[int(abs(at - (first + i)) / spread * STEPS + 0.5)]
        total += w[i]
    for i in range(last - first + 1):
        w[i] /= total
    return first, last - first + 1


@njit(cache=True)
def narrow(box, width, x, y, mxx, myy, bank, sums):  # type: ignore[no-untyped-def]
    """Sum eight rows of eight pixels; unsigned numbers spare the compiler the question what an index below 0 means."""
    left, wide, a = _eight_weights(x, mxx)
    top, high, b = _eight_weights(y, myy)
    v0, v1, v2, v3 = bank[high, b, 0], bank[high, b, 1], bank[high, b, 2], bank[high, b, 3]
    v4, v5, v6, v7 = bank[high, b, 4], bank[high, b, 5], bank[high, b, 6], bank[high, b, 7]
    step = np.uintp(3 * width)
    r0 = np.uintp(3 * (top * width + left))
    r1 = r0 + step
    r2 = r1 + step
    r3 = r2 + step
    r4 = r3 + step
    r5 = r4 + step
    r6 = r5 + step
    r7 = r6 + step
    for i in range(np.uintp(3 * TAPS)):
        upper = (v0 * box[r0 + i] + v1 * box[r1 + i]) + (v2 * box[r2 + i] + v3 * box[r3 + i])
        lower = (v4 * box[r4 + i] + v5 * box[r5 + i]) + (v6 * box[r6 + i] + v7 * box[r7 + i])
        sums[i] = upper + lower
    red, green, blue = np.float32(0), np.float32(0), np.float32(0)
    for i in range(TAPS):
        red += bank[wide, a, i] * sums[3 * i]
        green += bank[wide, a, i] * sums[3 * i + 1]
        blue += bank[wide, a, i] * sums[3 * i + 2]
    return red, green, blue


@njit(cache=True)
def _eight_weights(at, spread):  # type: ignore[no-untyped-def]
    """First pixel under a narrow filter around `at`, and where in the bank its weights are."""
    level = int((spread - 1) * WIDTHS + 0.5)
    start = at - LOBES * (1 + level / WIDTHS)
    first = np.ceil(start)
    return int(first), level, int((first - start) * PHASES + 0.5)


@njit(cache=True)
def upright(box, width, x, y, mxx, myy, kernel, wx, wy):  # type: ignore[no-untyped-def]
    """Sum over rows and columns, with weights for each; unsigned numbers as in `narrow`."""
    left, nx = _row_of_weights(x, mxx, kernel, wx)
    top, ny = _row_of_weights(y, myy, kernel, wy)
    red, green, blue = np.float32(0), np.float32(0), np.float32(0)
    for j in range(ny):
        r, g, b = np.float32(0), np.float32(0), np.float32(0)
        at = np.uintp(3 * ((top + j) * width + left))
        for i in range(np.uintp(nx)):
            r += wx[i] * box[at]
            g += wx[i] * box[at + np.uintp(1)]
            b += wx[i] * box[at + np.uintp(2)]
            at += np.uintp(3)
        red, green, blue = red + wy[j] * r, green + wy[j] * g, blue + wy[j] * b
    return red, green, blue


@njit(cache=True)
def skewed(box, width, x, y, mxx, mxy, myy, kernel):  # type: ignore[no-untyped-def]
    """Sum with a weight for every pixel."""
    size = mxx * myy - mxy * mxy
    reach_x, reach_y = LOBES * (mxx + abs(mxy)), LOBES * (myy + abs(mxy))
    red, green, blue, total = np.float32(0), np.float32(0), np.float32(0), np.float32(0)
    for i in range(int(np.ceil(y - reach_y)), int(np.floor(y + reach_y)) + 1):
        for j in range(int(np.ceil(x - reach_x)), int(np.floor(x + reach_x)) + 1):
            dx, dy = j - x, i - y
            u, v = abs(myy * dx - mxy * dy) / size, abs(mxx * dy - mxy * dx) / size
            if u < LOBES and v < LOBES:
                w = kernel[int(u * STEPS + 0.5)] * kernel[int(v * STEPS + 0.5)]
                at = 3 * (i * width + j)
                red += w * box[at]
                green += w * box[at + 1]
                blue += w * box[at + 2]
                total += w
    return red / total, green / total, blue / total
