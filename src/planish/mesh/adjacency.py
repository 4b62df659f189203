"""Who meets whom at a point: neighbours and faces as compressed rows."""

from __future__ import annotations

import numpy as np
from numba import njit

from planish.types import Ints


def neighbours(edges: Ints, point_count: int) -> tuple[Ints, Ints]:
    """Neighbours of every point along the edges, as compressed rows.

    Parameters
    ----------
    edges : (e, 2) int32
        In ascending order, as `Topology.edges` are; then every row is in ascending order too.
    point_count : int

    Returns
    -------
    start : (n + 1,) int32
        Row i is `neighbour[start[i]:start[i + 1]]`.
    neighbour : (2 e,) int32

    Examples
    --------
    >>> start, neighbour = neighbours(np.array([[0, 1], [0, 2], [1, 2]], np.int32), 3)
    >>> start.tolist(), neighbour.tolist()
    ([0, 2, 4, 6], [1, 2, 0, 2, 0, 1])
    """
    return _other_ends(edges, point_count)


def faces_around(faces: Ints, point_count: int) -> tuple[Ints, Ints]:
    """Faces around every point, as compressed rows: (n + 1,) starts and (3 m,) faces, ascending in each row.

    Examples
    --------
    >>> start, face = faces_around(np.array([[0, 1, 2], [2, 1, 3]], np.int32), 4)
    >>> face[start[1]:start[2]].tolist()
    [0, 1]
    """
    return _bucket_faces(faces, point_count)


@njit(cache=True, nogil=True)
def _starts(rows, point_count):  # type: ignore[no-untyped-def]
    """First place of each point's row when every mention of a point in `rows` fills one place."""
    start = np.zeros(point_count + 1, np.int32)
    for row in rows:
        for i in row:
            start[i + 1] += 1
    for i in range(point_count):
        start[i + 1] += start[i]
    return start


@njit(cache=True, nogil=True)
def _other_ends(edges, point_count):  # type: ignore[no-untyped-def]
    start = _starts(edges, point_count)
    fill = start[:-1].copy()
    neighbour = np.empty(2 * len(edges), np.int32)
    for e in range(len(edges)):
        i, j = edges[e, 0], edges[e, 1]
        neighbour[fill[i]] = j
        neighbour[fill[j]] = i
        fill[i] += 1
        fill[j] += 1
    return start, neighbour


@njit(cache=True, nogil=True)
def _bucket_faces(faces, point_count):  # type: ignore[no-untyped-def]
    start = _starts(faces, point_count)
    fill = start[:-1].copy()
    face = np.empty(3 * len(faces), np.int32)
    for f in range(len(faces)):
        for k in range(3):
            i = faces[f, k]
            face[fill[i]] = f
            fill[i] += 1
    return start, face
