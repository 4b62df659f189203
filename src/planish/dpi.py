"""Millimetres and pixels at a resolution in dots per inch."""

from __future__ import annotations

MM_PER_INCH = 25.4
"""By definition."""


def mm_to_px(mm: float, dpi: float) -> float:
    """Convert a length from millimetres to pixels.

    Examples
    --------
    >>> mm_to_px(50.8, 300)
    600.0
    """
    return mm * dpi / MM_PER_INCH


def px_to_mm(px: float, dpi: float) -> float:
    """Convert a length from pixels to millimetres.

    Examples
    --------
    >>> px_to_mm(600, 300)
    50.8
    """
    return px * MM_PER_INCH / dpi
