"""A photo and a depth map of which one is mirrored: the sheet on the photo then ends where the depth goes on."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from planish.types import Bools, Diagnostic, Floats

MIN_STEPS = 0.3
"""Part of the mirrored outline that must run along steps of the depth, where it is apart from the outline: a book page
has steps on 0.7 to 0.8 of it, the wrong way round on 0 to 0.2 (four captures)."""

TIMES = 2.0
"""So many times the part of the outline itself that does. At 1, either would be told where neither fits."""

MIN_APART = 0.1
"""Part of the outline that must be apart from its mirror image; a sheet seen straight from above may have none."""

NOISE_STEPS = 6.0
REACH_PX = 2
"""Steps count within so many pixels of the outline, and outlines are apart from twice as many on."""


def mirrored_warnings(depth: Floats, on_sheet: Bools, step_mm: float) -> list[Diagnostic]:
    """Tell where the photo's sheet fits the depth map better the other way round.

    Parameters
    ----------
    depth : (rows, cols) float64 [mm]
        NaN where there is none; of the whole view.
    on_sheet : (rows, cols) bool
        Its pixels on the sheet that the photo shows.
    step_mm : float
        In which the depths come.
    """
    steps = _grown(_steps(depth, step_mm), REACH_PX)
    rim = on_sheet & ~ndimage.binary_erosion(on_sheet)
    mirrored = rim[:, ::-1]
    here, there = rim & ~_grown(mirrored, 2 * REACH_PX), mirrored & ~_grown(rim, 2 * REACH_PX)
    if here.sum() <= MIN_APART * rim.sum():
        return []
    fits, fits_mirrored = float(steps[here].mean()), float(steps[there].mean())
    if fits_mirrored < MIN_STEPS or fits_mirrored < TIMES * fits:
        return []
    sentence = "the outline of the sheet on the photo fits the depth map only mirrored; one of the two is mirrored"
    return [Diagnostic("depth-mirrored", sentence, "save both as the camera gives them, or mirror one of them")]


def _grown(region: Bools, pixels: int) -> Bools:
    return np.asarray(ndimage.binary_dilation(region, np.ones((3, 3), bool), iterations=pixels))


def _steps(depth: Floats, step_mm: float) -> Bools:
    """Pixels where the depth bends by far more than its noise along rows or columns, or ends."""
    found = np.zeros(depth.shape, bool)
    for axis in (0, 1):
        bend = np.abs(np.diff(depth, 2, axis=axis))
        usual = 1.4826 * float(np.nanmedian(bend)) if np.isfinite(bend).any() else 0.0
        inner = (slice(1, -1), slice(None)) if axis == 0 else (slice(None), slice(1, -1))
        found[inner] |= ~(bend <= max(NOISE_STEPS * usual, 2.5 * step_mm))
    return found
