"""The size of a scan from what its flat page is known to measure."""

from __future__ import annotations

from dataclasses import replace

from planish.acquire.photos.scan import PhotosScan
from planish.pipeline.flatten import flatten
from planish.pipeline.restore import restore
from planish.settings import (
    PAPERS_MM,
    BinarizeSettings,
    PhotoSettings,
    RenderSettings,
    RestoreSettings,
    ShadingSettings,
)
from planish.types import Diagnostic

ROUGH_DPI = 100.0
"""Enough to tell which way up the text is."""
WIDTH_ERROR = 1e-3
"""Of a width measured with a ruler: a fifth of a millimetre."""
UNLIKE = 0.02
"""Difference of a page's proportions from its paper's from which on it is told: A4 and Letter differ by 9 %, outlines
by 0.5 %."""


def scaled_by_page(found: PhotosScan, settings: PhotoSettings) -> PhotosScan:
    """Scale a scan by what is known of its flat page: its width, or the distance of two marked places; if either is."""
    if settings.width_mm is not None:
        return scaled_to_width(found, settings.width_mm)
    if settings.distance_mm is not None and found.marked is not None:
        apart = found.marked.apart(flatten(found.acquired.scan.mesh).page_xy)
        error = found.marked.relative_error(settings.distance_mm)
        return found.scaled(settings.distance_mm / apart, "distance", error)
    return found


def scaled_to_width(found: PhotosScan, width_mm: float) -> PhotosScan:
    """Scale a scan so that its page gets a given width.

    Parameters
    ----------
    found : PhotosScan
    width_mm : float

    Returns
    -------
    PhotosScan
    """
    rough = RestoreSettings(
        render=RenderSettings(dpi=ROUGH_DPI),
        shading=ShadingSettings(shading="none"),
        binarize=BinarizeSettings(binarize="none"),
        pages="1",
    )
    width, _ = restore(replace(found.acquired.scan, others=()), rough).flattening.size_mm
    return found.scaled(width_mm / width, "width", WIDTH_ERROR)


def unlike_paper(size_mm: tuple[float, float], paper: str) -> list[Diagnostic]:
    """Tell where a page has other proportions than the paper that its size was taken from.

    Parameters
    ----------
    size_mm : (float, float)
    paper : str
        Name of a format, or "unknown".

    Examples
    --------
    >>> [note.sentence for note in unlike_paper((216.0, 279.0), "a4")]
    ['the page is 1.29 times as long as wide, but A4 is 1.41 times, so its size may be wrong']
    >>> unlike_paper((297.5, 210.1), "a4")
    []
    """
    if paper == "unknown":
        return []
    (short, long), true = sorted(size_mm), PAPERS_MM[paper]
    found, known = long / short, max(true) / min(true)
    if abs(found / known - 1) < UNLIKE:
        return []
    sentence = (
        f"the page is {found:.2f} times as long as wide, but {paper.title()} is {known:.2f} times, so its size may be "
        "wrong"
    )
    return [Diagnostic("unlike-paper", sentence, "give the sheet's own format as {paper}, or its width as {width_mm}")]
