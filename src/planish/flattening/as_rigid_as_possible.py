"""As-rigid-as-possible flattening: each triangle turned as a whole, all joined by least squares.

For triangles (i, j, k) with corners u in a frame of their own, at places x in the plane,

    E(x, R) = sum over triangles and their edges of cot (|(x_j - x_i) - R (u_j - u_i)|^2)

with the cotangent of the angle opposite to the edge is lowered by turns: the best rotation R of each triangle, then the
best places x (Liu, Zhang, Xu, Gotsman & Gortler, A local/global approach to mesh parameterization, 2008, eq. 3 and 9).
Rotations cannot mirror a triangle, so that a face on its back costs energy, where its edges alone do not tell. The
first layout is a least-squares conformal map (Levy, Petitjean, Ray & Maillot 2002, eq. 6). Both ask for nothing but
the lengths of the edges.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.sparse import coo_array, csc_array, diags_array
from scipy.sparse.linalg import SuperLU, splu

from planish.geometry.guards import TINY
from planish.mesh.measures import LEAST_HEIGHT, relative_height
from planish.types import Floats, Ints

STEPS = 100
"""Local and global steps at most. Most meshes end by `LEVEL` after 10 to 40 steps."""

LEVEL = 1e-3
"""The energy is low enough when five steps have lowered it by no more than this part; 1e-4 takes three times the steps,
for 0.01 % less strain."""

GROUND = 1e-9
"""Share of its diagonal added to the matrix, as a layout is free to move as a whole."""


class Triangles(NamedTuple):
    """Triangles laid out one by one from the lengths of their edges.

    Attributes
    ----------
    corners : (m, 3, 2) float64
        Counter-clockwise, the first in the origin, the second on the x axis.
    cotangents : (m, 3) float64
        Of the angles at the corners.
    areas : (m,) float64
    """

    corners: Floats
    cotangents: Floats
    areas: Floats


def lay_out_triangles(face_edges: Ints, edge_rest: Floats) -> Triangles:
    """Triangles from the lengths of their edges.

    Those without area (`planish.mesh.LEAST_HEIGHT`) are made as high as the least that counts, as the cotangents of a
    cap are without bounds.
    """
    return Triangles(*_lay_out(face_edges, edge_rest))


def least_squares_conformal(faces: Ints, triangles: Triangles, pins: Ints, pin_xy: Floats) -> Floats:
    """(n, 2) conformal map through the given places of some points, of the size of the triangles.

    Parameters
    ----------
    faces : (m, 3) int32
    triangles : Triangles
    pins : (k,) int
        Two or more for each piece of the mesh.
    pin_xy : (k, 2) float64
    """
    count, m = int(faces.max()) + 1, len(faces)
    z = triangles.corners[..., 0] + 1j * triangles.corners[..., 1]
    weights = np.roll(z, -2, axis=1) - np.roll(z, -1, axis=1)
    weights = (weights / np.sqrt(2 * triangles.areas)[:, None]).ravel()
    row, column = 2 * np.arange(m).repeat(3), 2 * faces.astype(np.int64).ravel()
    equations = csc_array(
        coo_array(
            (
                np.concatenate([weights.real, -weights.imag, weights.imag, weights.real]),
                (
                    np.concatenate([row, row, row + 1, row + 1]),
                    np.concatenate([column, column + 1, column, column + 1]),
                ),
            ),
            shape=(2 * m, 2 * count),
        )
    )
    held = np.zeros((count, 2), bool)
    held[pins] = True
    free = ~held.ravel()
    xy = np.zeros((count, 2))
    xy[pins] = pin_xy
    solved = xy.ravel()
    matrix = equations[:, free]
    solved[free] = _factor(matrix.T @ matrix).solve(-(matrix.T @ (equations @ solved)))
    area = signed_areas(xy, faces).sum()
    return np.asarray(xy * np.sqrt(triangles.areas.sum() / area)) if area > 0 else xy


def as_rigid_as_possible(faces: Ints, triangles: Triangles, xy: Floats, max_steps: int = STEPS) -> Floats:
    """(n, 2) places that let each triangle keep its shape as well as all of them together can, from a first layout."""
    a, b = faces[:, [1, 2, 0]].ravel(), faces[:, [2, 0, 1]].ravel()
    factor, ground = _laplacian(a, b, triangles.cotangents.ravel(), len(xy))
    pull = np.empty_like(xy)
    energies: list[float] = []
    for _ in range(max_steps):
        energies.append(_turn_triangles(faces, triangles.corners, triangles.cotangents, xy, pull))
        if len(energies) > 5 and energies[-6] - energies[-1] <= LEVEL * energies[-1]:
            break
        moved = factor.solve(pull + ground[:, None] * xy)
        if not np.isfinite(moved).all():
            break
        xy = moved
    return xy


def graph_laplacian(pairs: Ints, weight: Floats, count: int) -> SuperLU:
    """Factor of the weighted graph Laplacian, the Hessian of sum of w |x_j - x_i|^2 / 2, which sets no place."""
    return _laplacian(pairs[:, 0], pairs[:, 1], weight, count)[0]


@njit(cache=True, nogil=True)
def signed_areas(xy, faces):  # type: ignore[no-untyped-def]
    """(m,) areas, positive where the corners run counter-clockwise with y up."""
    out = np.empty(len(faces))
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        out[f] = 0.5 * (xy[b, 0] - xy[a, 0]) * (xy[c, 1] - xy[a, 1])
        out[f] -= 0.5 * (xy[c, 0] - xy[a, 0]) * (xy[b, 1] - xy[a, 1])
    return out


def _laplacian(a: Ints, b: Ints, weight: Floats, count: int) -> tuple[SuperLU, Floats]:
    values = np.concatenate([weight, weight, -weight, -weight])
    at = np.concatenate([a, b, a, b]), np.concatenate([a, b, b, a])
    matrix = coo_array((values, at), shape=(count, count)).tocsc()
    ground = GROUND * np.maximum(np.abs(matrix.diagonal()), TINY)
    return _factor(matrix + diags_array(ground)), ground


def _factor(matrix: csc_array) -> SuperLU:
    options = {"SymmetricMode": True}
    return splu(matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)


@njit(cache=True, nogil=True)
def _lay_out(face_edges, rest):  # type: ignore[no-untyped-def]
    m = len(face_edges)
    corners, cotangents, areas = np.zeros((m, 3, 2)), np.empty((m, 3)), np.empty(m)
    for f in range(m):
        base, far, near = rest[face_edges[f, 0]], rest[face_edges[f, 1]], rest[face_edges[f, 2]]
        longest = max(base, far, near, TINY)
        base = max(base, LEAST_HEIGHT * longest)
        x = min(max((base * base + (near - far) * (near + far)) / (2.0 * base), -near), near)
        height = max(relative_height(base, far, near), LEAST_HEIGHT) * longest * (longest / base)
        corners[f, 1, 0] = base
        corners[f, 2, 0], corners[f, 2, 1] = x, height
        areas[f] = 0.5 * base * height
        cotangents[f, 0] = x / height
        cotangents[f, 1] = (base - x) / height
        cotangents[f, 2] = (height * height + x * (x - base)) / (base * height)
    return corners, cotangents, areas


@njit(cache=True, nogil=True)
def _turn_triangles(faces, corners, cotangents, xy, pull):  # type: ignore[no-untyped-def]
    """Local step: the best rotation of each triangle. Fills the right side of the global step; returns the energy."""
    pull[:] = 0.0
    energy = 0.0
    for f in range(len(faces)):
        along, across = 0.0, 0.0
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            ux, uy = corners[f, j, 0] - corners[f, i, 0], corners[f, j, 1] - corners[f, i, 1]
            x, y = xy[faces[f, j], 0] - xy[faces[f, i], 0], xy[faces[f, j], 1] - xy[faces[f, i], 1]
            along += cotangents[f, k] * (ux * x + uy * y)
            across += cotangents[f, k] * (ux * y - uy * x)
        length = np.sqrt(along * along + across * across)
        c, s = (along / length, across / length) if length > 0.0 else (1.0, 0.0)
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            ux, uy = corners[f, j, 0] - corners[f, i, 0], corners[f, j, 1] - corners[f, i, 1]
            rx, ry = c * ux - s * uy, s * ux + c * uy
            x, y = xy[faces[f, j], 0] - xy[faces[f, i], 0], xy[faces[f, j], 1] - xy[faces[f, i], 1]
            energy += cotangents[f, k] * ((x - rx) ** 2 + (y - ry) ** 2)
            pull[faces[f, j], 0] += cotangents[f, k] * rx
            pull[faces[f, j], 1] += cotangents[f, k] * ry
            pull[faces[f, i], 0] -= cotangents[f, k] * rx
            pull[faces[f, i], 1] -= cotangents[f, k] * ry
    return energy
