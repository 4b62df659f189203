"""Images of a restoration: shaded relief of the scan, and montages."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from planish.geometry.guards import TINY_MM, normalize
from planish.mesh import point_normals, rasterize
from planish.report.drawing import rgb_uint8
from planish.types import Bools, Floats, Ints, Pixels

BACKGROUND = np.array([250, 250, 248], np.uint8)
GROUND = np.array([225, 225, 222], np.uint8)
PAPER = np.array([206, 200, 188])
BACK = np.array([150, 120, 105])
LIGHT = np.array([-0.45, 0.5, 0.74])


def relief(points: Floats, faces: Ints, *, height: int = 900, tilt: float = 50.0) -> Pixels:
    """Render a mesh as a shaded surface, seen obliquely from above.

    Parameters
    ----------
    points : (n, 3) float64 [mm]
        z up, y away from the viewer.
    faces : (m, 3) int32
    height : int
        Rows of the picture; its columns follow from the shape of what is seen.
    tilt : float
        Degrees from straight above (0) towards the front (90).

    Returns
    -------
    (rows, cols, 3) uint8
    """
    t = np.radians(tilt)
    right, up = points[:, 0], points[:, 1] * np.cos(t) + points[:, 2] * np.sin(t)
    towards = -points[:, 1] * np.sin(t) + points[:, 2] * np.cos(t)
    scale = 0.9 * height / max(np.ptp(up), 0.6 * np.ptp(right), TINY_MM)
    width = int(np.ceil(np.ptp(right) * scale / 0.9))
    xy = np.c_[right - (right.max() + right.min()) / 2, (up.max() + up.min()) / 2 - up] * scale
    xy += np.array([width / 2, height / 2])
    face, w = rasterize(xy, faces, (height, width), nearness=towards)
    picture = np.tile(BACKGROUND, (height, width, 1))
    seen = face >= 0
    normals = point_normals(points, faces)
    corners, b = faces[face[seen]], w[seen]
    weights = np.c_[1 - b.sum(axis=1), b]
    normal = np.einsum("pk,pkd->pd", weights, normals[corners])
    normal = normalize(normal)
    front = normal @ [0, -np.sin(t), np.cos(t)] > 0
    light = normalize(LIGHT)
    shade = 0.35 + 0.75 * np.abs(normal @ light)[:, None]
    picture[seen] = np.clip(np.where(front[:, None], PAPER, BACK) * shade, 0, 255).astype(np.uint8)
    return picture


def side_by_side(pictures: Sequence[Pixels | Bools], *, columns: int = 6, height: int = 900, gap: int = 24) -> Pixels:
    """Scale pictures to one height and arrange them in rows on a light background.

    Parameters
    ----------
    pictures : sequence of (rows, cols) or (rows, cols, 3), uint8, uint16 or bool
    columns : int
        Pictures in a row.
    height : int
        Of every picture, in pixels.
    gap : int
        Pixels around and between.
    """
    small = [_of_height(rgb_uint8(picture), height) for picture in pictures]
    rows = [small[k : k + columns] for k in range(0, len(small), columns)]
    widths = [sum(p.shape[1] + gap for p in row) + gap for row in rows]
    sheet = np.full((len(rows) * (height + gap) + gap, max(widths), 3), GROUND, np.uint8)
    for k, (row, width) in enumerate(zip(rows, widths, strict=True)):
        top, left = gap + k * (height + gap), gap + (max(widths) - width) // 2
        for picture in row:
            sheet[top : top + height, left : left + picture.shape[1]] = picture
            left += picture.shape[1] + gap
    return sheet


def _of_height(picture: NDArray[np.uint8], height: int) -> NDArray[np.uint8]:
    import cv2

    rows, cols = picture.shape[:2]
    size = (max(1, round(cols * height / rows)), height)
    return np.asarray(
        cv2.resize(picture, size, interpolation=cv2.INTER_AREA if rows > height else cv2.INTER_CUBIC), np.uint8
    )
