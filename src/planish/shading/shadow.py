"""Shadows that the sheet throws on itself."""

from __future__ import annotations

import numpy as np

from planish.mesh import rasterise
from planish.types import Floats, Mesh

SIDE_PX = 800
"""Of the square picture of the sheet as the lamp sees it."""
SLACK_MM = 1.0
"""What lies this much farther from the lamp than what the lamp sees is in shadow; on slopes more (see `lit`)."""


def lit(mesh: Mesh, lamp: Floats, points: Floats, normals: Floats) -> Floats:
    """Tell which share of the lamp each point of the sheet sees.

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
    face, w = rasterise(pixel_xy, mesh.faces, (SIDE_PX, SIDE_PX), nearness=near, perspective=True)
    depth = corner[:, 2][mesh.faces[np.maximum(face, 0)]]
    drawn = depth[..., 0] + w[..., 0] * (depth[..., 1] - depth[..., 0]) + w[..., 1] * (depth[..., 2] - depth[..., 0])
    drawn[face < 0] = np.inf
    return _compared(drawn, (points - lamp) @ view.T, normals @ view.T, low, scale)


def _compared(drawn: Floats, seen: Floats, normals: Floats, low: Floats, scale: float) -> Floats:
    """Share of nine pixels around each point (in the lamp's view) that show nothing nearer than the point."""
    place = (seen[..., :2] / seen[..., 2:] - low) * scale + 1
    col, row = np.moveaxis(np.clip(np.rint(place), 1, SIDE_PX - 2).astype(int), -1, 0)
    facing = np.abs(np.einsum("...i,...i->...", normals, seen)) / np.linalg.norm(seen, axis=-1)
    pixel_mm = seen[..., 2] / scale
    # a slope crosses this much depth within the pixels that are compared
    slack = SLACK_MM + 2 * pixel_mm * np.sqrt(1 - np.minimum(facing, 1) ** 2) / np.maximum(facing, 0.1)
    free = [drawn[row + r, col + c] > seen[..., 2] - slack for r in (-1, 0, 1) for c in (-1, 0, 1)]
    return np.asarray(np.mean(free, axis=0))


def _view(forward: Floats) -> Floats:
    """Rotation whose third row looks forward."""
    along = forward / np.linalg.norm(forward)
    return np.asarray(np.concatenate([np.linalg.svd(along[None])[2][1:], along[None]]))
