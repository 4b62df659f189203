"""Robust least-squares fit of the cylinder to observed text lines, margins and sheet sides."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import least_squares

from planish.geometry.guards import TINY_PX, TINY_SHARE
from planish.photo.cylinder import Cylinder, photo_to_page, photo_to_pages
from planish.types import Bools, Floats, Ints

ROUNDS = 4
"""Rounds of iteratively reweighted least squares."""
OUTLIER_SIGMA = 3.0
"""Outlier threshold, in robust standard deviations; Tukey's biweight reaches 0 at twice that."""
ANGLE_COEFFICIENTS = 9
"""B-spline coefficients of the profile's angle: enough for a page that drops steeply into the gutter."""
FIRST_SCALE = 4.0
"""Scale of residuals in the first round, in standard deviations of the observations."""
INDEPENDENT = 6.0
"""Largest effective number of independent positions per group."""
SMOOTH = 0.05
"""Prior standard deviation of second differences of the angle coefficients [rad]."""
TILT = 0.6
"""Prior standard deviation of the tilt of a hand-held camera [rad]; matters only where the data do not decide."""
STEP = float(np.finfo(float).eps) ** 0.5
"""Of forward differences, for parameters of about 1."""
MOST_STEPS = 60
"""Of a least-squares fit."""
RATIO = 0.0005
"""Standard deviation of a known aspect ratio."""
LOST = 0.3
"""Residual of a position whose ray misses the sheet, in camera distances."""
BOUND_ANGLE = 0.03
"""Prior standard deviation of the angle between text lines and bending direction of a bound page [rad]."""
LOOSE_ANGLE = 0.4
"""The same for loose sheets, which bend in any direction [rad]."""


@dataclass(frozen=True, eq=False)
class Observations:
    """Photo positions in groups; those of a group lie on one straight line of the page.

    Attributes
    ----------
    photo_xy : (n, 2) float64 [photo px]
    group : (n,) int32
        Positions of a group share their coordinate across the text lines (level) or along them (upright).
    upright : (groups,) bool
    sigma_px : (groups,) float64 [photo px]
        Standard deviation of the distance of a position from its line.
    evenly_spaced : (k, 3) int32
        Triples of consecutive, evenly spaced groups.
    sides : (4,) int32 or None
        Groups of the sheet's top, right, bottom and left sides; -1 for sides that are not observed.
    ratio : float or None
        Aspect ratio, width / height, if known and all sides are observed.
    """

    photo_xy: Floats
    group: Ints
    upright: Bools
    sigma_px: Floats
    evenly_spaced: Ints = field(default_factory=lambda: np.zeros((0, 3), np.int32))
    sides: Ints | None = None
    ratio: float | None = None

    def with_group(self, photo_xy: Floats, *, upright: bool, sigma_px: float) -> Observations:
        """Return a copy with one more group."""
        new = np.full(len(photo_xy), len(self.upright), np.int32)
        return replace(
            self,
            photo_xy=np.concatenate([self.photo_xy, photo_xy]),
            group=np.concatenate([self.group, new]),
            upright=np.append(self.upright, upright),
            sigma_px=np.append(self.sigma_px, sigma_px),
        )


def no_observations() -> Observations:
    """Return an empty set of observations."""
    return Observations(np.zeros((0, 2)), np.zeros(0, np.int32), np.zeros(0, bool), np.zeros(0))


@dataclass(frozen=True, eq=False)
class CylinderFit:
    """Result of the cylinder fit.

    Attributes
    ----------
    cylinder : Cylinder
    page : (n, 2) float64
        Observed positions on the page, along and across the text lines, in camera distances.
    residual_px : (n,) float64 [photo px]
        Distance of each position from its group's line.
    weight : (n,) float64
        Robust weights; 0 for outliers.
    position : (groups,) float64
        Coordinate of each group's line on the page, in camera distances.
    cost : float
        Sum of log(1 + (residual / sigma)^2), for comparing fits: it does not depend on the weights.
    """

    cylinder: Cylinder
    page: Floats
    residual_px: Floats
    weight: Floats
    position: Floats
    cost: float


def start(observations: Observations, angle: float, focal: float, centre: Floats, *, across: bool) -> Cylinder:
    """Return a flat, fronto-parallel sheet, its text at an angle [rad], bending along its text lines or across."""
    text_angle = np.pi / 2 if across else 0.0
    cylinder = Cylinder(
        np.array([0, angle - text_angle]), text_angle, np.zeros(ANGLE_COEFFICIENTS), (-1.0, 1.0), focal, centre
    )
    return replace(cylinder, span=_span(cylinder, observations))


def _span(cylinder: Cylinder, observations: Observations) -> tuple[float, float]:
    page, _ = photo_to_page(cylinder, observations.photo_xy)
    a = (page @ cylinder.text_axes())[:, 0]
    low, high = np.quantile(a, [0.005, 0.995])
    return float(low - 0.03 * (high - low)), float(high + 0.03 * (high - low))


def fit(
    cylinder: Cylinder, observations: Observations, *, rounds: int = ROUNDS, bend_angle_sigma: float = BOUND_ANGLE
) -> CylinderFit:
    """Fit pose and profile by robust least squares in photo pixels.

    All positions of a group shall have the same coordinate on the page. Line coordinates are eliminated (they are the
    means of their groups), so only the 12 parameters of the cylinder are unknown. Weights are Tukey's biweight (Beaton
    and Tukey 1974), updated in every round.

    Parameters
    ----------
    cylinder : Cylinder
        Initial guess.
    observations : Observations
    rounds : int
    bend_angle_sigma : float [rad]
        Prior standard deviation of the bending direction around that of `cylinder`.
    """
    reference, text_angle = cylinder, cylinder.text_angle
    weight, scale = np.ones(len(observations.photo_xy)), FIRST_SCALE
    group_weight = _independent(observations)

    def cylinder_at(parameters: Floats) -> Cylinder:
        return replace(
            reference,
            camera=parameters[:2],
            text_angle=text_angle + bend_angle_sigma * parameters[2],
            angle_coefficients=parameters[3:],
        )

    def residuals_at(several: Floats) -> Floats:
        """Residuals (k, m) at k sets of parameters."""
        cylinders = [cylinder_at(parameters) for parameters in several]
        residual, _, position = residuals_of_several(cylinders, observations, weight, cylinder.focal)
        prior = [several[:, :1] / TILT, several[:, 2:3], np.diff(several[:, 3:], 2) / SMOOTH, several[:, 3:]]
        uneven = (
            (position[:, observations.evenly_spaced] @ [1.0, -2.0, 1.0])
            * cylinder.focal
            / observations.sigma_px[observations.evenly_spaced[:, 1]]
        )
        shape = (
            [[[_ratio_residual(one, observations)] for one in position]]
            if observations.ratio and observations.sides is not None
            else []
        )
        data = np.sqrt(weight * group_weight) * residual / observations.sigma_px[observations.group]
        return np.concatenate([data / scale, uneven / scale, *prior, *shape], axis=1)

    def slopes(parameters: Floats) -> Floats:
        """Forward differences by all parameters at once."""
        step = STEP * np.maximum(np.abs(parameters), 1)
        begin, *ends = residuals_at(np.vstack([parameters, parameters + np.diag(step)]))
        return (np.array(ends) - begin).T / step

    def residuals(parameters: Floats) -> Floats:
        return residuals_at(parameters[None])[0]

    parameters = np.concatenate([cylinder.camera, [0.0], cylinder.angle_coefficients])
    for k in range(rounds):
        parameters = least_squares(
            residuals, parameters, slopes, method="lm", x_scale=0.1, xtol=1e-6, ftol=1e-6, max_nfev=MOST_STEPS
        ).x
        residual, page, position = residuals_of(cylinder_at(parameters), observations, weight, cylinder.focal)
        if k < rounds - 1:
            weight, scale = _weights(residual, observations, weight)
            reference = replace(reference, span=_span(cylinder_at(parameters), observations))
    relative = residual / observations.sigma_px[observations.group]
    cost = float((group_weight * np.log1p(relative**2)).sum())
    return CylinderFit(cylinder_at(parameters), page, residual, weight, position, cost)


def residuals_of(
    cylinder: Cylinder, observations: Observations, weight: Floats, px_per_unit: float
) -> tuple[Floats, Floats, Floats]:
    """Distance of each position from its group's line [photo px], page positions, and line coordinates."""
    residual, page, position = residuals_of_several([cylinder], observations, weight, px_per_unit)
    return residual[0], page[0], position[0]


def residuals_of_several(
    cylinders: Sequence[Cylinder], observations: Observations, weight: Floats, px_per_unit: float
) -> tuple[Floats, Floats, Floats]:
    """The same for k cylinders with one span: (k, n), (k, n, 2) and (k, groups)."""
    page, good = photo_to_pages(cylinders, observations.photo_xy)
    group, count = observations.group, len(observations.upright)
    value = np.where(observations.upright[group], page[..., 0], page[..., 1])
    w = weight * good + TINY_SHARE
    of_cylinder = (group + count * np.arange(len(cylinders))[:, None]).ravel()
    total, sums = (
        np.bincount(of_cylinder, what.ravel(), count * len(cylinders)).reshape(-1, count) for what in (w, w * value)
    )
    position = sums / total
    return np.where(good, value - position[:, group], LOST) * px_per_unit, page, position


def _ratio_residual(position: Floats, observations: Observations) -> float:
    """Deviation of the aspect ratio from the known one, in standard deviations."""
    assert observations.sides is not None
    assert observations.ratio is not None
    top, right, bottom, left = position[observations.sides]
    height = bottom - top if abs(bottom - top) > TINY_PX else TINY_PX
    return float(np.clip((right - left) / height / observations.ratio - 1, -9, 9)) / RATIO


def _independent(observations: Observations) -> Floats:
    """Weights that limit the effective size of a group: residuals of neighbours are correlated."""
    count = np.bincount(observations.group, minlength=len(observations.upright))
    return np.minimum(1.0, INDEPENDENT / np.maximum(count, 1))[observations.group]


def _weights(residual: Floats, observations: Observations, weight: Floats) -> tuple[Floats, float]:
    """Tukey's weights, and the robust scale of the residuals (from their median; at least 1 sigma)."""
    relative = np.abs(residual) / observations.sigma_px[observations.group]
    scale = max(1.0, 1.48 * float(np.median(relative[weight > 0.1])))
    return np.clip(1 - (relative / (2 * OUTLIER_SIGMA * scale)) ** 2, 0, 1) ** 2, scale
