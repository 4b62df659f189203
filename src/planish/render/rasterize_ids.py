"""Rasterize face ids: the face of the sheet that covers each pixel of a page."""

from __future__ import annotations

import numpy as np
from numba import get_num_threads, njit

from planish.geometry.guards import TINY_AREA_PX
from planish.parallel import thread_pool
from planish.types import Floats, Ints

EDGE_PX = 1e-4
"""A pixel centre this close outside a face still counts: no seams between faces."""


def rasterize_ids(
    pixel_xy: Floats, faces: Ints, shape_rc: tuple[int, int], *, top: int = 0, nearness: Floats | None = None
) -> Ints:
    """Find the face that covers each pixel centre; where faces overlap, the nearest, or the one that comes first.

    As `planish.mesh.rasterize` without places in the face, and several times as fast where faces are small.

    Parameters
    ----------
    pixel_xy : (n, 2) float64 [px]
        Points on the page; x right, y down, pixel centres at integers. Faces with a point that is not finite are
        left out.
    faces : (m, 3) int32
    shape_rc : (int, int)
        Rows and columns to fill.
    top : int
        Page row of the first row to fill, for drawing in bands.
    nearness : (m,) float64, optional
        Of every face, above 0.

    Returns
    -------
    (rows, cols) int32
        -1 where there is none.

    Examples
    --------
    >>> xy = np.array([[0.0, 0.0], [3.0, 0.0], [0.0, 3.0]])
    >>> rasterize_ids(xy, np.array([[0, 1, 2]], np.int32), (3, 4))
    array([[ 0,  0,  0,  0],
           [ 0,  0,  0, -1],
           [ 0,  0, -1, -1]], dtype=int32)
    """
    face = np.full(shape_rc, -1, np.int32)
    near, best = np.zeros(0), np.zeros((1, 1))
    if nearness is not None:
        near, best = np.asarray(nearness, np.float64), np.zeros(shape_rc)
    strips = 2 * get_num_threads()
    with thread_pool() as parallel_for:  # each strip of rows belongs to one thread, so no two write the same pixel
        parallel_for(_fill, strips, np.asarray(pixel_xy, np.float64), faces, near, best, top, strips, face, block=1)
    return face


@njit(cache=True, nogil=True)
def _fill(strip, end, xy, faces, near, best, top, strips, face):  # type: ignore[no-untyped-def]
    first, last = len(face) * strip // strips, len(face) * end // strips
    cols = face.shape[1]
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        ya, yb, yc = xy[a, 1] - top, xy[b, 1] - top, xy[c, 1] - top
        low, high = min(ya, yb, yc) - EDGE_PX, max(ya, yb, yc) + EDGE_PX
        if not (high >= first and low <= last):  # also refuses NaN
            continue
        upper, lower = max(first, int(np.ceil(low))), min(last - 1, int(np.floor(high)))
        if upper > lower:
            continue
        xa, xb, xc = xy[a, 0], xy[b, 0], xy[c, 0]
        if not abs((xb - xa) * (yc - ya) - (xc - xa) * (yb - ya)) > TINY_AREA_PX:
            continue
        for r in range(upper, lower + 1):
            left, right = np.inf, -np.inf
            left, right = _crossed(r, xa, ya, xb, yb, left, right)
            left, right = _crossed(r, xb, yb, xc, yc, left, right)
            left, right = _crossed(r, xc, yc, xa, ya, left, right)
            if not (right >= -EDGE_PX and left <= cols):  # also refuses an infinite x
                continue
            for q in range(max(0, int(np.ceil(left - EDGE_PX))), min(cols - 1, int(np.floor(right + EDGE_PX))) + 1):
                if len(near) and near[f] > best[r, q]:
                    best[r, q] = near[f]
                    face[r, q] = f
                elif not len(near) and face[r, q] < 0:
                    face[r, q] = f


@njit(cache=True)
def _crossed(r, xa, ya, xb, yb, left, right):  # type: ignore[no-untyped-def]
    """Widen left and right to where row r crosses an edge."""
    if ya > yb:
        xa, ya, xb, yb = xb, yb, xa, ya
    if r < ya - EDGE_PX or r > yb + EDGE_PX:
        return left, right
    if yb - ya < EDGE_PX:
        return min(left, xa, xb), max(right, xa, xb)
    x = xa + (xb - xa) * min(max((r - ya) / (yb - ya), 0.0), 1.0)
    return min(left, x), max(right, x)
