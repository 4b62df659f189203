"""Points in an order in which neighbours in the mesh are neighbours in memory.

Range scans come row by row, but many programs write points in any order. A solver that goes through all edges again
and again then waits for memory most of the time: three times as long for 300,000 points, more for larger meshes.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from planish.mesh.measures import bounds
from planish.mesh.topology import Topology
from planish.types import Ints, Mesh

SCATTERED = 10.0
"""Mean difference of the two point numbers of an edge, in square roots of the number of points, from which on an
order is worth changing. Row by row it is about 0.5, at random a third of the whole square root."""

LEVELS = 16
"""Bits of each coordinate in the order: cells of a 65,000th of the sheet."""


def local_order(mesh: Mesh, topology: Topology) -> Ints | None:
    """Order along a Morton curve through space: row of `mesh.points` for each new row; None where it is fine as it is.

    Examples
    --------
    >>> from planish.mesh import topology
    >>> x = np.arange(2000.0)
    >>> strip = np.concatenate([np.c_[x, 0 * x, 0 * x], np.c_[x, 1 + 0 * x, 0 * x]])
    >>> i = np.arange(1999)
    >>> faces = np.concatenate([np.c_[i, i + 1, i + 2000], np.c_[i + 1, i + 2001, i + 2000]]).astype(np.int32)
    >>> order = local_order(Mesh(strip, faces), topology(faces, 4000))
    >>> int(np.abs(np.diff(strip[order, 0])).max())
    1
    """
    step = topology.edges[:: len(topology.edges) // 10_000 + 1]
    count = len(mesh.points)
    if np.abs(step[:, 1] - step[:, 0]).mean() <= SCATTERED * np.sqrt(count):
        return None
    low, high = bounds(mesh.points)
    extent = float((high - low).max()) or 1.0
    return np.argsort(_morton(mesh.points, low, (2**LEVELS - 1) / extent)).astype(np.int32)


def renumbered(mesh: Mesh, order: Ints) -> Mesh:
    """The same mesh with its points in another order, and its faces in the order of their first points."""
    place = np.empty(len(order), np.int32)
    place[order] = np.arange(len(order), dtype=np.int32)
    return Mesh.owned(mesh.points[order], _by_first_point(place, mesh.faces))


def renumbered_faces(order: Ints, faces: Ints) -> Ints:
    """(m,) for every face that `renumbered` gives, its row in the faces that it was given.

    Examples
    --------
    >>> faces = np.array([[2, 1, 3], [0, 1, 2]], np.int32)
    >>> renumbered_faces(np.arange(4, dtype=np.int32), faces).tolist()
    [1, 0]
    """
    return np.asarray(np.argsort(np.argsort(order)[faces].min(axis=1), kind="stable"))


@njit(cache=True, nogil=True)
def _morton(points, low, scale):  # type: ignore[no-untyped-def]
    """The bits of x, y and z by turns, the highest first."""
    key = np.empty(len(points), np.int64)
    for i in range(len(points)):
        code = 0
        for d in range(3):
            at = int((points[i, d] - low[d]) * scale)
            for bit in range(LEVELS):
                code |= ((at >> bit) & 1) << (3 * bit + d)
        key[i] = code
    return key


@njit(cache=True, nogil=True)
def _by_first_point(place, faces):  # type: ignore[no-untyped-def]
    start = np.zeros(len(place) + 1, np.int32)
    for f in range(len(faces)):
        start[min(place[faces[f, 0]], place[faces[f, 1]], place[faces[f, 2]]) + 1] += 1
    for i in range(len(place)):
        start[i + 1] += start[i]
    out = np.empty_like(faces)
    for f in range(len(faces)):
        a, b, c = place[faces[f, 0]], place[faces[f, 1]], place[faces[f, 2]]
        first = min(a, b, c)
        row = start[first]
        start[first] += 1
        out[row, 0], out[row, 1], out[row, 2] = a, b, c
    return out
