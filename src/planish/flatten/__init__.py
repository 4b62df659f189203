"""From a bent sheet to the plane: one file per method behind one function."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from planish.flatten.frame import direction_of_growth, place_on_page, to_page_frame, turned
from planish.flatten.verlet import settle
from planish.mesh import Topology, carry, stand_on_table, subsample, topology
from planish.settings import FlattenSettings
from planish.sticks import make_sticks
from planish.types import Flattening, Mesh

__all__ = ["direction_of_growth", "flatten", "place_on_page", "settle", "to_page_frame", "turned"]

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
    count = s.points or (PAPER_POINTS if s.method == "verlet" else len(points))
    coarse = subsample(standing, topo, count) if count < len(points) else None
    solved = standing if coarse is None else coarse.mesh
    solved_topo = topo if coarse is None else topology(solved.faces, len(solved.points))
    sticks = make_sticks(solved, solved_topo, s.lengths)
    x, outcome, steps, residuals, heights = settle(solved.points, sticks, s.verlet, progress)
    flat = x[:, :2] if coarse is None else carry(coarse, points, x[:, :2])
    page_xy, size = place_on_page(flat * [1.0, -1.0])  # y runs down on the page
    return Flattening(
        page_xy=page_xy,
        size_mm=size,
        outcome=outcome,
        method=s.method,
        solved_points=len(x),
        iterations=steps,
        residuals=residuals,
        heights=heights,
        strain=_strain(x, sticks.pairs[: sticks.edges], sticks.rest[: sticks.edges]),
    )
