"""Normals without noise, sharp at creases."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planish.sticks.crew import Crew
from planish.types import Floats, Ints

Rows = NDArray[np.float32]
"""(n, 4) unit normal and area of every point, in one cache line."""

CREASE_PLACE = 0.6
"""A point belongs to a crease if more than this share of its ring lies across: 0.5 takes in whole borders of folds."""


def normal_rows(points: Floats, faces: Ints) -> Rows:
    """(n, 4) area-weighted unit normal of every point and twice the area of its faces [mm^2]."""
    return np.asarray(_normal_rows(points, faces))


def diffuse(rows: Rows, ring: tuple[Ints, Ints], reach: float, run: Crew) -> Rows:
    """One round of smoothing that stops at creases.

    N_i <- unit(A_i N_i + sum over the ring of A_j (1 - |N_i - N_j|^2 / reach)_+^2 N_j)
    """
    out = np.empty_like(rows)
    run(_diffuse, len(rows), rows, *ring, np.float32(1 / reach), out)
    return out


def typical_step(rows: Rows, edges: Ints) -> float:
    """Median |N_i - N_j|^2 over some 20,000 of the edges."""
    some = edges[:: max(1, len(edges) // 20_000)]
    step = rows[some[:, 0], :3] - rows[some[:, 1], :3]
    return float(np.median(np.einsum("ij,ij->i", step, step))) if len(some) else 0.0


def to_crease_sides(points: Floats, rows: Rows, ring: tuple[Ints, Ints], sigma: float, spacing: float, run: Crew) -> Rows:
    """Give points on a crease, whose normal is a mixture, that of the side they lie on."""
    spread = np.empty(len(rows), np.float32)
    run(_spread, len(rows), rows, *ring, spread)
    typical = float(np.median(spread))
    out = rows.copy()
    blur = 2 * sigma**2 + 1e-4 * spacing**2
    run(_choose_side, len(rows), points, rows, *ring, spread, max(typical, 1e-12), blur, out)
    return out


@njit(cache=True, nogil=True)
def _normal_rows(points, faces):  # type: ignore[no-untyped-def]
    out = np.zeros((len(points), 4), np.float32)
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        ux, uy, uz = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1], points[b, 2] - points[a, 2]
        vx, vy, vz = points[c, 0] - points[a, 0], points[c, 1] - points[a, 1], points[c, 2] - points[a, 2]
        x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        for i in (a, b, c):
            out[i, 0] += x
            out[i, 1] += y
            out[i, 2] += z
    for i in range(len(points)):
        length = np.sqrt(out[i, 0] ** 2 + out[i, 1] ** 2 + out[i, 2] ** 2)
        out[i, 3] = length
        if length > 0.0:
            out[i, :3] /= length
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def _diffuse(first, last, rows, start, neighbour, scale, out):  # type: ignore[no-untyped-def]
    one, tiny = np.float32(1), np.float32(1e-30)
    for i in range(first, last):
        x, y, z, area = rows[i, 0], rows[i, 1], rows[i, 2], rows[i, 3]
        sx, sy, sz = area * x, area * y, area * z
        for q in range(start[i], start[i + 1]):
            j = neighbour[q]
            u, v, w = rows[j, 0], rows[j, 1], rows[j, 2]
            near = one - scale * ((u - x) ** 2 + (v - y) ** 2 + (w - z) ** 2)
            if near > 0:
                near = near * near * rows[j, 3]
                sx += near * u
                sy += near * v
                sz += near * w
        shrink = one / max(np.sqrt(sx * sx + sy * sy + sz * sz), tiny)
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = sx * shrink, sy * shrink, sz * shrink, area


@njit(cache=True, nogil=True)
def _spread(first, last, rows, start, neighbour, out):  # type: ignore[no-untyped-def]
    """|N_i - N_j|^2 at the CREASE_PLACE of the ring in ascending order."""
    steps = np.empty(64, np.float32)
    for i in range(first, last):
        count = min(start[i + 1] - start[i], len(steps))
        for k in range(count):
            j, at = neighbour[start[i] + k], k
            step = (rows[i, 0] - rows[j, 0]) ** 2 + (rows[i, 1] - rows[j, 1]) ** 2 + (rows[i, 2] - rows[j, 2]) ** 2
            while at > 0 and steps[at - 1] > step:
                steps[at] = steps[at - 1]
                at -= 1
            steps[at] = step
        out[i] = steps[min(int(CREASE_PLACE * count), count - 1)] if count > 0 else 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def _choose_side(first, last, points, rows, start, neighbour, spread, typical, blur, out):  # type: ignore[no-untyped-def]
    for i in range(first, last):
        if spread[i] <= max(9.0 * typical, 0.02):
            continue
        best = np.inf
        for q in range(start[i], start[i + 1]):
            j = neighbour[q]
            if spread[j] >= spread[i] / 6.0:
                continue
            off = (
                rows[j, 0] * (points[i, 0] - points[j, 0])
                + rows[j, 1] * (points[i, 1] - points[j, 1])
                + rows[j, 2] * (points[i, 2] - points[j, 2])
            )
            cost = 3.0 * np.log(1.0 + spread[j] / typical) + off * off / blur
            if cost < best:
                best = cost
                out[i, :3] = rows[j, :3]
