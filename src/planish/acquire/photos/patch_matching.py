"""Patches of a surface compared across photos: how far along its normal the surface must move for all to agree.

A patch is a square of samples on the surface's tangent plane. It is projected into every photo that sees it; the
samples of a photo, their mean taken out, are scaled to length 1. The agreement of m photos is the mean of their
pairwise products, the normalised cross-correlation (NCC).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planish.parallel import thread_pool
from planish.types import Bools, Camera, Floats

RADIUS = 5
"""Samples on each side of a patch's middle: 11 x 11."""
MOST_VIEWS = 64
FLAT_LEVELS = 1.0
"""Standard deviation of a patch, in grey levels of 255, below which it is blank: that of a phone's noise."""
AGREE = 0.5
"""A photo takes part if its NCC with the mean of the others is at least this; glare and hidden places have none."""


@dataclass(frozen=True, eq=False)
class PhotoStack:
    """Photos of one scale, one behind the other, for kernels.

    Attributes
    ----------
    pixels : (k,) float32
        Grey levels 0 to 255 of all photos, row by row.
    first, rows, cols : (photos,) int64
    cameras : (photos, 24) float64
        Rotation (9), translation (3), fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6.
    """

    pixels: NDArray[np.float32]
    first: NDArray[np.int64]
    rows: NDArray[np.int64]
    cols: NDArray[np.int64]
    cameras: Floats


def stack_photos(
    photos: Sequence[NDArray[np.float32]], cameras: Sequence[Camera], scale: Sequence[float]
) -> PhotoStack:
    """Stack photos that were scaled by `scale` after `cameras` took them."""
    sizes = [photo.size for photo in photos]
    numbers = np.zeros((len(photos), 24))
    for row, camera, s in zip(numbers, cameras, scale, strict=True):
        row[:9], row[9:12] = camera.rotation.ravel(), np.ravel(camera.translation)
        row[12:14] = camera.matrix[0, 0] * s, camera.matrix[1, 1] * s
        row[14:16] = (camera.matrix[[0, 1], 2] + 0.5) * s - 0.5
        row[16 : 16 + min(8, len(camera.distortion))] = camera.distortion[:8]
    return PhotoStack(
        np.concatenate([photo.ravel() for photo in photos]),
        np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.int64),
        np.array([photo.shape[0] for photo in photos]),
        np.array([photo.shape[1] for photo in photos]),
        numbers,
    )


@dataclass(frozen=True, eq=False)
class Matches:
    """What patches tell of the surface.

    Attributes
    ----------
    offset : (n,) float64 [mm]
        Along the direction, to the place where the photos agree best; NaN where none was found.
    sigma : (n,) float64 [mm]
        Standard deviation of the offset.
    agreement : (n,) float64
        Mean NCC there.
    agrees : (n, photos) bool
        Photos that took part.
    """

    offset: Floats
    sigma: Floats
    agreement: Floats
    agrees: Bools


def match_patches(
    stack: PhotoStack,
    points: Floats,
    normals: Floats,
    seen: Bools,
    sample_mm: float,
    step_mm: float,
    steps: int,
    directions: Floats | None = None,
) -> Matches:
    """Find the offset of each patch along its normal, or along another direction.

    Parameters
    ----------
    stack : PhotoStack
    points, normals : (n, 3) float64
    seen : (n, photos) bool
        Photos that may show the patch.
    sample_mm : float
        Distance of samples: about a pixel.
    step_mm : float
        Of the offsets tried, about half a pixel of parallax.
    steps : int
        So many are tried on each side.
    directions : (n, 3) float64, optional
        Of the offsets. By default the normals.
    """
    n = len(points)
    offset, sigma, agreement = np.full(n, np.nan), np.full(n, np.inf), np.zeros(n)
    agrees = np.zeros((n, len(stack.first)), bool)
    along = normals if directions is None else directions
    photos = stack.pixels, stack.first, stack.rows, stack.cols, stack.cameras
    with thread_pool() as parallel_for:
        parallel_for(
            _match, n, *photos, points, normals, along, seen, sample_mm, step_mm, steps,
            offset, sigma, agreement, agrees, block=512,
        )  # fmt: skip
    return Matches(offset, sigma, agreement, agrees)


@njit(cache=True, nogil=True)
def _match(  # type: ignore[no-untyped-def]
    begin, end, pixels, first, rows, cols, cameras, points, normals, directions, seen, sample, step, steps,
    offset, sigma, agreement, agrees,
):  # fmt: skip
    side = 2 * RADIUS + 1
    size = side * side
    tried = 2 * steps + 1
    patch = np.empty((len(first), size), np.float32)
    total = np.empty(size, np.float32)
    arms = np.empty((len(first), 4))
    score, contrast = np.empty(tried), np.empty(len(first))
    used, each = np.empty(len(first), np.bool_), np.empty(len(first))
    for i in range(begin, end):
        n0, n1, n2 = normals[i, 0], normals[i, 1], normals[i, 2]
        a = (n1, -n0, 0.0) if abs(n2) < 0.9 else (0.0, n2, -n1)
        length = math.sqrt(a[0] ** 2 + a[1] ** 2 + a[2] ** 2)
        a0, a1, a2 = a[0] / length, a[1] / length, a[2] / length
        b0, b1, b2 = n1 * a2 - n2 * a1, n2 * a0 - n0 * a2, n0 * a1 - n1 * a0
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        many = 0
        for v in range(len(first)):
            used[v] = False
            if not seen[i, v]:
                continue
            c, r, depth = project_point(cameras[v], x, y, z)
            ca, ra, _ = project_point(cameras[v], x + sample * a0, y + sample * a1, z + sample * a2)
            cb, rb, _ = project_point(cameras[v], x + sample * b0, y + sample * b1, z + sample * b2)
            arms[v, 0], arms[v, 1], arms[v, 2], arms[v, 3] = ca - c, ra - r, cb - c, rb - r
            used[v] = depth > 0
            many += used[v]
        if many < 2:
            continue
        n0, n1, n2 = directions[i, 0], directions[i, 1], directions[i, 2]
        many = _agreeing(pixels, first, rows, cols, cameras, used, arms, patch, total, contrast, each, score, tried,
                         step, x, y, z, n0, n1, n2)  # fmt: skip
        if many < 2:
            continue
        best = 0
        for k in range(tried):
            if score[k] > score[best]:
                best = k
        agreement[i] = score[best]
        for v in range(len(first)):
            agrees[i, v] = used[v]
        if 0 < best < tried - 1:
            down, here, up = score[best - 1], score[best], score[best + 1]
            bend = 2 * here - down - up
            if bend > 1e-6:
                offset[i] = step * (best - steps + 0.5 * (up - down) / bend)
                sigma[i] = step * math.sqrt(max(1 - here, 1e-3) / (bend * many))


@njit(cache=True, nogil=True)
def _agreeing(  # type: ignore[no-untyped-def]
    pixels, first, rows, cols, cameras, used, arms, patch, total, contrast, each, score, tried, step,
    x, y, z, n0, n1, n2,
):  # fmt: skip
    """Scores of all offsets, first with all photos, then with those that agree at the best of them; their number."""
    steps = tried // 2
    many = 0
    for turn in range(2):
        best, most = -1, -2.0
        for k in range(tried):
            s = (k - steps) * step
            xs, ys, zs = x + s * n0, y + s * n1, z + s * n2
            many = _sample(pixels, first, rows, cols, cameras, used, arms, patch, total, contrast, xs, ys, zs)
            score[k] = _mean_correlation(total, many)
            if score[k] > most:
                best, most = k, score[k]
        if turn == 1 or best < 0:
            break
        s = (best - steps) * step
        xs, ys, zs = x + s * n0, y + s * n1, z + s * n2
        many = _sample(pixels, first, rows, cols, cameras, used, arms, patch, total, contrast, xs, ys, zs)
        dropped = False
        for v in range(len(first)):
            if used[v]:
                each[v] = _against_others(patch[v], total) if contrast[v] > 0 else -1.0
                if each[v] < AGREE:
                    used[v] = False
                    dropped = True
                    many -= 1
        if many < 2 or not dropped:
            break
    return many


@njit(cache=True, nogil=True)
def _sample(pixels, first, rows, cols, cameras, used, arms, patch, total, contrast, x, y, z):  # type: ignore[no-untyped-def]
    """Fill the normalised patches of the photos used, and their sum; photos that do not hold it are no longer used."""
    total[:] = 0
    many = 0
    for v in range(len(first)):
        if not used[v]:
            continue
        c, r, _ = project_point(cameras[v], x, y, z)
        reach = RADIUS * max(abs(arms[v, 0]) + abs(arms[v, 2]), abs(arms[v, 1]) + abs(arms[v, 3]))
        if not (reach < c < cols[v] - 1 - reach and reach < r < rows[v] - 1 - reach):
            used[v] = False
            continue
        contrast[v] = _one_patch(pixels, first[v], cols[v], c, r, arms[v], patch[v])
        if contrast[v] > 0:
            many += 1
            for k in range(len(total)):
                total[k] += patch[v, k]
    return many


@njit(cache=True, nogil=True)
def _one_patch(pixels, start, width, c, r, arm, out):  # type: ignore[no-untyped-def]
    """Bilinear samples around a place, less their mean, of length 1; returns their standard deviation, 0 if blank."""
    k = 0
    mean = 0.0
    for i in range(-RADIUS, RADIUS + 1):
        for j in range(-RADIUS, RADIUS + 1):
            u = c + j * arm[0] + i * arm[2]
            w = r + j * arm[1] + i * arm[3]
            q, p = int(u), int(w)
            fu, fw = np.float32(u - q), np.float32(w - p)
            at = start + p * width + q
            above = pixels[at] + fu * (pixels[at + 1] - pixels[at])
            below = pixels[at + width] + fu * (pixels[at + width + 1] - pixels[at + width])
            out[k] = above + fw * (below - above)
            mean += out[k]
            k += 1
    mean /= k
    square = 0.0
    for m in range(k):
        out[m] -= mean
        square += out[m] * out[m]
    deviation = math.sqrt(square / k)
    if deviation < FLAT_LEVELS:
        return 0.0
    scale = np.float32(1 / math.sqrt(square))
    for m in range(k):
        out[m] *= scale
    return deviation


@njit(cache=True, nogil=True)
def _mean_correlation(total, many):  # type: ignore[no-untyped-def]
    """Mean of the products of all pairs of m unit vectors, from their sum: (|sum|^2 - m) / (m (m - 1))."""
    if many < 2:
        return -1.0
    square = 0.0
    for k in range(len(total)):
        square += total[k] * total[k]
    return (square - many) / (many * (many - 1))


@njit(cache=True, nogil=True)
def _against_others(one, total):  # type: ignore[no-untyped-def]
    """Correlation of a unit vector with the mean of the others."""
    product, square = 0.0, 0.0
    for k in range(len(total)):
        rest = total[k] - one[k]
        product += one[k] * rest
        square += rest * rest
    return product / math.sqrt(square) if square > 0 else -1.0


@njit(cache=True, nogil=True)
def project_point(camera, x, y, z):  # type: ignore[no-untyped-def]
    """Column, row [px] and depth of a point: OpenCV's model with eight terms of distortion."""
    u = camera[0] * x + camera[1] * y + camera[2] * z + camera[9]
    v = camera[3] * x + camera[4] * y + camera[5] * z + camera[10]
    w = camera[6] * x + camera[7] * y + camera[8] * z + camera[11]
    u, v = u / w, v / w
    k1, k2, p1, p2, k3, k4, k5, k6 = (camera[16], camera[17], camera[18], camera[19], camera[20], camera[21],
                                      camera[22], camera[23])  # fmt: skip
    q = u * u + v * v
    radial = (1 + q * (k1 + q * (k2 + q * k3))) / (1 + q * (k4 + q * (k5 + q * k6)))
    ud = u * radial + 2 * p1 * u * v + p2 * (q + 2 * u * u)
    vd = v * radial + p1 * (q + 2 * v * v) + 2 * p2 * u * v
    return camera[12] * ud + camera[14], camera[13] * vd + camera[15], w
