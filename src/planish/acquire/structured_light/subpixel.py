"""Subpixel refinement of the Gray code from the positions of stripe edges between camera pixels.

Between projector columns c and c + 1 exactly one bit changes, so a pattern and its inverse have equal intensity at
c + 1/2, independent of reflectance. Between two camera pixels that see c and c + 1 the crossing is interpolated
linearly from the differences of the two, relative to white minus black. A quadratic surface fitted to the crossings
around every pixel gives the value at the pixel. Phase measurements (`phase`) are included with their weights.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planish.acquire.structured_light.gray_code import Codes, Grey, bits_for
from planish.acquire.structured_light.phase import PhaseMap
from planish.geometry.guards import SINGULAR
from planish.parallel import thread_pool
from planish.types import Bools, Floats, Ints

REACH = 4
"""Radius of the fit [px], along rows and columns; doubled if two bits are unresolved, so that it still contains four
lines of crossings."""

SPREAD = 2.0
"""Standard deviation of the Gaussian weights [px]."""

STEEPEST = 3.0
"""Largest gradient of the code on one surface [code px per camera px]."""

MIN_CROSSINGS = 8
"""Least number of crossings for a surface of six coefficients."""

MAX_CHANGE = 1.0
"""Largest deviation of the fit from the decoded value."""

SPAN = 2.0 * REACH + 2.0
"""Largest range of the crossings around an undecoded pixel on one surface."""

TERMS = 6

CROSSING = 3 / 4
"""Inverse variance of a crossing for noise of one level and a slope of one: 2 for two photos, times the mean of
(1 - t)^2 + t^2 over where it may lie between two pixels."""


def refine_subpixel(
    frames: Grey,
    codes: Codes,
    shape_rc: tuple[int, int],
    where: Bools | None = None,
    waves: PhaseMap | None = None,
    *,
    skipped_bits: tuple[int, int] = (0, 0),
) -> Floats:
    """Refine the projector position of each camera pixel to subpixel accuracy.

    Parameters
    ----------
    frames : (n, rows, cols)
        As for `gray_code.decode`.
    codes : Codes
        Its result.
    shape_rc : (int, int)
        Rows and columns of the projector.
    where : (rows, cols) bool, optional
        Pixels to refine; the others stay NaN.
    waves : Phased, optional
        Phase measurements, if any.
    skipped_bits : (int, int)
        As `codes` was decoded with, of columns and of rows; (0, 0) beside waves.

    Returns
    -------
    (rows, cols, 2) float64 [projector px]
        x right, y down, pixel centres at integers; NaN where too few stripe edges are nearby.
    """
    projector_xy = np.full((*codes.column.shape, 2), np.nan)
    selected = np.ones(codes.column.shape, bool) if where is None else where
    column_bits, row_bits = bits_for(shape_rc[1]), bits_for(shape_rc[0])
    contrast = frames[-2].astype(np.float32) - frames[-1]
    for axis, (code, start, bits) in enumerate(
        ((codes.column, 0, column_bits), (codes.row, 2 * column_bits, row_bits))
    ):
        pair = frames[start : start + 2 * (bits - skipped_bits[axis])]
        at, value, weight = _crossings(pair, code, contrast)
        coarse_xy = code.astype(np.float32)
        if waves is not None:
            value, weight = (
                np.dstack([value, waves.projector_xy[..., axis]]),
                np.dstack([weight, waves.weight[..., axis]]),
            )
            coarse_xy = np.where(waves.weight[..., axis] > 0, waves.projector_xy[..., axis], coarse_xy)
        wider = max(skipped_bits[axis], 1)
        near = np.exp(-0.5 * (np.arange(REACH * wider + 1) / (SPREAD * wider)) ** 2)
        with thread_pool() as parallel_for:
            parallel_for(
                _fit, len(code), selected, coarse_xy, at, value, weight, near, projector_xy[..., axis], block=16
            )
        side = 1 << skipped_bits[axis]  # projector pixels to one step of the code that was read
        projector_xy[..., axis] = side * projector_xy[..., axis] + 0.5 * (side - 1)
    return projector_xy


def _crossings(
    pairs: Grey, code: Ints, contrast: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """Stripe edges between each pixel and its right and lower neighbour, each (rows, cols, 2).

    Returns
    -------
    at : position between the two pixels, 0 to 1
    value : projector position
    weight : inverse variance; 0 where there is no edge
    """
    at, value, weight = (np.zeros((*code.shape, 2), np.float32) for _ in range(3))
    with thread_pool() as parallel_for:
        parallel_for(_cross, len(code), pairs, code, contrast, at, value, weight, block=32)
    return at, value, weight


@njit(cache=True, nogil=True)
def _cross(first, last, pairs, code, contrast, at, value, weight):  # type: ignore[no-untyped-def]
    rows, cols = code.shape
    bits = len(pairs) // 2
    for r in range(first, last):
        for q in range(cols):
            code_here = code[r, q]
            if code_here < 0:
                continue
            for side in range(2):
                nr, nq = (r, q + 1) if side == 0 else (r + 1, q)
                if nr >= rows or nq >= cols:
                    continue
                code_there = code[nr, nq]
                if code_there < 0 or abs(code_there - code_here) != 1:
                    continue
                changed = (code_here ^ (code_here >> 1)) ^ (code_there ^ (code_there >> 1))  # one bit of the Gray code
                k = bits - 1
                while changed > 1:
                    changed >>= 1
                    k -= 1
                a = (np.float32(pairs[2 * k, r, q]) - np.float32(pairs[2 * k + 1, r, q])) / contrast[r, q]
                b = (np.float32(pairs[2 * k, nr, nq]) - np.float32(pairs[2 * k + 1, nr, nq])) / contrast[nr, nq]
                if a * b >= 0.0 and a != 0.0:
                    continue
                at[r, q, side] = a / (a - b) if a != b else np.float32(0.5)
                value[r, q, side] = min(code_here, code_there) + np.float32(0.5)
                confidence_slope = (a - b) * min(contrast[r, q], contrast[nr, nq])
                weight[r, q, side] = (
                    CROSSING * confidence_slope * confidence_slope
                )  # variance = noise variance / slope^2


@njit(cache=True, nogil=True)
def _fit(first, last, selected, coarse_xy, at, value, weight, near, projector_xy):  # type: ignore[no-untyped-def]
    reach = len(near) - 1
    normal, right, term = np.empty((TERMS, TERMS)), np.empty(TERMS), np.empty(TERMS)
    for r in range(first, last):
        for q in range(coarse_xy.shape[1]):
            if not selected[r, q]:
                continue
            found = np.nan
            if coarse_xy[r, q] > -1.0:
                found = _fit_at(r, q, float(coarse_xy[r, q]), MAX_CHANGE, at, value, weight, near, term, normal, right)
            if np.isnan(found):  # undecoded, or decoded wrongly
                around = _mean_around(r, q, value, weight, reach)
                if not np.isnan(around):
                    found = _fit_at(r, q, around, SPAN, at, value, weight, near, term, normal, right)
            projector_xy[r, q] = found


@njit(cache=True, nogil=True)
def _fit_at(r, q, about, max_change, at, value, weight, near, term, normal, right):  # type: ignore[no-untyped-def]
    """Value at a pixel of the quadric through the crossings around it; NaN if over `max_change` from `about`."""
    rows, cols, reach = weight.shape[0], weight.shape[1], len(near) - 1
    normal[:], right[:] = 0.0, 0.0
    count = 0
    for nr in range(max(r - reach, 0), min(r + reach + 1, rows)):
        for nq in range(max(q - reach, 0), min(q + reach + 1, cols)):
            for side in range(weight.shape[2]):  # to the right, down, and at the pixel itself
                if weight[nr, nq, side] <= 0.0:
                    continue
                x = nq - q + (at[nr, nq, side] if side == 0 else 0.0)
                y = nr - r + (at[nr, nq, side] if side == 1 else 0.0)
                u = value[nr, nq, side] - about
                if abs(u) <= STEEPEST * (abs(x) + abs(y)) + 1.0:
                    _add(x, y, u, weight[nr, nq, side] * near[abs(nr - r)] * near[abs(nq - q)], term, normal, right)
                    count += 1
    if count < MIN_CROSSINGS:
        return np.nan
    constant = _constant(normal, right)
    return about + constant if abs(constant) <= max_change else np.nan


@njit(cache=True, nogil=True)
def _add(x, y, u, w, term, normal, right):  # type: ignore[no-untyped-def]
    """Add a crossing to the normal equations (lower triangle) of u = a + b x + c y + d x^2 + e x y + f y^2."""
    term[0], term[1], term[2], term[3], term[4], term[5] = 1.0, x, y, x * x, x * y, y * y
    for i in range(TERMS):
        right[i] += w * term[i] * u
        for j in range(i + 1):
            normal[i, j] += w * term[i] * term[j]


@njit(cache=True, nogil=True)
def _mean_around(r, q, value, weight, reach):  # type: ignore[no-untyped-def]
    """Mean of the crossings around an undecoded pixel, such as ink; NaN unless all are on one surface."""
    rows, cols = weight.shape[0], weight.shape[1]
    total, count = 0.0, 0
    low, high = np.inf, -np.inf
    quarters = 0
    for nr in range(max(r - reach, 0), min(r + reach + 1, rows)):
        for nq in range(max(q - reach, 0), min(q + reach + 1, cols)):
            for side in range(weight.shape[2]):
                if weight[nr, nq, side] > 0.0:
                    total += value[nr, nq, side]
                    count += 1
                    low, high = min(low, value[nr, nq, side]), max(high, value[nr, nq, side])
                    quarters |= 1 << (2 * int(nr >= r) + int(nq >= q))
    if quarters != 15 or count < 2 * MIN_CROSSINGS or high - low > SPAN:
        return np.nan
    return total / count


@njit(cache=True, nogil=True)
def _constant(normal, right):  # type: ignore[no-untyped-def]
    """First coefficient of the slightly regularised least-squares solution, by Cholesky decomposition."""
    n = len(right)
    scale = normal[0, 0]
    for i in range(1, n):
        normal[i, i] += 1e-6 * scale
    for j in range(n):
        for k in range(j):
            normal[j, j] -= normal[j, k] * normal[j, k]
        if normal[j, j] <= SINGULAR * scale:
            return np.nan
        normal[j, j] = np.sqrt(normal[j, j])
        for i in range(j + 1, n):
            for k in range(j):
                normal[i, j] -= normal[i, k] * normal[j, k]
            normal[i, j] /= normal[j, j]
    for i in range(n):
        for k in range(i):
            right[i] -= normal[i, k] * right[k]
        right[i] /= normal[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            right[i] -= normal[k, i] * right[k]
        right[i] /= normal[i, i]
    return right[0]
