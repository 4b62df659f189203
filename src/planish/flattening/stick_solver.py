"""All points at once: the energy of the sticks minimised, from a layout that is nearly right."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from planish.flattening.area_penalty import add_area_penalty
from planish.flattening.as_rigid_as_possible import lay_out_triangles, signed_areas
from planish.flattening.energy import energy, make_net
from planish.flattening.initial_layout import apply_face_flips, initial_layout
from planish.flattening.lbfgs import minimize
from planish.flattening.lengths import median_edge
from planish.flattening.multigrid_preconditioner import make_preconditioner, precondition
from planish.flattening.non_developable import DIRECT, distortion, solve_non_developable
from planish.flattening.overlaps import overlaps
from planish.flattening.pieces import align_pieces, number_pieces, orient_to_view, pack_pieces
from planish.flattening.solution import Solution
from planish.flattening.untangle import untangle
from planish.geometry.guards import TINY
from planish.geometry.rigid_fit import fit_rigid
from planish.mesh import LEAST_HEIGHT, Topology, relative_heights
from planish.parallel import ParallelFor, thread_pool
from planish.settings import MultigridSettings
from planish.sticks import face_strain
from planish.types import Diagnostic, Floats, Ints, Mesh, Outcome, Sticks

CRUSHED = 0.05
"""Rms relative error of the sticks from which on a sheet is not what was scanned any more."""

FOLDED_HEIGHT, FOLDED_SIDE = 0.2, 0.5
"""A face on its back is a fold of the layout, not one that noise turned over, if its height over its longest side is at
least this part of that side and none of its sides is shorter than so many median edges."""

NO_PAPER = 0.01
"""Rms relative error of the sticks from which on a sheet is looked at as a surface that cannot lie flat: paper with 0.2
mm of noise, in points 1.4 mm apart, ends at 0.6 %."""

FINEST_STEPS = 20
"""A mesh's steps are at most so much smaller in one direction than in the other; the error of the sticks is then at
least this part of the strain of its triangles."""

PREFERRED = 0.9
"""Of two layouts of a surface that cannot lie flat the one whose worst edge is bounded is taken, up to 1 / this times
the strain: on a hemisphere 11.9 % with 34 % at worst, not 11.8 with 40."""

FEW_STEPS, MANY_STEPS, SMALL = 30, 100, 5_000
"""Steps for single points to find their places in a sheet at rest, and for one that is laid out anew, up to SMALL
points: three poses of a rubber mat (1,500 points) are strained by 0.7, 0.6 and 1.4 %, only relaxed by 1.1, 1.5 and
2.2, else by 7.2, 1.5 and 2.4."""

MANY_TURNED = 0.01
"""Share of faces that noise turned over from which on it goes in all directions: 2 % and more at 0.05 mm of noise and
0.45 mm between points. Scans with triangles that lie badly have 0.3 to 0.7 % (a rubber mat, three times)."""

MANY, FEW = 100_000, 1_000
"""With more points than this the tolerance is what the settings say, with fewer it falls in proportion: steps cost
next to nothing then, and a coarse mesh shows its strain more. With fewer still it stays a hundredth."""

APART = 0.03
"""Room between pieces that lie apart, in the side of the sheet."""


def solve_sticks(
    mesh: Mesh,
    topology: Topology,
    sticks: Sticks,
    settings: MultigridSettings | None = None,
    progress: Callable[[float], None] | None = None,
) -> Solution:
    """Lay a sheet flat, so that its sticks come as near to their lengths as all of them together can.

    Parameters
    ----------
    mesh : Mesh
        Clean (see `planish.mesh.repair`).
    topology : Topology
        Of the same mesh.
    sticks : Sticks
        Of the same mesh; the lengths of its edges make the first layout.
    settings : MultigridSettings, optional
    progress : callable, optional
        Told the share of the work that is done, now and then.

    Examples
    --------
    Half a cylinder, 30 x 40 mm:

    >>> from planish.mesh import topology
    >>> from planish.sticks import make_sticks
    >>> angle, z = np.meshgrid(np.linspace(0, np.pi, 31), np.linspace(0, 40, 41))
    >>> points = np.c_[30 / np.pi * np.cos(angle.ravel()), z.ravel(), 30 / np.pi * np.sin(angle.ravel())]
    >>> i = np.arange(30)[:, None] + 31 * np.arange(40)
    >>> faces = np.concatenate([np.stack(f, -1).reshape(-1, 3) for f in [(i, i + 32, i + 1), (i, i + 31, i + 32)]])
    >>> mesh = Mesh(points, faces)
    >>> found = topology(mesh.faces, len(points))
    >>> flat = solve_sticks(mesh, found, make_sticks(mesh, found, "unfolded"))
    >>> flat.outcome.name, np.ptp(flat.xy, axis=0).round(2).tolist()
    ('SETTLED', [29.99, 40.0])
    """
    s = settings or MultigridSettings()
    tell = progress or (lambda share: None)
    rest = sticks.rest[: sticks.edges]
    edge = median_edge(rest)
    side = edge * float(np.sqrt(len(mesh.points)))
    with thread_pool() as parallel_for:
        faces, found = apply_face_flips(mesh.faces, topology, sticks.turned)
        xy, piece, aligned = initial_layout(faces, found, rest, len(mesh.points), parallel_for)
        xy, _ = untangle(xy, faces, found, rest)  # sticks can hold a flipped face down for a hundred steps
        tell(0.3)
        piece, count = number_pieces(piece)
        if count > 1:
            xy = pack_pieces(xy, piece, count, APART * side)
        xy, outcome, residuals = _bring_to_rest(
            xy, faces, found, sticks, s, parallel_for, lambda share: tell(0.3 + 0.65 * share)
        )
        failed = outcome is not Outcome.SETTLED or aligned is Outcome.DIVERGED
        if failed or _is_no_paper(residuals[-1], xy, faces, found, sticks):
            xy, outcome, residuals = _not_as_paper(
                mesh, topology, sticks, piece, s, (xy, outcome, residuals), parallel_for
            )
            if count > 1:
                xy = pack_pieces(xy, piece, count, APART * side)
    xy = orient_to_view(mesh.points, mesh.faces, xy, piece, count)
    warnings: list[Diagnostic] = []
    if count > 1:
        xy, warnings = _place(mesh, topology, xy, piece, count, edge, side)
    at_rest = xy
    xy, flipped = _lay_faces(xy, mesh, topology, sticks, piece)  # last, as a turn can flip a face without area
    if flipped:
        warnings.append(Diagnostic("faces-not-laid", _FLIPPED.format(flipped)))
    if outcome is Outcome.SETTLED and residuals[-1] > CRUSHED:
        outcome = Outcome.CRUSHED
    tell(1.0)
    return Solution(xy, outcome, len(residuals) - 1, residuals, warnings=tuple(warnings), at_rest=at_rest)


_FLIPPED = (
    "{:,} faces could not be laid on the page with their printed side up; the surface there is no flat sheet bent"
)
_JOINED = (
    "the sheet is in {:,} pieces; {:,} of them were set side by side across gaps about {:.1f} mm wide, by the "
    "directions of the borders"
)
_APART = "{:,} pieces of the sheet lie apart on the page, as nothing shows plainly where they belong"


def _bring_to_rest(
    xy: Floats,
    faces: Ints,
    topology: Topology,
    sticks: Sticks,
    settings: MultigridSettings,
    parallel_for: ParallelFor,
    progress: Callable[[float], None],
) -> tuple[Floats, Outcome, Floats]:
    rest = sticks.rest[: sticks.edges]
    edge = median_edge(rest)
    side = edge * float(np.sqrt(len(xy)))
    net = make_net(sticks, parallel_for)
    preconditioner = make_preconditioner(net, sticks.edges, xy, parallel_for)

    def precondition_force(force: Floats) -> Floats:
        return precondition(preconditioner, force, parallel_for)

    still = settings.tolerance * side * np.clip(len(xy), FEW, MANY) / MANY
    xy, outcome, energies = minimize(
        lambda places: energy(net, places, parallel_for),
        xy,
        precondition_force,
        max_steps=settings.max_steps,
        still_mm=still,
        parallel_for=parallel_for,
        progress=progress,
    )
    folded = _folded(xy, faces, topology, rest)
    if outcome is not Outcome.DIVERGED and len(folded):
        triangles = lay_out_triangles(topology.face_edges, rest)
        areas = np.where(relative_heights(rest, topology.face_edges) >= LEAST_HEIGHT, triangles.areas, 0.0)

        def objective(places: Floats) -> tuple[float, Floats]:
            value, gradient = energy(net, places, parallel_for)
            return value + add_area_penalty(places, faces, areas, edge**2, gradient), gradient

        opened, _, _ = minimize(
            objective, xy, precondition_force, max_steps=settings.max_steps, still_mm=still, parallel_for=parallel_for
        )
        if len(_folded(opened, faces, topology, rest)) < len(folded):
            xy = opened
            energies = np.append(energies, energy(net, xy, parallel_for)[0])
    return xy, outcome, _relative(energies, sticks)


def _is_no_paper(residual: float, xy: Floats, faces: Ints, topology: Topology, sticks: Sticks) -> bool:
    """Whether the sticks, or the triangles, each by its area, are strained as on no paper.

    The residual counts sticks by their lengths, and so passes over short ones of a mesh whose steps differ much along
    rows and columns. Raw lengths say nothing of triangles: noise strains their short sides as much.
    """
    if residual > NO_PAPER or sticks.noise_mm is None or residual < NO_PAPER / FINEST_STEPS:
        return residual > NO_PAPER
    edges = slice(sticks.edges)
    of_faces = face_strain(xy, sticks.pairs[edges], sticks.rest[edges], topology.face_edges)
    return bool(np.average(of_faces**2, weights=np.abs(signed_areas(xy, faces)) + TINY) > NO_PAPER**2)


def _lay_faces(xy: Floats, mesh: Mesh, topology: Topology, sticks: Sticks, piece: Ints) -> tuple[Floats, int]:
    """The sheet at rest with all faces printed side up, and how many could not be laid so.

    Where a bad mesh turns a few faces over, laying them may strain the sheet around them a lot; then it is relaxed
    there. Not where noise turned many: what that moves points by is no more than the noise. A small mesh is also laid
    out anew, as rigid as possible, if that leaves less strain still.
    """
    rest = sticks.rest[: sticks.edges]
    laid, flipped = untangle(xy, mesh.faces, topology, rest)
    many = sticks.turned is not None and float(sticks.turned.mean()) > MANY_TURNED
    if laid is xy or many or len(xy) > DIRECT:
        return laid, flipped
    strained = distortion(laid, mesh.faces, topology, rest)
    if flipped == 0 and strained.strain <= NO_PAPER:
        return laid, flipped
    with thread_pool() as parallel_for:
        ends = [solve_non_developable(mesh, topology, rest, piece, parallel_for, FEW_STEPS, laid)[0]]
        if len(xy) <= SMALL and piece.max() == 0:
            anew, *_ = solve_non_developable(mesh, topology, rest, piece, parallel_for, MANY_STEPS)
            rotation, shift = fit_rigid(anew, xy)
            ends.append(anew @ rotation.T + shift)
    for end in ends:
        if distortion(end, mesh.faces, topology, rest) < strained:
            laid, strained = end, distortion(end, mesh.faces, topology, rest)
    return laid, strained.flips


def _folded(xy: Floats, faces: Ints, topology: Topology, rest: Floats) -> NDArray[np.intp]:
    """Rows of faces on their back that are so large and well shaped that no noise can have turned them over."""
    flipped = np.flatnonzero(signed_areas(xy, faces) <= 0)
    if not len(flipped):
        return flipped
    lengths = rest[topology.face_edges[flipped]]
    height = relative_heights(rest, topology.face_edges[flipped])
    return flipped[(height >= FOLDED_HEIGHT) & (lengths.min(axis=1) >= FOLDED_SIDE * median_edge(rest))]


def _relative(energies: Floats, sticks: Sticks) -> Floats:
    """Root mean square relative error of the sticks, weighted by their lengths squared, for energies of theirs."""
    square = max(float(np.sum(sticks.weight * sticks.rest * sticks.rest)), TINY)
    return np.sqrt(2 * energies / square)


def _not_as_paper(
    mesh: Mesh,
    topology: Topology,
    sticks: Sticks,
    piece: Ints,
    settings: MultigridSettings,
    ended: tuple[Floats, Outcome, Floats],
    parallel_for: ParallelFor,
) -> tuple[Floats, Outcome, Floats]:
    """The better of a layout and of one made as for a surface that cannot lie flat: with fewer flips, or less strain.

    Faces that noise turned over are no flips of the first.
    """
    rest = sticks.rest[: sticks.edges]
    ours = distortion(ended[0], *apply_face_flips(mesh.faces, topology, sticks.turned), rest)
    try:
        other = solve_non_developable(mesh, topology, rest, piece, parallel_for, settings.max_steps)
    except RuntimeError:  # "Factor is exactly singular", where points lie upon each other
        return ended
    theirs = distortion(other[0], mesh.faces, topology, rest)
    if theirs.strain > NO_PAPER:  # its worst edge is never worse than as rigid as possible
        theirs = theirs._replace(strain=PREFERRED * theirs.strain)
    return other if theirs < ours else ended


def _place(
    mesh: Mesh, topology: Topology, xy: Floats, piece: Ints, count: int, edge: float, side: float
) -> tuple[Floats, list[Diagnostic]]:
    """Pieces beside each other where their gaps are plain, the others apart; and what to tell about it."""
    apart = pack_pieces(xy, piece, count, APART * side)
    together, group, joints = align_pieces(mesh.points, mesh.faces, topology, xy, piece, count, edge)
    group, groups = number_pieces(group)
    together = pack_pieces(together, group, groups, APART * side)
    if joints and overlaps(mesh.faces, together, topology) > overlaps(mesh.faces, apart, topology):
        together, groups, joints = apart, count, []
    warnings = []
    if joints:
        width = float(np.median([joint.width for joint in joints]))
        warnings.append(Diagnostic("pieces-aligned", _JOINED.format(count, len(joints) + 1, width)))
    if groups > 1:
        warnings.append(Diagnostic("pieces-apart", _APART.format(groups - 1)))
    return together, warnings
