"""Triangulation between a calibrated camera and projector, and a consistency check of the calibration."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from planish.errors import InputError
from planish.geometry.triangulation import rays
from planish.types import Camera, Floats

SAMPLE = 1000
"""Number of pixel pairs in the consistency check."""

FACTORS = np.exp(np.linspace(np.log(1 / 8), np.log(8), 209))
"""Scale factors of the projector that are tried: steps of 2 %."""

MAX_GAP_PX = 2.5
"""Largest median epipolar error of a usable calibration [code px]."""

USUAL_GAP_PX = 0.7
"""Largest median epipolar error of a good calibration [code px]."""

SCALE_GAIN = 3.0
"""Least improvement of the error by which another scale is blamed."""

MIN_SCALE_CHANGE = 0.04
"""Least deviation of the factor from 1: small rotations of a projector look alike below it."""

FLATNESS_GAIN = 0.5
"""Ratio of flatness that a scale of columns or rows alone, or a scale at a small error, must reach."""

FLAT_SHARE, PLANES = 0.3, 300
"""Share of the view assumed to be one plane, such as a board, wall or table, and number of planes tried."""

COMMON_FACTORS = np.array([1 / 8, 1 / 6, 1 / 5, 1 / 4, 1 / 3, 1 / 2, 2 / 3, 3 / 4, 4 / 3, 3 / 2, 2, 3, 4, 5, 6, 8])
"""Common ratios of resolutions; a factor within 2 % of one is reported as such."""


SCALED = {"pixels": np.array([1.0, 1.0]), "columns": np.array([1.0, 0.0]), "rows": np.array([0.0, 1.0])}
"""Axes of the projector that may be scaled: exponents of the factor for columns and rows."""


def triangulate_pairs(
    camera: Camera, projector: Camera, camera_xy: Floats, projector_xy: Floats
) -> tuple[Floats, Floats]:
    """Triangulate corresponding camera and projector pixels.

    The point on each camera ray with the least reprojection error in the projector: with q = q0 + t q1 the ray in the
    projector's frame and (a, b) the normalised projector pixel, t is the least-squares solution of q_x - a q_z = 0 and
    q_y - b q_z = 0.

    Parameters
    ----------
    camera, projector : Camera
        In one frame.
    camera_xy, projector_xy : (k, 2) float64 [px]

    Returns
    -------
    points : (k, 3) float64 [mm]
        NaN where rays do not meet in front of both.
    errors_px : (k,) float64 [projector px]
        Reprojection error of the point in the projector: its distance from the epipolar line.
    """
    directions, eye = rays(camera, camera_xy)
    light_rays, lamp_centre = rays(projector, projector_xy)
    seen = light_rays @ projector.rotation.T
    undistorted = seen[:, :2] / seen[:, 2:]  # NaN outside of the invertible range of the distortion
    start = projector.rotation @ (eye - lamp_centre)
    ray_directions = directions @ projector.rotation.T
    slope = ray_directions[:, :2] - undistorted * ray_directions[:, 2:]
    offset = start[:2] - undistorted * start[2]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = -(slope * offset).sum(axis=1) / (slope**2).sum(axis=1)
        far = start[2] + t * ray_directions[:, 2]
        across = slope[:, 0] * offset[:, 1] - slope[:, 1] * offset[:, 0]
        error = np.abs(across) / np.linalg.norm(slope, axis=1) / np.abs(far)
    t[~(t > 0) | ~(far > 0)] = np.nan
    focal = np.sqrt(projector.matrix[0, 0] * projector.matrix[1, 1])
    return eye + t[:, None] * directions, np.asarray(error * focal)


def projector_of_code(projector: Camera, factor: float) -> Camera:
    """The projector with pixels `factor` times as large: those of a code of lower resolution."""
    return _scaled(projector, factor, factor)


def _scaled(projector: Camera, across: float, down: float) -> Camera:
    matrix = projector.matrix.copy()
    matrix[:2] /= np.array([[across], [down]])
    matrix[:2, 2] += (1 / np.array([across, down]) - 1) / 2  # pixel centres lie at integers
    rows, cols = (max(1, round(n / f)) for n, f in zip(projector.shape_rc, (down, across), strict=True))
    return replace(projector, matrix=matrix, shape_rc=(rows, cols))


def check_fit(camera: Camera, projector: Camera, camera_xy: Floats, code_xy: Floats) -> float:
    """Refuse a calibration with large epipolar errors, and report the factor if the projector's scale is wrong.

    A wrong pixel scale deflects the projector's rays, so the median epipolar error has a sharp minimum at the right
    scale. The minimum is weak for the rows' scale if the projector is above the camera, and for the columns' if it is
    beside it; then the flatness of the flattest part of the view decides as well. With parallel optical axes neither
    detects the error, and only a known size would.

    Parameters
    ----------
    camera, projector : Camera
        Projector in code pixels.
    camera_xy, code_xy : (k, 2) float64 [px]
        From the whole view: surroundings of the sheet are often flat.

    Returns
    -------
    float
        Median epipolar error [code px].

    Raises
    ------
    InputError
        With the factor, or with the error if no scale fits.
    """
    some = slice(None, None, max(1, len(camera_xy) // SAMPLE))
    seen, lit = camera_xy[some], code_xy[some]
    error_px = _median_error_px(camera, projector, seen, lit)
    if error_px <= USUAL_GAP_PX:
        return error_px
    for name, axes in SCALED.items():
        best, scaled_error = _best_scale(camera, projector, seen, lit, axes)
        if scaled_error > MAX_GAP_PX or error_px < SCALE_GAIN * scaled_error or abs(best - 1) < MIN_SCALE_CHANGE:
            continue
        flatness, flatness_scaled = (
            _flatness_mm(camera, p, seen, lit) for p in (projector, _scaled(projector, *best**axes))
        )
        if not flatness_scaled < FLATNESS_GAIN * flatness and (error_px <= MAX_GAP_PX or not axes.all()):
            continue
        common = COMMON_FACTORS[np.argmin(np.abs(np.log(COMMON_FACTORS / best)))]
        factor = float(common) if abs(common / best - 1) < 0.03 else best
        remedy = (
            f"give {{projector_scale={factor:.3g}}} if its resolution was that much higher"
            if axes.all()
            else "show the patterns at the resolution that the projector was calibrated at, not stretched"
        )
        planes = (
            f", and the flattest part of the view is {flatness_scaled:.2g} mm off a plane instead of {flatness:.2g}"
        )
        raise InputError(
            f"the projector's calibration does not fit the code: the rays' median error is {error_px:.1f} pixels, but "
            f"{scaled_error:.1f} if its {name} are taken to be {factor:.3g} times as fine as those of the code"
            f"{planes if flatness_scaled < flatness else ''}",
            remedy,
        )
    if error_px <= MAX_GAP_PX:
        return error_px
    raise InputError(
        f"camera and projector do not fit the code: the rays' median error is {error_px:.1f} pixels (below "
        f"{MAX_GAP_PX:g} is wanted), and no other scale of the projector helps; did one of them move after it was "
        "calibrated, or is this the calibration of another camera or projector?"
    )


def _best_scale(
    camera: Camera, projector: Camera, camera_xy: Floats, code_xy: Floats, axes: Floats
) -> tuple[float, float]:
    """Scale factor of columns, rows or both with the least median error, and that error."""
    around, best = FACTORS, 1.0
    for _ in range(2):  # refined once: the minimum is narrow
        errors_px = [_median_error_px(camera, _scaled(projector, *f**axes), camera_xy, code_xy) for f in around]
        best = float(around[int(np.argmin(errors_px))])
        around = best * np.linspace(0.98, 1.02, 41)
    return best, float(min(errors_px))


def _flatness_mm(camera: Camera, projector: Camera, camera_xy: Floats, code_xy: Floats) -> float:
    """Largest distance [mm] of the flattest FLAT_SHARE of the view from one plane.

    Minimum over many planes through three points each (least quantile of absolute distances).
    """
    points, _ = triangulate_pairs(camera, projector, camera_xy, code_xy)
    points = points[np.isfinite(points).all(axis=1)]
    a, b, c = points[np.random.default_rng(0).integers(len(points), size=(3, PLANES))]
    normal = np.cross(b - a, c - a)
    size = np.linalg.norm(normal, axis=1)
    normal = normal[size > 0] / size[size > 0, None]  # skips duplicate draws
    distance = np.abs(points @ normal.T - (a[size > 0] * normal).sum(axis=1))
    return float(np.quantile(distance, FLAT_SHARE, axis=0).min())


def _median_error_px(camera: Camera, projector: Camera, camera_xy: Floats, code_xy: Floats) -> float:
    points, errors_px = triangulate_pairs(camera, projector, camera_xy, code_xy)
    met = np.isfinite(points[:, 2]) & np.isfinite(errors_px)
    return float(np.median(errors_px[met])) if met.mean() > 0.5 else np.inf
