"""Which faces of the sheet the photo saw, and which hid behind others or turned their back."""

from __future__ import annotations

import numpy as np

from planish.mesh import depths, rasterise
from planish.render.camera import resect
from planish.render.chart import Chart
from planish.types import Bools, Camera, Floats

BUFFER_MM = 0.5
"""Size on the page of the depth buffer's pixels."""
SAME_PLACE_MM = 1.0
"""What lies in front counts as the same part of the sheet this near on the page (and two buffer pixels more)."""


def seen_faces(chart: Chart, camera: Camera | None) -> Bools:
    """Tell which faces show their printed side to the camera with nothing in front of them.

    A face has its back to the camera where page and photo run round it in opposite senses. It is hidden where the
    foremost face at its place of the photo belongs to another part of the page. Without a camera the depths come from
    one fitted to the photo places; where none fits (an atlas of patches), nothing is taken to be hidden.

    Returns
    -------
    (m,) bool
    """
    turn = np.linalg.det(chart.jacobian)[chart.faces].mean(axis=1)
    facing = turn > 0
    nearness = _nearness(chart, camera)
    if nearness is None or not facing.any():
        return np.asarray(facing)
    px_per_mm = float(np.sqrt(np.median(turn[facing])))
    scale = 1 / max(1.0, px_per_mm * BUFFER_MM)
    origin = chart.photo_xy.min(axis=0)
    buffer_xy = (chart.photo_xy - origin) * scale
    cols, rows = (int(n) + 2 for n in buffer_xy.max(axis=0))
    front, _ = rasterise(buffer_xy, chart.faces, (rows, cols), nearness=nearness)

    place = chart.page_xy[chart.faces].mean(axis=1)
    x, y = np.rint(buffer_xy[chart.faces].mean(axis=1)).astype(int).T
    before = front[y, x]
    apart = np.linalg.norm(place[before] - place, axis=1)
    fewest = least_singular(chart.jacobian)[chart.faces].mean(axis=1)  # photo px per mm where they are fewest
    pixel_mm = 1 / (scale * np.maximum(fewest, 0.05 * px_per_mm))
    return np.asarray(facing & ((before < 0) | (apart <= SAME_PLACE_MM + 2 * pixel_mm)))


def _nearness(chart: Chart, camera: Camera | None) -> Floats | None:
    """1 / depth of every point, or None where no camera can be found."""
    if camera is not None:
        return np.asarray(1 / np.maximum(depths(camera, chart.points), 1e-9))
    matrix = resect(chart.points, chart.photo_xy)
    if matrix is None:
        return None
    return np.asarray(1 / (chart.points @ matrix[2, :3] + matrix[2, 3]))


def least_singular(jacobian: Floats) -> Floats:
    """The smaller singular value of each of (n, 2, 2) matrices."""
    square = (jacobian**2).sum(axis=(1, 2))
    product = np.abs(np.linalg.det(jacobian))
    return np.asarray(np.sqrt(np.maximum(square / 2 - np.sqrt(np.maximum(square**2 / 4 - product**2, 0)), 0)))
