"""How noisy a scan is, and where, found from the scan itself."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planish.geometry.guards import TINY
from planish.geometry.vectors import dot, minus, row
from planish.mesh import Topology, bounds
from planish.parallel import ParallelFor
from planish.surface.creases import height_over
from planish.surface.curvature import CURVATURE, ShapeOperators
from planish.surface.normals import OneRing, VertexRecords, sample
from planish.types import Floats, Ints

FROM_MEDIAN, FROM_MEAN = 1.4826, 1.2533
"""Standard deviation of a normal variable over the median and the mean of its size."""

RING_GAIN = 1.36
"""What white noise becomes in `ring_noise`, on regular and random meshes alike (within 3 % at 0.01 to 0.2 mm)."""

CELL = 12
"""Side of the cells that noise is averaged in, in edges; with their neighbours they hold 1,000 points or so."""

OUTLIER = 4.0
"""Values over so many medians count as that: what creases do is not noise, but noise may differ over a sheet."""

LEAST_AND_MOST_ALIKE = 0.06, 0.998
"""Correlations of neighbours that are told apart: white noise then has a length of 0.5 edges, the longest of 18."""


def angle_defects(rest: Floats, faces: Ints, topology: Topology, point_count: int, parallel_for: ParallelFor) -> Floats:
    """|2 pi - sum of the angles| at the points inside the sheet, for triangles of the edge lengths `rest`.

    Nought where a sheet can lie flat, however it is bent; noise makes it buckle everywhere.
    """
    angles = np.empty((len(faces), 3), np.float32)
    parallel_for(_angles, len(faces), rest, topology.face_edges, angles)
    sums = _sum_corners(angles, faces, point_count)
    inner = np.ones(point_count, bool)
    inner[topology.edges[topology.edge_uses != 2]] = False
    inner &= sums > 0.0
    return np.abs(2 * np.pi - sums[inner])


def ring_noise(
    points: Floats, rows: VertexRecords, ring: OneRing, parallel_for: ParallelFor, fewest: int = 5
) -> NDArray[np.float32]:
    """(n,) size [mm] of the noise of every point, if it is white: how far it stands out of its ring.

    Bending cancels in the difference of a point's height over its ring and the ring's mean height; noise does not.
    NaN where a point has fewer than `fewest` neighbours. Noise that
    is alike over several pixels cancels too, and is not seen here.
    """
    height, off = np.empty(len(points), np.float32), np.empty(len(points), np.float32)
    parallel_for(_heights, len(points), points, rows, ring, height)
    parallel_for(_less_ring, len(points), height, ring, fewest, off)
    return np.asarray(np.abs(off) / np.float32(RING_GAIN), np.float32)


def surface_noise(
    points: Floats,
    rows: VertexRecords,
    bends: ShapeOperators,
    patch: float,
    parallel_for: ParallelFor,
    source: Ints | None = None,
) -> NDArray[np.float32]:
    """(n,) signed height [mm] of every point over its bent plane: noise that is alike over some pixels shows here too.

    Parameters
    ----------
    patch : float
        Mean square width [mm^2], across the rulings, of the patch that every place is the average of: the average of
        a bent patch lies off the surface by half its curvature times that.
    source : (n,) int32, optional
        The point whose plane each point lies on (see `find_sides`); by default its own.
    """
    off = np.empty(len(points), np.float32)
    source = np.arange(len(points), dtype=np.int32) if source is None else source
    parallel_for(_off_surface, len(points), points, rows, bends, patch, source, off)
    return off


def robust_sigma(off: NDArray[np.float32]) -> float:
    """Standard deviation of noise, from the median of its sizes over a sample."""
    some = off[sample(len(off))]
    some = some[np.isfinite(some)]
    return FROM_MEDIAN * float(np.median(np.abs(some))) if len(some) else 0.0


def noise_length(off: NDArray[np.float32], edges: Ints, spacing: float) -> float:
    """Distance [mm] over which noise is alike: where the correlation of two points' heights `off` falls to a half.

    Told from the correlation r of points that share an edge, as if it fell like a Gaussian with the distance.
    """
    some = edges[sample(len(edges))]
    a, b = off[some[:, 0]].astype(np.float64), off[some[:, 1]].astype(np.float64)
    limit = OUTLIER * float(np.median(np.abs(a))) + 1e-30
    a, b = np.clip(a, -limit, limit), np.clip(b, -limit, limit)
    return length_of((a * b).sum() / max(0.5 * (a * a + b * b).sum(), TINY), spacing)


def length_of(alike: float, spacing: float) -> float:
    """Distance at which a correlation falls to a half that is `alike` at one spacing, if it falls like a Gaussian."""
    return spacing * math.sqrt(math.log(2) / -math.log(float(np.clip(alike, *LEAST_AND_MOST_ALIKE))))


def local_sigma(
    points: Floats, values: NDArray[np.floating], spacing: float, parallel_for: ParallelFor, least: float = 0.0
) -> Floats:
    """(n,) mean of the finite values in cells of CELL edges and those next to them, of every point's cell.

    Values over OUTLIER medians, or OUTLIER times `least` where that is more, count as that.

    Examples
    --------
    >>> from planish.parallel import thread_pool
    >>> x = np.arange(1000.0)
    >>> values = np.where(x < 504, 1.0, 3.0)
    >>> with thread_pool() as parallel_for:
    ...     local_sigma(np.c_[x, 0 * x, 0 * x], values, 1.0, parallel_for)[[0, 498, 999]].round(2)
    array([1.  , 1.67, 3.  ])
    """
    if not len(points):
        return np.zeros(0)
    low, high = bounds(points)
    side = max(CELL * spacing, float((high - low).max()) / 200, 1e-12)
    shape = ((high - low) / side).astype(np.int64) + 1
    known = values[np.isfinite(values)]
    ceiling = OUTLIER * max(float(np.median(known[sample(len(known))])), least) if len(known) else 0.0
    cell = np.empty(len(points), np.int64)
    parallel_for(_find_cells, len(points), points, low, 1 / side, shape, cell)
    sums, counts = _sum_cells(cell, values, ceiling, math.prod(shape))
    sums, counts = _with_neighbours(sums.reshape(shape)), _with_neighbours(counts.reshape(shape))
    return np.asarray((sums / np.maximum(counts, 1)).ravel()[cell])


def _with_neighbours(cells: Floats) -> Floats:
    """Sums over 3 x 3 x 3 cells."""
    for axis in range(3):
        padded = np.moveaxis(np.pad(cells, [(1, 1) if k == axis else (0, 0) for k in range(3)]), axis, 0)
        cells = np.moveaxis(padded[:-2] + padded[1:-1] + padded[2:], 0, axis)
    return cells


@njit(cache=True, nogil=True)
def _find_cells(first, last, points, low, scale, shape, cell):  # type: ignore[no-untyped-def]
    for i in range(first, last):
        at = 0
        for k in range(3):
            at = at * shape[k] + int((points[i, k] - low[k]) * scale)
        cell[i] = at


@njit(cache=True, nogil=True)
def _sum_cells(cell, values, ceiling, cells):  # type: ignore[no-untyped-def]
    sums, counts = np.zeros(cells), np.zeros(cells)
    for i in range(len(cell)):
        if np.isfinite(values[i]):
            sums[cell[i]] += min(values[i], ceiling)
            counts[cell[i]] += 1.0
    return sums, counts


@njit(cache=True, nogil=True, error_model="numpy")
def _angles(first, last, rest, face_edges, out):  # type: ignore[no-untyped-def]
    for f in range(first, last):
        for k in range(3):  # edge k joins corners k and k + 1, so edge k + 1 lies opposite to corner k
            u, v = rest[face_edges[f, k]], rest[face_edges[f, (k + 2) % 3]]
            opposite = rest[face_edges[f, (k + 1) % 3]]
            cosine = (u * u + v * v - opposite * opposite) / (2.0 * u * v) if u > 0.0 and v > 0.0 else 1.0
            out[f, k] = _arc_cosine(np.float32(min(1.0, max(-1.0, cosine))))


@njit(cache=True, nogil=True)
def _arc_cosine(x):  # type: ignore[no-untyped-def]
    """To 2e-8, a fifth of what float32 rounds to, in a quarter of the library's time (Abramowitz & Stegun 4.4.46)."""
    t = abs(x)
    series = 1.5707963050 + t * (-0.2145988016 + t * (0.0889789874 + t * (-0.0501743046 + t * (
        0.0308918810 + t * (-0.0170881256 + t * (0.0066700901 - t * 0.0012624911))))))  # fmt: skip
    angle = math.sqrt(1.0 - t) * series
    return angle if x >= 0.0 else math.pi - angle


@njit(cache=True, nogil=True)
def _sum_corners(angles, faces, point_count):  # type: ignore[no-untyped-def]
    sums = np.zeros(point_count)
    for f in range(len(faces)):
        for k in range(3):
            sums[faces[f, k]] += angles[f, k]
    return sums


@njit(cache=True, nogil=True, error_model="numpy")
def _heights(first, last, points, rows, ring, out):  # type: ignore[no-untyped-def]
    for i in range(first, last):
        total = 0.0
        for q in range(ring.start[i], ring.start[i + 1]):
            total += dot(row(rows, i), minus(row(points, i), row(points, ring.neighbour[q])))
        out[i] = total / max(ring.start[i + 1] - ring.start[i], 1)


@njit(cache=True, nogil=True)
def _less_ring(first, last, height, ring, fewest, out):  # type: ignore[no-untyped-def]
    for i in range(first, last):
        count, mean = ring.start[i + 1] - ring.start[i], 0.0
        for q in range(ring.start[i], ring.start[i + 1]):
            mean += height[ring.neighbour[q]]
        out[i] = height[i] - mean / count if count >= fewest else np.nan


@njit(cache=True, nogil=True)
def _off_surface(first, last, points, rows, bends, patch, source, out):  # type: ignore[no-untyped-def]
    for i in range(first, last):
        j = source[i]
        out[i] = height_over(points, i, rows, bends, j) - 0.5 * bends[j, CURVATURE] * patch
