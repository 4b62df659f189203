"""One stick for every edge of the mesh, and one across every two triangles that share an edge."""

from __future__ import annotations

import numpy as np

from planish.mesh import Topology
from planish.settings import Lengths
from planish.types import Floats, Ints, Mesh, Sticks


def make_sticks(mesh: Mesh, topology: Topology, lengths: Lengths = "unfolded") -> Sticks:
    """Turn a mesh into sticks of fixed length (eq. 1).

    Parameters
    ----------
    mesh : Mesh
    topology : Topology
        Of the same mesh.
    lengths : {"unfolded", "straight"}
        Rest length of the bending sticks. At a fold `straight`, the paper's choice, takes the corners' distance
        through the air, which is shorter than over the sheet, and so pulls the fold together; `unfolded` lays the
        two triangles into one plane first. On a smooth sheet the two agree to second order.

    Examples
    --------
    Two right triangles folded by a right angle along their common side: the corners stand sqrt(2) apart in the
    air and 2 on the flat sheet.

    >>> from planish.mesh import topology
    >>> mesh = Mesh(np.array([[0.0, 0, 0], [0, 1, 0], [1, 0, 0], [0, 0, 1]]), np.array([[0, 2, 1], [0, 1, 3]]))
    >>> for lengths in ("straight", "unfolded"):
    ...     print(make_sticks(mesh, topology(mesh.faces, 4), lengths).rest[-1].round(3))
    1.414
    2.0
    """
    edge_rest = _distance(mesh.points, topology.edges)
    corners, edge = bending_pairs(mesh.faces, topology)
    bend_rest = (
        _distance(mesh.points, corners)
        if lengths == "straight"
        else unfolded_distance(mesh.points, topology.edges[edge], corners)
    )
    rest = np.concatenate([edge_rest, bend_rest])
    pairs = np.concatenate([topology.edges, corners])
    return Sticks(pairs=pairs, rest=rest, weight=np.ones(len(rest)), edges=len(edge_rest))


def bending_pairs(faces: Ints, topology: Topology) -> tuple[Ints, Ints]:
    """Opposite corners of every two triangles that share an edge: (b, 2) points and the (b,) rows of that edge."""
    edge = np.flatnonzero(topology.edge_uses == 2).astype(np.int32)
    around = faces[topology.edge_faces[edge]].sum(axis=2, dtype=np.int64)
    corners = around - topology.edges[edge].sum(axis=1, dtype=np.int64)[:, None]
    return corners.astype(np.int32), edge


def unfolded_distance(points: Floats, edges: Ints, corners: Ints) -> Floats:
    """Distance of two opposite corners once their triangles lie in one plane, on both sides of the common edge.

    With x along the edge and h >= 0 across it, the corners lie at (x1, h1) and (x2, -h2), so that
    d^2 = (x1 - x2)^2 + (h1 + h2)^2.
    """
    origin = points[edges[:, 0]]
    along = points[edges[:, 1]] - origin
    length = np.linalg.norm(along, axis=1, keepdims=True)
    along = np.divide(along, length, out=np.zeros_like(along), where=length > 0)
    x, h = [], []
    for side in (0, 1):
        arm = points[corners[:, side]] - origin
        x.append(np.einsum("ij,ij->i", arm, along))
        h.append(np.linalg.norm(arm - x[-1][:, None] * along, axis=1))
    return np.hypot(x[0] - x[1], h[0] + h[1])


def _distance(points: Floats, pairs: Ints) -> Floats:
    return np.asarray(np.linalg.norm(points[pairs[:, 1]] - points[pairs[:, 0]], axis=1))
