"""Group text lines after a first fit: rows, margins and evenly spaced lines; reject what is no text."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from planish.geometry.guards import TINY
from planish.photo.cylinder import photo_to_page
from planish.photo.fit import CylinderFit, Observations
from planish.photo.lines import TextLines
from planish.types import Bools, Floats, Ints

BASELINE = 0.05
"""Standard deviation of a baseline position, in letter heights."""
MARGIN = 0.25
"""Standard deviation of a line's beginning around the margin, in letter heights."""
FEWEST_IN_MARGIN = 5
SLANT = 0.25
"""Largest slope of a margin or an upright rule after a first fit."""
SAME_ROW = 0.3
"""Distance, in letter heights, within which lines that are side by side form one row."""
LONG = 10
"""Least letters of a line in the test for even spacing."""
EVEN = 0.1
"""Largest relative difference of neighbouring distances of evenly spaced lines."""
SURE = 6
"""Least letters of a line that is accepted without a neighbour."""
NEAR = 7.0
"""Largest distance of a shorter line from an accepted one, in letter heights."""
PARALLEL = np.radians(12)
IN_SHADOW = 0.4
AS_BRIGHT = 0.8
"""Least brightness of paper in shadow, and of paper of short lines, relative to lit paper; a few letter-like specks on
darker ground may be the texture of the table."""
LITTLE = 0.25
"""Least share that is left, of all letters and pieces of rules seen, on a page with rules: music has 0.9, tables 0.3
and more, an engraving 0.2."""
RULE_END = 0.1
"""Share of a rule at either end that says nothing about what is inside of the sheet."""
SENTENCE = 12
"""Least letters of a line that cannot be texture."""


def line_observations(lines: TextLines) -> Observations:
    """Return observations of text lines: the letters of each share one coordinate across the lines."""
    count = len(lines.height)
    return Observations(lines.photo_xy, lines.line, np.zeros(count, bool), _baseline_sigma(lines))


def _baseline_sigma(lines: TextLines) -> Floats:
    """Standard deviation of the positions on each line [photo px]; paper waves beneath rules as beneath letters."""
    return BASELINE * lines.letter_heights


def reject_false_lines(lines: TextLines) -> TextLines | None:
    """Remove texture mistaken for text lines.

    Long lines on bright paper are accepted, then, repeatedly, shorter ones near accepted ones if direction, letter
    size and paper brightness are similar. Where little of all that was seen is left, there is a drawing, whose strokes
    are no rules. None if no line is left.
    """
    kept = _accepted(lines)
    if kept is None or not kept.rule.any() or len(kept.line) > LITTLE * lines.seen:
        return kept
    text = select(lines, ~lines.rule)
    return text and _accepted(text)


def _accepted(lines: TextLines) -> TextLines | None:
    letters = np.bincount(lines.line, minlength=len(lines.height))
    lit = float(np.quantile(np.repeat(lines.paper_level, letters), 0.75))
    good = (letters >= SENTENCE) & (lines.paper_level >= IN_SHADOW * lit) & ~lines.rule
    good |= (letters >= SURE) & (lines.paper_level >= AS_BRIGHT * lit)
    like = _near(lines) & _similar(lines)
    while (more := like[:, good].any(axis=1) & ~good).any():
        good |= more
    return select(lines, good)


def without_rule_ends(lines: TextLines) -> TextLines:
    """Leave out the ends of rules, which reach the border of ruled paper."""
    count = np.bincount(lines.line, minlength=len(lines.height))
    place = (np.arange(len(lines.line)) - (np.cumsum(count) - count)[lines.line]) / count[lines.line]
    inner = ~lines.rule[lines.line] | (np.abs(place - 0.5) < 0.5 - RULE_END)
    return replace(lines, photo_xy=lines.photo_xy[inner], line=lines.line[inner])


def _similar(lines: TextLines) -> Bools:
    """Whether line i is similar to line j in direction, letter size and brightness: (lines, lines)."""
    along = lines.ends[:, 1] - lines.ends[:, 0]
    angle = np.arctan2(along[:, 1], along[:, 0])
    parallel = np.abs(np.angle(np.exp(1j * (angle[:, None] - angle)))) < PARALLEL
    ratio = np.where(lines.rule[:, None] | lines.rule, 1.0, lines.height[:, None] / lines.height)
    return np.asarray(
        parallel & (ratio > 0.4) & (ratio < 2.5) & (lines.paper_level[:, None] > AS_BRIGHT * lines.paper_level)
    )


def select(lines: TextLines, good: Bools) -> TextLines | None:
    """Select lines; None if there are none."""
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
        rule=lines.rule[good],
        paper_level=lines.paper_level[good],
    )


def _near(lines: TextLines) -> Bools:
    """Whether the centre of line i is near the segment of line j: (lines, lines)."""
    begin, along = lines.ends[:, 0], lines.ends[:, 1] - lines.ends[:, 0]
    offset = lines.ends.mean(axis=1)[:, None] - begin
    share = np.clip((offset * along).sum(axis=2) / np.maximum((along**2).sum(axis=1), TINY), 0, 1)
    distance = np.linalg.norm(offset - share[..., None] * along, axis=2)
    return np.asarray(distance < NEAR * np.maximum(lines.height[:, None], lines.height))


def group_rows_and_margins(lines: TextLines, found: CylinderFit) -> Observations:
    """Rebuild the observations: lines joined to rows, margins, upright rules, evenly spaced rows.

    Parameters
    ----------
    lines : TextLines
    found : CylinderFit
        A fit to the lines, or to observations that begin with them.
    """
    ends, good = photo_to_page(found.cylinder, lines.ends.reshape(-1, 2))
    ends = ends.reshape(-1, 2, 2)
    unit = lines.letter_height / found.cylinder.focal
    row = _rows(ends, found.position[: len(lines.height)], lines.height / found.cylinder.focal)
    group = row[lines.line]
    rows = int(row.max()) + 1
    sigma = np.bincount(row, _baseline_sigma(lines), rows) / np.bincount(row, minlength=rows)
    observations = Observations(
        lines.photo_xy, group, np.zeros(rows, bool), sigma, _evenly_spaced(lines, found, group, rows)
    )
    for side in (0, 1):
        inside = _margin_inliers(ends[:, side], unit, good.reshape(-1, 2)[:, side])
        if inside.sum() >= FEWEST_IN_MARGIN:
            sigma_px = MARGIN * float(np.median(lines.height[inside]))
            observations = observations.with_group(lines.ends[inside, side], upright=True, sigma_px=sigma_px)
    for xy in lines.uprights:
        page, good = photo_to_page(found.cylinder, xy)
        if good.all() and abs(np.polyfit(page[:, 1], page[:, 0], 1)[0]) < SLANT:
            observations = observations.with_group(xy, upright=True, sigma_px=BASELINE * lines.letter_height)
    return observations


def _rows(ends: Floats, position: Floats, height: Floats) -> Ints:
    """Row index of each line: neighbours side by side at the same height are joined."""
    order = np.argsort(position)
    joined = []
    for i, j in pairwise(order):
        apart = max(ends[i, 0, 0], ends[j, 0, 0]) - min(ends[i, 1, 0], ends[j, 1, 0])
        lower, higher = sorted((height[i], height[j]))
        if position[j] - position[i] < SAME_ROW * lower and apart > 0 and higher < 1.6 * lower:
            joined.append((i, j))
    pair = np.array(joined, int).reshape(-1, 2)
    links = coo_array((np.ones(len(pair)), (pair[:, 0], pair[:, 1])), shape=(len(position), len(position)))
    return np.asarray(connected_components(links, directed=False)[1], np.int32)


def _evenly_spaced(lines: TextLines, found: CylinderFit, group: Ints, rows: int) -> Ints:
    """Triples of consecutive long rows with even spacing, of text or of rules."""
    letters = np.bincount(group, minlength=rows)
    position = np.bincount(group, found.page[: len(group), 1], rows) / np.maximum(letters, 1)
    order = np.argsort(position)
    gap = np.diff(position[order])
    evenly_spaced = (np.abs(np.diff(gap)) < EVEN * np.minimum(gap[1:], gap[:-1])) & (gap[1:] > 0) & (gap[:-1] > 0)
    triples = np.stack([order[:-2], order[1:-1], order[2:]], axis=1)[evenly_spaced]
    rule = np.bincount(group, lines.rule[lines.line], rows)[triples] > 0
    good = (letters[triples] >= LONG).all(axis=1) & (rule.all(axis=1) | ~rule.any(axis=1))
    return np.asarray(triples[good], np.int32).reshape(-1, 3)


def _margin_inliers(ends: Floats, unit: float, good: Bools) -> Bools:
    """Inliers among line ends (n, 2) of the nearly vertical line through two of them that has most inliers."""
    inside = np.zeros(len(ends), bool)
    i, j = np.triu_indices(len(ends), 1)
    down = ends[j, 1] - ends[i, 1]
    use = (np.abs(down) > 5 * unit) & good[i] & good[j]
    slant = np.where(use, (ends[j, 0] - ends[i, 0]) / np.where(use, down, 1), np.inf)
    use &= np.abs(slant) < SLANT
    if not use.any():
        return inside
    i, slant = i[use], slant[use]
    offset = ends[:, 0] - ends[i, 0][:, None] - slant[:, None] * (ends[:, 1] - ends[i, 1][:, None])
    near = (np.abs(offset) < 1.5 * MARGIN * unit) & good
    best = near[np.argmax(near.sum(axis=1))]
    span = np.ptp(ends[best, 1])
    return best if span > 0.3 * np.ptp(ends[:, 1]) else inside
