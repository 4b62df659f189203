"""Layers of a sheet that lies over itself: found near each other, kept apart, and counted when they pass through.

Lengths are in median sticks, the unit of the particle system.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from planish.geometry.guards import TINY

REACH = 0.5
"""A point and a face closer than this at the start of a step are watched through the step."""
CELL = 1.0
"""Side of the grid's cells, unless so small ones would be too many."""
MOST_CELLS, CELLS_PER_POINT = 100_000, 16
"""The grid has no more cells than this, or than so many for each point: 40 MB for a sheet of 300,000 points, where
cells of side 1 over its box would take 800. Sheets of the usual 1,000 points have a third of it at most."""
FASTEST = 0.2
"""No particle moves farther in a step when layers are kept apart: two that meet head-on are still seen coming."""


@njit(cache=True)
def slow_down(x, before):  # type: ignore[no-untyped-def]
    """Shorten what a particle has moved since the last step, and so its speed, to `FASTEST`."""
    for i in range(len(x)):
        far = 0.0
        for k in range(3):
            far += (x[i, k] - before[i, k]) ** 2
        if far > FASTEST * FASTEST:
            part = FASTEST / np.sqrt(far)
            for k in range(3):
                before[i, k] = x[i, k] - part * (x[i, k] - before[i, k])


@njit(cache=True)
def near_pairs(x, faces, start, around):  # type: ignore[no-untyped-def]
    """Points and faces near each other that are not neighbours on the sheet, and the side on which each point is.

    Points are sorted into the cells of a grid; each face looks into the cells that its box, widened by `REACH`,
    touches.

    Parameters
    ----------
    x : (n, 3) float64
    faces : (m, 3) int32
    start, around : int32
        Neighbours of every point, see `planish.mesh.neighbours`.

    Returns
    -------
    pairs : (k, 2) int32
        Point, face.
    side : (k,) float64
        1 where the point is in front of the face, -1 behind it.
    """
    pairs = np.empty((1024, 2), np.int32)
    side = np.empty(1024)
    found = 0
    if not np.isfinite(x.sum()):  # the simulation is lost, and its caller will see that
        return pairs[:0], side[:0]
    low, width, shape, inside, first = _sorted_into_cells(x)
    lo, hi = np.empty(3, np.int64), np.empty(3, np.int64)
    for f in range(len(faces)):
        for k in range(3):
            a, b, c = x[faces[f, 0], k], x[faces[f, 1], k], x[faces[f, 2], k]
            lo[k] = min(max(int((min(a, b, c) - REACH - low[k]) / width), 0), shape[k] - 1)
            hi[k] = min(max(int((max(a, b, c) + REACH - low[k]) / width), 0), shape[k] - 1)
        for u in range(lo[0], hi[0] + 1):
            for v in range(lo[1], hi[1] + 1):
                row = (u * shape[1] + v) * shape[2]
                for q in range(first[row + lo[2]], first[row + hi[2] + 1]):  # cells in z follow one another
                    i = inside[q]
                    height, w0, w1, w2 = over_face(x, i, faces, f)
                    if abs(height) > REACH or min(w0, w1, w2) < -0.5 or height == 0.0:
                        continue
                    if _neighbours(i, faces, f, start, around):
                        continue
                    if found == len(pairs):
                        pairs = np.concatenate((pairs, np.empty_like(pairs)))
                        side = np.concatenate((side, np.empty_like(side)))
                    pairs[found, 0], pairs[found, 1] = i, f
                    side[found] = np.sign(height)
                    found += 1
    return pairs[:found].copy(), side[:found].copy()


@njit(cache=True)
def _sorted_into_cells(x):  # type: ignore[no-untyped-def]
    """Corner, side of the cells and shape of a grid over the points; the points by cell, and the first of each cell."""
    low, high = np.empty(3), np.empty(3)
    for k in range(3):
        low[k], high[k] = x[:, k].min(), x[:, k].max()
    most = max(MOST_CELLS, CELLS_PER_POINT * len(x))
    side = CELL
    while True:
        cells = 1.0
        for k in range(3):
            cells *= np.floor((high[k] - low[k]) / side) + 1.0
        if cells <= most:
            break
        side *= 1.25
    shape = np.empty(3, np.int64)
    for k in range(3):
        shape[k] = int((high[k] - low[k]) / side) + 1
    cell = np.empty(len(x), np.int64)
    first = np.zeros(shape[0] * shape[1] * shape[2] + 1, np.int32)
    for i in range(len(x)):
        at = 0
        for k in range(3):
            at = at * shape[k] + min(int((x[i, k] - low[k]) / side), shape[k] - 1)
        cell[i] = at
        first[at + 1] += 1
    for at in range(len(first) - 1):
        first[at + 1] += first[at]
    fill = first[:-1].copy()
    inside = np.empty(len(x), np.int32)
    for i in range(len(x)):
        inside[fill[cell[i]]] = i
        fill[cell[i]] += 1
    return low, side, shape, inside, first


@njit(cache=True)
def keep_apart(x, faces, pairs, side, thickness):  # type: ignore[no-untyped-def]
    """Push each watched point back to its side of the face, a thickness away, point and corners sharing the way.

    The constraint side * (p - a).n >= thickness of a point p over a face with normal n is made good along its
    gradient, n for the point and -w_k n for the corners (Mueller et al. 2007, eq. 9 and 4.3).
    """
    for q in range(len(pairs)):
        i, f = pairs[q, 0], pairs[q, 1]
        height, w0, w1, w2 = over_face(x, i, faces, f)
        if min(w0, w1, w2) < 0.0:
            continue
        lacking = thickness - side[q] * height
        if lacking <= 0.0:
            continue
        n = _normal(x, faces, f)
        push = side[q] * lacking / (1.0 + w0 * w0 + w1 * w1 + w2 * w2)
        for k in range(3):
            x[i, k] += push * n[k]
            x[faces[f, 0], k] -= push * w0 * n[k]
            x[faces[f, 1], k] -= push * w1 * n[k]
            x[faces[f, 2], k] -= push * w2 * n[k]


@njit(cache=True)
def mark_passed(x, faces, pairs, side, passed):  # type: ignore[no-untyped-def]
    """Mark the points that stand on the other side of a face than at the start of the step."""
    for q in range(len(pairs)):
        height, w0, w1, w2 = over_face(x, pairs[q, 0], faces, pairs[q, 1])
        if min(w0, w1, w2) >= 0.0 and side[q] * height < -1e-9:
            passed[pairs[q, 0]] = True


@njit(cache=True)
def over_face(x, i, faces, f):  # type: ignore[no-untyped-def]
    """Height of a point over the plane of a face, and where its foot lies in it (barycentric)."""
    a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
    ux, uy, uz = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
    vx, vy, vz = x[c, 0] - x[a, 0], x[c, 1] - x[a, 1], x[c, 2] - x[a, 2]
    px, py, pz = x[i, 0] - x[a, 0], x[i, 1] - x[a, 1], x[i, 2] - x[a, 2]
    uu, uv, vv = ux * ux + uy * uy + uz * uz, ux * vx + uy * vy + uz * vz, vx * vx + vy * vy + vz * vz
    up, vp = ux * px + uy * py + uz * pz, vx * px + vy * py + vz * pz
    det = uu * vv - uv * uv
    if det <= 1e-12 * uu * vv:
        return 0.0, -9.0, -9.0, -9.0
    w1, w2 = (up * vv - vp * uv) / det, (vp * uu - up * uv) / det
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    return (px * nx + py * ny + pz * nz) / np.sqrt(det), 1.0 - w1 - w2, w1, w2


@njit(cache=True)
def _normal(x, faces, f):  # type: ignore[no-untyped-def]
    a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
    ux, uy, uz = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
    vx, vy, vz = x[c, 0] - x[a, 0], x[c, 1] - x[a, 1], x[c, 2] - x[a, 2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    length = max(np.sqrt(nx * nx + ny * ny + nz * nz), TINY)
    return nx / length, ny / length, nz / length


@njit(cache=True)
def _neighbours(i, faces, f, start, around):  # type: ignore[no-untyped-def]
    """Whether a face touches a point or one of the point's neighbours: there the sticks rule."""
    for k in range(3):
        corner = faces[f, k]
        if corner == i:
            return True
        for q in range(start[i], start[i + 1]):
            if around[q] == corner:
                return True
    return False
