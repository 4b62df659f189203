"""Normals of a scanned surface: area-weighted ones of its triangles, and their smoothing that stops at creases."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planish.geometry.vectors import cross, minus, plus, row, square, times
from planish.parallel import ParallelFor
from planish.types import Floats, Ints

VertexRecords = NDArray[np.float32]
"""(n, 8): unit normal, area of the point's faces, the place the normal belongs to [mm], local noise.

32 bytes, so that one cache line brings two points. The place is the point itself at first; it is averaged with the
normals, as an average normal belongs to the average place. The local noise is its variance over the typical one.
"""

AREA, PLACE, NOISE = 3, 4, 7

SAMPLE = 5_000
"""Edges or points that a median is taken over: its error is then about 1 %."""


GOLDEN = (math.sqrt(5) - 1) / 2


def sample(count: int) -> NDArray[np.int64]:
    """Rows of a sample of SAMPLE out of `count`, or all of them.

    Multiples of the golden ratio: equal steps would take only edges of one direction out of a range image, where three
    follow each other for every pixel, or only one phase of a ripple.
    """
    if count <= SAMPLE:
        return np.arange(count)
    return (np.arange(SAMPLE) * GOLDEN % 1.0 * count).astype(np.int64)


class OneRing(NamedTuple):
    """Neighbours of every point, as compressed rows (see `planish.mesh.neighbours`)."""

    start: Ints
    neighbour: Ints


def vertex_records(points: Floats, faces: Ints) -> VertexRecords:
    """Area-weighted normals at the points themselves."""
    return np.asarray(_surface_rows(points, faces))


def median_edge(rows: VertexRecords, edges: Ints) -> float:
    """Median |N_i - N_j|^2 over a sample of the edges, as it would be everywhere if noise were the same."""
    some = edges[sample(len(edges))]
    here, there = rows[some[:, 0]], rows[some[:, 1]]
    step = here[:, :3] - there[:, :3]
    return float(np.median(np.einsum("ij,ij->i", step, step) / here[:, NOISE])) if len(some) else 0.0


def diffuse(rows: VertexRecords, ring: OneRing, reach: float, out: VertexRecords, parallel_for: ParallelFor) -> None:
    """One round of smoothing; neighbours whose normals differ by more than noise makes them are left out.

    N_i <- unit(A_i N_i + sum over the ring of w_ij N_j),  w_ij = A_j (1 - |N_i - N_j|^2 / (reach s_i^2))_+^2

    with s_i^2 the local noise.
    """
    parallel_for(_diffuse, len(rows), rows, ring, np.float32(1 / max(reach, 1e-12)), out)


@njit(cache=True, nogil=True, error_model="numpy")
def _surface_rows(points, faces):  # type: ignore[no-untyped-def]
    out = np.zeros((len(points), 8), np.float32)
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        at = row(points, a)
        n = cross(minus(row(points, b), at), minus(row(points, c), at))
        for i in (a, b, c):
            for k in range(3):
                out[i, k] += n[k]
    for i in range(len(points)):
        area = math.sqrt(square(row(out, i)))
        for k in range(3):
            out[i, k] /= area if area > 0.0 else 1.0
            out[i, PLACE + k] = points[i, k]
        out[i, AREA], out[i, NOISE] = 0.5 * area, 1.0
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def _diffuse(first, last, rows, ring, scale, out):  # type: ignore[no-untyped-def]
    for i in range(first, last):
        n, total, near = row(rows, i), rows[i, AREA], scale / rows[i, NOISE]
        normal, place = times(total, n), times(total, row(rows, i, PLACE))
        for q in range(ring.start[i], ring.start[i + 1]):
            j = ring.neighbour[q]
            weight = closeness(n, row(rows, j), near) * rows[j, AREA]
            normal, place = plus(normal, weight, row(rows, j)), plus(place, weight, row(rows, j, PLACE))
            total += weight
        store(out, rows, i, normal, place, total)


@njit(cache=True, nogil=True)
def closeness(a, b, scale):  # type: ignore[no-untyped-def]
    """(1 - |a - b|^2 scale)_+^2: Tukey's weight, which leaves outliers out altogether."""
    near = np.float32(1) - scale * square(minus(a, b))
    return near * near if near > 0 else np.float32(0)


@njit(cache=True, nogil=True, error_model="numpy")
def store(out, rows, i, normal, place, total):  # type: ignore[no-untyped-def]
    """Write down weighted sums as a unit normal and its place; a sum of nothing changes nothing."""
    length = np.sqrt(square(normal))
    for k in range(out.shape[1]):
        out[i, k] = rows[i, k]
    if length > 0 and total > 0:
        for k in range(3):
            out[i, k] = normal[k] / length
            out[i, PLACE + k] = place[k] / total
