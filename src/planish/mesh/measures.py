"""Plain measures of a triangle mesh: areas, normals, border loops, angles."""

from __future__ import annotations

import numpy as np
from numba import njit

from planish.mesh.topology import Topology
from planish.types import Floats, Ints


def bounds(points: Floats) -> tuple[Floats, Floats]:
    """(d,) least and greatest coordinates of (n, d) points; ten times as fast as numpy's along the long axis.

    Examples
    --------
    >>> low, high = bounds(np.array([[1.0, 5.0], [3.0, 2.0]]))
    >>> low.tolist(), high.tolist()
    ([1.0, 2.0], [3.0, 5.0])
    """
    low, high = _bounds(points)
    return np.asarray(low), np.asarray(high)


@njit(cache=True, nogil=True)
def _bounds(points):  # type: ignore[no-untyped-def]
    low, high = points[0].copy(), points[0].copy()
    for i in range(len(points)):
        for d in range(points.shape[1]):
            low[d], high[d] = min(low[d], points[i, d]), max(high[d], points[i, d])
    return low, high


def area_vectors(points: Floats, faces: Ints) -> Floats:
    """(m, 3) normals of the faces, as long as the faces are large [mm^2]; corners run counter-clockwise around them."""
    return np.asarray(_area_vectors(points, faces))


@njit(cache=True)
def _area_vectors(points, faces):  # type: ignore[no-untyped-def]
    out = np.empty((len(faces), 3))
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        ux, uy, uz = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1], points[b, 2] - points[a, 2]
        vx, vy, vz = points[c, 0] - points[a, 0], points[c, 1] - points[a, 1], points[c, 2] - points[a, 2]
        out[f, 0] = 0.5 * (uy * vz - uz * vy)
        out[f, 1] = 0.5 * (uz * vx - ux * vz)
        out[f, 2] = 0.5 * (ux * vy - uy * vx)
    return out


def point_normals(points: Floats, faces: Ints) -> Floats:
    """(n, 3) unit normals: the mean direction of the faces around every point, by area."""
    total = np.zeros((len(points), 3))
    _gather(area_vectors(points, faces), faces, total)
    return np.asarray(total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-300))


@njit(cache=True)
def _gather(values, faces, total):  # type: ignore[no-untyped-def]
    for f in range(len(faces)):
        for k in range(3):
            for d in range(3):
                total[faces[f, k], d] += values[f, d]


def border_loops(topology: Topology) -> int:
    """How many closed lines the border of a mesh consists of: one for a sheet, one more for every hole.

    Counted as connected components of the border's edges, so that two holes that touch in a point are one.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    border = topology.edges[topology.edge_uses == 1]
    points, border = np.unique(border, return_inverse=True)
    border = border.reshape(-1, 2)
    links = coo_matrix((np.ones(len(border)), (border[:, 0], border[:, 1])), shape=(len(points), len(points)))
    return int(connected_components(links, directed=False, return_labels=False)) if len(points) else 0


def angle_sums(points: Floats, faces: Ints) -> Floats:
    """(n,) sum [rad] of the faces' angles at every point: a full turn, 2 pi, inside a sheet that can lie flat."""
    sums = np.zeros(len(points))
    for k in range(3):
        here, left, right = (points[faces[:, (k + j) % 3]] for j in range(3))
        u, v = left - here, right - here
        angle = np.arctan2(np.linalg.norm(np.cross(u, v), axis=1), np.einsum("ij,ij->i", u, v))
        sums += np.bincount(faces[:, k], angle, len(points))
    return sums
