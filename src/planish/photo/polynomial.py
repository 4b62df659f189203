"""Lines of text straightened one by one: polynomial regression (Zhang and Tan 2003), to compare with.

A polynomial is fitted to each line's letters, and what stands on it is moved up or down to a straight line. Nothing is
known of space: letters that lean away stay narrow, and the paper's length along the lines is not made good. The
original moved every word by itself; here the shift is carried on between the lines, so that pictures move with them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planish.photo.bent import Bent
from planish.photo.cylinder import seen_at
from planish.photo.fit import Fitted, start
from planish.photo.lines import TextLines
from planish.photo.rows import evidence_of
from planish.types import Floats

DEGREE = 3
PER_NUMBER = 6
"""Letters for every number of a line's polynomial."""
AROUND = 3.0
"""Paper drawn around the text, in heights of its letters."""


@dataclass(frozen=True, eq=False)
class LineShift:
    """Shift up and down that makes every line straight; linear between lines, constant beyond.

    Attributes
    ----------
    low, high : (2,) float64
        Corners of the page, along and across its lines.
    level : (lines,) float64
        Where each line is to lie, in order.
    curves : (lines, 4) float64
        Polynomials of the place along the line, highest power first.
    reach : (lines, 2) float64
        Where each line begins and ends.
    """

    low: Floats
    high: Floats
    level: Floats
    curves: Floats
    reach: Floats

    def undone(self, true: Floats) -> Floats:
        """Places of the flat photo that are shifted to given ones: (n, 2)."""
        along, which = np.unique(true[:, 0], return_inverse=True)
        held = np.clip(along, self.reach[:, :1], self.reach[:, 1:])
        powers = held[..., None] ** np.arange(DEGREE, -1, -1)
        seen = np.maximum.accumulate((powers * self.curves[:, None]).sum(axis=2), axis=0)
        page = true.copy()
        for k in range(len(along)):
            here = which == k
            page[here, 1] += np.interp(true[here, 1], self.level, seen[:, k] - self.level)
        return page


def from_polynomials(lines: TextLines, focal: float, centre: Floats) -> Bent:
    """Straighten the lines of text of a photo that is otherwise taken to be flat."""
    evidence = evidence_of(lines)
    sheet = start(evidence, lines.angle, focal, centre, across=False)
    page, _ = seen_at(sheet, evidence.photo_xy)
    ends = seen_at(sheet, lines.ends.reshape(-1, 2))[0].reshape(-1, 2, 2)
    count = len(lines.height)
    places = [page[evidence.group == k] for k in range(count)]
    curves = np.array([_curve(xy) for xy in places])
    level = np.array([float(np.mean(np.polyval(c, xy[:, 0]))) for c, xy in zip(curves, places, strict=True)])
    order = np.argsort(level)
    height = AROUND * float(np.median(lines.height)) / focal
    shift = LineShift(
        ends.min(axis=(0, 1)) - height,
        ends.max(axis=(0, 1)) + height,
        level[order],
        curves[order],
        np.sort(ends[order, :, 0], axis=1),
    )
    off = np.concatenate([xy[:, 1] - np.polyval(c, xy[:, 0]) for c, xy in zip(curves, places, strict=True)]) * focal
    flat = (page[:, 1] - level[evidence.group]) * focal
    fitted = Fitted(sheet, page, flat, np.ones(len(page)), level, 0.0)
    return Bent(sheet, shift, fitted, evidence, off, bordered=False)


def _curve(xy: Floats) -> Floats:
    """Coefficients of a line's polynomial, of as many powers as it has letters for."""
    degree = min(DEGREE, max(1, len(xy) // PER_NUMBER))
    return np.concatenate([np.zeros(DEGREE - degree), np.polyfit(xy[:, 0], xy[:, 1], degree)])
