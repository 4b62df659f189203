"""Text that reads backwards, as on a page whose scan or photo was mirrored."""

from __future__ import annotations

import cv2
import numpy as np

from planish.document.ink import Ink, ink_of
from planish.document.orientation import detect_orientation
from planish.types import Floats, Page

INK = 0.35
"""Darkness from which on a pixel belongs to a letter."""

FAINT_INK = 0.25
"""The same in lines, whose letters may be blurred."""

HEIGHT_MM = (0.9, 6.0)
ASPECT = (0.35, 1.3)
"""Height of letters, and their width as a part of it: no strokes, no joined words."""

MIN_LETTERS = 300

LEANING = 0.015
"""Mean distance of the letters' ink from the middle of their boxes, to the right, in widths, from which on they are
mirrored. Pages in Latin script have -0.02 to -0.033 at 75 dpi and more, since the round and the stemmed side of most
letters (b, c, e, h, k, p, r) is the left one; blurred or scattered print -0.015 to 0.007. Half of it is within that
scatter; twice of it would miss half of the pages."""

MIN_SIGMAS = 8.0
"""By how many standard errors it must differ from 0: upright pages in Latin script reach 10 to 35 the other way."""


LINE_MM = 15.0
WORD_GAP_MM = 4.0
SAME_MM = 1.0
"""Least length of a line, greatest gap between its words, and how far ends that are flush may differ."""

MIN_FLUSH = 8
FLUSH_RATIO = 4.0
"""At least so many lines end flush on one side only, and so many times as many as on the other, where that side tells
anything: pages of left-aligned or justified text have 4 : 0 to 25 : 0 and 14 : 1; an unflattened photo 12 : 5."""

LOOKED_AT_DPI = (100.0, 150.0)
"""Resolutions at which a page is asked for its way up. At one alone, shaded print of 60 ppi may be taken for upside
down with a confidence of 0.6."""

UPRIGHT = 0.7
"""Mean confidence with which all of them must agree: evenly lit pages of text have 0.76 to 0.98."""


def reads_backwards(page: Page) -> bool:
    """Whether the text of a page is plainly mirrored, left to right.

    Letters in Latin, Greek and Cyrillic have more ink on their left, and lines begin flush on the left; a page that is
    upright by its ascenders and has both the other way is mirrored. Letters alone suffice where they are sharp, lines
    where they are not. False where there are few of both, or no certainty which way is up.

    Parameters
    ----------
    page : Page

    Examples
    --------
    >>> from planish.gallery import typeset_page
    >>> page, _ = typeset_page(216, 279, dpi=100)
    >>> reads_backwards(page), reads_backwards(Page(page.pixels[:, ::-1], page.known, page.dpi))
    (False, True)
    """
    ink = ink_of(page)
    side = _by_letters(_leanings(ink)) or _by_lines(ink)
    if not side:
        return False
    found = [detect_orientation(_at_dpi(page, dpi)) for dpi in LOOKED_AT_DPI]
    degrees = {turn for turn, _ in found}
    if len(degrees) > 1 or np.mean([confidence for _, confidence in found]) < UPRIGHT:
        return False
    return degrees == {0 if side > 0 else 180}


def _at_dpi(page: Page, dpi: float) -> Page:
    scale = dpi / page.dpi
    pixels = page.pixels.astype(np.uint8) * np.uint8(255) if page.pixels.dtype == bool else page.pixels
    way = cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC
    resized = cv2.resize(pixels, None, fx=scale, fy=scale, interpolation=way)
    known = cv2.resize(page.known.astype(np.uint8), resized.shape[1::-1], interpolation=cv2.INTER_NEAREST)
    return Page(resized, known > 0, dpi)


def _by_letters(leaning: Floats) -> int:
    """1: the letters lean to the right, -1: to the left, 0: they do not tell."""
    if len(leaning) < MIN_LETTERS:
        return 0
    mean = float(leaning.mean())
    sigma = float(leaning.std()) / np.sqrt(len(leaning))
    return int(np.sign(mean)) if abs(mean) > max(LEANING, MIN_SIGMAS * sigma) else 0


def _by_lines(ink: Ink) -> int:
    """1: lines begin flush on the right, -1: on the left, 0: they do not tell."""
    mm = ink.px_per_mm
    gap = np.ones((1, int(WORD_GAP_MM * mm) | 1), np.uint8)
    joined = cv2.morphologyEx((ink.amount > FAINT_INK).astype(np.uint8), cv2.MORPH_CLOSE, gap)
    left, _, width, height, _ = cv2.connectedComponentsWithStats(joined)[2][1:].T
    line = (height > HEIGHT_MM[0] * mm) & (height < 8 * mm) & (width > LINE_MM * mm)
    if line.sum() < MIN_FLUSH:
        return 0
    ends = left[line] / mm, (left + width)[line] / mm
    mates = [(np.abs(end[:, None] - end) < SAME_MM).sum(axis=1) - 1 for end in ends]
    many = max(4, 0.15 * line.sum())
    on_left, on_right = (int(((mates[k] >= many) & (mates[1 - k] <= 1)).sum()) for k in (0, 1))
    if max(on_left, on_right) < MIN_FLUSH or max(on_left, on_right) < FLUSH_RATIO * min(on_left, on_right):
        return 0
    return 1 if on_right > on_left else -1


def _leanings(ink: Ink) -> Floats:
    """(k,) how far right of the middle of its box the ink of each letter lies, in widths."""
    amount, mm = ink.amount, ink.px_per_mm
    count, label, stats, _ = cv2.connectedComponentsWithStats((amount > INK).astype(np.uint8))
    left, width, height = stats[:, cv2.CC_STAT_LEFT], stats[:, cv2.CC_STAT_WIDTH], stats[:, cv2.CC_STAT_HEIGHT]
    letter = (height >= max(5.0, HEIGHT_MM[0] * mm)) & (height <= HEIGHT_MM[1] * mm) & (width >= 4)
    letter &= (width >= ASPECT[0] * height) & (width <= ASPECT[1] * height)
    letter[0] = False  # the paper
    row, col = np.nonzero(amount > INK)
    number, dark = label[row, col], amount[row, col].astype(np.float64)
    total = np.bincount(number, dark, count)[letter]
    middle = np.bincount(number, dark * col, count)[letter] / total
    return np.asarray((middle - left[letter] - (width[letter] - 1) / 2) / width[letter])
