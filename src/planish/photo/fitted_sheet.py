"""Fit a sheet on a photo to its text lines, its borders, or both."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from planish.errors import InputError
from planish.geometry.guards import TINY_SHARE
from planish.photo.borders import Borders
from planish.photo.cylinder import Cylinder
from planish.photo.fit import BOUND_ANGLE, LOOSE_ANGLE, CylinderFit, Observations, fit, no_observations, start
from planish.photo.line_grouping import group_rows_and_margins, line_observations
from planish.photo.lines import TextLines
from planish.photo.page_extent import region_extent, text_extent
from planish.photo.residual_warp import PageWarp, fit_warp, identity_warp
from planish.photo.surface import cell_centres
from planish.types import Floats

PAGE_OF_TEXT = 150
"""Least number of letters from which a bound page is tried."""
FAINTLY = 0.1
"""Least weight of a letter in the text's residual, however badly it fits."""
AGAINST_TEXT = 1.3
"""Ratio of the text's residual with some sides, or with rules, to that without, from which these are no sides of this
page, or do not lie level on it."""
BEYOND_REACH = 0.05
"""Share of the page by which a plain side may lie farther off and be one."""
ASKEW = 0.02
"""Largest rms distance of such a side from a straight line on the page, relative to its long side."""
MOST_BEYOND = 1.5
"""Largest extent of a page beyond its text, relative to that on a flat sheet."""
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


def from_lines(lines: TextLines, borders: Borders | None, focal: float, centre: Floats) -> FittedSheet:
    """Fit the sheet to its text lines alone; borders, if any, give its extent."""
    found, observations = _fit_lines(lines, focal, centre)
    low, high = _page_corners(found, observations, borders, lines)
    return add_warp(found, observations, low, high, bordered=False)


def _fit_lines(lines: TextLines, focal: float, centre: Floats) -> tuple[CylinderFit, Observations]:
    observations = line_observations(lines)
    # A bound page bends across its spine, which runs up the page: along level lines, and across columns.
    first = fit(start(observations, lines.angle, focal, centre, across=lines.columns), observations, rounds=3)
    observations = group_rows_and_margins(lines, first)
    return fit(first.cylinder, observations), observations


def from_borders(
    borders: Borders,
    lines: TextLines | None,
    focal: float,
    centre: Floats,
    *,
    ratio: float | None = None,
) -> FittedSheet:
    """Fit the sheet to its plain sides and, if any, its text lines.

    Where not all sides are plain, those that are may be of leaves below or of shadows; if the text says so, it is
    fitted alone.

    Starts bent along the text lines, across them, and as a bound page are tried; the best fit is kept.

    Parameters
    ----------
    borders : Borders
    lines : TextLines or None
    focal : float [px]
    centre : (2,) float64 [px]
    ratio : float, optional
        Aspect ratio, width / height, if all sides are plain.
    """
    whole = all(borders.plain)
    page_of_text = lines is not None and len(lines.line) >= PAGE_OF_TEXT
    alone = _fit_lines(lines, focal, centre) if lines is not None and (page_of_text or not whole) else None
    observations = _border_observations(borders, lines, ratio)
    tries = [_fit_loose_sheet(borders, observations, focal, centre, across=across) for across in (False, True)]
    if page_of_text and alone is not None:
        tries.append((fit(alone[0].cylinder, observations, rounds=2), BOUND_ANGLE))
    best, bend_angle_sigma = min(tries, key=lambda one: one[0].cost)
    if lines is not None:
        observations = _add_sides(group_rows_and_margins(lines, best), borders, ratio)
        best = fit(best.cylinder, observations, bend_angle_sigma=bend_angle_sigma)
    low, high = _page_corners(best, observations, borders, lines)
    fits = bool((low < high).all())
    if fits and lines is not None and not whole and observations.sides is not None:
        reach = _reach(best, lines, borders, text_extent(lines, best.cylinder))
        slack = BEYOND_REACH * (high - low)
        fits = bool((low > reach[0] - slack).all() and (high < reach[1] + slack).all())
        off = [best.residual_px[observations.group == k] for k in observations.sides if k >= 0]
        worst = max(float(np.sqrt(np.mean(one**2))) for one in off)
        fits &= worst < ASKEW * float((high - low).max()) * focal
    if fits:
        sheet = add_warp(best, observations, low, high, bordered=whole)
    if lines is not None and alone is not None and not whole:
        text = add_warp(*alone, *_page_corners(*alone, borders, lines), bordered=False)
        if not fits or text_residual_px(sheet, lines) > AGAINST_TEXT * text_residual_px(text, lines):
            return text
    elif not fits:
        raise InputError(
            "the outline on the photo does not fit any sheet of paper",
            "photograph it from the front, or try {shape=text-lines}",
        )
    return sheet


def _page_corners(
    found: CylinderFit, observations: Observations, borders: Borders | None, lines: TextLines | None
) -> tuple[Floats, Floats]:
    """Corners of the page: its plain sides; elsewhere all of the sheet's region and of the text."""
    extents = [text_extent(lines, found.cylinder)] if lines is not None else []
    if borders is not None and (region := region_extent(borders.outline, found.cylinder)) is not None:
        if lines is not None:
            region = _not_beyond(_reach(found, lines, borders, extents[0]), region)
        extents.append(region)
    low = np.min([low for low, _ in extents], axis=0)
    high = np.max([high for _, high in extents], axis=0)
    if borders is not None and observations.sides is not None:
        top, right, bottom, left = np.where(
            borders.plain, found.position[observations.sides], [low[1], high[0], high[1], low[0]]
        )
        low, high = np.array([left, top]), np.array([right, bottom])
    return low, high


def _reach(
    found: CylinderFit, lines: TextLines, borders: Borders, text: tuple[Floats, Floats]
) -> tuple[Floats, Floats]:
    """How far a page may extend beyond its text: as far as on a flat sheet, and half as far again.

    The bend of a sheet beyond its text is anybody's guess; a guess must not make most of the page.
    """
    count = len(lines.line)  # letters come first
    letters, root = np.c_[lines.photo_xy, np.ones(count)], np.sqrt(found.weight[:count, None])
    flat = np.linalg.lstsq(letters * root, found.page[:count] * root, rcond=None)[0]
    outline = np.c_[borders.outline, np.ones(len(borders.outline))] @ flat
    low, high = text
    return low - MOST_BEYOND * (low - outline.min(axis=0)).clip(0), high + MOST_BEYOND * (
        outline.max(axis=0) - high
    ).clip(0)


def _not_beyond(reach: tuple[Floats, Floats], extent: tuple[Floats, Floats]) -> tuple[Floats, Floats]:
    return np.maximum(reach[0], extent[0]), np.minimum(reach[1], extent[1])


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
    sides = np.full(4, -1, np.int32)
    for k in np.flatnonzero(borders.plain).tolist():
        sides[k] = len(observations.upright)
        observations = observations.with_group(borders.sides[k], upright=k % 2 == 1, sigma_px=borders.sigma_px)
    return replace(observations, sides=sides, ratio=ratio)


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


def text_residual_px(sheet: FittedSheet, lines: TextLines) -> float:
    """Weighted rms distance of letters from their lines after the warp [photo px]."""
    letters = slice(0, len(lines.line))
    return rms(sheet.warped_residual_px[letters], np.maximum(sheet.cylinder_fit.weight[letters], FAINTLY))


def letters_residual_px(sheet: FittedSheet, lines: TextLines) -> float:
    """The same of letters alone, without the pieces of rules."""
    letters = np.flatnonzero(~lines.rule[lines.line])
    return rms(sheet.warped_residual_px[letters], np.maximum(sheet.cylinder_fit.weight[letters], FAINTLY))


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
