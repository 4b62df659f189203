"""Sharpen a page: thin print that the photo's blur mixed with its paper gets its contrast back."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from planish.types import Page

BLUR = 2.5
"""Standard deviation of the blur that is subtracted, in photo pixels: about the width of a thin stroke."""
ROWS = 1024
"""Page rows sharpened at a time."""


def sharpened(page: Page, amount: float, photo_ppi: float) -> Page:
    """Unsharp mask: each channel's difference from its blurred self, `amount` times, is added.

    Even areas keep their colour, and white paper stays white.

    Parameters
    ----------
    page : Page
        8 or 16 bit.
    amount : float
        0 for the page itself.
    photo_ppi : float
        Photo pixels per inch of the page, which say how wide the photo's blur is on it.

    Examples
    --------
    >>> stroke = np.full((9, 9), 255, np.uint8)
    >>> stroke[:, 4] = 150
    >>> page = Page(stroke, np.ones((9, 9), bool), 300.0)
    >>> made = np.asarray(sharpened(page, 1.0, 300.0).pixels)
    >>> int(made[4, 4]), int(made[4, 0])
    (61, 255)
    """
    if amount == 0:
        return page
    pixels: NDArray[Any] = np.asarray(page.pixels)
    sigma = BLUR * page.dpi / photo_ppi
    reach = int(np.ceil(4 * sigma))
    made = np.empty_like(pixels)
    for first in range(0, len(pixels), ROWS):
        above = max(0, first - reach)
        part = pixels[above : first + ROWS + reach]
        sharp = cv2.addWeighted(part, 1 + amount, cv2.GaussianBlur(part, (0, 0), sigma), -amount, 0)
        made[first : first + ROWS] = sharp[first - above : first - above + ROWS]
    return Page.owned(made, page.known, page.dpi, page.icc)
