"""Cameras: points onto the photo."""

from __future__ import annotations

import numpy as np

from planish.types import Camera, Floats


def project(camera: Camera, points: Floats) -> Floats:
    """Find where points fall on the photo, with the lens's distortion.

    pixel ~ K distort((R p + t) / depth); the distortion is OpenCV's.

    Parameters
    ----------
    camera : Camera
    points : (n, 3) float64 [mm]

    Returns
    -------
    (n, 2) float64 [photo px]
        x right, y down, pixel centres at integers. Points beside the photo get places outside of it; those behind
        the camera are not told apart (see `depths`).

    Examples
    --------
    >>> camera = Camera(np.diag([500.0, 500, 1]), np.eye(3), np.array([0.0, 0, 100]), (480, 640))
    >>> project(camera, np.array([[10.0, -20, 0], [10, -20, 100]]))
    array([[  50., -100.],
           [  25.,  -50.]])
    """
    seen = points @ camera.rotation.T + np.ravel(camera.translation)
    if np.any(camera.distortion) and len(seen):
        import cv2

        still = np.zeros(3)
        xy, _ = cv2.projectPoints(np.ascontiguousarray(seen), still, still, camera.matrix, camera.distortion)
        return np.asarray(xy, np.float64).reshape(-1, 2)
    pixel = seen @ camera.matrix.T
    return np.asarray(pixel[:, :2] / pixel[:, 2:])


def camera_position(camera: Camera) -> Floats:
    """Where a camera stands: (3,) float64 [mm], -R^T t.

    Examples
    --------
    >>> camera_position(Camera(np.eye(3), np.eye(3), np.array([0.0, 0, 100]), (480, 640))).tolist()
    [0.0, 0.0, -100.0]
    """
    return np.asarray(-camera.rotation.T @ np.ravel(camera.translation) + 0.0)


def depths(camera: Camera, points: Floats) -> Floats:
    """Depth of points in front of a camera: (n,) float64 [mm]; negative behind it."""
    return np.asarray(points @ camera.rotation[2] + np.ravel(camera.translation)[2])
