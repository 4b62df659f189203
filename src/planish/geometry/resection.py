"""Camera resection: the camera found from points and their places on the photo."""

from __future__ import annotations

import numpy as np

from planish.geometry.guards import TINY
from planish.types import Floats

SAMPLE = 4000
"""Points of a scan that are used."""
MAX_MISFIT = 0.005
"""Rms reprojection error, in parts of the extent of the photo places, up to which one camera explains them."""


def resect(points: Floats, photo_xy: Floats) -> Floats | None:
    """Find the camera that sees given points at given places of the photo, as a matrix.

    The direct linear transform of Hartley and Zisserman (2004, 7.1): the 12 numbers of P in
    (x, y, 1) ~ P (X, Y, Z, 1) are the least singular vector of two linear equations a point.

    Parameters
    ----------
    points : (n, 3) float64 [mm]
    photo_xy : (n, 2) float64 [photo px]

    Returns
    -------
    (3, 4) float64, or None
        Scaled so that the third row gives positive numbers in proportion to depth. None where no camera sees the
        points so, as in an atlas of texture patches. Of points in one plane one of many fitting cameras is returned.
    """
    some = slice(None, None, max(1, len(points) // SAMPLE))
    space, to_space = _normalised(points[some])
    image, to_image = _normalised(photo_xy[some])
    if len(space) < 6:
        return None
    zero = np.zeros_like(space)
    equations = np.concatenate([np.c_[space, zero, -image[:, :1] * space], np.c_[zero, space, -image[:, 1:2] * space]])
    camera = np.linalg.eigh(equations.T @ equations)[1][:, 0].reshape(3, 4)
    camera = np.linalg.inv(to_image) @ camera @ to_space
    depth = points @ camera[2, :3] + camera[2, 3]
    if np.median(depth[some]) < 0:
        camera, depth = -camera, -depth
    if not (depth > 0).all():
        return None
    seen = points[some] @ camera[:2, :3].T + camera[:2, 3]
    misfit = seen / depth[some, None] - photo_xy[some]
    good = np.sqrt((misfit**2).sum(axis=1).mean()) < MAX_MISFIT * np.linalg.norm(np.ptp(photo_xy[some], axis=0))
    return camera if good else None


def _normalised(positions: Floats) -> tuple[Floats, Floats]:
    """Homogeneous positions with mean 0 and unit spread, and the matrix that made them."""
    middle = positions.mean(axis=0)
    scale = 1 / max(float(np.sqrt(((positions - middle) ** 2).mean())), TINY)
    size = positions.shape[1]
    matrix = np.eye(size + 1)
    matrix[:size, :size] *= scale
    matrix[:size, size] = -scale * middle
    return np.c_[positions, np.ones(len(positions))] @ matrix.T, matrix
