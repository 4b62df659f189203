"""Draw a photo through a map: one filter that interpolates where the photo is coarse and averages where it is fine.

The filter is Lanczos' windowed sinc of three lobes (Duchon 1979), stretched over the part of the photo that a page
pixel covers: a page pixel at x takes sum k(u) k(v) photo(x + d) / sum k(u) k(v), (u, v) = M^-1 d. M = (J J^T)^(1/2),
the shape of the page pixel on the photo, with singular values below 1 raised to 1 (Heckbert 1989, 3.5: the wider of
the filters that reconstruct the photo and that limit the page's band). Light is added, not code values.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planish.crew import crew
from planish.mesh import code_values, linear_light
from planish.types import Bools, Floats, Ints, Pixels

LOBES = 3
STEPS = 2048
"""Of the filter's table to one pixel: its error stays below a tenth of an 8-bit step."""
ROWS = 64
"""Page rows that a thread takes at a time: some 20 ms of work."""
SKEW = 0.1
"""A filter this near to upright, as a part of its size, is taken as upright: its weights then fall into rows and
columns, several times as fast, and nobody sees the difference."""
WIDEST = 32.0
"""Photo pixels to a page pixel beyond which the filter grows no more."""


def footprints(jacobian: Floats) -> Floats:
    """(n, 3) x x, x y and y y of M M^T for (n, 2, 2) maps from page pixels to photo pixels."""
    square = jacobian @ jacobian.transpose(0, 2, 1)
    values, vectors = np.linalg.eigh(square)
    values = np.clip(values, 1.0, WIDEST**2)
    clamped = (vectors * values[:, None, :]) @ vectors.transpose(0, 2, 1)
    return np.ascontiguousarray(np.stack([clamped[:, 0, 0], clamped[:, 0, 1], clamped[:, 1, 1]], axis=1))


def lanczos() -> NDArray[np.float32]:
    """Table of k(0) to k(LOBES), and zeros to half as far again for the filter's rim."""
    x = np.arange(int(1.5 * LOBES * STEPS)) / STEPS
    return np.where(x < LOBES, np.sinc(x) * np.sinc(x / LOBES), 0).astype(np.float32)


def sample(
    photo: Pixels,
    face: Ints,
    weights: NDArray[np.float32],
    faces: Ints,
    photo_xy: Floats,
    shape: Floats,
    pixels: Pixels,
    known: Bools,
) -> None:
    """Fill rows of a page.

    Parameters
    ----------
    photo : (rows, cols, 3) uint8 or uint16
    face : (r, c) int32
        Face that covers each page pixel; -1 for none.
    weights : (r, c, 2) float32
        Where in the face, as `rasterise` returns it.
    faces : (m, 3) int32
    photo_xy : (n, 2) float64 [photo px]
    shape : (n, 3) float64
        From `footprints`.
    pixels : (r, c, 3), of the photo's type
        Filled where the page is known, left as it is elsewhere.
    known : (r, c) bool
        Filled: where a face lies that falls within the photo.
    """
    light = linear_light(np.iinfo(photo.dtype).max + 1)
    carried = np.concatenate([photo_xy, shape], axis=1)
    tables = light, code_values(photo.dtype), lanczos()
    with crew() as run:
        run(_sample, len(face), photo, face, weights, faces, carried, *tables, pixels, known, block=ROWS)


@njit(cache=True, nogil=True)
def _sample(  # type: ignore[no-untyped-def]
    begin, end, photo, face, weights, faces, carried, light, codes, kernel, pixels, known
):
    rows, cols = photo.shape[:2]
    for r in range(begin, end):
        reach = int(2 * LOBES * WIDEST) + 2
        wx, wy = np.empty(reach, np.float32), np.empty(reach, np.float32)
        for q in range(face.shape[1]):
            known[r, q] = False
            if face[r, q] < 0:
                continue
            a, b, c = faces[face[r, q]]
            w1, w2 = np.float64(weights[r, q, 0]), np.float64(weights[r, q, 1])
            w0 = 1 - w1 - w2
            x = w0 * carried[a, 0] + w1 * carried[b, 0] + w2 * carried[c, 0]
            y = w0 * carried[a, 1] + w1 * carried[b, 1] + w2 * carried[c, 1]
            if not (-0.5 <= x <= cols - 0.5 and -0.5 <= y <= rows - 0.5):
                continue
            sxx = w0 * carried[a, 2] + w1 * carried[b, 2] + w2 * carried[c, 2]
            sxy = w0 * carried[a, 3] + w1 * carried[b, 3] + w2 * carried[c, 3]
            syy = w0 * carried[a, 4] + w1 * carried[b, 4] + w2 * carried[c, 4]
            # M = (S + det(S)^(1/2) 1) / (tr S + 2 det(S)^(1/2))^(1/2), the square root of a 2x2 matrix S
            root = np.sqrt(max(sxx * syy - sxy * sxy, 1.0))
            trace = np.sqrt(sxx + syy + 2 * root)
            mxx, mxy, myy = (sxx + root) / trace, sxy / trace, (syy + root) / trace
            if abs(mxy) < SKEW * (mxx + myy):
                red, green, blue = _upright(photo, x, y, mxx, myy, light, kernel, wx, wy)
            else:
                red, green, blue = _skewed(photo, x, y, mxx, mxy, myy, light, kernel)
            pixels[r, q, 0] = codes[int(min(max(red, 0.0), 1.0) * 65535 + 0.5)]
            pixels[r, q, 1] = codes[int(min(max(green, 0.0), 1.0) * 65535 + 0.5)]
            pixels[r, q, 2] = codes[int(min(max(blue, 0.0), 1.0) * 65535 + 0.5)]
            known[r, q] = True


@njit(cache=True)
def _row_of_weights(at, spread, kernel, w):  # type: ignore[no-untyped-def]
    """Fill w with the filter's weights around `at`, with sum 1; returns the first pixel and how many there are."""
    first, last = int(np.ceil(at - LOBES * spread)), int(np.floor(at + LOBES * spread))
    total = np.float32(0)
    for i in range(last - first + 1):
        w[i] = kernel[int(abs(at - (first + i)) / spread * STEPS + 0.5)]
        total += w[i]
    for i in range(last - first + 1):
        w[i] /= total
    return first, last - first + 1


@njit(cache=True)
def _upright(photo, x, y, mxx, myy, light, kernel, wx, wy):  # type: ignore[no-untyped-def]
    rows, cols = photo.shape[:2]
    left, nx = _row_of_weights(x, mxx, kernel, wx)
    top, ny = _row_of_weights(y, myy, kernel, wy)
    inside = left >= 0 and top >= 0 and left + nx <= cols and top + ny <= rows
    red, green, blue = np.float32(0), np.float32(0), np.float32(0)
    for j in range(ny):
        i_row = top + j if inside else min(max(top + j, 0), rows - 1)
        r, g, b = np.float32(0), np.float32(0), np.float32(0)
        for i in range(nx):
            i_col = left + i if inside else min(max(left + i, 0), cols - 1)
            r += wx[i] * light[photo[i_row, i_col, 0]]
            g += wx[i] * light[photo[i_row, i_col, 1]]
            b += wx[i] * light[photo[i_row, i_col, 2]]
        red, green, blue = red + wy[j] * r, green + wy[j] * g, blue + wy[j] * b
    return red, green, blue


@njit(cache=True)
def _skewed(photo, x, y, mxx, mxy, myy, light, kernel):  # type: ignore[no-untyped-def]
    rows, cols = photo.shape[:2]
    size = mxx * myy - mxy * mxy
    reach_x, reach_y = LOBES * (mxx + abs(mxy)), LOBES * (myy + abs(mxy))
    red, green, blue, total = np.float32(0), np.float32(0), np.float32(0), np.float32(0)
    for i_row in range(int(np.ceil(y - reach_y)), int(np.floor(y + reach_y)) + 1):
        for i_col in range(int(np.ceil(x - reach_x)), int(np.floor(x + reach_x)) + 1):
            dx, dy = i_col - x, i_row - y
            u, v = abs(myy * dx - mxy * dy) / size, abs(mxx * dy - mxy * dx) / size
            if u < LOBES and v < LOBES:
                w = kernel[int(u * STEPS + 0.5)] * kernel[int(v * STEPS + 0.5)]
                near_row, near_col = min(max(i_row, 0), rows - 1), min(max(i_col, 0), cols - 1)
                red += w * light[photo[near_row, near_col, 0]]
                green += w * light[photo[near_row, near_col, 1]]
                blue += w * light[photo[near_row, near_col, 2]]
                total += w
    return red / total, green / total, blue / total
