"""Preview image of a scan: shaded relief, textured surface, and confidence map."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from planish.acquire.grid_mesh import AcquiredScan
from planish.color import to_uint8
from planish.geometry.guards import TINY, TINY_MM
from planish.mesh import onto_support_plane, point_normals, rasterize
from planish.types import Bools, Floats, Mesh, Pixels

ROWS, GAP = 900, 24
TILT_DEG = 40.0
"""View angle from the vertical towards the front."""

GROUND = np.array([246, 246, 243], np.uint8)
PAPER = np.array([214, 208, 196], np.float64)
LIGHT = np.array([-0.5, 0.35, 0.79])


def preview(acquired: AcquiredScan) -> NDArray[np.uint8]:
    """Render a scan from the front and above: shaded, textured with its photo, and confidence (dark 0, light 1).

    Parameters
    ----------
    acquired : Acquired
        Its scan has `photo_xy` for every point; without a photo there are two panels.

    Returns
    -------
    (rows, cols, 3) uint8
    """
    scan = acquired.scan
    assert scan.photo_xy is not None
    points = _orient_top(scan.photo_xy, onto_support_plane(scan.mesh)[0])
    shade = 0.35 + 0.75 * np.abs(point_normals(points, scan.mesh.faces) @ LIGHT)
    values = np.column_stack([shade, acquired.confidence, scan.photo_xy])
    seen, rendered = _render(Mesh.owned(points, scan.mesh.faces), values)
    panels = [_shading(rendered[..., 0]), _confidence_colours(rendered[..., 1])]
    if scan.photo is not None:
        panels.insert(1, _textured(scan.photo, rendered[..., 2:]))
    margin = np.tile(GROUND, (ROWS, GAP, 1))
    whole = [margin]
    for panel in panels:
        whole += [np.where(seen[..., None], panel, GROUND), margin]
    return np.hstack(whole)


def _orient_top(photo_xy: Floats, points: Floats) -> Floats:
    """Rotate the sheet on its support plane so that the photo's top points away from the viewer."""
    position = points[:, :2] - points[:, :2].mean(axis=0)
    down = position.T @ (photo_xy[:, 1] - photo_xy[:, 1].mean())
    x, y = -down / max(float(np.linalg.norm(down)), TINY)
    return np.column_stack([position @ np.array([[y, x], [-x, y]]), points[:, 2]])


def _render(mesh: Mesh, values: Floats) -> tuple[Bools, Floats]:
    """Render a mesh: visibility mask and interpolated values (n, k) as an image (rows, cols, k)."""
    t = np.radians(TILT_DEG)
    right, up = mesh.points[:, 0], mesh.points[:, 1] * np.cos(t) + mesh.points[:, 2] * np.sin(t)
    towards = mesh.points[:, 2] * np.cos(t) - mesh.points[:, 1] * np.sin(t)
    scale = 0.94 * ROWS / max(np.ptp(up), 0.6 * np.ptp(right), TINY_MM)
    cols = int(np.ptp(right) * scale) + GAP
    xy = np.column_stack([right - (right.max() + right.min()) / 2, (up.max() + up.min()) / 2 - up]) * scale
    face, weight = rasterize(xy + [cols / 2, ROWS / 2], mesh.faces, (ROWS, cols), nearness=towards)
    seen = face >= 0
    corners, w = mesh.faces[face[seen]], weight[seen].astype(np.float64)
    shares = np.column_stack([1 - w.sum(axis=1), w])
    rendered = np.zeros((ROWS, cols, values.shape[1]))
    rendered[seen] = np.einsum("pk,pkc->pc", shares, values[corners])
    return seen, rendered


def _shading(shade: Floats) -> NDArray[np.uint8]:
    return np.clip(shade[..., None] * PAPER, 0, 255).astype(np.uint8)


def _confidence_colours(confidence: Floats) -> NDArray[np.uint8]:
    levels = (255 * np.clip(confidence, 0, 1)).astype(np.uint8)
    return np.asarray(cv2.applyColorMap(levels, cv2.COLORMAP_VIRIDIS)[..., ::-1], np.uint8)


def _textured(photo: Pixels, photo_xy: Floats) -> NDArray[np.uint8]:
    """Photo colours at visible pixels, downsampled to about the panel's resolution."""
    small = to_uint8(photo)
    position = np.asarray(photo_xy, np.float32)
    while min(small.shape[:2]) > 2 * ROWS:
        small = cv2.resize(small, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
        position = ((position + 0.5) / 2 - 0.5).astype(np.float32)
    rendered = cv2.remap(np.ascontiguousarray(small), position[..., 0], position[..., 1], cv2.INTER_LINEAR)
    return np.asarray(rendered, np.uint8)
