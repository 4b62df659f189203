"""Grading of a page by the FADGI guidelines, as far as the figures of a restoration allow."""

from __future__ import annotations

from dataclasses import replace

from planish.geometry.guards import TINY_MM
from planish.types import Criterion, GuidelineReport, Report
from planish.types.verdict import SCALE_GUESSED

NAME = (
    "FADGI Technical Guidelines for Digitizing Cultural Heritage Materials, September 2016, "
    "Bound Volumes: General Collections"
)
NOT_GRADED = (
    "tone response",
    "white balance",
    "colour accuracy",
    "colour registration",
    "sharpness",
    "sharpening",
    "noise",
)
"""Criteria that need a reference target in the photo."""

RESOLUTION_PPI = (150.0, 300.0, 300.0, 400.0)
EVENNESS_PERCENT = (8.0, 5.0, 3.0, 1.0)
SCALE_PERCENT = (5.0, 3.0, 2.0, 1.0)
"""Limits for one to four stars."""

LIGHT_PER_GREY = 2.2
"""The guidelines count light: so many times a small step of the code value near white, both in parts of white."""


def guideline(report: Report) -> GuidelineReport:
    """Compare a restoration with the limits of the guidelines.

    Resolution is what the photo has over nine tenths of the page, at most the page's own dpi: pixels that were only
    interpolated do not count. Evenness is that of the paper on the page, after shade was removed. Scale is by how much
    the expected errors of two opposite sides change the shorter way across the page; that the scanner's millimetre is
    true is taken for granted; where it is a guess, or the shape is one from a
    single photo, scale is not graded.

    Parameters
    ----------
    report : Report
    """
    page, found = report.page, []
    if page.dpi is not None and page.effective_ppi_p10 is not None:
        ppi = min(page.dpi, page.effective_ppi_p10)
        found.append(_criterion("resolution", "ppi", ppi, RESOLUTION_PPI))
    if report.shading is not None:
        found.append(
            _criterion("evenness of the paper", "%", 100 * LIGHT_PER_GREY * report.shading.unevenness, EVENNESS_PERCENT)
        )
    if report.photo is not None or not SCALE_GUESSED.isdisjoint(report.warning_codes):
        return GuidelineReport(NAME, found, [*NOT_GRADED, "accuracy of scale (the size or shape is a guess)"])
    across = max(min(page.width_mm, page.height_mm), TINY_MM)
    out = 2**0.5 * report.flatten.expected_error_mm
    found.append(_criterion("accuracy of scale", "%", 100 * out / across, SCALE_PERCENT))
    return GuidelineReport(NAME, found, list(NOT_GRADED))


def graded(report: Report) -> Report:
    """A report with its guideline derived from all that it holds by now."""
    return replace(report, guideline=guideline(report))


def stars(value: float, limits: tuple[float, ...]) -> int:
    """Stars that a value reaches: above the limits where they rise, else below.

    Examples
    --------
    >>> stars(310.0, RESOLUTION_PPI), stars(0.4, EVENNESS_PERCENT), stars(9.0, EVENNESS_PERCENT)
    (3, 4, 0)
    """
    rising = limits[-1] > limits[0]
    kept = [value >= limit if rising else value < limit for limit in limits]
    return kept.index(False) if False in kept else len(kept)


def _criterion(name: str, unit: str, value: float, limits: tuple[float, float, float, float]) -> Criterion:
    return Criterion(name, unit, value, limits, stars(value, limits))
