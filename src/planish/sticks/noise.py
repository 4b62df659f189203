"""How noisy a scan is, and where, found from the scan itself."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from planish.crew import Crew
from planish.mesh import Topology
from planish.sticks.bends import Bends
from planish.sticks.creases import height_over
from planish.sticks.normals import Ring, Rows
from planish.sticks.vectors import dot, minus, row
from planish.types import Floats, Ints

FROM_MEDIAN, FROM_MEAN = 1.4826, 1.2533
"""Standard deviation of a normal variable over the median and the mean of its size."""

RING_GAIN = 1.36
"""What white noise becomes in `ring_noise`, on regular and random meshes alike (within 3 % at 0.01 to 0.2 mm)."""

CELL = 12
"""Side of the cells that noise is averaged in, in edges; with their neighbours they hold 1,000 points or so."""

OUTLIER = 4.0
"""Values over so many medians count as that: a crease is no noise, but noise may differ by this over a sheet."""


def angle_defects(rest: Floats, faces: Ints, topology: Topology, point_count: int, run: Crew) -> Floats:
    """|2 pi - sum of the angles| at the points inside the sheet, for triangles of the edge lengths `rest`.

    Nought where a sheet can lie flat, however it is bent; noise makes it buckle everywhere.
    """
    angles = np.empty((len(faces), 3), np.float32)
    run(_angles, len(faces), rest, topology.face_edges, angles)
    sums = _sum_corners(angles, faces, point_count)
    inner = np.ones(point_count, bool)
    inner[topology.edges[topology.edge_uses != 2]] = False
    inner &= sums > 0.0
    return np.abs(2 * np.pi - sums[inner])


def ring_noise(points: Floats, rows: Rows, ring: Ring, run: Crew) -> Floats:
    """(n,) size of white noise [mm] at every point, from how far it stands out of its ring.

    Bending cancels in the difference of a point's height over its ring and the ring's mean height; noise does not.
    Scaled so that the median is the standard deviation; nan where a point has fewer than five neighbours. Noise that
    is alike over several pixels cancels too, and is not seen here.
    """
    height, off = np.empty(len(points), np.float32), np.empty(len(points), np.float32)
    run(_heights, len(points), points, rows, ring, height)
    run(_less_ring, len(points), height, ring, off)
    return np.asarray(np.abs(off) * np.float32(FROM_MEDIAN / RING_GAIN))


def surface_noise(points: Floats, rows: Rows, bends: Bends, source: Ints, spread_mm2: float, run: Crew) -> Floats:
    """(n,) distance [mm] of every point from the smooth surface, white or not.

    Parameters
    ----------
    spread_mm2 : float
        Mean square width, across the rulings, of the patch that every place is the average of: the average of a
        bent patch lies off the surface by half its curvature times that.
    """
    off = np.empty(len(points), np.float32)
    run(_off_surface, len(points), points, rows, bends, source, spread_mm2, off)
    return off


def around(points: Floats, values: Floats, spacing: float) -> Floats:
    """(n,) mean of the finite values in cells of CELL edges and those next to them, of every point's cell.

    Examples
    --------
    >>> x = np.arange(1000.0)
    >>> values = np.where(x < 500, 1.0, 3.0)
    >>> around(np.c_[x, 0 * x, 0 * x], values, 1.0)[[0, 499, 999]].round(1)
    array([1. , 2. , 3. ])
    """
    if not len(points):
        return np.zeros(0)
    low, span = points.min(axis=0), np.ptp(points, axis=0)
    side = max(CELL * spacing, float(span.max()) / 200, 1e-12)
    shape = np.append(np.maximum((span / side).astype(np.int64) + 1, 1), 1)
    cell = ((points - low) * (1 / side)).astype(np.int64) @ np.array([shape[1] * shape[2], shape[2], 1])
    known = np.isfinite(values)
    some = np.minimum(values[known], OUTLIER * np.median(values[known])) if known.any() else values[known]
    sums = np.bincount(cell[known], some, math.prod(shape)).reshape(shape[:3])
    counts = np.bincount(cell[known], minlength=math.prod(shape)).astype(np.float64).reshape(shape[:3])
    sums, counts = _with_neighbours(sums), _with_neighbours(counts)
    return np.asarray((sums / np.maximum(counts, 1)).ravel()[cell])


def _with_neighbours(cells: Floats) -> Floats:
    """Sums over 3 x 3 x 3 cells."""
    for axis in range(3):
        padded = np.moveaxis(np.pad(cells, [(1, 1) if k == axis else (0, 0) for k in range(3)]), axis, 0)
        cells = np.moveaxis(padded[:-2] + padded[1:-1] + padded[2:], 0, axis)
    return cells


@njit(cache=True, nogil=True, error_model="numpy")
def _angles(first, last, rest, face_edges, out):  # type: ignore[no-untyped-def]
    for f in range(first, last):
        for k in range(3):  # edge k joins corners k and k + 1, so edge k + 1 lies opposite to corner k
            u, v = rest[face_edges[f, k]], rest[face_edges[f, (k + 2) % 3]]
            opposite = rest[face_edges[f, (k + 1) % 3]]
            cosine = (u * u + v * v - opposite * opposite) / (2.0 * u * v) if u > 0.0 and v > 0.0 else 1.0
            out[f, k] = math.acos(min(1.0, max(-1.0, cosine)))


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
def _less_ring(first, last, height, ring, out):  # type: ignore[no-untyped-def]
    for i in range(first, last):
        count, mean = ring.start[i + 1] - ring.start[i], 0.0
        for q in range(ring.start[i], ring.start[i + 1]):
            mean += height[ring.neighbour[q]]
        out[i] = height[i] - mean / count if count >= 5 else np.nan


@njit(cache=True, nogil=True)
def _off_surface(first, last, points, rows, bends, source, spread_mm2, out):  # type: ignore[no-untyped-def]
    for i in range(first, last):
        j = source[i]
        sag = 0.5 * bends[j, 3] * spread_mm2
        out[i] = abs(height_over(points, i, rows, bends, j) - sag)
