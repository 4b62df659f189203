"""How far a page extends beyond what its shape was fitted to: its text with margins, and the sheet's region."""

from __future__ import annotations

import cv2
import numpy as np

from planish.errors import InputError
from planish.photo.cylinder import Cylinder, photo_to_page
from planish.photo.lines import TextLines
from planish.types import Floats

AROUND = 3.0
"""Margin drawn around the text where sheet borders are unknown, in heights of each line's letters."""
BESIDE = 5.0
"""Distance, in letter heights, within which text fragments are added to the text area."""
FRAGMENT_ROUNDS = 3
"""Repetitions of that, from fragment to fragment."""
MOST = 0.5
"""Least share of line ends whose rays meet the sheet; below it the fit failed."""
LEVEL = 0.5
"""Largest slope of a level fragment, in letter heights."""
KEPT_CELLS = 500
"""Cells along the longer side of the region in which it is compared with the page."""
MOST_STRETCH = 3.0
"""Largest length on the page of a photo pixel, relative to one of a sheet seen from the front: where a sheet falls away
more steeply, as into a gutter, its length is anybody's guess."""
RAGGED = 0.02
"""Share of the region's outline that may lie beyond the page: tips of what is no sheet."""


def text_extent(lines: TextLines, cylinder: Cylinder, around: float = AROUND) -> tuple[Floats, Floats]:
    """Corners of the text on the page, fragments of text beside it included, and a margin.

    Parameters
    ----------
    lines : TextLines
    cylinder : Cylinder
    around : float
        The margin, in letter heights; it follows the letters of each line, so that a large title stays whole.

    Returns
    -------
    low, high : (2,) float64
        Along and across the text lines, in camera distances.

    Raises
    ------
    InputError
        If the lines lie on no such sheet.
    """
    ends, good = photo_to_page(cylinder, lines.ends.reshape(-1, 2))
    if good.mean() < MOST:
        raise InputError(
            "the lines of text do not fit any sheet of paper bent in one direction; is it text, seen from the front?"
        )
    heights = np.repeat(lines.letter_heights, 2)[good, None] / cylinder.focal
    height = lines.letter_height / cylinder.focal
    low = (ends[good] - around * heights - heights * [0, 1]).min(axis=0)
    high = (ends[good] + around * heights).max(axis=0)
    fragments, good = photo_to_page(cylinder, lines.fragments.reshape(-1, 2))
    fragments = fragments.reshape(-1, 2, 2)
    level = good[::2] & good[1::2] & (np.abs(fragments[:, 1, 1] - fragments[:, 0, 1]) < LEVEL * height)
    before, after = np.array([around, around + 1]) * height, around * height
    for _ in range(FRAGMENT_ROUNDS):
        first, last = low + before - BESIDE * height, high - after + BESIDE * height
        near = (fragments.max(axis=1) > first) & (fragments.min(axis=1) < last)
        beside = fragments[level & near.all(axis=1)].reshape(-1, 2)
        low = np.minimum(low, (beside - before).min(axis=0, initial=np.inf))
        high = np.maximum(high, (beside + after).max(axis=0, initial=-np.inf))
    return low, high


def region_extent(outline: Floats, cylinder: Cylinder) -> tuple[Floats, Floats] | None:
    """Corners of the sheet's region on the page, its tips left out; None if too little of it lies on the sheet.

    Parameters
    ----------
    outline : (n, 2) float64 [photo px]
    cylinder : Cylinder

    Returns
    -------
    low, high : (2,) float64
        Along and across the text lines, in camera distances.
    """
    page, good = photo_to_page(cylinder, outline)
    for nudge in ([1.0, 0.0], [0.0, 1.0]):
        beside, also = photo_to_page(cylinder, outline + nudge)
        good &= also & (np.linalg.norm(beside - page, axis=1) * cylinder.focal < MOST_STRETCH)
    if good.mean() < MOST:
        return None
    low, high = np.quantile(page[good], [RAGGED, 1 - RAGGED], axis=0)
    return low, high


def kept_share(outline: Floats, page_rim: Floats) -> float:
    """Share of the sheet's region on the photo that the page shows.

    Parameters
    ----------
    outline : (n, 2) float64 [photo px]
        Of the region.
    page_rim : (m, 2) float64 [photo px]
        Of the page, in order.

    Examples
    --------
    >>> square = np.array([[0.0, 0], [100, 0], [100, 100], [0, 100]])
    >>> round(kept_share(square, square * [0.5, 1]), 1)
    0.5
    """
    low, cell = outline.min(axis=0), float(np.ptp(outline, axis=0).max()) / KEPT_CELLS
    masks = np.zeros((2, KEPT_CELLS + 1, KEPT_CELLS + 1), np.uint8)
    for mask, xy in zip(masks, (outline, page_rim), strict=True):
        far = 10 * KEPT_CELLS
        cv2.fillPoly(mask, [np.clip((xy - low) / cell, -far, far).round().astype(np.int32)], 1)
    return float((masks[0] & masks[1]).sum() / max(int(masks[0].sum()), 1))
