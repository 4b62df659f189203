"""Pieces of a mesh, and one consistent winding for each of them."""

from __future__ import annotations

import numpy as np
from numba import njit

from planish.mesh.topology import Topology
from planish.types import Bools, Ints


def pieces_and_winding(faces: Ints, topology: Topology) -> tuple[Ints, Bools, int]:
    """Walk over the edges that two faces share: which piece each face belongs to, and which must be turned over.

    Two neighbours agree when they run along their common edge in opposite directions. The first face of a piece is
    taken as right.

    Parameters
    ----------
    faces : (m, 3) int32
    topology : Topology
        Of the same faces. Edges with more than two faces join nothing.

    Returns
    -------
    piece : (m,) int32
        Counted from 0 in the order of their first faces.
    turned : (m,) bool
        Faces that run the other way round than the first of their piece.
    clashes : int
        Edges at which no choice fits: more than 0 for a Moebius strip.

    Examples
    --------
    >>> from planish.mesh.topology import topology
    >>> faces = np.array([[0, 1, 2], [1, 2, 3], [4, 5, 6]], np.int32)
    >>> piece, turned, clashes = pieces_and_winding(faces, topology(faces, 7))
    >>> piece.tolist(), turned.tolist(), clashes
    ([0, 0, 1], [False, True, False], 0)
    """
    piece, turned, clashes = _walk(faces, topology.edges, topology.edge_faces, topology.edge_uses, topology.face_edges)
    return piece, turned, int(clashes)


@njit(cache=True)
def _walk(faces, edges, edge_faces, edge_uses, face_edges):  # type: ignore[no-untyped-def]
    m = len(faces)
    piece = np.full(m, -1, np.int32)
    turned = np.zeros(m, np.bool_)
    todo = np.empty(m, np.int32)
    clashes, pieces = 0, 0
    for first in range(m):
        if piece[first] >= 0:
            continue
        piece[first] = pieces
        todo[0] = first
        end = 1
        at = 0
        while at < end:
            f = todo[at]
            at += 1
            for k in range(3):
                e = face_edges[f, k]
                if edge_uses[e] != 2:
                    continue
                g = edge_faces[e, 0] if edge_faces[e, 1] == f else edge_faces[e, 1]
                j = 0
                while face_edges[g, j] != e:
                    j += 1
                same_way = (faces[f, k] == edges[e, 0]) == (faces[g, j] == edges[e, 0])
                wanted = turned[f] != same_way
                if piece[g] < 0:
                    piece[g] = pieces
                    turned[g] = wanted
                    todo[end] = g
                    end += 1
                elif turned[g] != wanted:
                    clashes += 1
        pieces += 1
    return piece, turned, clashes // 2  # each is met from both sides
