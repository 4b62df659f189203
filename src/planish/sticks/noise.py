"""How noisy a scan is, found from the scan itself."""

from __future__ import annotations

import numpy as np
from numba import njit

from planish.sticks.crew import Crew
from planish.types import Bools, Floats, Ints


def residuals(points: Floats, rows: Floats, ring: tuple[Ints, Ints], run: Crew) -> Floats:
    """(n,) how far every point sticks out of its ring, less how far the ring's points do on average [mm].

    Bending cancels in the difference, noise does not. NaN where a point has fewer than five neighbours.
    """
    start, neighbour = ring
    height, out = np.empty(len(points), np.float32), np.empty(len(points), np.float32)
    run(_heights, len(points), points, rows, start, neighbour, height)
    run(_less_ring, len(points), height, start, neighbour, out)
    return out


def angle_defect(rest: Floats, faces: Ints, face_edges: Ints, inner: Bools) -> float:
    """Median over the inner points of |2 pi - sum of the angles|, for triangles of the edge lengths `rest`."""
    sums = _angle_sums(rest, faces, face_edges, len(inner))
    return float(np.median(np.abs(2 * np.pi - sums[inner]))) if inner.any() else 0.0


@njit(cache=True, nogil=True)
def _heights(first, last, points, rows, start, neighbour, out):  # type: ignore[no-untyped-def]
    for i in range(first, last):
        x, y, z = 0.0, 0.0, 0.0
        for q in range(start[i], start[i + 1]):
            j = neighbour[q]
            x += points[j, 0] - points[i, 0]
            y += points[j, 1] - points[i, 1]
            z += points[j, 2] - points[i, 2]
        count = max(start[i + 1] - start[i], 1)
        out[i] = -(rows[i, 0] * x + rows[i, 1] * y + rows[i, 2] * z) / count


@njit(cache=True, nogil=True)
def _less_ring(first, last, height, start, neighbour, out):  # type: ignore[no-untyped-def]
    for i in range(first, last):
        count = start[i + 1] - start[i]
        if count < 5:
            out[i] = np.nan
            continue
        mean = 0.0
        for q in range(start[i], start[i + 1]):
            mean += height[neighbour[q]]
        out[i] = height[i] - mean / count


@njit(cache=True, nogil=True, error_model="numpy")
def _angle_sums(rest, faces, face_edges, point_count):  # type: ignore[no-untyped-def]
    sums = np.zeros(point_count)
    for f in range(len(faces)):
        for k in range(3):  # edge k joins corners k and k + 1, so edge k + 1 lies opposite to corner k
            u, v = rest[face_edges[f, k]], rest[face_edges[f, (k + 2) % 3]]
            o = rest[face_edges[f, (k + 1) % 3]]
            if u > 0.0 and v > 0.0:
                cosine = (u * u + v * v - o * o) / (2.0 * u * v)
                sums[faces[f, k]] += np.arccos(min(1.0, max(-1.0, cosine)))
    return sums
