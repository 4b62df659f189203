"""How far the points of a page from photos are likely to be from the truth."""

from __future__ import annotations

import numpy as np

from planish.types import FlattenReport, PhotosReport

STRAIN_WEIGHT = 1.6
"""As in `planish.flattening.expected`."""
ALIKE_MM = 15.0
"""Distance over which errors of the surface are alike: that of print from print, across which it is bridged."""


def expected_page_error(photos: PhotosReport, size_mm: tuple[float, float], flat: FlattenReport) -> float:
    """Expected distance of the page's points from their true places, rms [mm].

        e^2 = (a s sqrt(l L))^2 + e_m^2 + (k r)^2 + b^2

    The first term is that of a flattening with strain s (rms) over a sheet of side L, of which l is alike: paper has
    no strain, so that what there is comes from errors of the surface. e_m is the error of the measured places along
    the sheet, k that of the scale, r the rms distance of points from the page's middle, b what may be
    missing across a sharp bend that was bridged: the parts of the sheet on its sides lie b too near to each other, and
    where there is one such bend there are more.
    """
    width, height = size_mm
    side = float(np.sqrt(width * height))
    strain = STRAIN_WEIGHT * flat.strain_rms * np.sqrt(ALIKE_MM * side)
    scale = (photos.scale_error or 0.0) * np.sqrt((width**2 + height**2) / 12)
    return float(np.sqrt(strain**2 + photos.surface_error_mm**2 + scale**2 + photos.lost_at_bends_mm**2))
