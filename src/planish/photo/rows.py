"""What a first fit tells of the lines of text: those of one row, of one margin, and at even distances."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from planish.geometry.guards import TINY
from planish.photo.cylinder import seen_at
from planish.photo.fit import Evidence, Fitted
from planish.photo.lines import TextLines
from planish.types import Bools, Floats, Ints

BASELINE = 0.05
"""How far off its line a letter's foot usually is found, in heights of the line's letters."""
MARGIN = 0.25
"""How far off the margin a line usually begins, in the same."""
FEWEST_IN_MARGIN = 5
SLANT = 0.25
"""A margin leans by no more than so much after a first fit."""
SAME_ROW = 0.3
"""Lines this close to each other, in heights, and side by side, are one row."""
LONG = 10
"""Letters in a line whose distance to the next is looked at."""
EVEN = 0.1
"""Neighbouring distances differ by less than so much of themselves where lines are even."""
SURE = 6
"""Letters in a line that needs no neighbour to be believed."""
NEAR = 7.0
"""How near to such a line a shorter one must be, in heights of its letters."""
PARALLEL = np.radians(12)
IN_SHADOW = 0.4
AS_BRIGHT = 0.8
"""Paper in a shadow is not darker than this part of the paper that is lit; what looks like a few letters, and is darker
than this, may be the grain of the table."""
SENTENCE = 12
"""Letters that no grain looks like."""


def evidence_of(lines: TextLines) -> Evidence:
    """What lines of text say of the sheet: the letters of each stand level."""
    count = len(lines.height)
    return Evidence(lines.photo_xy, lines.line, np.zeros(count, bool), BASELINE * lines.height)


def believable(lines: TextLines) -> TextLines | None:
    """Without what only looks like a line of text.

    Long lines on bright paper are believed, and shorter ones near to them, and so on, if they run the same way, have
    letters of like size, and stand on paper that is not suddenly darker. None where none are left.
    """
    letters = np.bincount(lines.line, minlength=len(lines.height))
    lit = float(np.quantile(np.repeat(lines.paper, letters), 0.75))
    good = (letters >= SENTENCE) & (lines.paper >= IN_SHADOW * lit)
    good |= (letters >= SURE) & (lines.paper >= AS_BRIGHT * lit)
    like = _near(lines) & _alike(lines)
    while (more := like[:, good].any(axis=1) & ~good).any():
        good |= more
    return only(lines, good)


def _alike(lines: TextLines) -> Bools:
    """(lines, lines): whether the first is like the other in direction, size and brightness."""
    way = lines.ends[:, 1] - lines.ends[:, 0]
    angle = np.arctan2(way[:, 1], way[:, 0])
    parallel = np.abs(np.angle(np.exp(1j * (angle[:, None] - angle)))) < PARALLEL
    ratio = lines.height[:, None] / lines.height
    return np.asarray(parallel & (ratio > 0.4) & (ratio < 2.5) & (lines.paper[:, None] > AS_BRIGHT * lines.paper))


def only(lines: TextLines, good: Bools) -> TextLines | None:
    """Some of the lines; None for none."""
    if not good.any():
        return None
    kept = good[lines.line]
    number = np.cumsum(good, dtype=np.int32) - 1
    return replace(
        lines,
        photo_xy=lines.photo_xy[kept],
        line=number[lines.line[kept]],
        height=lines.height[good],
        ends=lines.ends[good],
        paper=lines.paper[good],
    )


def _near(lines: TextLines) -> Bools:
    """(lines, lines): whether the first's middle is near to the line between the other's ends."""
    begin, way = lines.ends[:, 0], lines.ends[:, 1] - lines.ends[:, 0]
    off = lines.ends.mean(axis=1)[:, None] - begin
    share = np.clip((off * way).sum(axis=2) / np.maximum((way**2).sum(axis=1), TINY), 0, 1)
    distance = np.linalg.norm(off - share[..., None] * way, axis=2)
    return np.asarray(distance < NEAR * np.maximum(lines.height[:, None], lines.height))


def with_rows_and_margins(lines: TextLines, found: Fitted) -> Evidence:
    """The evidence anew: lines joined in rows, margins found, rows at even distances.

    Parameters
    ----------
    lines : TextLines
    found : Fitted
        To the lines, or to evidence that begins with them.
    """
    ends, good = seen_at(found.sheet, lines.ends.reshape(-1, 2))
    ends = ends.reshape(-1, 2, 2)
    unit = float(np.median(lines.height)) / found.sheet.focal
    row = _rows(ends, found.place[: len(lines.height)], lines.height / found.sheet.focal)
    group = row[lines.line]
    rows = int(row.max()) + 1
    height = np.bincount(row, lines.height, rows) / np.bincount(row, minlength=rows)
    evidence = Evidence(lines.photo_xy, group, np.zeros(rows, bool), BASELINE * height, _even(found, group, rows))
    for side in (0, 1):
        inside = _in_margin(ends[:, side], unit, good.reshape(-1, 2)[:, side])
        if inside.sum() >= FEWEST_IN_MARGIN:
            doubt = MARGIN * float(np.median(lines.height))
            evidence = evidence.and_also(lines.ends[inside, side], upright=True, doubt_px=doubt)
    return evidence


def _rows(ends: Floats, place: Floats, height: Floats) -> Ints:
    """Number of the row of each line: neighbours at one height that lie side by side are joined."""
    order = np.argsort(place)
    joined = []
    for i, j in pairwise(order):
        apart = max(ends[i, 0, 0], ends[j, 0, 0]) - min(ends[i, 1, 0], ends[j, 1, 0])
        lower, higher = sorted((height[i], height[j]))
        if place[j] - place[i] < SAME_ROW * lower and apart > 0 and higher < 1.6 * lower:
            joined.append((i, j))
    pair = np.array(joined, int).reshape(-1, 2)
    links = coo_array((np.ones(len(pair)), (pair[:, 0], pair[:, 1])), shape=(len(place), len(place)))
    return np.asarray(connected_components(links, directed=False)[1], np.int32)


def _even(found: Fitted, group: Ints, rows: int) -> Ints:
    """Triples of long rows that follow each other at even distances."""
    letters = np.bincount(group, minlength=rows)
    place = np.bincount(group, found.page[: len(group), 1], rows) / np.maximum(letters, 1)
    order = np.argsort(place)
    gap = np.diff(place[order])
    even = (np.abs(np.diff(gap)) < EVEN * np.minimum(gap[1:], gap[:-1])) & (gap[1:] > 0) & (gap[:-1] > 0)
    triples = np.stack([order[:-2], order[1:-1], order[2:]], axis=1)[even]
    return np.asarray(triples[(letters[triples] >= LONG).all(axis=1)], np.int32).reshape(-1, 3)


def _in_margin(ends: Floats, unit: float, good: Bools) -> Bools:
    """Which of the ends (n, 2) lie on one straight line that is nearly upright: that of two of them with the most."""
    inside = np.zeros(len(ends), bool)
    i, j = np.triu_indices(len(ends), 1)
    down = ends[j, 1] - ends[i, 1]
    use = (np.abs(down) > 5 * unit) & good[i] & good[j]
    slant = np.where(use, (ends[j, 0] - ends[i, 0]) / np.where(use, down, 1), np.inf)
    use &= np.abs(slant) < SLANT
    if not use.any():
        return inside
    i, slant = i[use], slant[use]
    off = ends[:, 0] - ends[i, 0][:, None] - slant[:, None] * (ends[:, 1] - ends[i, 1][:, None])
    near = (np.abs(off) < 1.5 * MARGIN * unit) & good
    best = near[np.argmax(near.sum(axis=1))]
    span = np.ptp(ends[best, 1])
    return best if span > 0.3 * np.ptp(ends[:, 1]) else inside
