"""Missing regions: parts of a page that neither scan nor photo covers."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from planish.dpi import mm_to_px, px_to_mm
from planish.types import Bools, Page

WIDE_MM = 1.0
"""Missing parts that are nowhere so wide are the steps of the scan's border, not holes in the page; clipped ones are
glints and grain."""
MISSING, CLIPPED, SEEN = 0, 128, 255


@dataclass(frozen=True)
class MissingRegions:
    """The parts of a page that were not seen.

    Attributes
    ----------
    regions : int
        That hang together, and are somewhere at least 1 mm wide.
    area_mm2 : float
        Of these.
    """

    regions: int
    area_mm2: float


def missing_regions(page: Page) -> MissingRegions:
    """Count the parts of a page that were not seen, and their area.

    Examples
    --------
    >>> known = np.ones((100, 200), bool)
    >>> known[10:30, 10:20] = known[50, :] = False
    >>> missing_regions(Page(np.zeros((100, 200), np.uint8), known, dpi=50.8))
    MissingRegions(regions=1, area_mm2=50.0)
    """
    unseen = np.asarray(~page.known, np.uint8)
    wide = cv2.erode(unseen, _square(page.dpi), borderValue=0)
    if not wide.any():
        return MissingRegions(0, 0.0)
    _, label, box, _ = cv2.connectedComponentsWithStats(unseen, connectivity=8)
    counted = np.unique(label[wide > 0])
    area = box[counted, cv2.CC_STAT_AREA].sum() * px_to_mm(1, page.dpi) ** 2
    return MissingRegions(len(counted), float(area))


def mask_of(page: Page, clipped: Bools | None = None) -> Page:
    """Draw what is known of a page: 255 where it was seen, 128 where the photo is clipped, 0 where nobody saw it.

    Parameters
    ----------
    page : Page
    clipped : (rows, cols) bool, optional
        Where the photo was too bright to tell how bright; drawn where it is at least 1 mm wide.
    """
    value = np.where(page.known, np.uint8(SEEN), np.uint8(MISSING))
    if clipped is not None:
        square = _square(page.dpi)
        back = (len(square) - 1 - len(square) // 2,) * 2  # else an even square would move everything by a pixel
        wide = cv2.dilate(cv2.erode(np.asarray(clipped & page.known, np.uint8), square), square, anchor=back)
        value[wide > 0] = CLIPPED
    return Page.owned(value, page.known, page.dpi)


def _square(dpi: float) -> NDArray[np.uint8]:
    side = max(1, round(mm_to_px(WIDE_MM, dpi)))
    return np.ones((side, side), np.uint8)
