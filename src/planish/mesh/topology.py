"""Edges of a triangle mesh and the faces at each of them, found in one pass."""

from __future__ import annotations

import numpy as np
from numba import njit

from planish.types import Ints, Topology


def topology(faces: Ints, point_count: int) -> Topology:
    """Find all edges of a mesh and their faces.

    Half-edges are bucketed by their smaller point and each bucket, about six long, is sorted by insertion: one
    pass over memory, where sorting all half-edges takes several times as long.

    Parameters
    ----------
    faces : (m, 3) int32
    point_count : int
        Rows of the point array that the faces refer to.

    Examples
    --------
    >>> import numpy as np
    >>> t = topology(np.array([[0, 1, 2], [2, 1, 3]], np.int32), 4)
    >>> t.edges.tolist()
    [[0, 1], [0, 2], [1, 2], [1, 3], [2, 3]]
    >>> t.edge_faces.tolist()
    [[0, -1], [0, -1], [0, 1], [1, -1], [1, -1]]
    """
    return Topology(*_find_edges(np.ascontiguousarray(faces, np.int32), point_count))


@njit(cache=True)
def _find_edges(faces, point_count):  # type: ignore[no-untyped-def]
    m = len(faces)
    start = np.zeros(point_count + 1, np.int64)
    for f in range(m):
        for k in range(3):
            start[min(faces[f, k], faces[f, (k + 1) % 3]) + 1] += 1
    for i in range(point_count):
        start[i + 1] += start[i]

    # Bucket the half-edges by their smaller point; half holds 3 * face + corner.
    fill = start[:-1].copy()
    half = np.empty(3 * m, np.int64)
    other = np.empty(3 * m, np.int32)
    for f in range(m):
        for k in range(3):
            a, b = faces[f, k], faces[f, (k + 1) % 3]
            at = fill[min(a, b)]
            fill[min(a, b)] += 1
            half[at] = 3 * f + k
            other[at] = max(a, b)

    edges = np.empty((3 * m, 2), np.int32)
    edge_faces = np.full((3 * m, 2), -1, np.int32)
    edge_uses = np.zeros(3 * m, np.int32)
    face_edges = np.empty((m, 3), np.int32)
    count = 0
    for i in range(point_count):
        lo, hi = start[i], start[i + 1]
        for j in range(lo + 1, hi):  # insertion sort, stable: faces stay in ascending order within an edge
            key, mate, at = half[j], other[j], j
            while at > lo and other[at - 1] > mate:
                half[at], other[at] = half[at - 1], other[at - 1]
                at -= 1
            half[at], other[at] = key, mate
        for j in range(lo, hi):
            if j == lo or other[j] != other[j - 1]:
                edges[count, 0] = i
                edges[count, 1] = other[j]
                count += 1
            e = count - 1
            f, k = half[j] // 3, half[j] % 3
            if edge_uses[e] < 2:
                edge_faces[e, edge_uses[e]] = f
            edge_uses[e] += 1
            face_edges[f, k] = e
    return edges[:count].copy(), edge_faces[:count].copy(), edge_uses[:count].copy(), face_edges
