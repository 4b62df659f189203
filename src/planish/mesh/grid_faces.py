"""Triangles over the grid of a range image: neighbouring pixels joined, depth jumps and crumbs left out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from planish.mesh.topology import topology
from planish.types import Floats, Ints

CRUMB = 0.01
"""Pieces with less than this share of the faces are dropped, as scanner programs do."""


def grid_faces(index: Ints, points: Floats, greatest_step: float = np.inf) -> Ints:
    """Join neighbouring pixels of a range image by triangles, counter-clockwise as the image is seen.

    Parameters
    ----------
    index : (rows, cols) int32
        Row of `points` that each pixel holds; -1 where it holds none.
    points : (n, d) float64
        The shorter diagonal of four pixels is taken.
    greatest_step : float
        Two pixels whose last coordinates differ by more are not joined (a depth jump).

    Examples
    --------
    >>> grid_faces(np.array([[0, 1], [2, -1]], np.int32), np.eye(3)).tolist()
    [[0, 2, 1]]
    """
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]
    there = [corner >= 0 for corner in (a, b, c, d)]
    full = np.logical_and.reduce(there)
    falling = np.linalg.norm(points[a] - points[d], axis=-1) <= np.linalg.norm(points[b] - points[c], axis=-1)
    triangles = []
    for corners, lone in (((a, c, b), 3), ((c, d, b), 0), ((a, c, d), 1), ((a, d, b), 2)):
        three = np.logical_and.reduce([there[k] for k in range(4) if k != lone])
        split = (full & (falling == (lone in (1, 2)))) | (three & ~there[lone])
        triangles.append(np.stack([corner[split] for corner in corners], axis=1))
    faces = np.concatenate(triangles)
    return np.ascontiguousarray(faces[np.ptp(points[faces][..., -1], axis=1) <= greatest_step])


def without_small_components(
    faces: Ints, point_count: int, *, only_largest: bool = False
) -> tuple[NDArray[np.int64], Ints]:
    """Drop pieces that hang together with the rest by less than an edge and are small, and points without faces.

    Parameters
    ----------
    faces : (m, 3) int32
    point_count : int
    only_largest : bool
        Drop all but the piece with the most faces.

    Returns
    -------
    used : (k,) int64
        Rows of the points that are left, in their order.
    faces : (m, 3) int32
        Of those points.
    """
    pairs = topology(faces, point_count).edge_faces
    pairs = pairs[pairs[:, 1] >= 0]
    links = sparse.coo_matrix((np.ones(len(pairs), bool), tuple(pairs.T)), shape=(len(faces), len(faces)))
    piece = sparse.csgraph.connected_components(links, directed=False)[1]
    size = np.bincount(piece)
    faces = faces[piece == size.argmax() if only_largest else size[piece] >= CRUMB * len(faces)]
    used = np.zeros(point_count, bool)
    used[faces] = True
    return np.flatnonzero(used), (np.cumsum(used, dtype=np.int32) - 1)[faces]
