"""The sheet that was found, as a scan: mesh, photo and camera."""

from __future__ import annotations

import numpy as np

from planish.photo.cylinder import Cylinder, in_space, on_photo
from planish.photo.free import AnyShift, grid
from planish.types import Camera, Floats, Ints, Mesh, Pixels, Scan

POINTS_ACROSS = 72
"""Of the mesh, over the page's longer side; the drawing bends the faces between them."""
UP = np.array([1.0, -1.0, -1.0])
"""From y down and z away, as in the sheet's frame, to a scan's, y up and z towards the eye."""


def as_scan(
    sheet: Cylinder,
    shift: AnyShift,
    photo: Pixels,
    mm_per_unit: float,
    icc: bytes | None = None,
    upright: float = 0.0,
) -> Scan:
    """Make a scan of a sheet: points on the bent sheet, lines of text along x, and where the photo shows them.

    Parameters
    ----------
    sheet : Cylinder
    shift : AnyShift
        Its corners are the page's.
    photo : (rows, cols, 3) uint8 or uint16
    mm_per_unit : float
        The camera's distance.
    icc : bytes, optional
        The photo's colour profile.
    upright : float
        How sure it is that the page is not upside down [standard deviations].
    """
    true, (rows, cols) = grid(shift.low, shift.high, float((shift.high - shift.low).max()) / POINTS_ACROSS)
    seen = on_photo(sheet, in_space(sheet, shift.undone(true)))
    level = np.eye(3)
    level[:2, :2] = sheet.turned_lines()
    points = in_space(sheet, true) @ level.T * UP * mm_per_unit
    matrix = np.array([[sheet.focal, 0, sheet.centre[0]], [0, sheet.focal, sheet.centre[1]], [0, 0, 1]])
    rotation = sheet.rotation @ level.T * UP
    camera = Camera(matrix, rotation, mm_per_unit * sheet.rotation[:, 2], photo.shape[:2])
    return Scan(Mesh(points, _faces(rows, cols)), photo, seen, camera, icc, upright=upright)


def on_page(shape_rc: tuple[int, int], low: Floats, high: Floats) -> Floats:
    """Middle of each of rows x cols cells of a page: (rows * cols, 2)."""
    y, x = ((np.arange(n) + 0.5) / n for n in shape_rc)
    along, across = low[0] + x * (high[0] - low[0]), low[1] + y * (high[1] - low[1])
    return np.stack(np.meshgrid(along, across), axis=-1).reshape(-1, 2)


def _faces(rows: int, cols: int) -> Ints:
    """Two triangles a cell, counter-clockwise seen from the printed side."""
    at = np.arange(rows * cols, dtype=np.int32).reshape(rows, cols)
    a, b, c, d = at[:-1, :-1].ravel(), at[:-1, 1:].ravel(), at[1:, :-1].ravel(), at[1:, 1:].ravel()
    return np.concatenate([np.stack([a, c, b], axis=1), np.stack([c, d, b], axis=1)])
