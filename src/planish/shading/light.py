"""The light on the sheet, found from how bright its paper is and how it is turned."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from planish.types import Bools, Floats

ENOUGH_CELLS = 3000
DARKER = (0.4, 0.15, 0.05, 0.03)
"""How far below the paper's brightness [log] a cell counts as something printed on it, from the first round on."""
BRIGHTER = 0.1
"""Nothing is brighter than paper, so what is pulls at the fit; beyond this [log] no longer with its square."""


@dataclass(frozen=True, eq=False)
class Light:
    """A lamp, light from all around, and a lens that darkens towards its rim.

    Paper with normal n at x shines with exp(paper) V (ambient (1 + sky . n) + (1 - ambient) max(n . l, 0) (d0 / d)^2),
    where l points from x to the lamp, d is its distance, d0 that from the sheet's middle, and V = (1 + fall rho^2)^-2
    with rho the distance from the photo's middle.

    Attributes
    ----------
    middle : (3,) float64 [mm]
    size : float [mm]
        Of the sheet.
    numbers : (9,) float64
        Lamp's place (3, from the middle, in sizes), logarithm of the paper's brightness, ambient share before the
        logistic function, sky (3), logarithm of fall.
    """

    middle: Floats
    size: float
    numbers: Floats

    @property
    def lamp(self) -> Floats:
        """Place of the lamp: (3,) [mm]; very far for light from one direction."""
        return np.asarray(self.middle + self.size * self.numbers[:3])

    @property
    def ambient(self) -> float:
        """Share of the light on the sheet's middle that comes from all around."""
        return float(1 / (1 + np.exp(-self.numbers[4])))

    def log_brightness(self, points: Floats, normals: Floats, off_axis: Floats, lit: Floats | float = 1.0) -> Floats:
        """Natural logarithm of the brightness that paper has at (..., 3) points that see a share of the lamp."""
        way = self.lamp - points
        distance = np.linalg.norm(way, axis=-1)
        facing = np.maximum(np.einsum("...i,...i->...", normals, way) / distance, 0)
        near = (np.linalg.norm(self.numbers[:3]) * self.size / distance) ** 2
        around = np.maximum(1 + normals @ self.numbers[5:8], 0.05)
        lens = -2 * np.log1p(np.exp(self.numbers[8]) * off_axis**2)
        light = self.ambient * around + (1 - self.ambient) * lit * facing * near
        return np.asarray(self.numbers[3] + lens + np.log(np.maximum(light, 1e-4)))


PRIOR = np.array([0, 0, 0, 0, 0.02, 1, 1, 1, 0.02])
"""How strongly each number is held to its start, against the misfit of all cells in log brightness: what the sheet's
shape cannot tell stays where it was."""


def fit(points: Floats, normals: Floats, off_axis: Floats, brightness: Floats) -> Light:
    """Fit the light to cells most of which may be blank paper.

    Cells darker than the fit count the less the darker they are: print, pictures and stamps are darker than paper.
    Found by least squares from several lamps around the sheet's normal, in rounds that trust dark cells less and less
    (Black and Rangarajan 1996).

    Parameters
    ----------
    points, normals : (k, 3) float64
    off_axis : (k,) float64
    brightness : (k,) float64
        Linear, greater than 0.
    """
    middle = points.mean(axis=0)
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    log = np.log(brightness)
    few = slice(None, None, 4)
    rough = points[few], normals[few], off_axis[few], log[few]
    tries = [_round(Light(middle, size, start), *rough, DARKER[0], 6) for start in _starts(normals, log)]
    tries.sort(key=lambda light: _cost(light, *rough, DARKER[2]))
    best = tries[:2]
    for darker in DARKER[1:]:
        best = [_round(light, points, normals, off_axis, log, darker, 20) for light in best]
    return min(best, key=lambda light: _cost(light, points, normals, off_axis, log, DARKER[-1]))


def _starts(normals: Floats, log: Floats) -> list[Floats]:
    """Lamps over the middle and to four sides, as high as the sheet is wide."""
    up = normals.mean(axis=0)
    up /= np.linalg.norm(up)
    aside = np.linalg.svd(up[None])[2][1:]
    level = float(np.quantile(log, 0.8))
    around = [(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)]
    return [np.r_[1.2 * up + a * aside[0] + b * aside[1], level, -1.0, 0, 0, 0, -4.0] for a, b in around]


def _round(
    light: Light, points: Floats, normals: Floats, off_axis: Floats, log: Floats, darker: float, steps: int
) -> Light:
    start = light.numbers
    pull = PRIOR * np.sqrt(len(log)) * 0.03

    def misfit(numbers: Floats) -> Floats:
        model = Light(light.middle, light.size, numbers).log_brightness(points, normals, off_axis)
        return np.r_[robust(log - model, darker), pull * (numbers - START_OF_PRIOR)]

    found = least_squares(misfit, start, method="lm", x_scale="jac", max_nfev=steps * (len(start) + 1))
    return Light(light.middle, light.size, found.x)


START_OF_PRIOR = np.array([0, 0, 0, 0, -1.0, 0, 0, 0, -4.0])


def robust(residual: Floats, darker: float) -> Floats:
    """Residuals whose squares grow no more below -darker, and only linearly above BRIGHTER."""
    low = residual / np.sqrt(1 + (residual / darker) ** 2)
    high = np.sign(residual) * BRIGHTER * np.sqrt(2 * (np.sqrt(1 + (residual / BRIGHTER) ** 2) - 1))
    return np.where(residual < 0, low, high)


def _cost(light: Light, points: Floats, normals: Floats, off_axis: Floats, log: Floats, darker: float) -> float:
    return float((robust(log - light.log_brightness(points, normals, off_axis), darker) ** 2).sum())


def chosen(usable: Bools) -> Bools:
    """At most ENOUGH_CELLS of the usable ones, evenly spread."""
    step = max(1, int(np.sqrt(usable.sum() / ENOUGH_CELLS)))
    some = np.zeros_like(usable)
    some[step // 2 :: step, step // 2 :: step] = True
    return np.asarray(some & usable)
