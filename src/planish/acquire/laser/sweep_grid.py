"""Resample the crossings of a laser sweep to a grid of camera pixels."""

from __future__ import annotations

import numpy as np
from numba import njit

from planish.acquire.grid_mesh import STEEPEST
from planish.acquire.laser.crossings import Sweep
from planish.parallel import thread_pool
from planish.types import Camera, Floats

WIDEST_GAP = 4.0
"""Largest gap between neighbouring lines, in grid cells; wider ones stay empty."""

MIN_SD_PX = 0.02
"""Least standard deviation of a line [px]: speckle limits accuracy, whatever the noise."""

OUTLIER = 2.5
"""Outlier threshold for the second fit, in rms of the first."""


def grid_cell_px(sweep: Sweep) -> int:
    """Side of a grid cell [camera px]: the step of a line from photo to photo."""
    at = np.sort(sweep.at.transpose(1, 0, 2).reshape(sweep.at.shape[1], -1), axis=1)
    steps = np.diff(at, axis=1)
    return max(1, round(float(np.nanmedian(steps))))


def resample_to_grid(sweep: Sweep, inverse: Floats, camera: Camera, cell: int) -> tuple[Floats, Floats, Floats]:
    """Resample to (grid rows, grid columns): depth [mm], share of agreeing rows, and standard deviation [mm]."""
    count = sweep.at.shape[1]
    length = camera.shape_rc[1 if sweep.along == "rows" else 0]
    at, w, sd = (v.transpose(1, 0, 2).reshape(count, -1) for v in (sweep.at, inverse, sweep.sd))
    at = np.where(np.isfinite(w), at, np.nan)
    order = np.argsort(at, axis=1)  # NaN last
    at, w, sd = (np.take_along_axis(v, order, axis=1) for v in (at, w, sd))
    count_valid = np.isfinite(at).sum(axis=1)
    shape = -(-count // cell), -(-length // cell)
    grid_w, agreement, grid_sd = (np.full(shape, np.nan) for _ in range(3))
    focal = camera.matrix[0, 0] if sweep.along == "rows" else camera.matrix[1, 1]
    with thread_pool() as parallel_for:
        parallel_for(_fit_grid, shape[0], cell, at, w, sd, count_valid, focal, grid_w, agreement, grid_sd, block=8)
    depth = 1 / grid_w
    return depth, agreement, grid_sd * depth**2


@njit(cache=True, nogil=True)
def _fit_grid(first, last, cell, at, w, sd, count_valid, focal, grid_w, agreement, grid_sd):  # type: ignore[no-untyped-def]
    """Fit w = a + b x + c y + e x^2 at every grid point to two samples per side in each of its rows."""
    x, y, z, q = np.empty(4 * cell), np.empty(4 * cell), np.empty(4 * cell), np.empty(4 * cell)
    result = np.empty(3)
    for i in range(first, last):
        behind = np.zeros(cell, np.int64)  # first sample right of the grid point, per row
        rows = min(cell, len(at) - i * cell)
        for j in range(grid_w.shape[1]):
            middle = j * cell + (cell - 1) / 2
            n, full = 0, 0
            for r in range(rows):
                row = i * cell + r
                while behind[r] < count_valid[row] and at[row, behind[r]] < middle:
                    behind[r] += 1
                m = behind[r]
                if m == 0 or m == count_valid[row] or at[row, m] - at[row, m - 1] > WIDEST_GAP * cell:
                    continue
                full += 1
                for k in range(max(m - 2, 0), min(m + 2, count_valid[row])):
                    if abs(at[row, k] - middle) <= WIDEST_GAP * cell:
                        x[n], y[n], z[n] = at[row, k] - middle, r - (cell - 1) / 2, w[row, k]
                        q[n] = 1 / max(sd[row, k], MIN_SD_PX) ** 2
                        n += 1
            if 2 * full < rows or not _fit_sheet(n, x, y, z, q, result):
                continue
            # across a discontinuity samples scatter more than on the steepest joined surface
            if result[1] <= STEEPEST / 2 * result[0] / focal:
                grid_w[i, j], grid_sd[i, j], agreement[i, j] = result[0], result[1], result[2] * full / rows


@njit(cache=True, nogil=True)
def _fit_sheet(n, x, y, z, q, result):  # type: ignore[no-untyped-def]
    """Weighted least squares, repeated without outliers: a, its standard deviation, share of inliers."""
    base, limit = z[0], np.inf
    fit = np.zeros(4)
    for _ in range(2):
        normal, right = np.zeros((4, 4)), np.zeros(4)
        kept = 0
        for k in range(n):
            if abs(_residual(x[k], y[k], z[k] - base, fit)) > limit:
                continue
            kept += 1
            row = (1.0, x[k], y[k], x[k] * x[k])
            for u in range(4):
                right[u] += q[k] * row[u] * (z[k] - base)
                for v in range(4):
                    normal[u, v] += q[k] * row[u] * row[v]
        if kept < 3:
            return False
        for u in range(1, 4):  # regularises slopes that a single row or two lines leave undetermined
            normal[u, u] *= 1 + 1e-9
            normal[u, u] += 1e-9 * normal[0, 0]
        inverse = np.linalg.inv(normal)
        fit = inverse @ right
        square = 0.0
        for k in range(n):
            residual = _residual(x[k], y[k], z[k] - base, fit)
            if abs(residual) <= limit:
                square += q[k] * residual * residual
        variance = square / max(kept - 4, 1)
        limit = OUTLIER * np.sqrt(square / normal[0, 0])
    result[0] = base + fit[0]
    result[1] = np.sqrt(variance * max(inverse[0, 0], 0.0))
    result[2] = kept / n
    return True


@njit(cache=True, nogil=True)
def _residual(x, y, z, fit):  # type: ignore[no-untyped-def]
    return z - fit[0] - fit[1] * x - fit[2] * y - fit[3] * x * x
