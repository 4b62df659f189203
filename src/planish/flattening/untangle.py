"""Turn faces that lie with their back up over again, by moving single points as little as possible.

For a point the condition that a face around it keeps a least area is a half-plane, bounded by a line along the
face's other side. So the place to go to is the nearest point of a small convex polygon, which lies at the point
itself, at its foot on one of the lines, or where two of them meet.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from planish.mesh import Topology
from planish.mesh.adjacency import faces_around
from planish.mesh.measures import LEAST_HEIGHT, relative_height
from planish.types import Floats, Ints

LEAST = 0.1
"""Area that a face must keep, as a share of what its rest lengths give it. Tried smaller where there is no room."""

WITHOUT_GAIN = 8
"""Rounds over all points of flipped faces in a row without one flip less."""

LOOSENED, ROUNDS = 6, 30
"""How often a knot that single points cannot undo is loosened, each time by one more ring of faces around it: all
points within go to the mean of their neighbours, in so many rounds, which opens it where its rim is nearly convex."""

KNOTS, FEW = 0.01, 200
"""With more than this part of all faces flipped, and not just a few, there are no knots but a surface that cannot lie
flat."""


def untangle(xy: Floats, faces: Ints, topology: Topology, edge_rest: Floats) -> tuple[Floats, int]:
    """Turn flipped faces over where there is room for them.

    Faces without area (`planish.mesh.LEAST_HEIGHT`) may lie either way up: to turn a cap of 179 degrees over would
    drag its neighbours by many times its height.

    Parameters
    ----------
    xy : (n, 2) float64 [mm]
        x right, y up.
    faces : (m, 3) int32
        Counter-clockwise seen from the printed side.
    topology : Topology
    edge_rest : (e,) float64 [mm]

    Returns
    -------
    xy : (n, 2) float64 [mm]
    flipped : int
        Faces that are still flipped, or have lost their area.
    """
    if not len(_flipped(xy, faces)):
        return xy, 0
    need = _least_areas(topology.face_edges, edge_rest)
    flipped = _flipped_with_area(xy, faces, need)
    if not len(flipped):
        return xy, 0
    around, face = faces_around(faces, len(xy))
    fixed = np.zeros(len(xy), np.bool_)
    fixed[topology.edges[topology.edge_uses == 1]] = True
    xy = xy.copy()
    flipped = _turn_over(xy, faces, around, face, need, flipped)
    for wide in range(1, LOOSENED + 1):
        if 0 < len(flipped) <= max(KNOTS * len(faces), FEW):
            _loosen(xy, faces, around, face, fixed, flipped, wide)
            flipped = _turn_over(xy, faces, around, face, need, _flipped_with_area(xy, faces, need))
    return xy, len(_flipped_with_area(xy, faces, need))


@njit(cache=True, nogil=True)
def _double_area(xy, faces, f):  # type: ignore[no-untyped-def]
    a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
    return (xy[b, 0] - xy[a, 0]) * (xy[c, 1] - xy[a, 1]) - (xy[c, 0] - xy[a, 0]) * (xy[b, 1] - xy[a, 1])


@njit(cache=True, nogil=True)
def _flipped(xy, faces):  # type: ignore[no-untyped-def]
    found = np.empty(len(faces), np.int32)
    count = 0
    for f in range(len(faces)):
        if not _double_area(xy, faces, f) > 0.0:
            found[count] = f
            count += 1
    return found[:count].copy()


@njit(cache=True, nogil=True)
def _flipped_with_area(xy, faces, need):  # type: ignore[no-untyped-def]
    flipped = _flipped(xy, faces)
    return flipped[need[flipped] > 0.0]


@njit(cache=True, nogil=True)
def _least_areas(face_edges, rest):  # type: ignore[no-untyped-def]
    """Twice the area that each face should keep; 0 for those without area, which are left as they lie."""
    need = np.zeros(len(face_edges))
    for f in range(len(face_edges)):
        a, b, c = rest[face_edges[f, 0]], rest[face_edges[f, 1]], rest[face_edges[f, 2]]
        height = relative_height(a, b, c)
        if height >= LEAST_HEIGHT:
            need[f] = LEAST * height * max(a, b, c) ** 2
    return need


@njit(cache=True, nogil=True)
def _turn_over(xy, faces, around, face, need, flipped):  # type: ignore[no-untyped-def]
    """Move points one by one until no face is flipped, or nothing is gained any more; the faces that still are."""
    lines = np.empty((64, 3))
    fewest, idle = len(flipped), 0
    share = 1.0
    while len(flipped) and idle < WITHOUT_GAIN:
        for f in flipped:
            for k in range(3):
                i = faces[f, k]
                count, reach = _lines(i, xy, faces, around, face, need, share, lines)
                _move(i, xy, lines[:count], reach)
        # Only faces around the points that were moved can have changed.
        flipped = _flipped_near(xy, faces, around, face, need, flipped)
        idle += 1
        if len(flipped) < fewest:
            fewest, idle = len(flipped), 0
        if idle > 2:
            share *= 0.3
    return flipped


@njit(cache=True, nogil=True)
def _loosen(xy, faces, around, face, fixed, flipped, wide):  # type: ignore[no-untyped-def]
    """Bring the points within `wide` faces of flipped ones to the mean of their neighbours, but for the border's."""
    knot = np.unique(faces[flipped])
    for _ in range(wide):
        near = [np.int32(0) for _ in range(0)]
        for i in knot:
            for at in range(around[i], around[i + 1]):
                for k in range(3):
                    near.append(faces[face[at], k])
        knot = np.unique(np.array(near))
    for _ in range(ROUNDS):
        for i in knot:
            if fixed[i]:
                continue
            x, y, count = 0.0, 0.0, 2 * (around[i + 1] - around[i])
            for at in range(around[i], around[i + 1]):
                for k in range(3):
                    x += xy[faces[face[at], k], 0]
                    y += xy[faces[face[at], k], 1]
            xy[i, 0] = (x - 0.5 * count * xy[i, 0]) / count
            xy[i, 1] = (y - 0.5 * count * xy[i, 1]) / count


@njit(cache=True, nogil=True)
def _flipped_near(xy, faces, around, face, need, old):  # type: ignore[no-untyped-def]
    near = np.empty(len(old) * 3 * 64, np.int32)
    count = 0
    for f in old:
        for k in range(3):
            i = faces[f, k]
            for at in range(around[i], around[i + 1]):
                g = face[at]
                if count < len(near) and need[g] > 0.0 and not _double_area(xy, faces, g) > 0.0:
                    near[count] = g
                    count += 1
    return np.unique(near[:count])


@njit(cache=True, nogil=True, error_model="numpy")
def _lines(i, xy, faces, around, face, need, share, lines):  # type: ignore[no-untyped-def]
    """Half-planes u x + v y >= w, (u, v) of length 1, in which point i leaves the faces around it their least areas.

    Also the square of the longest of the other sides: as far as a point may be moved at once.
    """
    count, reach = 0, 0.0
    for at in range(around[i], min(around[i + 1], around[i] + len(lines))):
        f = face[at]
        k = 0 if faces[f, 0] == i else (1 if faces[f, 1] == i else 2)
        q, r = faces[f, (k + 1) % 3], faces[f, (k + 2) % 3]
        dx, dy = xy[r, 0] - xy[q, 0], xy[r, 1] - xy[q, 1]
        length = np.sqrt(dx * dx + dy * dy)
        if length > 0.0 and need[f] > 0.0:
            u, v = -dy / length, dx / length
            lines[count, 0], lines[count, 1] = u, v
            lines[count, 2] = u * xy[q, 0] + v * xy[q, 1] + share * need[f] / length
            count += 1
            reach = max(reach, length * length)
    return count, reach


@njit(cache=True, nogil=True, error_model="numpy")
def _move(i, xy, lines, reach):  # type: ignore[no-untyped-def]
    """Put a point on the nearest place inside all half-planes; where there is none, on the least bad place met."""
    x0, y0 = xy[i, 0], xy[i, 1]
    if _worst(x0, y0, lines) >= 0.0:
        return
    best, best_x, best_y = np.inf, x0, y0
    least_bad, bad_x, bad_y = _worst(x0, y0, lines), x0, y0
    for a in range(len(lines)):
        for b in range(a, len(lines)):
            if a == b:  # the foot on line a
                off = lines[a, 2] - lines[a, 0] * x0 - lines[a, 1] * y0
                x, y = x0 + off * lines[a, 0], y0 + off * lines[a, 1]
            else:  # where lines a and b meet
                det = lines[a, 0] * lines[b, 1] - lines[a, 1] * lines[b, 0]
                if abs(det) < 1e-6:
                    continue
                x = (lines[a, 2] * lines[b, 1] - lines[b, 2] * lines[a, 1]) / det
                y = (lines[a, 0] * lines[b, 2] - lines[b, 0] * lines[a, 2]) / det
            slack = _worst(x, y, lines)
            distance = (x - x0) ** 2 + (y - y0) ** 2
            if distance > reach:
                continue
            if slack > -1e-12 and distance < best:
                best, best_x, best_y = distance, x, y
            if slack > least_bad:
                least_bad, bad_x, bad_y = slack, x, y
    if best < np.inf:
        xy[i, 0], xy[i, 1] = best_x, best_y
    else:
        xy[i, 0], xy[i, 1] = 0.5 * (x0 + bad_x), 0.5 * (y0 + bad_y)


@njit(cache=True, nogil=True)
def _worst(x, y, lines):  # type: ignore[no-untyped-def]
    """Distance inside the half-plane that is entered least; negative outside."""
    worst = np.inf
    for a in range(len(lines)):
        worst = min(worst, lines[a, 0] * x + lines[a, 1] * y - lines[a, 2])
    return worst
