"""Orientation and skew of a page, from its print.

Any script of separate lines has a skew. Which way is up shows in the Latin, Greek and Cyrillic alphabets: they have
more ascenders than descenders (Bloomberg, Kopec and Dasari 1995).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import erf, sqrt

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from planish.document.ink import Ink, ink_of
from planish.geometry.guards import TINY
from planish.types import Floats, Page

STRIP_MM = 4.0
"""Width of the strips of page whose ink is summed before it is sheared; at 7 degrees they bend by half a millimetre."""
MAX_SKEW = 7.0
PAGE_MM = 150.0
"""Wider sheets are looked at in parts of about this width: on a spread the lines left and right do not go on in each
other, and the angle at which they happen to meet would count."""
EVEN_SHIFT = 0.2113
"""Of all strips, in rows. Strips are moved by parts of a row, which blurs them by f (1 - f); this is its mean, 1/6, for
the level page too, which would look sharper than all others if it were not blurred at all."""
TEXT_LINES = 0.7
"""Confidence of a skew above which there are lines: pages of print reach 0.75 to 0.98, seen sideways 0.3 to 0.7."""
MIN_ROWS = 20.0
"""Rows that must share the abrupt changes of the profile: five lines of text have 20, a page of print 60 and more; the
shade along a spine or a fold has 8."""
FAINT = 0.15
"""A page whose darkest thousandth differs from its paper by less has no lines: grain, JPEG blocks, or the steps of a
shade that coarse points show (half of it: these steps pass for lines of text; twice: pencil is lost)."""
SURE = 0.5
"""A page is turned only for a confidence above this."""
COLUMN_MM = 20.0
"""Lines are looked at in pieces of this length: short enough for narrow columns, long enough for a few words."""
SMALL_LETTERS_MM = (0.7, 8.0)
"""Least and greatest height of the letters without ascenders that are looked at."""
ALIKE = 0.5
"""Largest difference of heights of small letters from the usual one, as a logarithm: what is lower are the tips of
ascenders in wide spacing."""
COLUMNS = 1.1
"""Ratio of upright to level stems above which lines on end are columns: Japanese has 1.5, Latin print on its side 0.25
to 0.85."""
PUNCTUATION = 0.008
"""How much more ink above than below, as a part of that in the small letters, says nothing: punctuation gives it too.
Print in mixed case has 0.02 to 0.1."""


def skew_angle(page: Page) -> tuple[float, float]:
    """Skew of the lines of text: how far they run down to the right.

    The angle whose projection profile has the greatest sum of squared differences (Postl 1986).

    Parameters
    ----------
    page : Page
        Upright or upside down.

    Returns
    -------
    degrees : float
        Clockwise is positive; within 7. Turn the page by minus this to level its text. 0 where no lines are found.
    confidence : float
        0 to 1: 1 less the typical sum as a part of the greatest; less where the changes are in a few rows only. Below
        0.7 there are no lines, and `degrees` is 0.

    Examples
    --------
    >>> rows, cols = np.mgrid[:600, :900]
    >>> words = ((rows - cols * np.tan(np.radians(1.5))) % 25 < 8) & (cols % 40 < 30)
    >>> degrees, confidence = skew_angle(Page(~words, np.ones(words.shape, bool), 150.0))
    >>> round(degrees, 1), confidence > 0.7
    (1.5, True)
    """
    lines = _lines_along(ink_of(page))
    return (lines.degrees, lines.confidence) if lines.confidence >= TEXT_LINES else (0.0, lines.confidence)


def detect_orientation(page: Page, prior: float = 0.0) -> tuple[int, float]:
    """Clockwise rotation that puts a page upright.

    Lines of text leave two of the four ways round. Of these the one with more ink in ascenders than in descenders is
    upright. Lines on end whose letters have upright stems are columns, as of Chinese, and stay.

    Parameters
    ----------
    page : Page
    prior : float
        How sure it is from elsewhere, in standard deviations, that the page stands upright.

    Returns
    -------
    degrees : int
        0, 90, 180 or 270. 0 where there are no lines, or where they are level and their letters say too little.
    confidence : float
        0 to 1: the product of how sure the lines and how sure the letters are. Pages of text reach 0.7 and more; print
        in capitals, other scripts and pages with few words have less than 0.5, and then only lines that stand on end
        are turned, by 90 or 270 as it falls out.

    Examples
    --------
    >>> from planish.gallery import typeset_page
    >>> page, _ = typeset_page(105, 148, dpi=150)
    >>> lying = Page(np.rot90(page.pixels), np.rot90(page.known), page.dpi)
    >>> detect_orientation(lying)[0]
    90
    """
    ink = ink_of(page)
    level, upright = _lines_along(ink), _lines_along(ink.rotated())
    lying = upright.contrast > level.contrast
    lines, other = (upright, level) if lying else (level, upright)
    if lines.confidence < TEXT_LINES:
        return 0, 0.0
    sure_lines = 1 - other.contrast / lines.contrast
    if lying and stem_ratio(np.asarray(255 * ink.amount, np.uint8), ink.amount > 0) > COLUMNS:
        return 0, 0.0
    rise = _ascender_score(lines)
    if lying:
        confidence = sure_lines * erf(abs(rise) / sqrt(2))
        # Lines on end of which letters say less than the prior are columns, as of Chinese.
        return (90 if rise >= 0 else 270) if sure_lines > SURE and abs(rise) >= prior else 0, confidence
    rise += prior
    confidence = sure_lines * erf(abs(rise) / sqrt(2))
    return 180 if rise < 0 and confidence > SURE else 0, confidence


def stem_ratio(grey: NDArray[np.uint8], where: NDArray[np.bool_]) -> float:
    """Upright strokes relative to level ones: squared grey gradients within 20 degrees of either direction.

    Parameters
    ----------
    grey : (rows, cols) uint8
    where : (rows, cols) bool
        The text.
    """
    x, y = (np.square(cv2.Sobel(grey, cv2.CV_32F, *order)[where]) for order in ((1, 0), (0, 1)))
    steep = np.float32(1 / np.tan(np.radians(20.0)) ** 2)
    return float(x[x > steep * y].sum() / max(float(y[y > steep * x].sum()), TINY))


@dataclass(frozen=True, eq=False)
class _Lines:
    """The ink of a page in strips across its width, and the angle at which it falls into lines."""

    strips: NDArray[np.float32]
    middles: Floats
    px_per_mm: float
    degrees: float
    contrast: float
    confidence: float


def _lines_along(ink: Ink) -> _Lines:
    """Look for lines that run from left to right."""
    strips, middles = _strips(ink)
    angles = np.arange(-MAX_SKEW, MAX_SKEW + 0.1, 0.2)
    sums = np.array([_steepness(strips, middles, a) for a in angles])
    usual, most = float(np.median(sums)), float(sums.max())
    if most <= 0 or np.quantile(ink.amount, 0.999) < FAINT:
        return _Lines(strips, middles, ink.px_per_mm, 0.0, 0.0, 0.0)
    fine = angles[sums.argmax()] + np.linspace(-0.3, 0.3, 13)
    near = np.array([_steepness(strips, middles, a) for a in fine])
    top = slice(max(0, int(near.argmax()) - 3), int(near.argmax()) + 4)
    bend, slope, _ = np.polyfit(fine[top], near[top] / most, 2)
    degrees = -slope / (2 * bend) if bend < 0 else fine[near.argmax()]
    degrees = float(np.clip(degrees, fine[0], fine[-1]))
    many = min(1.0, _effective_rows(strips, middles, degrees) / MIN_ROWS)
    return _Lines(strips, middles, ink.px_per_mm, degrees, most - usual, many * (1 - usual / most))


def _strips(ink: Ink) -> tuple[NDArray[np.float32], Floats]:
    """Ink summed over strips: (strips, rows), and the strips' middles from the page's [px]."""
    rows, cols = ink.amount.shape
    wide = min(max(1, round(STRIP_MM * ink.px_per_mm)), cols)
    count = cols // wide
    strips = ink.amount[:, : count * wide].reshape(rows, count, wide).sum(axis=2)
    smooth = cv2.GaussianBlur(strips, (1, 7), sigmaX=0, sigmaY=1.0)
    return np.ascontiguousarray(smooth.T), (np.arange(count) - (count - 1) / 2) * wide


def _steepness(strips: NDArray[np.float32], middles: Floats, degrees: float) -> float:
    """How abruptly the ink along lines at an angle changes from line to line."""
    down = middles * np.tan(np.radians(degrees)) + EVEN_SHIFT
    pages = max(1, round(len(strips) * STRIP_MM / PAGE_MM))
    parts = zip(np.array_split(strips, pages), np.array_split(down, pages), strict=True)
    return float(sum((np.diff(_profile(*part)) ** 2).sum() for part in parts))


def _effective_rows(strips: NDArray[np.float32], middles: Floats, degrees: float) -> float:
    """Over how many rows the abrupt changes are spread: (sum of squares)^2 / sum of fourth powers."""
    change = np.diff(_profile(strips, middles * np.tan(np.radians(degrees)) + EVEN_SHIFT)).astype(np.float64) ** 2
    return float(change.sum() ** 2 / max((change**2).sum(), TINY))


@njit(cache=True)
def _profile(strips, down):  # type: ignore[no-untyped-def]
    """Sum over the strips, each moved up by `down` rows: float32 (rows,)."""
    rows = strips.shape[1]
    total = np.zeros(rows, np.float32)
    for s in range(len(strips)):
        whole = int(np.floor(down[s]))
        part = np.float32(down[s] - whole)
        for r in range(max(0, -whole), min(rows, rows - 1 - whole)):
            total[r] += (1 - part) * strips[s, r + whole] + part * strips[s, r + whole + 1]
    return total


def _ascender_score(lines: _Lines) -> float:
    """How much more ink is in ascenders than in descenders, in standard deviations."""
    per_column = max(1, round(COLUMN_MM / STRIP_MM))
    count = max(1, round(len(lines.strips) / per_column))
    down = lines.middles * np.tan(np.radians(lines.degrees))
    pieces = [
        _ascenders_less_descenders(_profile(strips, shift), lines.px_per_mm)
        for strips, shift in zip(np.array_split(lines.strips, count), np.array_split(down, count), strict=True)
    ]
    height, ink, votes = np.concatenate(pieces).T
    if len(votes) < 3:
        return 0.0
    order = np.argsort(height)
    usual = height[order][np.searchsorted(np.cumsum(ink[order]), 0.5 * ink.sum())]
    votes = votes[np.abs(np.log(height / usual)) < ALIKE]
    # Pieces of one line are correlated: they count for half. The effect of punctuation is added to the uncertainty.
    sigma = np.hypot(votes.std() / sqrt(len(votes) / 2), PUNCTUATION)
    return float(votes.mean() / sigma)


def _ascenders_less_descenders(profile: NDArray[np.float32], px_per_mm: float) -> Floats:
    """For every line of a column: its small letters' height and ink, and ink just above less just below, in theirs."""
    near = max(3, round(3 * px_per_mm)) | 1
    most = cv2.dilate(profile[:, None], np.ones((near, 1), np.uint8)).ravel()
    small = (profile > 0.5 * most) & (profile > 0.1 * np.quantile(profile, 0.98))
    ends = np.flatnonzero(np.diff(np.concatenate([[False], small, [False]]).astype(np.int8)))
    tops, bases = ends[::2], ends[1::2]
    gap_above = tops - np.concatenate([[0], bases[:-1]])
    gap_below = np.concatenate([tops[1:], [len(profile)]]) - bases
    votes = []
    for top, base, gap in zip(tops, bases, np.minimum(gap_above, gap_below), strict=True):
        height = base - top
        far, rim = round(min(0.6 * height, gap / 2)), max(1, round(0.12 * height))
        if SMALL_LETTERS_MM[0] <= height / px_per_mm <= SMALL_LETTERS_MM[1] and far - rim >= 2:
            above, below = profile[top - far : top - rim].mean(), profile[base + rim : base + far].mean()
            ink = float(profile[top:base].sum())
            votes.append((height, ink, (above - below) * height / ink))
    return np.array(votes).reshape(-1, 3)
