"""Draw a photo through a map: one filter that interpolates where the photo is coarse and averages where it is fine.

A page pixel at x takes sum k(u) k(v) photo(x + d) / sum k(u) k(v), (u, v) = M^-1 d, with the filter k of
`planish.render.filters`. M = (J J^T)^(1/2) is the shape of the page pixel on the photo, with singular values below 1
raised to 1 (Heckbert 1989, 3.5: the wider of the filters that reconstruct the photo and that limit the page's band).
Light is added, not code values.

The page is drawn in tiles. The part of the photo that a tile needs is turned into light once, in memory that stays in
the core's cache, so that a photo of any size takes no more memory than it has.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planish.color import linear_light
from planish.parallel import thread_pool
from planish.render.filters import LOBES, NARROW, TAPS, lanczos, narrow, narrow_filters, skewed, upright
from planish.types import Bools, Floats, Ints, Pixels, read_only

SKEW = 0.1
"""A filter this near to upright, as a part of its size, is taken as upright: its weights then fall into rows and
columns, several times as fast, and nobody sees the difference."""
WIDEST = 32.0
"""Photo pixels to a page pixel beyond which the filter grows no more."""
TILE, SMALL_TILE = 64, 8
"""Page pixels across a tile; small ones where a tile's part of the photo is too large, at seams and folds."""
BOX = 1 << 17
"""Most photo pixels of a tile's part: 1.5 MB of light. A single page pixel of the widest filter needs 9e4."""


def maps_of_faces(pixel_xy: Floats, photo_xy: Floats, jacobian: Floats, faces: Ints) -> Floats:
    """Where each face lies on the photo, and its filter there.

    Parameters
    ----------
    pixel_xy : (n, 2) float64 [page px]
    photo_xy : (n, 2) float64 [photo px]
    jacobian : (n, 2, 2) float64 [photo px per page px]
        At the points; a face takes the mean of its three.
    faces : (m, 3) int32

    Returns
    -------
    (m, 9) float64
        x = m0 q + m1 r + m2 and y = m3 q + m4 r + m5 on the photo for page column q and row r; M's xx, xy and yy.
    """
    maps = np.zeros((len(faces), 9))
    with thread_pool() as parallel_for:
        parallel_for(_maps, len(faces), pixel_xy, read_only(photo_xy), jacobian, faces, maps)
    return maps


def sample(photo: Pixels, face: Ints, maps: Floats, top: int, light: NDArray[np.float32], known: Bools) -> None:
    """Fill rows of a page.

    Parameters
    ----------
    photo : (rows, cols, 3) uint8 or uint16
    face : (r, c) int32
        Face that covers each page pixel; -1 for none.
    maps : (m, 9) float64
        From `maps_of_faces`.
    top : int
        Page row of the first row.
    light : (r, c, 3) float32
        Filled with linear light where the page is known.
    known : (r, c) bool
        Filled: where a face lies that falls within the photo.
    """
    tables = linear_light(np.iinfo(photo.dtype).max + 1), lanczos(), narrow_filters()
    tiles = -(-face.shape[0] // TILE) * -(-face.shape[1] // TILE)
    with thread_pool() as parallel_for:
        parallel_for(_sample, tiles, read_only(photo), face, maps, top, tables, light, known, block=8)


@njit(cache=True, nogil=True)
def _maps(begin, end, page, photo, jacobian, faces, maps):  # type: ignore[no-untyped-def]
    for f in range(begin, end):
        a, b, c = faces[f]
        u1, v1 = page[b, 0] - page[a, 0], page[b, 1] - page[a, 1]
        u2, v2 = page[c, 0] - page[a, 0], page[c, 1] - page[a, 1]
        area = u1 * v2 - u2 * v1
        if area == 0:
            continue
        for k in range(2):
            d1, d2 = photo[b, k] - photo[a, k], photo[c, k] - photo[a, k]
            across, down = (d1 * v2 - d2 * v1) / area, (d2 * u1 - d1 * u2) / area
            maps[f, 3 * k], maps[f, 3 * k + 1] = across, down
            maps[f, 3 * k + 2] = photo[a, k] - across * page[a, 0] - down * page[a, 1]
        jxx = (jacobian[a, 0, 0] + jacobian[b, 0, 0] + jacobian[c, 0, 0]) / 3
        jxy = (jacobian[a, 0, 1] + jacobian[b, 0, 1] + jacobian[c, 0, 1]) / 3
        jyx = (jacobian[a, 1, 0] + jacobian[b, 1, 0] + jacobian[c, 1, 0]) / 3
        jyy = (jacobian[a, 1, 1] + jacobian[b, 1, 1] + jacobian[c, 1, 1]) / 3
        maps[f, 6], maps[f, 7], maps[f, 8] = _shape(jxx, jxy, jyx, jyy)


@njit(cache=True)
def _shape(jxx, jxy, jyx, jyy):  # type: ignore[no-untyped-def]
    """M = (J J^T)^(1/2) with its eigenvalues kept between 1 and WIDEST: xx, xy, yy.

    With S = J J^T, half its trace h and half the distance of its eigenvalues d, M = m + n (S - h) / d where m and n
    are half the sum and half the difference of M's eigenvalues (h +- d)^(1/2).
    """
    sxx, sxy, syy = jxx * jxx + jxy * jxy, jxx * jyx + jxy * jyy, jyx * jyx + jyy * jyy
    half, apart = (sxx + syy) / 2, np.hypot((sxx - syy) / 2, sxy)
    large = np.sqrt(min(max(half + apart, 1.0), WIDEST**2))
    small = np.sqrt(min(max(half - apart, 1.0), WIDEST**2))
    middle, ratio = (large + small) / 2, (large - small) / 2 / apart if apart > 0 else 0.0
    return middle + ratio * (sxx - half), ratio * sxy, middle + ratio * (syy - half)


@njit(cache=True, nogil=True)
def _sample(begin, end, photo, face, maps, top, tables, light, known):  # type: ignore[no-untyped-def]
    rows, cols = face.shape
    across = -(-cols // TILE)
    rim = int(2 * LOBES * WIDEST) + 2
    box, weights = np.zeros(3 * (BOX + TAPS), np.float32), np.zeros((2, rim), np.float32)
    work = box, weights[0], weights[1], np.zeros(3 * TAPS, np.float32)
    for t in range(begin, end):
        r, q = t // across * TILE, t % across * TILE
        below, right = min(r + TILE, rows), min(q + TILE, cols)
        if _region(r, below, q, right, photo, face, maps, top, tables, work, light, known):
            continue
        for i in range(r, below, SMALL_TILE):
            for j in range(q, right, SMALL_TILE):
                low, far = min(i + SMALL_TILE, below), min(j + SMALL_TILE, right)
                if _region(i, low, j, far, photo, face, maps, top, tables, work, light, known):
                    continue
                for m in range(i, low):
                    for n in range(j, far):
                        _region(m, m + 1, n, n + 1, photo, face, maps, top, tables, work, light, known)


@njit(cache=True)
def _region(r0, r1, q0, q1, photo, face, maps, top, tables, work, light, known):  # type: ignore[no-untyped-def]
    """Draw a part of the page, unless the part of the photo that it needs is too large for the box."""
    levels, kernel, bank = tables
    box, wx, wy, sums = work
    x0, x1, y0, y1 = _reach(r0, r1, q0, q1, photo, face, maps, top)
    if x0 > x1:
        known[r0:r1, q0:q1] = False
        return True
    left, upper = int(np.floor(x0)) - 1, int(np.floor(y0)) - 1
    width, height = int(np.ceil(x1)) + 2 - left, int(np.ceil(y1)) + 2 + TAPS - upper
    if width * height > BOX:
        return False
    _into_light(photo, left, upper, width, height, levels, box)
    rows, cols = photo.shape[:2]
    for r in range(r0, r1):
        for q in range(q0, q1):
            f = face[r, q]
            known[r, q] = False
            if f < 0:
                continue
            x, y = _place(maps, f, q, r + top)
            if not (-0.5 <= x <= cols - 0.5 and -0.5 <= y <= rows - 0.5):
                continue
            mxx, mxy, myy = np.float32(maps[f, 6]), np.float32(maps[f, 7]), np.float32(maps[f, 8])
            x, y = x - left, y - upper
            if abs(mxy) >= SKEW * (mxx + myy):
                red, green, blue = skewed(box, width, x, y, mxx, mxy, myy, kernel)
            elif max(mxx, myy) < 1 + NARROW:
                red, green, blue = narrow(box, width, x, y, mxx, myy, bank, sums)
            else:
                red, green, blue = upright(box, width, x, y, mxx, myy, kernel, wx, wy)
            light[r, q, 0], light[r, q, 1], light[r, q, 2] = red, green, blue
            known[r, q] = True
    return True


@njit(cache=True)
def _place(maps, f, q, r):  # type: ignore[no-untyped-def]
    return maps[f, 0] * q + maps[f, 1] * r + maps[f, 2], maps[f, 3] * q + maps[f, 4] * r + maps[f, 5]


@njit(cache=True)
def _reach(r0, r1, q0, q1, photo, face, maps, top):  # type: ignore[no-untyped-def]
    """Part of the photo under the filters of a part of the page: left, right, top, bottom."""
    rows, cols = photo.shape[:2]
    x0, x1, y0, y1 = np.inf, -np.inf, np.inf, -np.inf
    for r in range(r0, r1):
        last = -1
        for q in range(q0, q1):
            f = face[r, q]
            if f < 0 or (f == last and q + 1 < q1 and face[r, q + 1] == f):  # inside a face nothing is outermost
                continue
            last = f
            x, y = _place(maps, f, q, r + top)
            x, y = min(max(x, -0.5), cols - 0.5), min(max(y, -0.5), rows - 0.5)
            wide, high = LOBES * (maps[f, 6] + abs(maps[f, 7])), LOBES * (maps[f, 8] + abs(maps[f, 7]))
            x0, x1, y0, y1 = min(x0, x - wide), max(x1, x + wide), min(y0, y - high), max(y1, y + high)
    return x0, x1, y0, y1


@njit(cache=True)
def _into_light(photo, left, upper, width, height, levels, box):  # type: ignore[no-untyped-def]
    """Fill the box with a part of the photo; beyond its rim the rim goes on."""
    rows, cols = photo.shape[:2]
    for i in range(height):
        row = min(max(upper + i, 0), rows - 1)
        at = 3 * i * width
        for j in range(width):
            col = min(max(left + j, 0), cols - 1)
            box[at + 3 * j] = levels[photo[row, col, 0]]
            box[at + 3 * j + 1] = levels[photo[row, col, 1]]
            box[at + 3 * j + 2] = levels[photo[row, col, 2]]
