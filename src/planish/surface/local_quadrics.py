"""Points moved onto quadrics fitted around them: what takes out noise so strong that the mesh has no normals."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planish.geometry.linear import solve_symmetric
from planish.geometry.vectors import dot, minus, row, tangents
from planish.parallel import ParallelFor
from planish.surface.noise_scale import UNKNOWNS
from planish.surface.normals import AREA, OneRing, VertexRecords
from planish.types import Floats, Ints

ROOM = 600
"""Neighbours that are used at most."""

REACH = 2.2
"""Neighbours count up to this many radii away, where their weight is 0.09."""

SAME_SIDE = math.cos(math.radians(20.0))
"""Neighbours whose averaged normals differ by more than 20 degrees lie across a fold. With 30 degrees a letter folded
by 46 and 56 is 0.23 % too small, with 50 degrees 0.30 %, so 0.14 %."""

SAME_SIDE_OF_STEEP = math.cos(math.radians(50.0))
"""The same, while normals are still rough, or always where the mesh is: with 20 degrees a plane under noise of one
edge, shared over 1.5, is 2.7 % too large, with 50 degrees 0.8 %; but folds of 46 degrees are rounded."""

NORMAL_ROUNDS = 12
"""Rounds of averaging of the area vectors that tell one side of a fold from the other."""

STIFF = 0.02
"""Of a fit against bending, in parts of its weight: at the border, where a quadric has points on one side only."""


def average_normals(rows: VertexRecords, ring: OneRing) -> NDArray[np.float32]:
    """(n, 3) unit normals from area vectors averaged over NORMAL_ROUNDS rings: linear, so noise cancels."""
    vectors = rows[:, :3] * rows[:, AREA : AREA + 1]
    count = np.diff(ring.start).astype(np.float32)[:, None] + 1
    start = ring.start[:-1]
    some = np.diff(ring.start) > 0
    for _ in range(NORMAL_ROUNDS):
        sums = np.zeros_like(vectors)
        sums[some] = np.add.reduceat(vectors[ring.neighbour], start[some], axis=0)
        vectors = (vectors + sums) / count
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-30), np.float32)


def onto_quadrics(
    points: Floats,
    normals: NDArray[np.float32],
    directions: Floats,
    ring: OneRing,
    radius: float,
    parallel_for: ParallelFor,
    same_side: float,
    at: Ints | None = None,
) -> Floats:
    """Move points along their directions onto quadrics fitted to their neighbours, with Gaussian weights.

    Parameters
    ----------
    points : (n, 3) float64 [mm]
    normals : (n, 3) float32
        That tell the sides of folds apart.
    directions : (n, 3) float64
        Unit vectors, along which the noise is: the rays, or the normals.
    ring : OneRing
    radius : float [mm]
        Standard deviation of the weights.
    same_side : float
        Least cosine between the normals of neighbours that count.
    at : (k,) int32, optional
        Rows of the points that are moved; by default all.

    Returns
    -------
    (n, 3) float64 [mm]
    """
    moved = points.copy()
    at = np.arange(len(points), dtype=np.int32) if at is None else at
    parallel_for(
        _onto_quadrics, len(at), at, points, normals, directions, ring, 1 / radius, REACH**2, same_side, STIFF, moved,
        block=2048,
    )  # fmt: skip
    return moved


@njit(cache=True, nogil=True, error_model="numpy")
def _onto_quadrics(first, last, at, points, normals, directions, ring, scale, reach, same_side, stiff, moved):  # type: ignore[no-untyped-def]
    near, stamp = np.empty(ROOM, np.int32), np.zeros(len(points), np.int32)
    matrix, terms = np.empty((UNKNOWNS, UNKNOWNS + 1)), np.empty(UNKNOWNS)
    for m in range(first, last):
        i = at[m]
        axis, n, place = row(directions, i), row(normals, i), row(points, i)
        s, t = tangents(axis)
        near[0], stamp[i], count, done = i, i + 1, 1, 0
        matrix[:] = 0.0
        while done < count:
            j = near[done]
            done += 1
            step = minus(row(points, j), place)
            u, v, height = scale * dot(step, s), scale * dot(step, t), dot(step, axis)
            agree = max(0.0, (dot(row(normals, j), n) - same_side) / (1.0 - same_side))
            weight = math.exp(-0.5 * (u * u + v * v)) * agree * agree
            terms[0], terms[1], terms[2], terms[3], terms[4], terms[5] = 1.0, u, v, u * u, u * v, v * v
            for x in range(UNKNOWNS):
                for y in range(x, UNKNOWNS):
                    matrix[x, y] += weight * terms[x] * terms[y]
                matrix[x, UNKNOWNS] += weight * terms[x] * height
            for q in range(ring.start[j], ring.start[j + 1]):
                k = ring.neighbour[q]
                if stamp[k] == i + 1 or count == len(near):
                    continue
                step = minus(row(points, k), place)
                u, v = scale * dot(step, s), scale * dot(step, t)
                if u * u + v * v < reach and dot(row(normals, k), n) > same_side:
                    stamp[k], near[count] = i + 1, k
                    count += 1
        for x in range(3, UNKNOWNS):
            matrix[x, x] += stiff * matrix[0, 0]
        solve_symmetric(matrix)
        for c in range(3):
            moved[i, c] = points[i, c] + axis[c] * matrix[0, UNKNOWNS]
