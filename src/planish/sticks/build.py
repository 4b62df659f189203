"""One stick for every edge of the mesh, and one across every two triangles that share an edge."""

from __future__ import annotations

import numpy as np
from numba import njit

from planish.geometry.distances import distances
from planish.mesh import LEAST_HEIGHT, Topology, relative_heights
from planish.parallel import thread_pool
from planish.settings import Lengths
from planish.surface.smooth_lengths import smooth_lengths
from planish.types import Bools, Floats, Ints, Mesh, Sticks


def make_sticks(mesh: Mesh, topology: Topology, lengths: Lengths = "smooth", *, eye: Floats | None = None) -> Sticks:
    """Turn a mesh into sticks of fixed length (eq. 1).

    Parameters
    ----------
    mesh : Mesh
    topology : Topology
        Of the same mesh.
    lengths : {"smooth", "unfolded", "straight"}
        smooth: the edges are as long as the surface without the scanner's noise, true also across creases (see
        `smooth_lengths`). The others take them as they stand in space. Bending sticks are as long as the distance of
        their corners once the two triangles are laid into one plane (smooth, unfolded), or as they stand in space
        (straight, the paper's choice): at a fold that is shorter than over the sheet, and pulls the fold together.
    eye : (3,) float64 [mm], optional
        For smooth lengths: where the scanner's rays come from (see `smooth_lengths`).

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
    smoothed = smooth_lengths(mesh.points, mesh.faces, topology, eye=eye) if lengths == "smooth" else None
    edge_rest = distances(mesh.points, topology.edges) if smoothed is None else smoothed.rest
    corners, edge = bending_pairs(mesh.faces, topology)
    if lengths == "straight":
        bend_rest = distances(mesh.points, corners)
    else:
        turned = None if smoothed is None else smoothed.turned
        bend_rest = unfolded_distance(edge_rest, edge, mesh.faces, topology, turned)
    return Sticks(
        pairs=np.concatenate([topology.edges, corners]),
        rest=np.concatenate([edge_rest, bend_rest]),
        weight=np.concatenate([np.ones(len(edge_rest)), bending_weights(edge_rest, edge, topology)]),
        edges=len(edge_rest),
        noise_mm=None if smoothed is None else smoothed.noise_mm,
        noise_left=1.0 if smoothed is None else smoothed.noise_left,
        bias_mm=0.0 if smoothed is None else smoothed.bias_mm,
        turned=None if smoothed is None else smoothed.turned,
        normals=None if smoothed is None else smoothed.normals,
        noise_length_mm=None if smoothed is None else smoothed.noise_length_mm,
        spikes=0 if smoothed is None else smoothed.spikes,
        doubt=None if smoothed is None else smoothed.doubt,
    )


def bending_pairs(faces: Ints, topology: Topology) -> tuple[Ints, Ints]:
    """Opposite corners of every two triangles that share an edge: (b, 2) points and the (b,) rows of that edge."""
    edge = np.flatnonzero(topology.edge_uses == 2).astype(np.int32)
    corners = np.empty((len(edge), 2), np.int32)
    with thread_pool() as parallel_for:
        parallel_for(_opposite_corners, len(edge), edge, topology.edges, topology.edge_faces, faces, corners)
    return corners, edge


def bending_weights(edge_rest: Floats, edge: Ints, topology: Topology) -> Floats:
    """(b,) weights of the bending sticks: 1, but less across a face without area.

    A stick across a cap turns with the cap's small angle, which the lengths tell poorly or with the wrong sign. Its
    weight is (h / 0.02)^2 where the lower of its two faces is h < 0.02 high in parts of its longest side
    (`LEAST_HEIGHT`), as the variance of a length that depends on 1 / h falls.
    """
    height = np.minimum(relative_heights(edge_rest, topology.face_edges) / LEAST_HEIGHT, 1.0)
    if height.min(initial=1.0) == 1.0:
        return np.ones(len(edge))
    return np.asarray(height[topology.edge_faces[edge]].min(axis=1) ** 2)


def unfolded_distance(
    edge_rest: Floats, edge: Ints, faces: Ints, topology: Topology, turned: Bools | None = None
) -> Floats:
    """Distance of two opposite corners once their triangles are laid into one plane, on both sides of their edge.

    Found from nothing but the lengths of the five edges, so that bending sticks and edges agree on one flat shape.
    With x along the common edge and h >= 0 across it, the corners lie at (x1, h1) and (x2, -h2), so that
    d^2 = (x1 - x2)^2 + (h1 + h2)^2. The height of a face that was turned over counts as negative.

    Parameters
    ----------
    edge_rest : (e,) float64 [mm]
        Of the edges of the topology. Three that cannot close to a triangle count as one without height.
    edge : (b,) int32
        Rows of the edges with two faces.
    faces : (m, 3) int32
    topology : Topology
    turned : (m,) bool, optional
        See `Sticks`.

    Returns
    -------
    (b,) float64 [mm]
    """
    out = np.empty(len(edge))
    side = np.ones(len(faces)) if turned is None else np.where(turned, -1.0, 1.0)
    with thread_pool() as parallel_for:
        at = (edge, topology.edges, topology.edge_faces, topology.face_edges, faces, side)
        parallel_for(_unfold, len(edge), edge_rest, *at, out)
    return out


@njit(cache=True, nogil=True)
def _opposite_corners(first, last, edge, edges, edge_faces, faces, corners):  # type: ignore[no-untyped-def]
    for b in range(first, last):
        i, j = edges[edge[b], 0], edges[edge[b], 1]
        for side in range(2):
            f = edge_faces[edge[b], side]
            corners[b, side] = faces[f, 0] + faces[f, 1] + faces[f, 2] - i - j


@njit(cache=True, nogil=True, error_model="numpy")
def _unfold(first, last, edge_rest, edge, edges, edge_faces, face_edges, faces, side, out):  # type: ignore[no-untyped-def]
    for b in range(first, last):
        e = edge[b]
        f, g = edge_faces[e, 0], edge_faces[e, 1]
        x1, h1 = _corner(edge_rest, e, f, edges[e, 0], face_edges, faces)
        x2, h2 = _corner(edge_rest, e, g, edges[e, 0], face_edges, faces)
        out[b] = np.sqrt((x1 - x2) ** 2 + (side[f] * h1 + side[g] * h2) ** 2)


@njit(cache=True, nogil=True, error_model="numpy")
def _corner(edge_rest, e, f, origin, face_edges, faces):  # type: ignore[no-untyped-def]
    """Place of the corner of face f opposite to its edge e, along e from the point `origin` and across it."""
    k = 0
    while face_edges[f, k] != e:
        k += 1
    b, u, v = edge_rest[e], edge_rest[face_edges[f, (k + 2) % 3]], edge_rest[face_edges[f, (k + 1) % 3]]
    if faces[f, k] != origin:  # edge k joins the corners k and k + 1; u is to start at the origin
        u, v = v, u
    if b == 0.0:
        return 0.0, u
    x = min(max((b * b + (u - v) * (u + v)) / (2.0 * b), -u), u)
    area = (b + u + v) * (u + v - b) * (b + u - v) * (b - u + v)  # 16 times its square (Heron)
    return x, np.sqrt(max(area, 0.0)) / (2.0 * b)
