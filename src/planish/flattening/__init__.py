"""From a bent sheet to the plane: one file per method behind one function."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from time import perf_counter

import numpy as np

from planish.flattening.expected import chords_shortfall, expected_error
from planish.flattening.frame import direction_of_growth, place_on_page, to_page_frame, turned
from planish.flattening.mass_spring import simulate_mass_spring
from planish.flattening.overlaps import overlaps
from planish.flattening.quad_mesh import QuadMesh, make_quad_mesh, quad_mesh_springs
from planish.flattening.solution import Solution
from planish.flattening.stick_solver import NO_PAPER, solve_sticks
from planish.flattening.verlet import simulate_verlet
from planish.mesh import (
    Topology,
    bounds,
    edges_with_area,
    local_order,
    onto_support_plane,
    prolongate,
    renumbered,
    renumbered_faces,
    subsample,
    topology,
)
from planish.settings import FlattenSettings
from planish.sticks import face_strain, make_sticks, strain, stretch_over_lengths
from planish.types import Diagnostic, Doubt, Flattening, Floats, Mesh, Sticks

__all__ = [
    "Solution",
    "direction_of_growth",
    "flatten",
    "place_on_page",
    "simulate_mass_spring",
    "simulate_verlet",
    "solve_sticks",
    "to_page_frame",
    "turned",
]

PAPER_POINTS = 1000
"""How many of 307,000 points the paper kept, and what its method gets here unless told otherwise."""
SMOOTHED_AS_PAPER = 0.5
"""Lengths without noise presuppose paper. Where a sheet cannot lie flat by them (`stick_solver.NO_PAPER`) the lengths
in space are tried too, and taken unless they strain the page more than twice as much: on a camel, whose bends were
taken for noise, 7.0 % and 6.9 %; on a printed relief in steps of noise, 0.5 % and 11.8 %."""
BUCKLED = 1e-3
"""Strain from which lengths by which a sheet buckles more than raw (`Doubt.BUCKLES`) are held against raw ones. Those
are taken if they strain the page less: the facets of a curved fold, taken for noise, leave 0.145 %, raw lengths 0.09.
Noise over 3 points raises the same doubt, but strains a book by 0.02 and a wave by 0.04 %."""

RAW_LIES_FLAT, STRONG_POINTS = 0.02, 30_000
"""Strong noise that neighbours share (`Doubt.STRONG`) is none where raw lengths strain the page by no more than this: a
coarse crumpled sheet is strained by 1.1 to 1.75 % (1,000 to 6,000 points, 1 to 2.5 mm out by raw lengths and 4.4 to 5.1
without its folds), pieces of walls and boards under real noise by 2.5 % (scan-waves) to 15. Not asked of larger meshes,
whose facets are told from noise (`surface.noise_plan.FOLDED`)."""

OVERHANG = 0.005
"""Share of a sheet that may face the table before a mesh laid over it from above is said not to show it."""

ROUGH = 0.25
"""Noise, in typical edges, from which raw lengths are not tried: two faces of a box before a depth camera read 0.4, and
are 97 x 162 mm without noise, 103 x 172 by raw lengths; meshes that are no paper read 0.1 (camel_b)."""

Progress = Callable[[float], None]


def flatten(
    mesh: Mesh,
    topo: Topology,
    settings: FlattenSettings | None = None,
    progress: Progress | None = None,
    *,
    eye: Floats | None = None,
) -> Flattening:
    """Lay a sheet flat: reduce it if asked, turn it into sticks, solve them, place every point.

    Parameters
    ----------
    mesh : Mesh
        Clean (see `planish.mesh.repair`).
    topo : Topology
        Of the same mesh.
    settings : FlattenSettings, optional
    progress : callable, optional
        Told the share of the work that is done, now and then.
    eye : (3,) float64 [mm], optional
        Where the scanner's rays come from, if its errors lie along them (see `smooth_lengths`).

    Returns
    -------
    Flattening
        Its page is not turned yet: see `to_page_frame`.
    """
    s = settings or FlattenSettings()
    start = perf_counter()
    faces, order = mesh.faces, local_order(mesh, topo)
    if order is not None:
        mesh = renumbered(mesh, order)
        topo = topology(mesh.faces, len(mesh.points))
    count = _points_to_solve(s, len(mesh.points))
    lattice = make_quad_mesh(mesh, count) if s.method == "mass-spring" else None
    coarse = lattice.coarse if lattice else subsample(mesh, topo, count) if count < len(mesh.points) else None
    sheet = mesh if coarse is None else coarse.mesh
    sheet_topo = topo if coarse is None else topology(sheet.faces, len(sheet.points))
    # Between points kept far apart there is next to no noise, but true bends that smoothing would take away.
    lengths = "unfolded" if coarse is not None and s.lengths == "smooth" else s.lengths
    if lattice:
        sticks = quad_mesh_springs(lattice, lengths)
        solved = _by_mass_spring(lattice, sticks, s, progress)
    else:
        sticks = make_sticks(sheet, sheet_topo, lengths, eye=eye)
        solve = _by_verlet if s.method == "verlet" else _by_multigrid
        solved = solve(sheet, sheet_topo, sticks, s, progress)
        if s.method == "multigrid" and lengths == "smooth" and _try_raw(solved, sticks, sheet_topo):
            raw = make_sticks(sheet, sheet_topo, "unfolded")
            again = solve(sheet, sheet_topo, raw, s, progress)
            ours, theirs = (_edge_strain(*one, sheet_topo)[0] for one in ((solved.xy, sticks), (again.xy, raw)))
            if ours > _believed_up_to(solved, sticks, theirs):
                lengths, sticks, solved = "unfolded", raw, again
    flat = solved.xy if coarse is None else prolongate(coarse, mesh.points, solved.xy)
    (left, low), (right, top) = bounds(flat)
    page_xy = np.column_stack([flat[:, 0] - left, top - flat[:, 1]])  # y runs down on the page
    seconds = perf_counter() - start
    error, local_strain = expected_error(solved.xy, sticks, solved.at_rest)
    if coarse is not None:
        short = lattice.shortfall_mm if lattice else chords_shortfall(sheet, sheet_topo)
        error = np.hypot(error, short)[coarse.nearest]
        local_strain = local_strain[coarse.nearest]
        of_faces = np.sqrt((local_strain[mesh.faces] ** 2).mean(axis=1))
    else:
        of_faces = face_strain(solved.xy, sticks.pairs[: sticks.edges], sticks.rest[: sticks.edges], topo.face_edges)
    back = slice(None) if order is None else np.argsort(order)
    face_back = slice(None) if order is None else np.argsort(renumbered_faces(order, faces))
    return Flattening(
        page_xy=page_xy[back],
        size_mm=(float(right - left), float(top - low)),
        outcome=solved.outcome,
        method=s.method,
        lengths=lengths,
        solved_points=len(sheet.points),
        iterations=solved.iterations,
        residuals=solved.residuals,
        heights=solved.heights,
        strain=_edge_strain(solved.xy, sticks, None if lattice else sheet_topo),
        stretch=None
        if lattice
        else stretch_over_lengths(sticks.rest[: sticks.edges], sheet_topo.face_edges, sheet.faces, solved.xy),
        error_mm=error[back],
        local_strain=local_strain[back],
        face_strain=of_faces[face_back],
        seconds=seconds,
        noise_mm=None if sticks.noise_mm is None else float(np.median(sticks.noise_mm)),
        noise_length_mm=sticks.noise_length_mm,
        spikes=sticks.spikes,
        overlaps=overlaps(mesh.faces, page_xy, topo),
        passed_points=int(solved.passed.sum()),
        warnings=solved.warnings,
        normals=None if coarse is not None or sticks.normals is None else sticks.normals[back],
    )


def _edge_strain(xy: Floats, sticks: Sticks, topo: Topology | None) -> tuple[float, float]:
    """Rms and greatest strain of the edges, without those of a triangle mesh that belong to no face with area."""
    rest = sticks.rest[: sticks.edges]
    if topo is not None:
        rest = np.where(edges_with_area(rest, topo.face_edges), rest, 0.0)
    return strain(xy, sticks.pairs[: sticks.edges], rest)


def _try_raw(solved: Solution, sticks: Sticks, topo: Topology) -> bool:
    """Whether lengths without noise are to be held against raw ones."""
    if sticks.doubt is Doubt.STRONG:
        return len(solved.xy) <= STRONG_POINTS
    if _is_rough(sticks):
        return False
    if solved.residuals[-1] > NO_PAPER:
        return True
    return sticks.doubt is Doubt.BUCKLES and _edge_strain(solved.xy, sticks, topo)[0] > BUCKLED


def _believed_up_to(solved: Solution, sticks: Sticks, strain_of_raw: float) -> float:
    """Strain of the page up to which lengths without noise are kept, beside that of the page by raw lengths."""
    if sticks.doubt is Doubt.STRONG:
        return 0.0 if strain_of_raw < RAW_LIES_FLAT else math.inf
    return (SMOOTHED_AS_PAPER if solved.residuals[-1] > NO_PAPER else 1.0) * strain_of_raw


def _is_rough(sticks: Sticks) -> bool:
    """Whether noise is so large beside the edges that raw lengths say nothing: they are up to 10 % too long then."""
    if sticks.noise_mm is None or sticks.noise_length_mm is None:
        return False
    return float(np.median(sticks.noise_mm)) > ROUGH * float(np.median(sticks.rest[: sticks.edges]))


def _by_multigrid(
    mesh: Mesh, topo: Topology, sticks: Sticks, settings: FlattenSettings, progress: Progress | None
) -> Solution:
    return solve_sticks(mesh, topo, sticks, settings.multigrid, progress)


def _by_verlet(
    mesh: Mesh, topo: Topology, sticks: Sticks, settings: FlattenSettings, progress: Progress | None
) -> Solution:
    standing = Mesh.owned(onto_support_plane(mesh)[0], mesh.faces)
    done = simulate_verlet(standing, sticks, settings.verlet, progress)
    passed = int(done.passed.sum())
    through = Diagnostic(
        "layers-passed",
        f"{passed:,} points went through another layer of the sheet while it fell, so the page may be folded over "
        "itself",
        "set {verlet.self_collision} to keep layers apart",
    )
    return replace(done, warnings=(through,)) if passed else done


def _by_mass_spring(
    lattice: QuadMesh, springs: Sticks, settings: FlattenSettings, progress: Progress | None
) -> Solution:
    mesh = lattice.coarse.mesh
    done = simulate_mass_spring(
        Mesh.owned(onto_support_plane(mesh)[0], mesh.faces), springs, settings.mass_spring, progress
    )
    hidden = Diagnostic(
        "overhang-hidden",
        f"{lattice.overhang:.1%} of the sheet faces the table: the regular mesh of mass-spring, laid over it from "
        "above, does not show that nor what lies below, so the page is wrong there",
        "take another {method}",
    )
    return replace(done, warnings=(hidden,)) if lattice.overhang > OVERHANG else done


def _points_to_solve(settings: FlattenSettings, available: int) -> int:
    if settings.points == "auto":
        return available if settings.method == "multigrid" else PAPER_POINTS
    return available if settings.points == "all" else settings.points
