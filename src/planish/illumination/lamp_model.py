"""Lamp model: a near lamp, ambient light and vignetting, fitted to the brightness of the paper and its normals."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.optimize import least_squares

from planish.geometry.axes import perpendicular_axes
from planish.parallel import thread_pool
from planish.types import Bools, Floats, read_only

MAX_CELLS = 3000
DARKER = (0.4, 0.15, 0.05, 0.03)
"""How far below the paper's brightness [log] a cell counts as something printed on it, from the first round on."""
BRIGHTER = 0.1
"""Nothing is brighter than paper, so what is pulls at the fit; beyond this [log] no longer with its square."""


@dataclass(frozen=True, eq=False)
class LampModel:
    """A near point light, directional ambient light and the vignetting of the lens.

    Paper with normal n at x shines with exp(paper) V (ambient (1 + a . n) + (1 - ambient) max(n . l, 0) (d0 / d)^2),
    where l points from x to the lamp, d is its distance, d0 that from the sheet's middle, and V = (1 + v rho^2)^-2
    with rho the distance from the photo's middle.

    Attributes
    ----------
    middle : (3,) float64 [mm]
    size : float [mm]
        Of the sheet.
    parameters : (9,) float64
        Place of the lamp (3, from the middle, in units of `size`), logarithm of the paper's brightness, logit of the
        ambient share, ambient direction a (3), logarithm of the vignetting v.
    """

    middle: Floats
    size: float
    parameters: Floats

    @property
    def lamp(self) -> Floats:
        """Place of the lamp: (3,) [mm]; very far for light from one direction."""
        return np.asarray(self.middle + self.size * self.parameters[:3])

    @property
    def ambient(self) -> float:
        """Share of the light on the sheet's middle that comes from all around."""
        return float(1 / (1 + np.exp(-self.parameters[4])))

    def log_brightness(
        self, points: Floats, normals: Floats, off_axis: Floats, visibility: Floats | float = 1.0
    ) -> Floats:
        """Natural logarithm of the brightness that paper has at (..., 3) points that see a share of the lamp."""
        return self._evaluated(points, normals, off_axis, visibility, slopes=False)[0]

    def with_slopes(self, points: Floats, normals: Floats, off_axis: Floats) -> tuple[Floats, Floats]:
        """The same for (k, 3) points in full light, and its derivatives by `parameters`: (k, 9)."""
        return self._evaluated(points, normals, off_axis, 1.0, slopes=True)

    def _evaluated(
        self, points: Floats, normals: Floats, off_axis: Floats, visibility: Floats | float, *, slopes: bool
    ) -> tuple[Floats, Floats]:
        shape = points.shape[:-1]
        flat = np.ascontiguousarray(points.reshape(-1, 3)), np.ascontiguousarray(normals.reshape(-1, 3))
        scalars = (read_only(np.broadcast_to(value, shape).ravel()) for value in (off_axis, visibility))
        log, by = np.empty(flat[0].shape[0]), np.empty((flat[0].shape[0] if slopes else 0, len(self.parameters)))
        work = (*flat, *scalars, self.middle, self.size, self.parameters, log, by)
        with thread_pool() as parallel_for:
            parallel_for(_log_brightness, len(log), *work)
        return log.reshape(shape), by


@njit(cache=True, nogil=True, error_model="numpy")
def _log_brightness(  # type: ignore[no-untyped-def]
    first, last, points, normals, off_axis, visibility, middle, size, parameters, log, slopes
):
    """Formula of `LampModel` at each point; where `slopes` has rows, its derivatives by the parameters too."""
    ambient, vignetting = 1 / (1 + math.exp(-parameters[4])), math.exp(parameters[8])
    lamp = size * parameters[0], size * parameters[1], size * parameters[2]
    high = lamp[0] ** 2 + lamp[1] ** 2 + lamp[2] ** 2  # d0^2
    for i in range(first, last):
        n = normals[i, 0], normals[i, 1], normals[i, 2]
        way = (
            lamp[0] + middle[0] - points[i, 0],
            lamp[1] + middle[1] - points[i, 1],
            lamp[2] + middle[2] - points[i, 2],
        )
        squared = way[0] ** 2 + way[1] ** 2 + way[2] ** 2  # d^2
        facing = max(n[0] * way[0] + n[1] * way[1] + n[2] * way[2], 0.0)  # d (n . l)
        spread = visibility[i] / (squared * math.sqrt(squared))
        near = facing * high * spread  # (n . l) (d0 / d)^2
        directional = 1 + n[0] * parameters[5] + n[1] * parameters[6] + n[2] * parameters[7]
        around = max(directional, DIMMEST)
        light = max(ambient * around + (1 - ambient) * near, 1e-4)
        dim = vignetting * off_axis[i] ** 2
        log[i] = parameters[3] - 2 * math.log1p(dim) + math.log(light)
        if len(slopes) == 0:
            continue
        for k in range(3):
            by_lamp = 0.0
            if facing > 0:
                by_lamp = spread * (high * n[k] + facing * (2 * lamp[k] - 3 * high * way[k] / squared))
            slopes[i, k] = (1 - ambient) * size * by_lamp / light
            slopes[i, 5 + k] = ambient * n[k] / light if directional > DIMMEST else 0.0
        slopes[i, 3] = 1.0
        slopes[i, 4] = ambient * (1 - ambient) * (around - near) / light
        slopes[i, 8] = -2 * dim / (1 + dim)


DIMMEST = 0.05
"""LampModel from all around is never less than this part of its mean."""


class Cells(NamedTuple):
    """What the fit knows of each cell: (k, 3), (k, 3), and (k,) each."""

    points: Floats
    normals: Floats
    off_axis: Floats
    log: Floats


PRIOR = np.array([0, 0, 0, 0, 0.02, 1, 1, 1, 0.02])
"""How strongly each number is held to its start, against the misfit of all cells in log brightness: what the sheet's
shape cannot tell stays where it was."""


def fit_lamp(points: Floats, normals: Floats, off_axis: Floats, brightness: Floats) -> LampModel:
    """Fit the light to cells most of which may be blank paper.

    Cells darker than the fit count the less the darker they are: print, pictures and stamps are darker than paper.
    Found by least squares from several lamps around the sheet's normal, in rounds that trust dark cells less and less
    (Black and Rangarajan 1996). Cast shadows count as print.

    Parameters
    ----------
    points, normals : (k, 3) float64
    off_axis : (k,) float64
    brightness : (k,) float64
        Linear, greater than 0.
    """
    middle = points.mean(axis=0)
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    cells = Cells(points, normals, off_axis, np.log(brightness))
    rough = Cells(*(values[::4] for values in cells))
    tries = [_round(LampModel(middle, size, start), rough, DARKER[0], 6) for start in _starts(normals, cells.log)]
    tries.sort(key=lambda light: _cost(light, rough, DARKER[2]))
    best = tries[:2]
    for darker in DARKER[1:]:
        best = [_round(light, cells, darker, 20) for light in best]
    return min(best, key=lambda light: _cost(light, cells, DARKER[-1]))


def _starts(normals: Floats, log: Floats) -> list[Floats]:
    """Lamps over the middle and to four sides, as high as the sheet is wide."""
    up = normals.mean(axis=0)
    up /= np.linalg.norm(up)
    aside = perpendicular_axes(up)
    level = float(np.quantile(log, 0.8))
    around = [(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)]
    return [np.r_[1.2 * up + a * aside[0] + b * aside[1], level, -1.0, 0, 0, 0, -4.0] for a, b in around]


def _round(light: LampModel, cells: Cells, darker: float, steps: int) -> LampModel:
    pull = PRIOR * np.sqrt(len(cells.log)) * 0.03
    where = cells.points, cells.normals, cells.off_axis

    def residuals(parameters: Floats) -> Floats:
        model = LampModel(light.middle, light.size, parameters).log_brightness(*where)
        return np.r_[robust(cells.log - model, darker), pull * (parameters - START_OF_PRIOR)]

    def slopes(parameters: Floats) -> Floats:
        model, by = LampModel(light.middle, light.size, parameters).with_slopes(*where)
        return np.concatenate([-robust_slope(cells.log - model, darker)[:, None] * by, np.diag(pull)])

    solution = least_squares(residuals, light.parameters, slopes, method="lm", x_scale="jac", max_nfev=steps)
    return LampModel(light.middle, light.size, solution.x)


START_OF_PRIOR = np.array([0, 0, 0, 0, -1.0, 0, 0, 0, -4.0])


def robust(residual: Floats, darker: float) -> Floats:
    """Residuals whose squares grow no more below -darker, and only linearly above BRIGHTER."""
    low = residual / np.sqrt(1 + (residual / darker) ** 2)
    high = np.sign(residual) * BRIGHTER * np.sqrt(2 * (np.sqrt(1 + (residual / BRIGHTER) ** 2) - 1))
    return np.where(residual < 0, low, high)


def robust_slope(residual: Floats, darker: float) -> Floats:
    """Derivative of `robust` by the residual."""
    low = (1 + (residual / darker) ** 2) ** -1.5
    share = np.maximum(residual / BRIGHTER, 1e-6)
    root = np.sqrt(1 + share**2)
    return np.where(residual < 0, low, share / (root * np.sqrt(2 * (root - 1))))


def _cost(light: LampModel, cells: Cells, darker: float) -> float:
    model = light.log_brightness(cells.points, cells.normals, cells.off_axis)
    return float((robust(cells.log - model, darker) ** 2).sum())


def sample_cells(usable: Bools) -> Bools:
    """At most MAX_CELLS of the usable ones, evenly spread."""
    step = max(1, int(np.sqrt(usable.sum() / MAX_CELLS)))
    some = np.zeros_like(usable)
    some[step // 2 :: step, step // 2 :: step] = True
    return np.asarray(some & usable)
