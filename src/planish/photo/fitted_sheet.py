"""Fit a sheet on a photo to its text lines, its borders, or both."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from planish.errors import InputError
from planish.geometry.guards import TINY_SHARE
from planish.photo.borders import Borders
from planish.photo.cylinder import Cylinder, photo_to_page
from planish.photo.fit import BOUND_ANGLE, LOOSE_ANGLE, CylinderFit, Observations, fit, no_observations, start
from planish.photo.line_grouping import group_rows_and_margins, line_observations
from planish.photo.lines import TextLines
from planish.photo.residual_warp import PageWarp, fit_warp, identity_warp
from planish.photo.surface import cell_centres
from planish.types import Floats

AROUND = 3.0
"""Margin drawn around the text where sheet borders are unknown, in letter heights."""
BESIDE = 5.0
"""Distance, in letter heights, within which text fragments are added to the text area."""
FRAGMENT_ROUNDS = 3
"""Repetitions of that, from fragment to fragment."""
MOST = 0.5
"""Least share of line ends whose rays meet the sheet; below it the fit failed."""
LEVEL = 0.5
"""Largest slope of a level fragment, in letter heights."""
PAGE_OF_TEXT = 150
"""Least number of letters from which a bound page is tried."""
STIFFNESS = 3.0
"""Regularisation of the residual warp: a second difference of one sigma costs as much as so many letters displaced by
one sigma."""


@dataclass(frozen=True, eq=False)
class FittedSheet:
    """A fitted sheet, its observations and residuals.

    Attributes
    ----------
    cylinder : Cylinder
    warp : ResidualWarp
        Residual warp; its corners are the page's, along and across the text lines, in camera distances.
    cylinder_fit : CylinderFit
    observations : Observations
    warped_residual_px : (n,) float64 [photo px]
        Distance of the observations from their lines after the warp.
    bordered : bool
        Whether the page's corners are the corners of the sheet.
    shade : float or None
        Relative rms residual of the brightness of blank paper, for shape from shading.
    """

    cylinder: Cylinder
    warp: PageWarp
    cylinder_fit: CylinderFit
    observations: Observations
    warped_residual_px: Floats
    bordered: bool
    shade: float | None = None


def from_lines(lines: TextLines, focal: float, centre: Floats) -> FittedSheet:
    """Fit the sheet to its text lines alone."""
    observations = line_observations(lines)
    first = fit(start(observations, lines.angle, focal, centre, across=False), observations, rounds=3)
    observations = group_rows_and_margins(lines, first)
    second = fit(first.cylinder, observations)
    low, high = _page_corners(lines, second.cylinder)
    return add_warp(second, observations, low, high, bordered=False)


def from_borders(
    borders: Borders,
    lines: TextLines | None,
    focal: float,
    centre: Floats,
    *,
    ratio: float | None = None,
) -> FittedSheet:
    """Fit the sheet to its borders and, if any, its text lines.

    Starts bent along the text lines, across them, and as a bound page are tried; the best fit is kept.

    Parameters
    ----------
    borders : Borders
    lines : TextLines or None
    focal : float [px]
    centre : (2,) float64 [px]
    ratio : float, optional
        Aspect ratio, width / height.
    """
    observations = _border_observations(borders, lines, ratio)
    tries = [_fit_loose_sheet(borders, observations, focal, centre, across=across) for across in (False, True)]
    if lines is not None and len(lines.line) >= PAGE_OF_TEXT:
        bound = from_lines(lines, focal, centre).cylinder
        tries.append((fit(bound, observations, rounds=2), BOUND_ANGLE))
    best, bend_angle_sigma = min(tries, key=lambda one: one[0].cost)
    if lines is not None:
        observations = _add_sides(group_rows_and_margins(lines, best), borders, ratio)
        best = fit(best.cylinder, observations, bend_angle_sigma=bend_angle_sigma)
    assert observations.sides is not None
    top, right, bottom, left = best.position[observations.sides]
    if not (left < right and top < bottom):
        raise InputError(
            "the outline on the photo does not fit any sheet of paper",
            "photograph it from the front, or try {shape=text-lines}",
        )
    return add_warp(best, observations, np.array([left, top]), np.array([right, bottom]), bordered=True)


def _fit_loose_sheet(
    borders: Borders, observations: Observations, focal: float, centre: Floats, *, across: bool
) -> tuple[CylinderFit, float]:
    """Fit a sheet that may bend in any direction, to its borders first; also return the prior of that direction."""
    sides = _border_observations(borders, None, observations.ratio)
    flat = start(sides, borders.angle, focal, centre, across=across)
    first = fit(flat, sides, rounds=2, bend_angle_sigma=LOOSE_ANGLE)
    return fit(first.cylinder, observations, rounds=2, bend_angle_sigma=LOOSE_ANGLE), LOOSE_ANGLE


def _border_observations(borders: Borders, lines: TextLines | None, ratio: float | None) -> Observations:
    text = line_observations(lines) if lines is not None else no_observations()
    return _add_sides(text, borders, ratio)


def _add_sides(observations: Observations, borders: Borders, ratio: float | None) -> Observations:
    first = len(observations.upright)
    for k, side in enumerate(borders.sides):
        observations = observations.with_group(side, upright=k % 2 == 1, sigma_px=borders.sigma_px)
    return replace(observations, sides=np.arange(first, first + 4, dtype=np.int32), ratio=ratio)


def add_warp(
    found: CylinderFit, observations: Observations, low: Floats, high: Floats, *, bordered: bool
) -> FittedSheet:
    """Fit the residual warp to what the cylinder does not explain."""
    upright = observations.upright[observations.group]
    value = np.where(upright, found.page[:, 0], found.page[:, 1])
    target = found.position[observations.group] - value
    sigma = observations.sigma_px[observations.group] / found.cylinder.focal
    typical = float(np.median(sigma))
    weight = _warp_weights(found, observations) * (typical / sigma) ** 2
    warp = fit_warp(identity_warp(low, high), found.page, target, weight, np.where(upright, 0, 1), STIFFNESS)
    moved = warp(found.page)
    remaining = (target - np.where(upright, moved[:, 0], moved[:, 1])) * found.cylinder.focal
    return FittedSheet(found.cylinder, warp, found, observations, remaining, bordered)


def _warp_weights(found: CylinderFit, observations: Observations) -> Floats:
    """Weights of the observations for the warp: sides of a sheet count fully, however badly they fit a cylinder."""
    if observations.sides is None:
        return found.weight
    return np.where(np.isin(observations.group, observations.sides), 1.0, found.weight)


def _page_corners(lines: TextLines, cylinder: Cylinder) -> tuple[Floats, Floats]:
    """Corners of the page: the text, fragments of text beside it, and a margin."""
    ends, good = photo_to_page(cylinder, lines.ends.reshape(-1, 2))
    if good.mean() < MOST:
        raise InputError(
            "the lines of text do not fit any sheet of paper bent in one direction; is it text, seen from the front?"
        )
    height = float(np.median(lines.height)) / cylinder.focal
    low, high = ends[good].min(axis=0), ends[good].max(axis=0)
    fragments, good = photo_to_page(cylinder, lines.fragments.reshape(-1, 2))
    fragments = fragments.reshape(-1, 2, 2)
    level = good[::2] & good[1::2] & (np.abs(fragments[:, 1, 1] - fragments[:, 0, 1]) < LEVEL * height)
    for _ in range(FRAGMENT_ROUNDS):
        near = (fragments.max(axis=1) > low - BESIDE * height) & (fragments.min(axis=1) < high + BESIDE * height)
        beside = fragments[level & near.all(axis=1)].reshape(-1, 2)
        low = np.minimum(low, beside.min(axis=0, initial=np.inf))
        high = np.maximum(high, beside.max(axis=0, initial=-np.inf))
    return low - [AROUND * height, (AROUND + 1) * height], high + AROUND * height


def extrapolated_share(sheet: FittedSheet, slack: float) -> float:
    """Share of the page farther than `slack` (camera distances) outside of the hull of the observations."""
    centres = cell_centres((50, 50), sheet.warp.low, sheet.warp.high)
    known = sheet.cylinder_fit.page[sheet.cylinder_fit.weight > 0.1]
    try:
        hull = ConvexHull(known)
    except (QhullError, ValueError):
        return 1.0
    extrapolated = (centres @ hull.equations[:, :2].T + hull.equations[:, 2]).max(axis=1)
    return float((extrapolated > slack).mean())


def rms(residual: Floats, weight: Floats) -> float:
    """Weighted root mean square."""
    return float(np.sqrt(np.average(residual**2, weights=weight + TINY_SHARE)))
