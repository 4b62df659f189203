"""Which triangle covers each pixel, and where in the triangle it lies.

Behind photos, maps over the page and pictures of meshes. Drawing a page needs the triangle alone, for which
`planish.render.rasterize_ids` is several times as fast.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planish.geometry.guards import TINY_AREA_PX
from planish.parallel import thread_pool
from planish.types import Floats, Ints

EDGE = 1e-7
"""A pixel centre this close outside a triangle, in units of the triangle, still counts: no seams between faces."""

STRIPS = 8
"""Of rows, for the cores to share: a few for each, so that a busy one holds nobody up. Every strip goes through all
faces, at 1 ms a strip for 600,000 of them, so not many."""


def rasterize(
    pixel_xy: Floats,
    faces: Ints,
    shape_rc: tuple[int, int],
    *,
    nearness: Floats | None = None,
    perspective: bool = False,
    top: int = 0,
) -> tuple[Ints, NDArray[np.float32]]:
    """Find the face that covers each pixel centre, and where in the face the centre lies.

    Parameters
    ----------
    pixel_xy : (n, 2) float64 [px]
        Points on the image; x right, y down, pixel centres at integers. Faces with a point that is not finite are
        left out.
    faces : (m, 3) int32
    shape_rc : (int, int)
        Rows and columns to fill.
    nearness : (n,) float64, optional
        Where faces overlap the greater nearness wins; it must be linear over the image (1 / depth for a pinhole,
        height for a view from above). Without it the face that comes first wins.
    perspective : bool
        Return weights that are linear in space, not on the image; `nearness` must then be 1 / depth.
    top : int
        Image row of the first row to fill, for drawing in bands.

    Returns
    -------
    face : (rows, cols) int32
        -1 where there is none.
    weights : (rows, cols, 2) float32
        Barycentric weights of the face's corners 1 and 2; corner 0 has the rest.

    Examples
    --------
    >>> xy = np.array([[0.0, 0.0], [3.0, 0.0], [0.0, 3.0]])
    >>> rasterize(xy, np.array([[0, 1, 2]], np.int32), (3, 4))[0]
    array([[ 0,  0,  0,  0],
           [ 0,  0,  0, -1],
           [ 0,  0, -1, -1]], dtype=int32)
    """
    rows, cols = shape_rc
    face = np.full((rows, cols), -1, np.int32)
    weights = np.zeros((rows, cols, 2), np.float32)
    near = np.zeros(len(pixel_xy)) if nearness is None else np.asarray(nearness, np.float64)
    best = np.full((rows, cols) if nearness is not None else (1, 1), -np.inf)
    xy = np.asarray(pixel_xy, np.float64)
    with thread_pool() as parallel_for:  # each strip of rows belongs to one thread, so no two write the same pixel
        parallel_for(
            _fill, STRIPS, xy, faces, near, nearness is not None, perspective, top, face, weights, best, block=1
        )
    return face, weights


@njit(cache=True, nogil=True)
def _fill(strip, end, xy, faces, near, test, perspective, top, face, weights, best):  # type: ignore[no-untyped-def]
    first, last = len(face) * strip // STRIPS, len(face) * end // STRIPS
    for f in range(len(faces)):
        _fill_face(f, xy, faces, near, test, perspective, top, first, last, face, weights, best)


@njit(cache=True, nogil=True)
def _fill_face(  # type: ignore[no-untyped-def]
    f, xy, faces, near, test, perspective, top, first, last, face, weights, best
):
    a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
    y0, y1, y2 = xy[a, 1] - top, xy[b, 1] - top, xy[c, 1] - top
    low, high = min(y0, y1, y2), max(y0, y1, y2)
    if not (high >= first - 1e-3 and low <= last + 1e-3):  # also refuses NaN
        return
    x0, x1, x2 = xy[a, 0], xy[b, 0], xy[c, 0]
    twice_area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
    if not (abs(twice_area) > TINY_AREA_PX) or not np.isfinite(twice_area):
        return
    for r in range(max(first, int(np.ceil(low - 1e-3))), min(last, int(np.floor(high + 1e-3)) + 1)):
        left, right = _span(r, x0, y0, x1, y1, x2, y2, face.shape[1])
        for q in range(left, right):
            w1 = ((q - x0) * (y2 - y0) - (x2 - x0) * (r - y0)) / twice_area
            w2 = ((x1 - x0) * (r - y0) - (q - x0) * (y1 - y0)) / twice_area
            w0 = 1.0 - w1 - w2
            if w0 < -EDGE or w1 < -EDGE or w2 < -EDGE:
                continue
            here = w0 * near[a] + w1 * near[b] + w2 * near[c]
            if test:
                if not here > best[r, q]:
                    continue
                best[r, q] = here
            elif face[r, q] >= 0:
                continue
            face[r, q] = f
            weights[r, q, 0] = w1 * near[b] / here if perspective else w1
            weights[r, q, 1] = w2 * near[c] / here if perspective else w2


@njit(cache=True, nogil=True)
def _span(r, x0, y0, x1, y1, x2, y2, cols):  # type: ignore[no-untyped-def]
    """Columns between which row r can meet the triangle, a pixel wide of the truth on either side."""
    left, right = np.inf, -np.inf
    for xa, ya, xb, yb in ((x0, y0, x1, y1), (x1, y1, x2, y2), (x2, y2, x0, y0)):
        if min(ya, yb) - 1e-3 <= r <= max(ya, yb) + 1e-3:
            if abs(yb - ya) < 1e-2:
                left, right = min(left, xa, xb), max(right, xa, xb)
            else:
                at = xa + (xb - xa) * min(max((r - ya) / (yb - ya), 0.0), 1.0)
                left, right = min(left, at), max(right, at)
    if left > right:
        return 0, 0
    return max(0, int(np.ceil(left - 1e-2))), min(cols, int(np.floor(right + 1e-2)) + 1)
