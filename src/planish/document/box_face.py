"""The printed face of a box on a table: its faces cannot be laid flat together where three of them meet."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from planish.document.raised import Raised, dominant_plane
from planish.mesh import area_vectors
from planish.types import Bools, Floats, Ints, Mesh

SQUARE = 0.26
"""Sine of 15 degrees, within which the faces of a box are square to another and to the table: steps of 2 mm of a
depth camera tilt a face of 50 mm by 3 to 5 degrees. Halved or doubled, nothing changes on four scenes."""

MIN_FACE = 0.05
"""Part of the box's area that a face must have, so that strips of mixed pixels along edges are none. Halved or doubled,
nothing changes on four scenes."""

MIN_FLAT = 0.7
"""Part of the area that must lie in such faces: 0.94 to 0.98 on four scenes. The rest are edges, noise, and what lies
on the box."""

MOST_FACES = 6
"""Of two boxes, three each."""


def box_face(mesh: Mesh, raised: Raised) -> Bools | None:
    """Faces (m,) of the largest flat side of a box that stands on a table; None where it is no box.

    A box shows two or three flat faces, each square to another and square or parallel to the table. Several boxes that
    touch each other may be turned.
    """
    solid = _largest_part(mesh, np.asarray(raised.above[mesh.faces].all(axis=1)))
    area = np.linalg.norm(area_vectors(mesh.points, mesh.faces), axis=1)
    rest, normals, sides = solid, [], []
    for _ in range(MOST_FACES):
        plane = dominant_plane(mesh.points[mesh.faces[rest][:, 0]], raised.tolerance_mm / 2)
        if plane is None:
            break
        middle, normal, _ = plane
        within = np.abs((mesh.points - middle) @ normal) < raised.tolerance_mm
        side = _largest_part(mesh, rest & within[mesh.faces].all(axis=1))
        if area[side].sum() < MIN_FACE * area[solid].sum():
            break
        normals.append(normal)
        sides.append(side)
        rest = rest & ~within[mesh.faces].any(axis=1)
    if len(sides) < 2 or not _square(np.array(normals), raised.normal):
        return None
    areas = [float(area[side].sum()) for side in sides]
    if sum(areas) < MIN_FLAT * area[solid].sum():
        return None
    return sides[int(np.argmax(areas))]


def _square(normals: Floats, up: Floats) -> bool:
    """Whether each plane is square to another one, and square or parallel to the ground."""
    has_square = (np.abs(normals @ normals.T) < SQUARE).any(axis=1)
    to_ground = np.abs(normals @ up)
    return bool((has_square & ((to_ground < SQUARE) | (to_ground > (1 - SQUARE**2) ** 0.5))).all())


def _largest_part(mesh: Mesh, faces: Bools) -> Bools:
    """Of some faces (m,) those of the piece with most of them."""
    rows = np.flatnonzero(faces)
    out = np.zeros(len(faces), bool)
    if len(rows):
        piece = _pieces(mesh.faces[rows], len(mesh.points))
        out[rows[piece == np.bincount(piece).argmax()]] = True
    return out


def _pieces(faces: Ints, count: int) -> Ints:
    """The number of the piece of each face; pieces share no point."""
    ends = faces[:, [0, 1, 1, 2]].reshape(-1, 2)
    graph = coo_array((np.ones(len(ends), bool), (ends[:, 0], ends[:, 1])), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1][faces[:, 0]])
