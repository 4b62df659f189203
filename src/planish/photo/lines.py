"""Text line detection: letters linked to their neighbours, and a smooth baseline through them; and rules."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from planish.document import stem_ratio
from planish.photo.chains import fit_baseline, link_letters
from planish.photo.letters import Letters, find_letters, stroke_direction, text_direction
from planish.photo.rules import DEGREE, RuleLimits, Rules, find_crossing_rules, find_rules, rule_limits
from planish.photo.strokes import cut_into_slices
from planish.photo.working_image import NEARBY, WorkingImage, ink_mask
from planish.types import Bools, Floats, Ints

FEWEST = 4
"""Least number of letters in a line."""
FRAGMENT = 3
"""Least number of letters in a fragment of text beside other text."""
STRAIGHT = 0.13
"""Largest median distance of letters from their baseline, in letter heights: print has 0.03 to 0.08, leaves 0.2."""
LONG = 8
"""Least number of letters in a line that votes on orientation."""
MAX_SIGMA = 3.0
"""Limit of the score [standard deviations]: errors of digits and capitals, straight on both sides, are correlated."""
SCATTER = 0.04
"""Scatter of this from line to line, in letter heights, without which two or three lines that agree would be sure."""
UPRIGHT_PRIOR = 1.3
"""Prior [standard deviations]: nine of ten photographed documents are not upside down."""
LEVEL = np.radians(8)
"""Text with a larger skew is rotated before its lines are detected."""
FEW_LETTERS = 50
"""With fewer letters the direction of most strokes is tried as well, and taken if more rules are seen along it."""
JOINED = 0.85
"""Residual of the heaviest strokes relative to that of the straighter edge below which a script is joined: Devanagari
has 0.2 to 0.5, Arabic 0.4 to 0.7, Latin print 1.2 to 10."""
MOST = 0.5
"""Least share of a line's letters that no rule crosses: notes in a staff are no line of text."""
COLUMNS = 0.9
"""Strokes across the lines relative to those along them below which lines are columns: columns of Japanese have 0.65,
level lines of Latin print 1.2 to 4."""
COLUMN_LETTERS = 150
"""Least number of letters on which that is seen."""
SAMPLE = 12
"""Number of chains, the longest ones, on which that is seen."""


@dataclass(frozen=True, eq=False)
class TextLines:
    """Positions on the baselines of text lines, and on rules, on the photo.

    Attributes
    ----------
    photo_xy : (n, 2) float64 [photo px]
        Base point of each letter.
    line : (n,) int32
        Its line, from 0; letters of a line are ordered from left to right.
    height : (lines,) float64 [photo px]
        Median letter height of each line.
    ends : (lines, 2, 2) float64 [photo px]
        Beginning and end of each line.
    rule : (lines,) bool
        Whether it is a rule: of a staff, ruled paper, a table or a frame; its letters are pieces of it.
    angle : float [rad]
        Direction of the lines on the photo, clockwise from horizontal.
    upright : float
        Confidence that they are not upside down [standard deviations].
    straightness : float
        Median distance of letters from their baselines, in letter heights.
    paper_level : (lines,) float64
        Mean grey around the letters of each line, 0 to 255.
    fragments : (k, 2, 2) float64 [photo px]
        Beginning and end of everything that may be text, including what is too short for a line.
    seen : int
        Number of all letters and pieces of rules, on lines or not.
    uprights : tuple of (k, 2) float64 [photo px]
        Positions on rules across the lines, of tables, frames and staves.
    columns : bool
        Whether the lines are columns, which run down the page.
    """

    photo_xy: Floats
    line: Ints
    height: Floats
    ends: Floats
    rule: Bools
    angle: float
    upright: float
    straightness: float
    paper_level: Floats
    fragments: Floats
    seen: int = 0
    uprights: tuple[Floats, ...] = ()
    columns: bool = False

    @property
    def letter_height(self) -> float:
        """Median letter height of the lines of text [photo px]; where there is none, of letters between the rules."""
        text = self.height[~self.rule]
        return float(np.median(text)) if len(text) else 2 * float(np.median(self.height))

    @property
    def letter_heights(self) -> Floats:
        """Letter height of each line [photo px], of rules that of the page."""
        return np.where(self.rule, self.letter_height, self.height)


def find_text_lines(image: WorkingImage) -> TextLines | None:
    """Detect text lines and rules at any angle; None if there are too few letters.

    Letters share a baseline, but their tops do not line up: the straighter edge is the baseline. Joined scripts are
    written along a stroke, which is straighter than both. Stems that run along the lines show columns, as of Chinese.
    Which way up these two are, and rules, is left to the prior against upside-down photos.
    """
    deskewed = _deskewed(image)
    rotated, angle, ink, rules = deskewed.image, deskewed.angle, deskewed.ink, deskewed.rules
    letters = find_letters(ink & ~rules.ink)
    if len(letters.left) < 2 * FEWEST and not rules.chains:
        return None
    fragments = [chain for chain in link_letters(letters) if len(chain) >= FRAGMENT]
    apart = ~_cross(letters, rules.ink)
    chains = [chain for chain in fragments if len(chain) >= FEWEST and apart[chain].mean() > MOST]
    joined = _is_joined(ink, letters, chains)
    columns = not joined and _are_columns(rotated.grey, ink, letters, chains)
    words, chains = cut_into_slices(ink, letters, chains) if joined else (letters, chains)
    if columns:
        words = replace(words, base=words.middle[:, 1])
    vote = 0.0 if joined or columns else _upright_score(letters, chains)
    upright = vote + UPRIGHT_PRIOR * float(np.sin(angle) if columns else np.cos(angle))
    pieces, rule_chains = rules.pieces, rules.chains
    uprights = tuple(rotated.to_photo_xy(xy) for xy in find_crossing_rules(rotated.grey, ink, rules))
    if upright < 0:
        letters, words, pieces = (these.rotated_half_turn(rotated.grey.shape) for these in (letters, words, pieces))
        fragments, chains, rule_chains = ([c[::-1] for c in these] for these in (fragments, chains, rule_chains))
        rotated, angle = rotated.rotated(np.pi), angle + np.pi
    text = [_baseline(words, chain) for chain in chains]
    ruled = [_baseline(pieces, chain, DEGREE) for chain in rule_chains]
    ends = np.concatenate([_ends(letters, fragments), _ends(pieces, rule_chains)])
    seen = len(letters.left) + sum(len(chain) for chain in rules.chains)
    found = _collect(rotated, text, ruled, ends, angle, abs(upright))
    return None if found is None else replace(found, seen=seen, uprights=uprights, columns=columns)


@dataclass(frozen=True, eq=False)
class _Deskewed:
    """A deskewed image, its skew angle, ink and rules."""

    image: WorkingImage
    angle: float
    ink: Bools
    rules: Rules


def _deskewed(image: WorkingImage) -> _Deskewed:
    ink = ink_mask(image.grey)
    letters = find_letters(ink)
    many = len(letters.left) >= FEW_LETTERS
    limits = rule_limits(image.grey, letters if many else letters.select(np.zeros(0, np.intp)))
    text_angle = text_direction(letters) if len(letters.left) >= 2 * FEWEST else 0.0
    angles = [text_angle] if many else [text_angle, stroke_direction(image.grey, ink)]
    return max((_rotated(image, angle, ink, limits) for angle in angles), key=lambda one: len(one.rules.chains))


def _rotated(image: WorkingImage, angle: float, ink: Bools, limits: RuleLimits) -> _Deskewed:
    if abs(angle) >= LEVEL:
        image = image.rotated(-angle)
        ink = ink_mask(image.grey)
    return _Deskewed(image, angle, ink, find_rules(image.grey, ink, limits))


def _cross(letters: Letters, rule_ink: Bools) -> Bools:
    """Which boxes a rule crosses, as staff lines do notes: (n,)."""
    count = cv2.integral(rule_ink.astype(np.uint8))
    left, top, right, bottom = (v.astype(int) for v in (letters.left, letters.top, letters.right, letters.bottom))
    return np.asarray(count[bottom, right] - count[top, right] - count[bottom, left] + count[top, left] > 0)


def _is_joined(ink: Bools, letters: Letters, chains: list[Ints]) -> bool:
    """Whether the heaviest strokes lie on straighter lines than bottoms and tops."""
    longest = [chain for chain in sorted(chains, key=len)[-SAMPLE:] if len(chain) >= LONG]
    if len(longest) < 2:
        return False
    slices, cut = cut_into_slices(ink, letters, longest)
    strokes = np.median([_residual(slices, chain, slices.base) for chain in cut])
    edges = [np.median([_residual(letters, c, edge) for c in longest]) for edge in (letters.top, letters.bottom)]
    return bool(strokes < JOINED * min(edges))


def _are_columns(grey: NDArray[np.uint8], ink: Bools, letters: Letters, chains: list[Ints]) -> bool:
    """Whether most strokes of the text run along its lines."""
    if sum(len(chain) for chain in chains) < COLUMN_LETTERS:
        return False
    mask = np.zeros(ink.shape, np.uint8)
    for i in np.concatenate(chains):
        mask[int(letters.top[i]) : int(letters.bottom[i]), int(letters.left[i]) : int(letters.right[i])] = 1
    mask &= cv2.dilate(ink.astype(np.uint8), np.ones((3, 3), np.uint8))
    return stem_ratio(grey, mask > 0) < COLUMNS


def _upright_score(letters: Letters, chains: list[Ints]) -> float:
    """How much straighter letter bottoms are than letter tops [standard deviations]."""
    long = [chain for chain in chains if len(chain) >= LONG]
    if len(long) < 2:
        return 0.0
    residual = np.array([[_residual(letters, chain, edge) for edge in (letters.top, letters.bottom)] for chain in long])
    weight = np.array([len(chain) for chain in long])
    straighter = residual[:, 0] - residual[:, 1]
    mean = float(np.average(straighter, weights=weight))
    scatter = np.hypot(np.sqrt(np.average((straighter - mean) ** 2, weights=weight)), SCATTER)
    return float(np.clip(mean * np.sqrt(len(long)) / scatter, -MAX_SIGMA, MAX_SIGMA))


def _residual(letters: Letters, chain: Ints, edge: Floats) -> float:
    """Median distance of letter bottoms, or tops, from a smooth curve [letter heights]."""
    return fit_baseline(letters.middle[chain, 0], edge[chain], float(np.median(letters.height[chain])))[1]


def _ends(letters: Letters, chains: list[Ints]) -> Floats:
    """Beginning and end of each chain, at the bottom of its letters: (chains, 2, 2) [px]."""
    return np.array(
        [[[letters.left[c[0]], letters.bottom[c[0]]], [letters.right[c[-1]], letters.bottom[c[-1]]]] for c in chains]
    ).reshape(-1, 2, 2)


@dataclass(frozen=True, eq=False)
class _Baseline:
    """Baseline of a chain: positions on it, its ends, letter height, number of letters and their median residual."""

    xy: Floats
    ends: Floats
    height: float
    letters: int
    residual: float


def _baseline(letters: Letters, chain: Ints, most_degree: int = 3) -> _Baseline:
    x, height = letters.middle[chain, 0], float(np.median(letters.height[chain]))
    weight, residual = fit_baseline(x, letters.base[chain], height, most_degree)
    xy = np.stack([x, letters.base[chain]], axis=1)[weight > 0] - [0.0, 0.5]
    y = xy[[0, -1], 1] if len(xy) else np.zeros(2)
    return _Baseline(xy, np.stack([[letters.left[chain[0]], letters.right[chain[-1]]], y], 1), height, len(x), residual)


def _collect(
    image: WorkingImage,
    text: Sequence[_Baseline],
    rules: Sequence[_Baseline],
    ends: Floats,
    angle: float,
    upright: float,
) -> TextLines | None:
    found = [*text, *rules]
    good = [one.residual < STRAIGHT and len(one.xy) >= FEWEST - 1 for one in found]
    kept = [one for one, use in zip(found, good, strict=True) if use]
    if not kept:
        return None
    side = int(max(image.grey.shape) * NEARBY) | 1
    level = np.asarray(cv2.blur(image.grey, (side, side)), np.uint8)
    return TextLines(
        photo_xy=image.to_photo_xy(np.concatenate([one.xy for one in kept])),
        line=np.repeat(np.arange(len(kept), dtype=np.int32), [len(one.xy) for one in kept]),
        height=np.array([one.height for one in kept]) * image.pixel_size,
        ends=image.to_photo_xy(np.array([one.ends for one in kept]).reshape(-1, 2)).reshape(-1, 2, 2),
        rule=np.repeat([False, True], [len(text), len(rules)])[good],
        angle=angle,
        upright=upright,
        straightness=float(np.median(np.repeat([one.residual for one in found], [one.letters for one in found]))),
        paper_level=np.array([_median_at(level, one.xy) for one in kept]),
        fragments=image.to_photo_xy(ends.reshape(-1, 2)).reshape(-1, 2, 2),
    )


def _median_at(level: NDArray[np.uint8], xy: Floats) -> float:
    x, y = np.clip(np.rint(xy).astype(int), 0, np.array(level.shape[::-1]) - 1).T
    return float(np.median(level[y, x]))
