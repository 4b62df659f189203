"""Pages of no usual size: drawn no finer than the photo shows them, so that a wrong unit is told in seconds."""

from __future__ import annotations

from dataclasses import replace

from planish.settings import RenderSettings
from planish.types import Diagnostic

HUGE_MM = 2000.0
"""Sheets above are rare (wall maps, banners) and mostly a unit or depth scale that is wrong by 10: a page of 3 m at 300
dpi has 1000 megapixels. At half of it plans of A0 (1189 mm) would count as huge."""

BRIEF_PIXELS = 4e6
"""Of a quick look at a page; an A4 page at 150 dpi has half of it."""


def bounded_dpi(
    settings: RenderSettings, size_mm: tuple[float, float], photo_ppi: float
) -> tuple[RenderSettings, list[Diagnostic]]:
    """The settings with a dpi that a huge page is worth, and a warning where that is less than was asked for.

    Parameters
    ----------
    settings : RenderSettings
    size_mm : (float, float)
    photo_ppi : float
        What the photo shows of the page.

    Examples
    --------
    >>> bounded_dpi(RenderSettings(dpi=300), (216, 279), 40.0)[0].dpi
    300
    >>> bounded_dpi(RenderSettings(dpi=300), (2160, 2790), 14.2)[0].dpi
    15.0
    """
    dpi = max(1.0, float(-(-photo_ppi // 1)))
    if max(size_mm) <= HUGE_MM or (settings.dpi != "auto" and settings.dpi <= dpi):
        return settings, []
    sentence = (
        f"the page is {size_mm[0]:.0f} x {size_mm[1]:.0f} mm, larger than sheets are; it was drawn at the {dpi:.0f} "
        "dpi of the photo"
    )
    return replace(settings, dpi=dpi), [Diagnostic("page-huge", sentence, "set {units}, or the depth scale, if so")]


def quick_dpi(usual: float, size_mm: tuple[float, float]) -> float:
    """Dpi for a quick look: the usual one, less for huge pages.

    Examples
    --------
    >>> quick_dpi(150.0, (216, 279)), round(quick_dpi(150.0, (2160, 2790)))
    (150.0, 21)
    """
    if max(size_mm) <= HUGE_MM:
        return usual
    return float(min(usual, 25.4 * (BRIEF_PIXELS / (size_mm[0] * size_mm[1])) ** 0.5))
