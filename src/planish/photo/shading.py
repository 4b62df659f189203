"""Shape from shading: the profile of a page of uniform cross-section from the brightness of its blank paper.

Near-light model (Wada, Ukida and Matsuyama 1997; Zhang, Tan and others 2004). Matte paper of one colour, bent in one
direction only, has the brightness

    I = paper (ambient + (1 - ambient) max(n . l, 0) (d0 / d)^2),

where l points to the lamp at distance d, so brightness along the profile gives the profile's angle. In the cited work
the lamp position is known from the set-up; here it is fitted too, from the fall-off of brightness along the straight
rulings. The formula is that of `planish.illumination.lamp_model`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from planish.color import LUMINANCE, linear_light
from planish.errors import InputError
from planish.geometry.guards import TINY_SHARE
from planish.illumination.lamp_model import LampModel
from planish.photo.borders import Borders
from planish.photo.cylinder import STEEPEST, Cylinder, page_to_space, photo_to_page
from planish.photo.fit import TILT, CylinderFit, Observations, no_observations, residuals_of, start
from planish.photo.fitted_sheet import FittedSheet
from planish.photo.residual_warp import identity_warp
from planish.types import Floats, Pixels

CELLS = 48
"""Cells along the photo's long side: large enough that each contains blank paper between lines of text."""
BRIGHTER_PART = 90
"""Percentile of a cell's brightness taken as that of its paper."""
GREY = 0.015
"""Standard deviation of the brightness of paper [log]."""
INDEPENDENT = 400.0
"""Effective number of independent cells: residuals of neighbours are correlated."""
DARKER = (0.5, 0.2, 0.1, 0.06)
"""Scale of the robust loss for cells darker than the fit (print) [log], one value per round."""
SMOOTH = 0.12
"""Prior standard deviation of second differences of the profile's coefficients [rad]."""
RULINGS = 40
"""Number of strips along the rulings; the first round uses only the brightest cells of each."""
LEAST_PAPER = 0.3
"""Least share of the sheet's cells that must be blank paper."""
UNEVEN = 0.012
"""Largest rms residual of these cells [log] of a sheet of uniform cross-section and even colour."""
LAMPS = ((0.0, 0.0, -1.0), (0.4, 0.0, -0.8), (-0.4, 0.0, -0.8), (0.0, 0.4, -0.8), (0.0, -0.4, -0.8))
BOWS = (-0.4, 0.0, 0.4)
"""Initial lamps and profiles of the fit: flat, concave and convex."""
RIM = 0.03
"""Share of the sheet along its borders that is ignored."""


@dataclass(frozen=True, eq=False)
class LitSheet:
    """A curved sheet and the lamp above it.

    Attributes
    ----------
    cylinder : Cylinder
    lamp : (3,) float64
        In the sheet's frame, in distances of the camera.
    ambient : float
        Share of ambient light.
    paper_level : float
        Log of the paper's brightness where the lamp is nearest the origin.
    """

    cylinder: Cylinder
    lamp: Floats
    ambient: float
    paper_level: float

    def log_brightness(self, page: Floats) -> Floats:
        """Log brightness of blank paper at page positions (n, 2), along and across the text lines."""
        along = (page @ self.cylinder.text_axes())[:, 0]
        angle = np.clip(self.cylinder.angle(along), -STEEPEST, STEEPEST)
        normals = np.column_stack([np.sin(angle), np.zeros(len(angle)), -np.cos(angle)])
        logit = np.log(self.ambient / (1 - self.ambient))
        no_ambient_direction_no_vignetting = 0.0, 0.0, 0.0, -np.inf
        light = LampModel(
            np.zeros(3), 1.0, np.array([*self.lamp, self.paper_level, logit, *no_ambient_direction_no_vignetting])
        )
        return light.log_brightness(page_to_space(self.cylinder, page), normals, np.zeros(len(angle)))


def from_shading(photo: Pixels, borders: Borders, focal: float, centre: Floats) -> FittedSheet:
    """Fit the profile of a sheet to its shading, and its pose to its corners and straight sides.

    Raises
    ------
    InputError
        If too little of the sheet is blank paper, or its brightness does not fit a sheet bent in one direction.
    """
    sides = _corners_and_sides(borders)
    xy, log = _paper(photo, borders)
    starts = [
        _start_model(start(sides, borders.angle, focal, centre, across=False), lamp, bow)
        for lamp in LAMPS
        for bow in BOWS
    ]
    few = _brightest(photo_to_page(starts[0].cylinder, xy)[0][:, 0], log)
    tries = sorted((_round(model, sides, xy[few], log[few], DARKER[0], 20) for model in starts), key=lambda one: one[1])
    best = [model for model, _ in tries[:3]]
    for darker in DARKER[1:]:
        rounds = sorted((_round(model, sides, xy, log, darker, 20) for model in best), key=lambda one: one[1])
        best = [model for model, _ in rounds[:2]]
    model = best[0]
    residual = log - model.log_brightness(photo_to_page(model.cylinder, xy)[0])
    uneven = _check_brightness(residual)
    weight = np.ones(len(sides.photo_xy))
    residual_px, page, position = residuals_of(model.cylinder, sides, weight, focal)
    assert sides.sides is not None
    top, right, bottom, left = position[sides.sides]
    fitted = CylinderFit(model.cylinder, page, residual_px, weight, position, rounds[0][1])
    warp = identity_warp(np.array([left, top]), np.array([right, bottom]))
    return FittedSheet(model.cylinder, warp, fitted, sides, residual_px, bordered=True, shade=uneven)


def _brightest(along: Floats, log: Floats) -> NDArray[np.intp]:
    """Select some of the brightest cells of each strip: blank paper even where a picture fills half of the page."""
    ruling = np.floor((along - along.min()) / (np.ptp(along) + TINY_SHARE) * RULINGS).astype(int)
    order = np.lexsort((-log, ruling))
    first = np.searchsorted(ruling[order], ruling[order])
    count = np.bincount(ruling, minlength=RULINGS + 1)[ruling[order]]
    rank = (np.arange(len(log)) - first) / count
    return order[(rank > 0.03) & (rank < 0.2)]


def _start_model(sheet: Cylinder, lamp: tuple[float, float, float], bow: float) -> LitSheet:
    return LitSheet(
        replace(sheet, angle_coefficients=bow * np.linspace(-1, 1, len(sheet.angle_coefficients))),
        np.array(lamp),
        0.3,
        0.0,
    )


def _check_brightness(residual: Floats) -> float:
    """Return the rms residual of the blank paper [log]; refuse sheets that the model does not fit."""
    is_paper = np.abs(residual) < DARKER[-1]
    if is_paper.mean() < LEAST_PAPER:
        raise InputError(
            f"only {100 * is_paper.mean():.0f} % of the sheet is blank paper as bright as a sheet bent in one "
            "direction would be; shape from shading does not work on folded or crumpled sheets, under cast shadows or "
            "where print covers the page",
            "use {shape=auto}, or a 3D scan",
        )
    uneven = float(np.sqrt(np.mean(residual[is_paper] ** 2)))
    if uneven > UNEVEN:
        raise InputError(
            f"the blank paper's brightness is {100 * uneven:.1f} % off that of a sheet bent in one direction (at most "
            f"{100 * UNEVEN:.1f} % is good enough): it may be folded, or lie in a shadow",
            "use {shape=auto}, or a 3D scan",
        )
    return uneven


def _corners_and_sides(borders: Borders) -> Observations:
    """Observations of the left and right sides, which are straight rulings, and of the ends of top and bottom."""
    observations = no_observations()
    ends = np.r_[0:3, -3:0]
    for k, side in enumerate(borders.sides):
        positions = side if k % 2 else side[ends]
        observations = observations.with_group(positions, upright=k % 2 == 1, sigma_px=borders.sigma_px)
    return replace(observations, sides=np.arange(4, dtype=np.int32))


def _paper(photo: Pixels, borders: Borders) -> tuple[Floats, Floats]:
    """Centres of the sheet's cells on the photo (n, 2) [px] and the log brightness of their paper (n,)."""
    side = max(1, max(photo.shape[:2]) // CELLS)
    step = max(1, side // 12)
    rows, cols = (n // side for n in photo.shape[:2])
    part = np.asarray(photo)[: rows * side : step, : cols * side : step]
    per = side // step
    rows, cols = part.shape[0] // per, part.shape[1] // per
    light = linear_light(np.iinfo(photo.dtype).max + 1)[part[: rows * per, : cols * per]] @ LUMINANCE
    cells = light.reshape(rows, per, cols, per).swapaxes(1, 2).reshape(rows, cols, -1)
    bright = np.percentile(cells, BRIGHTER_PART, axis=2)
    x, y = np.meshgrid(np.arange(cols), np.arange(rows))
    xy = (np.stack([x, y], axis=-1) + 0.5) * per * step - 0.5
    outline = np.concatenate(borders.sides)
    inner = outline.mean(axis=0) + (1 - 2 * RIM) * (outline - outline.mean(axis=0))
    mask = np.zeros((rows, cols), np.uint8)
    cv2.fillPoly(mask, [np.rint((inner + 0.5) / (per * step) - 0.5).astype(np.int32)], 1)
    inside = (mask > 0) & (bright > 1e-3)
    return xy[inside], np.log(bright[inside])


def _round(
    model: LitSheet, sides: Observations, xy: Floats, log: Floats, darker: float, steps: int
) -> tuple[LitSheet, float]:
    """Run a round of robust least squares; cells darker by `darker` lose weight (Black and Rangarajan 1996)."""
    sheet = model.cylinder
    group_weight = np.sqrt(INDEPENDENT / len(xy)) / GREY

    def model_at(parameters: Floats) -> LitSheet:
        camera, angle_coefficients = parameters[:2], parameters[7:]
        ambient = 1 / (1 + np.exp(-parameters[5]))
        lamp = np.array([parameters[2], parameters[3], -np.exp(parameters[4])])  # always on the camera's side
        return LitSheet(
            replace(sheet, camera=camera, angle_coefficients=angle_coefficients),
            lamp,
            float(ambient),
            float(parameters[6]),
        )

    def residuals(parameters: Floats) -> Floats:
        model = model_at(parameters)
        page, good = photo_to_page(model.cylinder, xy)
        residual = np.where(good, log - model.log_brightness(page), 1.0)
        dark = residual / np.sqrt(1 + (residual / np.where(residual < 0, darker, 2 * darker)) ** 2)
        side_residual, _, _ = residuals_of(model.cylinder, sides, np.ones(len(sides.photo_xy)), sheet.focal)
        prior = np.concatenate(
            [parameters[:1] / TILT, parameters[2:4] / 2, parameters[4:5], (parameters[5:6] + 1) / 1.5, parameters[7:]]
        )
        bending = np.diff(parameters[7:], 2) / SMOOTH
        return np.concatenate([group_weight * dark, side_residual / sides.sigma_px[sides.group], prior, bending])

    ambient = np.log(model.ambient / (1 - model.ambient))
    level = float(np.quantile(log, 0.8)) if model.paper_level == 0 else model.paper_level
    begin = np.concatenate(
        [
            sheet.camera,
            model.lamp[:2],
            [np.log(-model.lamp[2] if model.lamp[2] < 0 else 1.0)],
            [ambient, level],
            sheet.angle_coefficients,
        ]
    )
    best = least_squares(residuals, begin, method="lm", max_nfev=steps)
    return model_at(best.x), float(best.cost)
