"""A camera and a projector that are calibrated to each other: points from pairs of pixels, and whether they fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from planish.acquire.triangulate import rays
from planish.errors import InputError
from planish.types import Camera, Floats

SAMPLE = 1000
"""Pairs that tell whether code and calibration belong together."""

FACTORS = np.exp(np.linspace(np.log(1 / 8), np.log(8), 209))
"""Of the projector's scale, that are tried: steps of 2 %."""

GOOD_PX = 2.5
"""Rays of a fitting pair miss each other by less, in pixels of the code (median)."""

MUCH_BETTER = 3.0
"""Another scale must fit so many times better before it is the scale that is to blame."""

PLAIN = np.array([1 / 8, 1 / 6, 1 / 5, 1 / 4, 1 / 3, 1 / 2, 2 / 3, 3 / 4, 4 / 3, 3 / 2, 2, 3, 4, 5, 6, 8])
"""Factors that people's resolutions differ by; one within 2 % is named as such."""


def points_and_misses(
    camera: Camera, projector: Camera, camera_xy: Floats, projector_xy: Floats
) -> tuple[Floats, Floats]:
    """Find the points that a camera sees at its pixels and a projector lights from its own.

    On each ray of the camera, the point that falls closest to the projector's pixel: with q = q0 + t q1 the ray in the
    projector's frame and (a, b) the pixel in its plane at distance 1, t is the least squares solution of
    q_x - a q_z = 0 and q_y - b q_z = 0.

    Parameters
    ----------
    camera, projector : Camera
        In one world.
    camera_xy, projector_xy : (k, 2) float64 [px]

    Returns
    -------
    points : (k, 3) float64 [mm]
        NaN where the rays meet nowhere before both.
    misses : (k,) float64 [projector px]
        How far from its pixel the point falls on the projector: across the epipolar line, since along it the point
        was free.
    """
    directions, eye = rays(camera, camera_xy)
    lights, lamp = rays(projector, projector_xy)
    seen = lights @ projector.rotation.T
    place = seen[:, :2] / seen[:, 2:]  # NaN where the lens folds over and has no ray
    start = projector.rotation @ (eye - lamp)
    along = directions @ projector.rotation.T
    slope = along[:, :2] - place * along[:, 2:]
    offset = start[:2] - place * start[2]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = -(slope * offset).sum(axis=1) / (slope**2).sum(axis=1)
        far = start[2] + t * along[:, 2]
        across = slope[:, 0] * offset[:, 1] - slope[:, 1] * offset[:, 0]
        missed = np.abs(across) / np.linalg.norm(slope, axis=1) / np.abs(far)
    t[~(t > 0) | ~(far > 0)] = np.nan
    focal = np.sqrt(projector.matrix[0, 0] * projector.matrix[1, 1])
    return eye + t[:, None] * directions, np.asarray(missed * focal)


def coarser(projector: Camera, factor: float) -> Camera:
    """The same projector with pixels `factor` times as wide and high: those of its code, where they are not its own."""
    matrix = projector.matrix.copy()
    matrix[:2] /= factor
    matrix[:2, 2] += (1 / factor - 1) / 2  # pixel centres lie at integers
    rows, cols = (max(1, round(n / factor)) for n in projector.shape_rc)
    return replace(projector, matrix=matrix, shape_rc=(rows, cols))


def check_fit(camera: Camera, projector: Camera, camera_xy: Floats, code_xy: Floats) -> float:
    """Refuse a calibration whose rays miss each other, and name the factor if the projector's scale is to blame.

    A wrong scale of the projector's pixels bends all rays of light, so that they miss the camera's. How far, as a
    median over the image and in pixels of the code, is a sharp minimum at the right scale.

    Parameters
    ----------
    camera, projector : Camera
        The projector in pixels of the code.
    camera_xy, code_xy : (k, 2) float64 [px]

    Returns
    -------
    float
        The median miss [code px].

    Raises
    ------
    InputError
        Naming the factor, or, if no scale fits, saying by how much the rays miss.
    """
    some = slice(None, None, max(1, len(camera_xy) // SAMPLE))
    seen, lit = camera_xy[some], code_xy[some]
    here = _median_miss(camera, projector, seen, lit)
    if here <= GOOD_PX:
        return here
    around = FACTORS
    for _ in range(2):  # the minimum is narrow: once more between its neighbours
        misses = np.array([_median_miss(camera, coarser(projector, f), seen, lit) for f in around])
        best = float(around[int(np.argmin(misses))])
        around = best * np.linspace(0.98, 1.02, 41)
    if misses.min() <= GOOD_PX and here > MUCH_BETTER * misses.min():
        plain = PLAIN[np.argmin(np.abs(np.log(PLAIN / best)))]
        factor = float(plain) if abs(plain / best - 1) < 0.03 else best
        raise InputError(
            f"the projector's calibration does not fit the code: rays miss each other by {here:.1f} pixels, but by "
            f"{misses.min():.1f} if its pixels are taken to be {factor:.3g} times as fine as those of the code; if its "
            f"resolution was that much higher, say --projector-scale {factor:.3g}"
        )
    raise InputError(
        f"camera and projector do not fit the code: rays miss each other by {here:.1f} pixels (below {GOOD_PX:g} is "
        f"wanted), and no other scale of the projector helps; did one of them move after it was calibrated, or are the "
        f"images of another set?"
    )


def _median_miss(camera: Camera, projector: Camera, camera_xy: Floats, code_xy: Floats) -> float:
    points, misses = points_and_misses(camera, projector, camera_xy, code_xy)
    met = np.isfinite(points[:, 2]) & np.isfinite(misses)
    return float(np.median(misses[met])) if met.mean() > 0.5 else np.inf
