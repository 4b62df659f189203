"""A flat layout from nothing but the lengths of a mesh's edges.

Laying triangles down one after the other drifts, and a projection folds over what stands steep. So the sheet is cut
into clusters that are too small to drift, each is laid out by itself, and all are turned and shifted until they fit.
"""

from __future__ import annotations

from dataclasses import replace

from planish.flattening.cluster_alignment import align_clusters, average_copies
from planish.flattening.clusters import lay_out_clusters
from planish.mesh import Topology
from planish.parallel import ParallelFor
from planish.types import Bools, Floats, Ints, Outcome


def initial_layout(
    faces: Ints, topology: Topology, edge_rest: Floats, point_count: int, parallel_for: ParallelFor
) -> tuple[Floats, Ints, Outcome]:
    """Lay a mesh flat, nearly: exactly where its lengths are those of a flat sheet.

    Parameters
    ----------
    faces : (m, 3) int32
    topology : Topology
        Of the faces.
    edge_rest : (e,) float64 [mm]
        Length of each edge.
    point_count : int
    parallel_for : ParallelFor

    Returns
    -------
    xy : (n, 2) float64 [mm]
        Faces run counter-clockwise. Each piece lies anywhere, in any turn.
    piece : (n,) int32
        Points that hang together have the same number.
    outcome : Outcome
        Of the alignment of the clusters.

    Examples
    --------
    Four triangles around a point, each with a right angle there: a square.

    >>> import numpy as np
    >>> from planish.parallel import thread_pool
    >>> from planish.mesh import topology
    >>> faces = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]], np.int32)
    >>> found = topology(faces, 5)
    >>> rest = np.where(found.edges[:, 0] == 0, 1.0, np.sqrt(2))
    >>> with thread_pool() as parallel_for:
    ...     xy, piece, _ = initial_layout(faces, found, rest, 5, parallel_for)
    >>> np.linalg.norm(xy[1] - xy[3]).round(12), piece.tolist()
    (np.float64(2.0), [0, 0, 0, 0, 0])
    """
    clusters = lay_out_clusters(faces, topology, edge_rest, point_count, parallel_for)
    rho, tau, piece, outcome = align_clusters(clusters)
    return average_copies(clusters, rho, tau), piece[clusters.cluster[clusters.start[:-1]]], outcome


def apply_face_flips(faces: Ints, topology: Topology, turned: Bools | None) -> tuple[Ints, Topology]:
    """Faces, and their edges, with those that noise turned over running the other way round, as their lengths want it.

    Parameters
    ----------
    faces : (m, 3) int32
    topology : Topology
    turned : (m,) bool or None
        See `Sticks`.
    """
    if turned is None or not turned.any():
        return faces, topology
    faces, face_edges = faces.copy(), topology.face_edges.copy()
    faces[turned] = faces[turned][:, [0, 2, 1]]
    face_edges[turned] = face_edges[turned][:, [2, 1, 0]]
    return faces, replace(topology, face_edges=face_edges)
