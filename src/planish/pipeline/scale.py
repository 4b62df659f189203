"""The size of a scan from the width of its page, which can be told only once the page is upright."""

from __future__ import annotations

from dataclasses import replace

from planish.acquire.photos.scan import PhotosScan
from planish.pipeline.restore import restore
from planish.settings import BinarizeSettings, RenderSettings, RestoreSettings, ShadingSettings

ROUGH_DPI = 100.0
"""Enough to tell which way up the text is."""
WIDTH_ERROR = 1e-3
"""Of a width measured with a ruler: a fifth of a millimetre."""


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
