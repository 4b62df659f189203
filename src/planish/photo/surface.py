"""Convert a fitted sheet to a scan: mesh, photo and camera."""

from __future__ import annotations

import numpy as np

from planish.photo.cylinder import Cylinder, page_to_space, space_to_photo
from planish.photo.residual_warp import PageWarp, grid
from planish.types import Camera, Floats, Ints, Mesh, Pixels, Scan

POINTS_ACROSS = 72
"""Mesh points along the page's longer side; rendering interpolates smoothly between them."""
UP = np.array([1.0, -1.0, -1.0])
"""From the sheet's frame (y down, z away) to a scan's (y up, z towards the viewer)."""

CLOCKWISE = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""A quarter turn of a scan."""


def make_scan(
    cylinder: Cylinder,
    warp: PageWarp,
    photo: Pixels,
    mm_per_unit: float,
    icc: bytes | None = None,
    upright: float = 0.0,
    *,
    columns: bool = False,
) -> Scan:
    """Make a scan of a fitted sheet: points on the cylinder, text lines along x, and their photo positions.

    Parameters
    ----------
    cylinder : Cylinder
    warp : PageWarp
        Its corners are the corners of the page.
    photo : (rows, cols, 3) uint8 or uint16
    mm_per_unit : float
        The camera distance.
    icc : bytes, optional
        The photo's colour profile.
    upright : float
        Confidence that the page is not upside down [standard deviations].
    columns : bool
        Whether the text lines are columns, and run down the page instead, the first one at the right.
    """
    page, (rows, cols) = grid(warp.low, warp.high, float((warp.high - warp.low).max()) / POINTS_ACROSS)
    photo_xy = space_to_photo(cylinder, page_to_space(cylinder, warp.inverse(page)))
    to_text_frame = np.eye(3)
    to_text_frame[:2, :2] = cylinder.text_axes()
    turn = CLOCKWISE if columns else np.eye(3)
    points = page_to_space(cylinder, page) @ to_text_frame.T * UP @ turn.T * mm_per_unit
    matrix = np.array([[cylinder.focal, 0, cylinder.centre[0]], [0, cylinder.focal, cylinder.centre[1]], [0, 0, 1]])
    rotation = cylinder.rotation @ to_text_frame.T * UP @ turn.T
    camera = Camera(matrix, rotation, mm_per_unit * cylinder.rotation[:, 2], photo.shape[:2])
    return Scan(Mesh.owned(points, _faces(rows, cols)), photo, photo_xy, camera, icc, upright=upright)


def page_rim(cylinder: Cylinder, warp: PageWarp) -> Floats:
    """Positions along the page's rim, clockwise from its first corner, on the photo: (n, 2) [photo px]."""
    share = np.linspace(0, 1, POINTS_ACROSS, endpoint=False)
    zero, one = np.zeros_like(share), np.ones_like(share)
    around = np.concatenate([np.c_[share, zero], np.c_[one, share], np.c_[1 - share, one], np.c_[zero, 1 - share]])
    page = warp.low + around * (warp.high - warp.low)
    return space_to_photo(cylinder, page_to_space(cylinder, warp.inverse(page)))


def cell_centres(shape_rc: tuple[int, int], low: Floats, high: Floats) -> Floats:
    """Centres of rows x cols cells of a page: (rows * cols, 2)."""
    y, x = ((np.arange(n) + 0.5) / n for n in shape_rc)
    along, across = low[0] + x * (high[0] - low[0]), low[1] + y * (high[1] - low[1])
    return np.stack(np.meshgrid(along, across), axis=-1).reshape(-1, 2)


def _faces(rows: int, cols: int) -> Ints:
    """Two triangles per cell, counter-clockwise seen from the printed side."""
    at = np.arange(rows * cols, dtype=np.int32).reshape(rows, cols)
    a, b, c, d = at[:-1, :-1].ravel(), at[:-1, 1:].ravel(), at[1:, :-1].ravel(), at[1:, 1:].ravel()
    return np.concatenate([np.stack([a, c, b], axis=1), np.stack([c, d, b], axis=1)])
