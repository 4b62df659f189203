"""Rules: the lines of staves, ruled paper, tables and frames, as level lines of a page."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from planish.photo.chains import fit_baseline, link_letters
from planish.photo.letters import Letters
from planish.photo.working_image import NEARBY
from planish.types import Bools, Floats, Ints

CELL = 8
"""Length of the pieces in which a rule is followed [px]: about a letter."""
THICKNESS = 0.4
"""Greatest thickness of a rule, in heights of the page's letters."""
THICKEST = (4, 6)
"""Limits of that [px]: blurred, fine lines have 3; twice as thick, lines of touching letters pass for rules."""
LIKE_LETTER = 5.0
"""Height of the letter that a piece of a rule stands for [px]: less than the distance of staff lines."""
GAP = 5.0
"""Widest gap in a rule, in such heights: three note heads."""
LONG = 1 / 14
"""Least length of a rule, as a share of the image's long side: longer than a word."""
COVERED = 0.6
"""Least covered share of a rule's length: staff lines among chords have 0.65, letters that touch 0.3."""
REACH = 16
"""Longest extension of a rule at either end [pieces]: under a clef with its key signature."""
FEW = 8
"""Number of pieces that give its direction there."""
BREAK = 3
"""Length of a gap in the ink that ends a rule [px]."""
IN_SHADOW = 0.7
"""Least brightness of the paper along a rule relative to that around letters: less is the grain of a wooden table."""
ALIKE = 0.85
"""Least brightness of the darker side of a rule relative to the brighter one."""
CROSSED = 2
"""Least number of level rules that an upright one crosses or meets."""
DEGREE = 6
"""Highest degree of the curve along a rule, which is longer than a line of text between two gaps."""
STRAIGHT = 0.13
"""Largest median distance of the pieces from that curve, in heights: 0.02 to 0.08 in print."""


@dataclass(frozen=True)
class RuleLimits:
    """What passes for a rule.

    Attributes
    ----------
    thickest : int [px]
    darkest : float
        Least grey of the paper beside it.
    """

    thickest: int
    darkest: float


@dataclass(frozen=True, eq=False)
class Rules:
    """Rules of a page.

    Attributes
    ----------
    pieces : Letters
        Boxes of equal size; `base` is the middle of the rule.
    chains : list of (k,) int32
        The pieces of each rule, from left to right.
    ink : (rows, cols) bool
        Their ink.
    looked_for : RuleLimits
    """

    pieces: Letters
    chains: list[Ints]
    ink: Bools
    looked_for: RuleLimits


def rule_limits(grey: NDArray[np.uint8], letters: Letters) -> RuleLimits:
    """Limits for the rules of a page with these letters; the widest ones without any."""
    if not len(letters.height):
        return RuleLimits(THICKEST[1], 0.0)
    side = int(max(grey.shape) * NEARBY) | 1
    x, y = np.rint(letters.middle).astype(int).T
    level = cv2.blur(grey, (side, side))[y.clip(0, grey.shape[0] - 1), x.clip(0, grey.shape[1] - 1)]
    thickest = int(np.clip(THICKNESS * np.median(letters.height), *THICKEST))
    return RuleLimits(thickest, IN_SHADOW * float(np.quantile(level, 0.75)))


def find_rules(grey: NDArray[np.uint8], ink: Bools, look_for: RuleLimits) -> Rules:
    """Find thin, long lines that are level or slope by up to about 20 degrees.

    What is thin (vertical runs of ink, Carter and Bacon 1992) is cut into pieces of a letter's width, and these are
    linked as letters are. Note heads and letters that cross a rule are no part of it.

    Parameters
    ----------
    grey : (rows, cols) uint8
    ink : (rows, cols) bool
        See `ink_mask`.
    look_for : RuleLimits
    """
    thickest = look_for.thickest
    ink_8bit = ink.astype(np.uint8)
    thin = ink_8bit & ~cv2.morphologyEx(ink_8bit, cv2.MORPH_OPEN, np.ones((thickest + 1, 1), np.uint8))
    thin[:, ::CELL] = 0
    _, label, stats, centre = cv2.connectedComponentsWithStats(thin, connectivity=8)
    left, _, width, height, area = stats.T.astype(np.float64)
    good = (width >= CELL - 2) & (height <= thickest + 3) & (area <= thickest * (CELL - 1))
    good[0] = False  # what is no ink
    pieces = _pieces(CELL * np.floor(left[good] / CELL), centre[good, 1] + 0.5)
    chains = [chain for chain in link_letters(pieces, GAP) if _is_rule(pieces, chain, LONG * max(ink.shape))]
    smooth = np.asarray(cv2.blur(grey, (CELL, 3)), np.uint8)
    chains = [chain for chain in chains if _is_on_paper(smooth, pieces.middle[chain], look_for)]
    used = np.zeros(len(stats), bool)
    used[np.flatnonzero(good)[np.concatenate([*chains, np.zeros(0, np.int32)])]] = True
    _extend_to_ends(ink_8bit, pieces, chains)
    return Rules(pieces, chains, cv2.dilate(used[label].astype(np.uint8), np.ones((3, 3), np.uint8)) > 0, look_for)


def find_crossing_rules(grey: NDArray[np.uint8], ink: Bools, level: Rules) -> list[Floats]:
    """Find upright rules that cross level ones at two places: of tables, frames and staves, not the edges of leaves.

    Returns
    -------
    list of (k, 2) float64 [px]
        Positions along each.
    """
    if len(level.chains) < 2:
        return []
    upright = find_rules(np.ascontiguousarray(grey.T), np.ascontiguousarray(ink.T), level.looked_for)
    near = cv2.dilate(level.ink.astype(np.uint8), np.ones((CELL + 1, CELL + 1), np.uint8))
    lines = [np.stack([upright.pieces.base, upright.pieces.middle[:, 0]], 1)[chain] - 0.5 for chain in upright.chains]
    return [xy for xy in lines if _runs(near[tuple(np.rint(xy[:, ::-1]).astype(int).T)]) >= CROSSED]


def _runs(inside: NDArray[np.uint8]) -> int:
    """Number of runs of ones."""
    return int((np.diff(np.concatenate([[0], inside]).astype(np.int8)) == 1).sum())


def _pieces(left: Floats, base: Floats) -> Letters:
    return Letters(left, base - LIKE_LETTER / 2, left + CELL, base + LIKE_LETTER / 2, base)


def _extend_to_ends(ink: NDArray[np.uint8], pieces: Letters, chains: list[Ints]) -> None:
    """Move the left and right borders of each rule to where its ink ends: staves begin under their clefs."""
    near = cv2.dilate(ink, np.ones((3, 1), np.uint8))
    step = np.arange(REACH * CELL)
    for chain in chains:
        for border, few, way in ((pieces.left, chain[:FEW], -1), (pieces.right, chain[-FEW:], 1)):
            end = few[0] if way < 0 else few[-1]
            slope = np.polyfit(pieces.left[few], pieces.base[few], 1)[0]
            x = (border[end] + way * step - (way < 0)).astype(int)
            y = np.rint(pieces.base[end] - 0.5 + slope * (x + 0.5 - pieces.middle[end, 0])).astype(int)
            inside = (x >= 0) & (x < ink.shape[1]) & (y >= 0) & (y < ink.shape[0])
            inked = np.where(inside, near[y.clip(0, ink.shape[0] - 1), x.clip(0, ink.shape[1] - 1)], 0)
            gaps = np.flatnonzero(np.convolve(inked, np.ones(BREAK), "full")[BREAK - 1 :] == 0)
            border[end] += way * (gaps[0] if len(gaps) else len(step))


def _is_rule(pieces: Letters, chain: Ints, least: float) -> bool:
    length = float(pieces.right[chain[-1]] - pieces.left[chain[0]])
    if length < least or len(chain) * CELL < COVERED * length:
        return False
    _, residual = fit_baseline(pieces.middle[chain, 0], pieces.base[chain], LIKE_LETTER, DEGREE)
    return residual < STRAIGHT


def _is_on_paper(smooth: NDArray[np.uint8], xy: Floats, limits: RuleLimits) -> bool:
    """Whether there is paper above and below, and alike, which it is not along the edges of sheets and pictures."""
    x, y = np.rint(xy).astype(int).T
    last = smooth.shape[0] - 1
    away = np.arange(1, limits.thickest + 3)
    level = np.median(smooth[(y[:, None] + np.concatenate([-away, away])).clip(0, last), x[:, None]], axis=0)
    above, below = level[: len(away)].max(), level[len(away) :].max()
    return bool(min(above, below) >= max(ALIKE * max(above, below), limits.darkest))
