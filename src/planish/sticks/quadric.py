"""The normal of a surface at its edge, from a quadric fitted to the points of one side."""

from __future__ import annotations

import numpy as np
from numba import njit

from planish.sticks.crew import Crew
from planish.types import Floats, Ints

RINGS = 4
SAME_SIDE = np.cos(np.radians(20.0))


def refine(points: Floats, rows: Floats, ring: tuple[Ints, Ints], at: Ints, sigma: float, run: Crew) -> Floats:
    """Refit the normals of the points `at`, and leave the others."""
    out = rows.copy()
    run(_refine, len(at), points, rows, *ring, at, sigma, out)
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def _refine(first, last, points, rows, start, neighbour, at, sigma, out):  # type: ignore[no-untyped-def]
    for k in range(first, last):
        i = at[k]
        near = _same_side(i, rows, start, neighbour)
        if len(near) >= 12:
            _fit(points, rows, i, near, sigma, out)


@njit(cache=True, nogil=True)
def _same_side(i, rows, start, neighbour):  # type: ignore[no-untyped-def]
    near, seen = [i], {i}
    begin = 0
    for _ in range(RINGS):
        end = len(near)
        for q in range(begin, end):
            for r in range(start[near[q]], start[near[q] + 1]):
                j = neighbour[r]
                agree = rows[j, 0] * rows[i, 0] + rows[j, 1] * rows[i, 1] + rows[j, 2] * rows[i, 2]
                if agree > SAME_SIDE and j not in seen:
                    seen.add(j)
                    near.append(j)
        begin = end
    return near


@njit(cache=True, nogil=True, error_model="numpy")
def _fit(points, rows, i, near, sigma, out):  # type: ignore[no-untyped-def]
    n = rows[i, :3].astype(np.float64)
    s = np.array([0.0, n[2], -n[1]]) if abs(n[0]) < 0.9 else np.array([-n[2], 0.0, n[0]])
    s /= np.sqrt(s @ s)
    t = np.cross(n, s)
    basis = np.empty((len(near), 6))
    height = np.empty(len(near))
    for q in range(len(near)):
        d = points[near[q]] - points[i]
        u, v = d @ s, d @ t
        height[q] = d @ n
        basis[q, 0], basis[q, 1], basis[q, 2], basis[q, 3], basis[q, 4], basis[q, 5] = 1.0, u, v, u * u, u * v, v * v
    weight = np.ones(len(near))
    c = np.zeros(6)
    for _ in range(4):
        weighted = basis * weight.reshape(-1, 1)
        normal_matrix = basis.T @ weighted
        for x in range(6):
            normal_matrix[x, x] += 1e-9 * (1.0 + normal_matrix[x, x])
        c = np.linalg.solve(normal_matrix, weighted.T @ height)
        off = np.abs(height - basis @ c)
        scale = 4.0 * max(1.4826 * np.median(off), 0.3 * sigma, 1e-9)
        weight = np.maximum(1.0 - (off / scale) ** 2, 0.0) ** 2
    m = n - c[1] * s - c[2] * t
    m /= np.sqrt(m @ m)
    if m @ n > SAME_SIDE:
        out[i, :3] = m
