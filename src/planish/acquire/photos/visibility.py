"""Which nodes of a surface a camera sees."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from planish.geometry import camera_position, depths, project
from planish.mesh import rasterize
from planish.types import Bools, Camera, Floats, Ints

GRAZING = 0.2
"""Cosine of the angle between normal and ray below which a patch is too foreshortened to compare: 78 degrees."""
IN_FRONT = 4.0
"""A node is hidden by what lies so many spacings in front of it; steep surfaces stand in front of themselves."""


def seen_nodes(points: Floats, normals: Floats, faces: Ints, spacing: float, cameras: Sequence[Camera]) -> Bools:
    """Find the nodes that face each camera with nothing in front of them.

    Parameters
    ----------
    points, normals : (n, 3) float64 [mm]
    faces : (m, 3) int32
    spacing : float [mm]
        Of the nodes.
    cameras : sequence of Camera

    Returns
    -------
    (n, cameras) bool
    """
    return np.stack([_seen(points, normals, faces, spacing, camera) for camera in cameras], axis=1)


def facing_cameras(points: Floats, normals: Floats, cameras: Sequence[Camera]) -> Bools:
    """(n, cameras) whether surfaces with these normals at these points show their front, not at a grazing angle."""
    return np.stack([_facing(points, normals, camera) for camera in cameras], axis=1)


def _facing(points: Floats, normals: Floats, camera: Camera) -> Bools:
    away = camera_position(camera) - points
    return np.asarray((normals * away).sum(axis=1) > GRAZING * np.linalg.norm(away, axis=1))


def _seen(points: Floats, normals: Floats, faces: Ints, spacing: float, camera: Camera) -> Bools:
    facing = _facing(points, normals, camera)
    depth = depths(camera, points)
    photo_xy = project(camera, points) * (np.median(depth) / (camera.matrix[0, 0] * spacing))  # a pixel a spacing
    photo_xy -= photo_xy.min(axis=0)
    cols, rows = (int(side) + 2 for side in photo_xy.max(axis=0))
    nearness = 1 / np.maximum(depth, spacing)
    face, weights = rasterize(photo_xy, faces, (rows, cols), nearness=nearness)
    col, row = np.rint(photo_xy).astype(np.int64).T
    front, share = face[row, col], weights[row, col]
    corners = nearness[faces[front]]
    front_nearness = corners[:, 0] + (share * (corners[:, 1:] - corners[:, :1])).sum(axis=1)
    hidden = (front >= 0) & (1 / front_nearness < depth - IN_FRONT * spacing)
    return np.asarray(facing & ~hidden & (depth > 0))
