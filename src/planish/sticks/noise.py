"""How noisy a scan is, found from the scan itself."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from planish.mesh import Topology
from planish.sticks.crew import Crew
from planish.sticks.normals import PLACE, Ring, Rows
from planish.sticks.vectors import dot, minus, row
from planish.types import Floats, Ints


def angle_defects(rest: Floats, faces: Ints, topology: Topology, point_count: int, run: Crew) -> Floats:
    """|2 pi - sum of the angles| at the points inside the sheet, for triangles of the edge lengths `rest`.

    Nought where a sheet can lie flat, whatever its shape; noise makes it buckle everywhere.
    """
    angles = np.empty((len(faces), 3), np.float32)
    run(_angles, len(faces), rest, topology.face_edges, angles)
    sums = _sum_corners(angles, faces, point_count)
    inner = np.ones(point_count, bool)
    inner[topology.edges[topology.edge_uses != 2]] = False
    return np.abs(2 * np.pi - sums[inner])


def ring_noise(points: Floats, rows: Rows, ring: Ring, run: Crew) -> float:
    """Standard deviation of white noise [mm], from how far points stick out of their rings.

    Bending cancels in the difference of a point's height and its ring's mean height, noise does not: its standard
    deviation is 1.36 sigma on a regular mesh (within 3 % of the truth on scans with white noise).
    """
    height, off = np.empty(len(points), np.float32), np.empty(len(points), np.float32)
    run(_heights, len(points), points, rows, ring, height)
    run(_less_ring, len(points), height, ring, off)
    off = off[np.isfinite(off)]
    return 1.4826 / 1.36 * float(np.median(np.abs(off))) if len(off) else 0.0


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
