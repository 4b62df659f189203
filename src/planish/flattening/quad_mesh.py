"""A regular quad mesh laid over a sheet from above, as the structured light of Brown & Seales gave it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planish.errors import InputError
from planish.flattening.frame import to_page_frame
from planish.geometry.distances import distances
from planish.mesh import Coarse, area_vectors, onto_support_plane, rasterize
from planish.settings import Lengths
from planish.types import Bools, Floats, Ints, Mesh, Sticks

SUBSTEPS = 6
"""Places looked at from node to node, to see whether the sheet leads from one to the other."""
PIECES = 3
"""Of a cell, whose lengths together are compared with its side: fewer miss corners, more count noise as length."""
STEEPEST = 8.0
"""Where two of these places differ more than so many times in height as they do across (83 degrees), it does not."""
INSET = 1.5
"""Edges of the scan by which the outermost nodes lie within the sheet, for its border may run in steps; a quarter of
a cell at most."""


@dataclass(frozen=True, eq=False)
class QuadMesh:
    """A quad mesh over a sheet.

    Attributes
    ----------
    coarse : Coarse
        Its nodes, with every quad cut into two triangles, and the node nearest to every point of the sheet.
    node : (rows, cols) int32
        Row of `coarse.mesh.points` at every crossing; -1 where there is no sheet.
    across : (rows, cols - 1) bool
        Whether the sheet leads from a node to the next of its row.
    down : (rows - 1, cols) bool
        And to that in the next row.
    overhang : float
        Share of the sheet's area that faces the table, and so cannot be seen from above.
    shortfall_mm : float
        Expected error of the page, rms, from sides of cells that cut the corners and bends of the sheet.
    """

    coarse: Coarse
    node: Ints
    across: Bools
    down: Bools
    overhang: float
    shortfall_mm: float


def make_quad_mesh(mesh: Mesh, count: int) -> QuadMesh:
    """Lay a regular quad mesh of about `count` nodes over a sheet, as seen from straight above its table.

    Rows and columns run along the sides of the least rectangle around the sheet in this view. Where layers of the
    sheet lie over each other the topmost is taken: a regular mesh knows one height for every place.

    Parameters
    ----------
    mesh : Mesh
        Clean (see `planish.mesh.repair`).
    count : int

    Raises
    ------
    InputError
        Where no part of the sheet is as wide as a cell.
    """
    standing = onto_support_plane(mesh)[0]
    view, size = to_page_frame(standing[:, :2], np.zeros(2), long_side_upright=False)
    sides = np.maximum(size, max(size) / 1000)
    upward, overhang = _areas(standing, mesh.faces)
    cells = _cells(sides, min(upward, float(sides.prod())), count)
    inset = np.minimum(INSET * np.sqrt(2 * upward / len(mesh.faces)) * cells / sides, 0.25)
    pixel_xy = SUBSTEPS * ((view / sides - 0.5) * (cells + 2 * inset) + 0.5 * cells)
    cols, rows = cells * SUBSTEPS + 1
    face, weights = rasterize(pixel_xy, mesh.faces, (rows, cols), nearness=standing[:, 2])
    share = np.concatenate([1 - weights.sum(axis=2, keepdims=True), weights], axis=2)
    height = np.where(face >= 0, (share * standing[mesh.faces[face], 2]).sum(axis=2), np.nan)
    across, lacking_x = _along(height[::SUBSTEPS], sides[0] / cells[0])
    down, lacking_y = _along(height.T[::SUBSTEPS], sides[1] / cells[1])
    down, shortfall = down.T, float(np.hypot(lacking_x, lacking_y))
    crossings, corners = np.unique(_halved_quads(across, down), return_inverse=True)
    at, w = (values[::SUBSTEPS, ::SUBSTEPS].reshape(-1, depth)[crossings] for values, depth in ((face, 1), (share, 3)))
    if not len(crossings):
        raise InputError(
            f"a mesh of {count} nodes finds no hold on this sheet: all parts of it are narrower than the cells",
            "ask for more {points}, or take another {method}",
        )
    faces = corners.reshape(-1, 3).astype(np.int32)
    nodes = Mesh.owned(np.einsum("nk,nkd->nd", w, mesh.points[mesh.faces[at[:, 0]]]), faces)
    node = np.full((cells[1] + 1, cells[0] + 1), -1, np.int32)
    node.ravel()[crossings] = np.arange(len(crossings))
    return QuadMesh(Coarse(nodes, _nearest(nodes.points, mesh.points)), node, across, down, overhang, shortfall)


def quad_mesh_springs(lattice: QuadMesh, lengths: Lengths) -> Sticks:
    """Springs of a quad mesh: structural ones along its lines, shear ones across its quads, and flexion ones.

    Parameters
    ----------
    lattice : QuadMesh
    lengths : {"smooth", "unfolded", "straight"}
        Of the flexion springs, which join every second node of a line: as these stand in space (straight), or with
        the surface between them laid into one plane. All others are as long as their nodes stand apart.

    Returns
    -------
    Sticks
        Structural and shear springs count as edges.
    """
    node, points = lattice.node, lattice.coarse.mesh.points
    first, last, left, right = _sides_of_quads(lattice.across, lattice.down)
    rising = left & last | first & right
    falling = (first & left | last & right) & ~rising | first & last & left & right
    along = [_pairs(node[:, :-1], node[:, 1:], lattice.across), _pairs(node[:-1], node[1:], lattice.down)]
    shear = [_pairs(node[:-1, :-1], node[1:, 1:], rising), _pairs(node[:-1, 1:], node[1:, :-1], falling)]
    edges = np.concatenate(along + shear)
    flexion = [_flexion(node, lattice.across, lattice.down), _flexion(node.T, lattice.down.T, lattice.across.T)]
    triples = np.concatenate(flexion)
    ends = triples[:, [0, 2]]
    apart = distances(points, ends) if lengths == "straight" else _unfolded(points, triples)
    rest = np.concatenate([distances(points, edges), apart])
    return Sticks(np.concatenate([edges, ends]), rest, np.ones(len(rest)), len(edges))


def _cells(sides: Floats, filled: float, count: int) -> Ints:
    """Cells along x and y, for about `count` nodes on the area of the rectangle that the sheet fills.

    With cells of side h the nodes are  filled / h^2 + (width + height) / h + 1.
    """
    half_round = sides.sum()
    side = (half_round + np.sqrt(half_round**2 + 4 * (count - 1) * filled)) / (2 * (count - 1))
    return np.maximum(np.rint(sides / side), 1).astype(np.int32)


def _along(height: Floats, cell_mm: float) -> tuple[Bools, float]:
    """Whether the sheet leads on from node to node of every line, and the error that its springs make as chords.

    It does where it is there everywhere, and nowhere too steep. Chords are all too short, and what they lack adds up
    along a line: that, less its mean over the line, is by how much points will be off; taken as no less than if the
    whole lack c of a line were spread over it evenly, c / sqrt(12) rms.
    """
    gentle = np.abs(np.diff(height, axis=1)) <= STEEPEST * cell_mm / SUBSTEPS
    joined = np.asarray(gentle.reshape(len(height), -1, SUBSTEPS).all(axis=2))
    stops = height[:, :: SUBSTEPS // PIECES]
    pieces = np.hypot(np.diff(stops, axis=1), cell_mm / PIECES).reshape(*joined.shape, PIECES)
    chords = np.hypot(np.diff(stops[:, ::PIECES], axis=1), cell_mm)
    lack = np.cumsum(np.where(joined, pieces.sum(axis=2) - chords, 0), axis=1)
    return joined, float(np.sqrt(np.maximum(lack.var(axis=1), lack[:, -1] ** 2 / 12).mean()))


def _halved_quads(across: Bools, down: Bools) -> Ints:
    """Triangles (m, 3), counter-clockwise from above, in numbers of crossings; half quads along the border too."""
    rows, cols = across.shape[0], down.shape[1]
    crossing = np.arange(rows * cols).reshape(rows, cols)
    a, b, c, d = crossing[:-1, :-1], crossing[:-1, 1:], crossing[1:, :-1], crossing[1:, 1:]
    first, last, left, right = _sides_of_quads(across, down)
    upper, lower = left & last, first & right
    rest = ~(upper | lower)
    halves = ((a, d, c, upper), (a, b, d, lower), (a, b, c, rest & first & left), (b, d, c, rest & last & right))
    return np.concatenate([np.stack([p[there], q[there], r[there]], axis=1) for p, q, r, there in halves])


def _sides_of_quads(across: Bools, down: Bools) -> tuple[Bools, Bools, Bools, Bools]:
    """Whether each quad has its side in the row before and after, in the column before and after."""
    return across[:-1], across[1:], down[:, :-1], down[:, 1:]


def _pairs(one: Ints, other: Ints, joined: Bools) -> Ints:
    there = joined & (one >= 0) & (other >= 0)
    return np.stack([one[there], other[there]], axis=1)


def _flexion(node: Ints, across: Bools, down: Bools) -> Ints:
    """(t, 5) three nodes in a row, and the neighbours of the middle one in the rows before and after; -1 for none."""
    before, after = np.full_like(node, -1), np.full_like(node, -1)
    before[1:], after[:-1] = np.where(down, node[:-1], -1), np.where(down, node[1:], -1)
    found = np.stack([node[:, :-2], node[:, 1:-1], node[:, 2:], before[:, 1:-1], after[:, 1:-1]], axis=-1)
    return found[across[:, :-1] & across[:, 1:] & (found[..., :3] >= 0).all(axis=-1)]


def _unfolded(points: Floats, triples: Ints) -> Floats:
    """Distance of the outer two of three nodes once the surface around the middle one is laid into one plane.

    With a, b the middle node's distances from the two, and t the angle between them along the surface:
    d^2 = a^2 + b^2 - 2 a b cos t.
    """
    one, middle, other, before, after = triples.T
    arms = [points[end] - points[middle] for end in (one, other)]
    a, b = (np.linalg.norm(arm, axis=1) for arm in arms)
    turns = []
    for beside in (before, after):
        out = points[beside] - points[middle]
        turn = sum(_angle(arm, out) for arm in arms)
        turns.append(np.where(beside >= 0, turn, np.nan))
    whole = 2 * np.pi * turns[0] / (turns[0] + turns[1])  # around a point of a flat sheet there is one full turn
    turn = np.where(np.isnan(whole), np.where(np.isnan(turns[0]), turns[1], turns[0]), whole)
    turn = np.where(np.isnan(turn), np.pi, turn)
    return np.sqrt(np.maximum(a * a + b * b - 2 * a * b * np.cos(turn), 0))


def _angle(u: Floats, v: Floats) -> Floats:
    return np.arctan2(np.linalg.norm(np.cross(u, v), axis=1), np.einsum("ij,ij->i", u, v))


def _nearest(nodes: Floats, points: Floats) -> Ints:
    from scipy.spatial import cKDTree

    return np.asarray(cKDTree(nodes).query(points)[1], np.int32)


def _areas(standing: Floats, faces: Ints) -> tuple[float, float]:
    """Area that the sheet covers as seen from above, and the share of its surface that faces down."""
    vectors = area_vectors(standing, faces)
    area = np.linalg.norm(vectors, axis=1)
    down = vectors[:, 2] < 0
    return float(vectors[~down, 2].sum()), float(area[down].sum() / area.sum())
