"""Thresholds of the doxapy library, with windows that follow the page's resolution."""

from __future__ import annotations

import cv2
import numpy as np

from planish.color import to_grey
from planish.dpi import mm_to_px
from planish.errors import UsageError
from planish.settings import BinarizeSettings
from planish.types import Page

BEST_K = {"nick": 0.2, "sauvola": 0.34, "wolf": 0.6, "trsingh": 0.2}
"""Of the methods that have such a weight: the F1 of ink is best a little above these, and faint print is lost there."""
SMALLEST = 32
"""Sides of pages below this are filled up: the library divides by zero on pages of a few pixels."""


def binarize(page: Page, settings: BinarizeSettings | None = None) -> Page:
    """Decide for every pixel whether it is ink or paper.

    Parameters
    ----------
    page : Page
        Grey or colour, 8 or 16 bit. Only its brightness counts.
    settings : BinarizeSettings, optional
        With a method other than "none".

    Returns
    -------
    Page
        Its pixels are bool, True is paper. What is not known is paper, and so is a page of one grey.

    Raises
    ------
    UsageError
        Where the method is "none".

    Notes
    -----
    The default is the NICK threshold of Khurshid et al. (2009), T = m - k sqrt(v + m^2) with m the mean and v the
    variance of the neighbourhood. Where there is little ink it stays at (1 - k) m, where Sauvola's falls to half the
    paper's brightness and faint print is lost.

    Examples
    --------
    >>> pixels = np.full((40, 40), 220, np.uint8)
    >>> pixels[18:22, 5:35] = 60
    >>> ink = ~binarize(Page(pixels, np.ones((40, 40), bool), 100.0)).pixels
    >>> int(ink.sum()), bool(ink[20, 20])
    (120, True)
    """
    import doxapy

    s = settings or BinarizeSettings()
    if s.binarize == "none":
        raise UsageError('binarize is "none", so there is no black and white page to make; choose a method')
    grey = to_grey(page.pixels)
    if grey.min() == grey.max():
        return Page(np.ones(grey.shape, bool), page.known, page.dpi)
    rows, cols = grey.shape
    if min(rows, cols) < SMALLEST:
        grey = cv2.copyMakeBorder(grey, 0, max(0, SMALLEST - rows), 0, max(0, SMALLEST - cols), cv2.BORDER_REPLICATE)
    threshold = doxapy.Binarization(getattr(doxapy.Binarization.Algorithms, s.binarize.upper()))
    threshold.initialize(grey)
    out = np.empty_like(grey)
    threshold.to_binary(out, _parameters(s, page.dpi, min(grey.shape)))
    return Page.owned((out[:rows, :cols] > 127) | ~page.known, page.known, page.dpi)


def _parameters(s: BinarizeSettings, dpi: float, short_side: int) -> dict[str, int | float]:
    """The library's: an odd window within the page, and its sign of k."""
    window = min(max(3, round(mm_to_px(s.window_mm, dpi))), max(3, short_side - 1))
    parameters: dict[str, int | float] = {"window": window if window % 2 else window - 1}
    if s.binarize in BEST_K:
        k = BEST_K[s.binarize] if s.k == "auto" else float(s.k)
        parameters["k"] = -k if s.binarize == "nick" else k
    return parameters
