"""From a bent sheet to the plane: one file per method behind one function."""

from __future__ import annotations

from collections.abc import Callable

from planish.flatten.frame import direction_of_growth, place_on_page, to_page_frame, turned
from planish.flatten.verlet import settle
from planish.mesh import Topology, carry, stand_on_table, subsample, topology
from planish.settings import FlattenSettings
from planish.sticks import make_sticks, strain
from planish.types import Flattening, Mesh

__all__ = ["direction_of_growth", "flatten", "place_on_page", "settle", "to_page_frame", "turned"]

_THROUGH = (
    "{:,} points went through another layer of the sheet while it fell, so the page may be folded over itself; "
    "--verlet.self-collision keeps layers apart"
)
PAPER_POINTS = 1000
"""How many of 307,000 points the paper kept, and what its method gets here unless told otherwise."""


def flatten(
    mesh: Mesh,
    topo: Topology,
    settings: FlattenSettings | None = None,
    progress: Callable[[float], None] | None = None,
) -> Flattening:
    """Lay a sheet flat: reduce it if asked, turn it into sticks, let the method settle them, place every point.

    Parameters
    ----------
    mesh : Mesh
        Clean (see `planish.mesh.clean`).
    topo : Topology
        Of the same mesh.
    settings : FlattenSettings, optional
    progress : callable, optional
        Told the share of the work that is done, now and then.

    Returns
    -------
    Flattening
        Its page is not turned yet: see `to_page_frame`.
    """
    s = settings or FlattenSettings()
    points, _, _ = stand_on_table(mesh)
    standing = Mesh(points, mesh.faces)
    count = _points_to_solve(s, len(points))
    coarse = subsample(standing, topo, count) if count < len(points) else None
    solved = standing if coarse is None else coarse.mesh
    solved_topo = topo if coarse is None else topology(solved.faces, len(solved.points))
    sticks = make_sticks(solved, solved_topo, s.lengths)
    settled = settle(solved, sticks, s.verlet, progress)
    x = settled.points[:, :2]
    flat = x if coarse is None else carry(coarse, points, x)
    page_xy, size = place_on_page(flat * [1.0, -1.0])  # y runs down on the page
    passed = int(settled.passed.sum())
    return Flattening(
        page_xy=page_xy,
        size_mm=size,
        outcome=settled.outcome,
        method=s.method,
        solved_points=len(x),
        iterations=len(settled.residuals),
        residuals=settled.residuals,
        heights=settled.heights,
        strain=strain(x, sticks.pairs[: sticks.edges], sticks.rest[: sticks.edges]),
        passed_points=passed,
        warnings=(_THROUGH.format(passed),) if passed else (),
    )


def _points_to_solve(settings: FlattenSettings, available: int) -> int:
    if settings.points == "auto":
        return PAPER_POINTS if settings.method == "verlet" else available
    return available if settings.points == "all" else settings.points
