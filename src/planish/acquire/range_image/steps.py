"""Quantization of depths: whole millimetres, disparities, and what they add to the noise."""

from __future__ import annotations

import numpy as np

from planish.types import Diagnostic, Floats

MAX_DISTINCT = 0.5
"""Depths of which more than this share is distinct are not quantized. Floats of a laser or of averaged frames are
nearly all distinct; a sheet of 100,000 pixels in whole millimetres has some hundred values."""

FEWEST = 1000
"""Least number of depths for the test: few values may be equal, or all distinct, by chance."""

MAX_SHARE = 0.02
"""Of the depth, that a step of numbers may be: disparities of a Kinect at 3 m are 0.8 % apart. What is farther apart is
the scene's own, as two flat surfaces one behind the other."""

COARSE_MM = 0.25
"""Steps above this are reported: rounding alone then adds 0.07 mm of noise, as much as a fair scanner has in all. At
half of it a camera in tenths of a millimetre is still silent; at twice, half millimetres would be too."""


def depth_step(depth: Floats) -> float:
    """Typical step between the distinct values of a depth map; 0 where it is not quantized.

    Steps of disparities grow with the depth, so the median over the pixels is taken.

    Parameters
    ----------
    depth : any shape, float64 [mm]
        Not finite, or 0, where there is none.

    Examples
    --------
    >>> depth = np.random.default_rng(0).normal(500, 5, 5000)
    >>> depth_step(depth), depth_step(np.rint(depth)), depth_step(np.rint(4 * depth) / 4)
    (0.0, 1.0, 0.25)
    """
    values = depth[np.isfinite(depth) & (depth > 0)]
    if len(values) < FEWEST:
        return 0.0
    distinct, count = np.unique(values, return_counts=True)
    if len(distinct) < 3 or len(distinct) > MAX_DISTINCT * len(values):
        return 0.0
    gap = np.diff(distinct)
    by_gap = np.argsort(gap)
    weight = np.cumsum(count[1:][by_gap])
    step = float(gap[by_gap][np.searchsorted(weight, weight[-1] / 2)])
    return step if step <= MAX_SHARE * float(np.median(values)) else 0.0


def with_rounding(noise_mm: float, step_mm: float) -> float:
    """Standard deviation of noise that was measured on rounded numbers: at least step / sqrt(12).

    A robust measure is 0 where most of the differences are equal; the rounding itself is uniform over one step.
    """
    return max(noise_mm, step_mm / float(np.sqrt(12)))


def step_warnings(step_mm: float) -> list[Diagnostic]:
    """The warning for depths in coarse steps, if they are."""
    if step_mm <= COARSE_MM:
        return []
    return [
        Diagnostic(
            "depth-in-steps",
            f"the depths come in steps of {step_mm:.2g} mm, which the surface shows as terraces",
            "give several frames of the same still scene, or bring the camera nearer",
        )
    ]
