"""The ink of a page's letters, apart from its paper, shade, pictures and rules."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from planish.color import to_grey
from planish.dpi import MM_PER_INCH
from planish.types import Page

WORKING_DPI = 150.0
"""Enough for letters of 6 points."""
PAPER_MM = 5.0
"""Dark places wider than this are pictures or shade."""
RULE_MM = 10.0
"""Straight strokes longer than this are rules and frames."""
RULE_RIM_MM = 0.5
"""Blurred rim of a rule, which is left out with it."""
GRAIN = 4.0
"""Least darkness of ink against the median of the page, in multiples of the median of what deviates from it."""
FAINTEST = 0.04
"""Least darkness of ink where paper is even: the rules of a notepad leave 0.02 to 0.03 beside them, pencil has 0.2."""
BORDER_MM = 2.0
"""Rim of the known part that is left out: there the edge of the sheet looks like ink."""


@dataclass(frozen=True, eq=False)
class Ink:
    """How dark each place is against the paper around it.

    Attributes
    ----------
    amount : (rows, cols) float32
        0 is paper with its grain, 1 nearly black.
    px_per_mm : float
    """

    amount: NDArray[np.float32]
    px_per_mm: float

    def rotated(self) -> Ink:
        """The same, rotated a quarter turn clockwise."""
        return Ink(np.ascontiguousarray(np.rot90(self.amount, -1)), self.px_per_mm)


def ink_of(page: Page) -> Ink:
    """Find the ink of the letters, at 150 dpi or the page's own resolution where that is less."""
    scale = min(1.0, WORKING_DPI / page.dpi)
    mm = scale * page.dpi / MM_PER_INCH
    grey, known = to_grey(page.pixels), np.ascontiguousarray(page.known, np.uint8)
    if scale < 1:
        grey = cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        known = cv2.resize(known, grey.shape[::-1], interpolation=cv2.INTER_NEAREST)
    paper = cv2.morphologyEx(grey, cv2.MORPH_CLOSE, _box(PAPER_MM * mm, PAPER_MM * mm))
    known = cv2.erode(known, _box(2 * BORDER_MM * mm, 2 * BORDER_MM * mm), borderValue=0)
    dark = np.where(known > 0, 255 - 255 * (grey / np.maximum(paper, 1).astype(np.float32)), 0).astype(np.uint8)
    rules = np.maximum(
        cv2.morphologyEx(dark, cv2.MORPH_OPEN, _box(RULE_MM * mm, 1)),
        cv2.morphologyEx(dark, cv2.MORPH_OPEN, _box(1, RULE_MM * mm)),
    )
    dark[cv2.dilate(rules, _box(2 * RULE_RIM_MM * mm, 2 * RULE_RIM_MM * mm)) > 25] = 0
    return Ink(cv2.subtract(dark, _grain(dark[known > 0])).astype(np.float32) / np.float32(255), mm)


def _grain(dark: NDArray[np.uint8]) -> float:
    """How dark grain and faint traces on the paper are [levels of 255]."""
    if not dark.size:
        return 0.0
    paper = float(np.median(dark))
    return max(paper + GRAIN * float(np.median(cv2.absdiff(dark, paper))), 255 * FAINTEST)


def _box(width: float, height: float) -> NDArray[np.uint8]:
    """All of an odd number of pixels each way."""
    return np.ones((int(height) | 1, int(width) | 1), np.uint8)
