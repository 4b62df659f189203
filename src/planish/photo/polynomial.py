"""Straighten text lines one by one by polynomial regression (Zhang and Tan 2003): a baseline for comparison.

A polynomial is fitted to the letters of each line, and the line is shifted vertically onto a straight one. There is no
3D model: foreshortened letters stay narrow and lengths along the lines are not corrected. The original moves each word
separately; here the shift is interpolated between lines, so that pictures move with them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planish.photo.cylinder import photo_to_page
from planish.photo.fit import CylinderFit, start
from planish.photo.fitted_sheet import FittedSheet
from planish.photo.line_grouping import line_observations
from planish.photo.lines import TextLines
from planish.types import Floats

DEGREE = 3
PER_NUMBER = 6
"""Letters per coefficient of a line's polynomial."""
AROUND = 3.0
"""Margin drawn around the text, in letter heights."""


@dataclass(frozen=True, eq=False)
class LineWarp:
    """Vertical shift that straightens every line; linear between lines, constant beyond.

    Attributes
    ----------
    low, high : (2,) float64
        Corners of the page, along and across the text lines.
    level : (lines,) float64
        Target position of each line, in order.
    curves : (lines, 4) float64
        Polynomials of the position along the line, highest power first.
    reach : (lines, 2) float64
        Beginning and end of each line.
    """

    low: Floats
    high: Floats
    level: Floats
    curves: Floats
    reach: Floats

    def inverse(self, page_xy: Floats) -> Floats:
        """Map page positions (n, 2) to positions on the flat photo."""
        along, which = np.unique(page_xy[:, 0], return_inverse=True)
        held = np.clip(along, self.reach[:, :1], self.reach[:, 1:])
        powers = held[..., None] ** np.arange(DEGREE, -1, -1)
        seen = np.maximum.accumulate((powers * self.curves[:, None]).sum(axis=2), axis=0)
        page = page_xy.copy()
        for k in range(len(along)):
            here = which == k
            page[here, 1] += np.interp(page_xy[here, 1], self.level, seen[:, k] - self.level)
        return page


def from_polynomials(lines: TextLines, focal: float, centre: Floats) -> FittedSheet:
    """Straighten the text lines of a photo, assuming a flat sheet otherwise."""
    observations = line_observations(lines)
    cylinder = start(observations, lines.angle, focal, centre, across=False)
    page, _ = photo_to_page(cylinder, observations.photo_xy)
    ends = photo_to_page(cylinder, lines.ends.reshape(-1, 2))[0].reshape(-1, 2, 2)
    count = len(lines.height)
    positions = [page[observations.group == k] for k in range(count)]
    curves = np.array([_curve(xy) for xy in positions])
    level = np.array([float(np.mean(np.polyval(c, xy[:, 0]))) for c, xy in zip(curves, positions, strict=True)])
    order = np.argsort(level)
    height = AROUND * lines.letter_height / focal
    warp = LineWarp(
        ends.min(axis=(0, 1)) - height,
        ends.max(axis=(0, 1)) + height,
        level[order],
        curves[order],
        np.sort(ends[order, :, 0], axis=1),
    )
    residual = (
        np.concatenate([xy[:, 1] - np.polyval(c, xy[:, 0]) for c, xy in zip(curves, positions, strict=True)]) * focal
    )
    flat = (page[:, 1] - level[observations.group]) * focal
    fitted = CylinderFit(cylinder, page, flat, np.ones(len(page)), level, 0.0)
    return FittedSheet(cylinder, warp, fitted, observations, residual, bordered=False)


def _curve(xy: Floats) -> Floats:
    """Polynomial coefficients of a line; the degree depends on its number of letters."""
    degree = min(DEGREE, max(1, len(xy) // PER_NUMBER))
    return np.concatenate([np.zeros(DEGREE - degree), np.polyfit(xy[:, 0], xy[:, 1], degree)])
