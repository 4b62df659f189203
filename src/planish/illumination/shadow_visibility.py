"""Shadows that the sheet casts on itself."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from planish.geometry.axes import perpendicular_axes
from planish.mesh import rasterize
from planish.parallel import thread_pool
from planish.types import Floats, Mesh

SIDE_PX = 800
"""Of the square picture of the sheet as the lamp sees it."""
SLACK_MM = 1.0
"""What lies this much farther from the lamp than what the lamp sees is in shadow; more on slopes."""


def shadow_visibility(mesh: Mesh, lamp: Floats, points: Floats, normals: Floats) -> Floats:
    """Share of the lamp that each point of the sheet sees.

    The sheet is drawn as the lamp sees it, and each point is compared with what was drawn in nine pixels around it
    (a shadow map: Williams 1978; Reeves et al. 1987).

    Parameters
    ----------
    mesh : Mesh
        What may stand in the way.
    lamp : (3,) float64 [mm]
    points, normals : (..., 3) float64

    Returns
    -------
    (...) float64
        1 in full light, 0 in shadow, between at a shadow's edge.
    """
    view = _view(mesh.points.mean(axis=0) - lamp)
    corner = (mesh.points - lamp) @ view.T
    if corner[:, 2].min() <= 0:
        return np.ones(points.shape[:-1])
    flat = corner[:, :2] / corner[:, 2:]
    low, scale = flat.min(axis=0), (SIDE_PX - 3) / np.ptp(flat, axis=0).max()
    pixel_xy = (flat - low) * scale + 1
    near = 1 / corner[:, 2]
    face, w = rasterize(pixel_xy, mesh.faces, (SIDE_PX, SIDE_PX), nearness=near, perspective=True)
    depth = corner[:, 2][mesh.faces[np.maximum(face, 0)]]
    drawn = depth[..., 0] + w[..., 0] * (depth[..., 1] - depth[..., 0]) + w[..., 1] * (depth[..., 2] - depth[..., 0])
    drawn[face < 0] = np.inf
    share = np.empty(points.shape[:-1])
    rows = np.ascontiguousarray(points.reshape(-1, 3)), np.ascontiguousarray(normals.reshape(-1, 3))
    with thread_pool() as parallel_for:
        parallel_for(_compare, share.size, drawn, *rows, lamp, view, low, scale, share.reshape(-1))
    return share


@njit(cache=True, nogil=True, error_model="numpy")
def _compare(  # type: ignore[no-untyped-def]
    first, last, drawn, points, normals, lamp, view, low, scale, share
):
    """Share of nine pixels around each point (in the lamp's view) that show nothing nearer than the point."""
    seen = np.empty(3)
    for i in range(first, last):
        facing = 0.0
        for k in range(3):
            seen[k] = 0.0
            for m in range(3):
                seen[k] += view[k, m] * (points[i, m] - lamp[m])
            facing += normals[i, k] * (points[i, k] - lamp[k])
        depth = seen[2]
        if not depth > 0:  # behind the lamp, or no point at all
            share[i] = 1.0
            continue
        col = int(min(max(round((seen[0] / depth - low[0]) * scale + 1), 1), SIDE_PX - 2))
        row = int(min(max(round((seen[1] / depth - low[1]) * scale + 1), 1), SIDE_PX - 2))
        facing = min(abs(facing) / math.sqrt(seen[0] ** 2 + seen[1] ** 2 + depth**2), 1.0)
        # a slope crosses this much depth within the pixels that are compared
        slack = SLACK_MM + 2 * depth / scale * math.sqrt(1 - facing**2) / max(facing, 0.1)
        free = 0
        for r in range(row - 1, row + 2):
            for q in range(col - 1, col + 2):
                free += drawn[r, q] > depth - slack
        share[i] = free / 9


def _view(forward: Floats) -> Floats:
    """Rotation whose third row looks forward."""
    along = forward / np.linalg.norm(forward)
    return np.asarray(np.concatenate([perpendicular_axes(along), along[None]]))
