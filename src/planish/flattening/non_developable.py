"""Surfaces that cannot lie flat, and sheets on which the sticks' descent fails: never worse than as rigid as possible.

Sticks are blind to mirror images. On paper that does no harm, as the first layout is nearly right; on a face or an
animal the first layout is far off, and the descent ends crumpled. Here it begins as rigid as possible, each edge weighs
as 1 / r, and faces are pushed open where they would turn over. Weights of 1 / r^2 would lower the mean square strain
itself, but 1 / r ends within 0.2 % of that, with less strain of the worst edge (5.8 % instead of 7.0 on a quad mesh, 18
instead of 21 on a snail, 15 instead of 17 on a roof). Edges that are strained nearly as much as the worst
one where the descent began resist more. Whatever comes of it, strain and flips end no higher than there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from planish.flattening.area_penalty import add_area_penalty, add_stretch_penalty
from planish.flattening.as_rigid_as_possible import (
    as_rigid_as_possible,
    graph_laplacian,
    lay_out_triangles,
    least_squares_conformal,
    signed_areas,
)
from planish.flattening.energy import energy, make_net
from planish.flattening.lbfgs import minimize
from planish.flattening.lengths import median_edge
from planish.flattening.multigrid_preconditioner import make_preconditioner, precondition
from planish.flattening.untangle import untangle
from planish.geometry.distances import distances
from planish.mesh import LEAST_HEIGHT, Topology, edges_with_area, prolongate, relative_heights, subsample, topology
from planish.parallel import ParallelFor
from planish.sticks import strain
from planish.types import Floats, Ints, Mesh, Outcome, Sticks

DIRECT = 30_000
"""Points up to which sparse matrices are factored: half a second. A larger mesh begins from a sub-sampled one."""

GREATEST = 0.7
"""Part of the greatest strain as rigid as possible from which edges resist ten times as much. With 0.95 the worst edge
of a lilium is strained by 23 %, not 17 (21.6 as rigid as possible); with 0.35 a hemisphere stays where it began."""

STILL = 1e-2
"""Median edges that the points of the next step would move by, rms, when the surface is at rest. A tenth of it lowers
the strain by less than 0.05 % and takes three times the steps; but slow bends of the whole outline, which cost next to
no strain, then go on: a skirt ends 1.34 cm from its sewing pattern instead of 0.98."""

LEVEL = 0.02
"""At rest, too, when ten steps have lowered the energy by no more than this part: 1 % of the strain."""

SHORTEST = 1e-3
"""Edges shorter than this part of the median edge weigh as much as one so long."""


class Distortion(NamedTuple):
    """How far a flat sheet is from the surface: less is better, flips first.

    Attributes
    ----------
    flips : int
        Faces with area that lie with their back up.
    strain : float
        Root mean square strain of the edges of faces with area.
    """

    flips: int
    strain: float


def distortion(xy: Floats, faces: Ints, topo: Topology, edge_rest: Floats) -> Distortion:
    """Flips and strain of a flat sheet, x right and y up, against lengths of its edges."""
    with_area = relative_heights(edge_rest, topo.face_edges) >= LEAST_HEIGHT
    flips = int(np.count_nonzero(signed_areas(xy, faces)[with_area] <= 0))
    counted = np.where(edges_with_area(edge_rest, topo.face_edges), edge_rest, 0.0)
    return Distortion(flips, strain(xy, topo.edges, counted)[0])


def solve_non_developable(
    mesh: Mesh,
    topo: Topology,
    edge_rest: Floats,
    piece: Ints,
    parallel_for: ParallelFor,
    max_steps: int,
    start: Floats | None = None,
) -> tuple[Floats, Outcome, Floats]:
    """Lay any surface with a border flat, with little strain and no face turned over where that can be.

    Parameters
    ----------
    mesh : Mesh
    topo : Topology
        Of the same mesh.
    edge_rest : (e,) float64 [mm]
    piece : (n,) int32
        Points that hang together have the same number.
    parallel_for : callable
    max_steps : int
    start : (n, 2) float64 [mm], optional
        A layout that is right but for single points; by default as rigid as possible.

    Returns
    -------
    xy : (n, 2) float64 [mm]
        Pieces lie over each other.
    outcome : Outcome
        SETTLED, OUT_OF_STEPS or DIVERGED.
    residuals : (steps + 1,) float64
        Root mean square strain of the edges before and after each step, the penalty on thin faces counted in.
    """
    start = _first_layout(mesh, topo, edge_rest, piece) if start is None else start
    median = median_edge(edge_rest)
    weight = median / np.maximum(edge_rest, SHORTEST * median)
    net = make_net(Sticks(topo.edges, edge_rest, weight, len(edge_rest)), parallel_for)
    triangles = lay_out_triangles(topo.face_edges, edge_rest)
    areas = np.where(relative_heights(edge_rest, topo.face_edges) >= LEAST_HEIGHT, triangles.areas, 0.0)

    counted = np.where(edges_with_area(edge_rest, topo.face_edges), edge_rest, 0.0)
    most = GREATEST * strain(start, topo.edges, counted)[1]

    def objective(xy: Floats) -> tuple[float, Floats]:
        value, gradient = energy(net, xy, parallel_for)
        value += add_area_penalty(xy, mesh.faces, areas, median**2, gradient)
        return value + add_stretch_penalty(xy, topo.edges, counted, weight, most, gradient), gradient

    if len(start) <= DIRECT:
        step = graph_laplacian(topo.edges, weight, len(start)).solve
    else:
        grids = make_preconditioner(net, len(edge_rest), start, parallel_for)
        step = lambda force: precondition(grids, force, parallel_for)  # noqa: E731
    xy, outcome, energies = minimize(
        objective, start, step, max_steps=max_steps, still_mm=STILL * median, parallel_for=parallel_for, level=LEVEL
    )
    mended, _ = untangle(xy, mesh.faces, topo, edge_rest)
    best = min((xy, mended, start), key=lambda end: distortion(end, mesh.faces, topo, edge_rest))
    residuals = np.sqrt(2 * energies / float(np.sum(weight * edge_rest**2)))
    return best, outcome, residuals


def _first_layout(mesh: Mesh, topo: Topology, edge_rest: Floats, piece: Ints) -> Floats:
    """As rigid as possible, from a conformal map; of a large mesh by way of fewer points."""
    if len(mesh.points) > DIRECT:
        coarse = subsample(mesh, topo, DIRECT // 2)
        coarse_topo = topology(coarse.mesh.faces, len(coarse.mesh.points))
        coarse_piece = np.zeros(len(coarse.mesh.points), piece.dtype)
        coarse_piece[coarse.nearest] = piece
        rest = distances(coarse.mesh.points, coarse_topo.edges)
        return prolongate(coarse, mesh.points, _first_layout(coarse.mesh, coarse_topo, rest, coarse_piece))
    triangles = lay_out_triangles(topo.face_edges, edge_rest)
    pins, pin_xy = _pins(mesh.points, topo, piece)
    xy = least_squares_conformal(mesh.faces, triangles, pins, pin_xy)
    return as_rigid_as_possible(mesh.faces, triangles, xy)


def _pins(points: Floats, topo: Topology, piece: Ints) -> tuple[Ints, Floats]:
    """Two points of each piece that lie far apart, at its border if it has one, and places for them on a line."""
    border = np.zeros(len(points), bool)
    border[topo.edges[topo.edge_uses == 1]] = True
    pins, places = [], []
    for number in np.unique(piece):
        own = np.flatnonzero((piece == number) & border)
        own = own if len(own) > 1 else np.flatnonzero(piece == number)
        far = np.linalg.norm(points[own] - points[own[0]], axis=1)
        pins += [own[0], own[np.argmax(far)]]
        places += [(0.0, 0.0), (float(far.max()), 0.0)]
    return np.array(pins), np.array(places)
