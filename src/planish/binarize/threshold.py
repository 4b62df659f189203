"""Thresholds of the doxapy library, with windows that follow the page's resolution."""

from __future__ import annotations

import numpy as np

from planish.settings import BinarizeSettings
from planish.types import Page

WITH_K = ("sauvola", "niblack", "wolf", "nick", "isauvola", "wan", "trsingh")
"""Methods that weigh the contrast by k; the others have no such choice."""


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
        Its pixels are bool, True is paper. What is not known is paper.

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
    grey = _grey(page)
    side = max(3, round(s.window_mm * page.dpi / 25.4)) | 1
    side = min(side, 2 * (min(grey.shape) // 2) - 1) if min(grey.shape) > 3 else 3
    parameters = {"window": side} | ({"k": s.k} if s.binarize in WITH_K else {})
    threshold = doxapy.Binarization(getattr(doxapy.Binarization.Algorithms, s.binarize.upper()))
    threshold.initialize(grey)
    out = np.empty_like(grey)
    threshold.to_binary(out, parameters)
    return Page((out > 127) | ~page.known, page.known, page.dpi)


def _grey(page: Page) -> np.ndarray:
    """Brightness as 8 bit: the luma of sRGB, as OCR programs and thresholds expect it."""
    pixels = page.pixels
    if pixels.dtype == np.uint16:
        pixels = (pixels >> 8).astype(np.uint8)
    if pixels.ndim == 3:
        import cv2

        pixels = cv2.cvtColor(np.ascontiguousarray(pixels), cv2.COLOR_RGB2GRAY)
    return np.ascontiguousarray(pixels, np.uint8)
