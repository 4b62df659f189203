"""Rays through pixels, and where they meet a plane of light.

A projector is a camera in reverse: both are `Camera`s, and their pixels have rays alike.
"""

from __future__ import annotations

import cv2
import numpy as np
from numba import njit

from planish.geometry.projection import camera_position
from planish.parallel import thread_pool
from planish.types import Camera, Floats

TOLERANCE_PX = 1e-8
"""Reprojection error at which the undistortion of a ray has converged."""

MAX_CORRECTIONS = 20
"""Two are enough for a usual lens; where the distortion folds over, far outside of the photo, none converges."""

MAX_ITERATIONS = 60
"""Each reduces the error of a usual lens tenfold."""


def rays(camera: Camera, xy: Floats) -> tuple[Floats, Floats]:
    """Find the rays on which the points lie that a camera sees at given pixels.

    Parameters
    ----------
    camera : Camera
        Or a projector.
    xy : (k, 2) float64 [px]
        x right, y down, pixel centres at integers; lens distortion is removed. Rows with NaN give NaN.

    Returns
    -------
    directions : (k, 3) float64
        Of length 1, in the world, away from the camera.
    eye : (3,) float64 [mm]
        Where they begin.

    Examples
    --------
    >>> camera = Camera(np.diag([500.0, 500, 1]), np.eye(3), np.array([0.0, 0, 100]), (480, 640))
    >>> directions, eye = rays(camera, np.array([[0.0, 0], [500, 0]]))
    >>> directions.round(3).tolist(), (eye + 0).tolist()
    ([[0.0, 0.0, 1.0], [0.707, 0.0, 0.707]], [0.0, 0.0, -100.0])
    """
    xy = np.ascontiguousarray(xy, np.float64).reshape(-1, 2)
    seen = np.column_stack([_undistorted(camera, xy), np.ones(len(xy))])
    seen /= np.linalg.norm(seen, axis=1, keepdims=True)
    return seen @ camera.rotation, camera_position(camera)


def _undistorted(camera: Camera, xy: Floats) -> Floats:
    """Places in the plane at distance 1 before the camera, (k, 2)."""
    m = camera.matrix
    y = (xy[:, 1] - m[1, 2]) / m[1, 1]
    flat = np.column_stack([(xy[:, 0] - m[0, 2] - m[0, 1] * y) / m[0, 0], y])
    known = np.isfinite(xy).all(axis=1)
    if not np.any(camera.distortion) or not known.any():
        return flat
    if not np.any(camera.distortion[5:]):
        lens = np.zeros(5)
        lens[: min(5, len(camera.distortion))] = camera.distortion[:5]
        with thread_pool() as parallel_for:
            parallel_for(_undistort, len(flat), lens, TOLERANCE_PX / m[0, 0], flat)
        return flat
    target = xy[known]
    place = np.asarray(cv2.undistortPoints(target[:, None], m, camera.distortion), np.float64).reshape(-1, 2)
    for _ in range(MAX_CORRECTIONS):  # OpenCV stops early in some versions; this ends where its projection agrees
        miss = target - _distorted(camera, place)
        if np.abs(miss).max() < TOLERANCE_PX:
            break
        place += miss / [m[0, 0], m[1, 1]]
    flat[known] = place
    return flat


@njit(cache=True, nogil=True)
def _undistort(first, last, lens, close, place):  # type: ignore[no-untyped-def]
    """Solve x_d = x radial + tangential for x, in place: x <- (x_d - tangential) / radial until it stays."""
    k1, k2, p1, p2, k3 = lens
    for i in range(first, last):
        x_d, y_d = place[i, 0], place[i, 1]
        x, y = x_d, y_d
        for _ in range(MAX_ITERATIONS):
            r2 = x * x + y * y
            radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
            x_new = (x_d - 2.0 * p1 * x * y - p2 * (r2 + 2.0 * x * x)) / radial
            y_new = (y_d - p1 * (r2 + 2.0 * y * y) - 2.0 * p2 * x * y) / radial
            moved = abs(x_new - x) + abs(y_new - y)
            x, y = x_new, y_new
            if not moved > 0.1 * close:
                break
        place[i, 0], place[i, 1] = x, y


def _distorted(camera: Camera, place: Floats) -> Floats:
    still = np.zeros(3)
    space = np.column_stack([place, np.ones(len(place))])
    xy, _ = cv2.projectPoints(space, still, still, camera.matrix, camera.distortion)
    return np.asarray(xy, np.float64).reshape(-1, 2)


def meet_plane(origin: Floats, directions: Floats, plane: Floats) -> Floats:
    """Find where rays meet a plane a x + b y + c z + d = 0.

    Parameters
    ----------
    origin : (3,) float64 [mm]
        Where all rays begin.
    directions : (k, 3) float64
    plane : (4,) or (k, 4) float64
        a b c d: one plane for all, or one for each ray.

    Returns
    -------
    (k, 3) float64 [mm]
        NaN where a ray does not meet its plane, or only behind its beginning.

    Examples
    --------
    >>> meet_plane(np.zeros(3), np.array([[0.0, 0, 1], [0.6, 0, 0.8], [1, 0, 0]]), np.array([0.0, 0, 1, -40]))
    array([[ 0.,  0., 40.],
           [30.,  0., 40.],
           [nan, nan, nan]])
    """
    plane = np.atleast_2d(plane)
    against = (directions * plane[:, :3]).sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        far = -(plane[:, :3] @ origin + plane[:, 3]) / against
    far[~(far > 0) | ~np.isfinite(far)] = np.nan
    return np.asarray(origin + far[:, None] * directions)
