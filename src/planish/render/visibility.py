"""Visibility: the faces of the sheet that a photo sees, neither back-facing nor occluded."""

from __future__ import annotations

import numpy as np
from numba import njit

from planish.geometry import depths
from planish.geometry.guards import TINY_MM
from planish.geometry.resection import resect
from planish.parallel import thread_pool
from planish.render.rasterize_ids import rasterize_ids
from planish.render.uv_map import UVMap
from planish.types import Bools, Camera, Floats

BUFFER_MM = 0.5
"""Size on the page of the depth buffer's pixels."""
SAME_PLACE_MM = 1.0
"""What lies in front counts as the same part of the sheet this near on the page (and two buffer pixels more)."""


def visible_faces(uv_map: UVMap, camera: Camera | None) -> Bools:
    """Find the faces that show their printed side to the camera with nothing in front of them.

    A face has its back to the camera where page and photo run round it in opposite senses. It is hidden where the
    foremost face at its place of the photo belongs to another part of the page. Without a camera the depths come from
    one fitted to the photo places; where none fits (an atlas of patches, several textures), nothing is taken to be
    hidden.

    Returns
    -------
    (m,) bool
    """
    turn, fewest = determinants(uv_map.jacobian), least_singular(uv_map.jacobian)
    facing = _mean_of_corners(turn, uv_map.faces) > 0
    nearness = _nearness(uv_map, camera)
    if nearness is None or not facing.any():
        return np.asarray(facing)
    px_per_mm = float(np.sqrt(np.median(turn[turn > 0])))
    scale = 1 / (px_per_mm * BUFFER_MM)
    buffer_xy = (uv_map.photo_xy - uv_map.photo_xy.min(axis=0)) * scale
    cols, rows = (int(n) + 2 for n in buffer_xy.max(axis=0))
    front = rasterize_ids(buffer_xy, uv_map.faces, (rows, cols), nearness=_mean_of_corners(nearness, uv_map.faces))
    pixel_mm = 1 / (scale * np.maximum(fewest, 0.05 * px_per_mm))
    seen = np.zeros(len(facing), np.bool_)
    with thread_pool() as parallel_for:
        parallel_for(_in_front, len(seen), uv_map.faces, uv_map.page_xy, buffer_xy, pixel_mm, facing, front, seen)
    return seen


def _nearness(uv_map: UVMap, camera: Camera | None) -> Floats | None:
    """1 / depth of every point, or None where no camera can be found."""
    if camera is not None:
        return np.asarray(1 / np.maximum(depths(camera, uv_map.points), TINY_MM))
    if uv_map.image is not None:
        return None
    matrix = resect(uv_map.points, uv_map.photo_xy)
    if matrix is None:
        return None
    return np.asarray(1 / (uv_map.points @ matrix[2, :3] + matrix[2, 3]))


@njit(cache=True, nogil=True)
def _in_front(begin, end, faces, page, buffer_xy, pixel_mm, facing, front, seen):  # type: ignore[no-untyped-def]
    """Mark the faces that are foremost at their middle, or whose foremost lies beside them on the page."""
    for f in range(begin, end):
        a, b, c = faces[f]
        x = (buffer_xy[a, 0] + buffer_xy[b, 0] + buffer_xy[c, 0]) / 3
        y = (buffer_xy[a, 1] + buffer_xy[b, 1] + buffer_xy[c, 1]) / 3
        first = front[int(y + 0.5), int(x + 0.5)]
        apart = 0.0
        for k in range(2):
            here = page[a, k] + page[b, k] + page[c, k]
            apart += ((page[faces[first, 0], k] + page[faces[first, 1], k] + page[faces[first, 2], k] - here) / 3) ** 2
        same = SAME_PLACE_MM + 2 / 3 * (pixel_mm[a] + pixel_mm[b] + pixel_mm[c])
        seen[f] = facing[f] and (first < 0 or apart <= same**2)


@njit(cache=True)
def _mean_of_corners(values, faces):  # type: ignore[no-untyped-def]
    found = np.empty(len(faces))
    for f in range(len(faces)):
        found[f] = (values[faces[f, 0]] + values[faces[f, 1]] + values[faces[f, 2]]) / 3
    return found


def determinants(jacobian: Floats) -> Floats:
    """Of each of (n, 2, 2) matrices."""
    return np.asarray(jacobian[:, 0, 0] * jacobian[:, 1, 1] - jacobian[:, 0, 1] * jacobian[:, 1, 0])


def least_singular(jacobian: Floats) -> Floats:
    """The smaller singular value of each of (n, 2, 2) matrices."""
    half = 0.5 * np.einsum("nij,nij->n", jacobian, jacobian)
    return np.asarray(np.sqrt(np.maximum(half - np.sqrt(np.maximum(half**2 - determinants(jacobian) ** 2, 0)), 0)))
