"""How far the page is likely to be from the truth, from what is left in the sticks and from the scanner's noise."""

from __future__ import annotations

import numpy as np

from planish.geometry.distances import distances
from planish.mesh import Topology, area_vectors, bounds, point_normals
from planish.types import Floats, Mesh, Sticks

STRAIN_WEIGHT = 1.6
NOISE_WEIGHT, ALL_AROUND = 0.36, 2**0.5
"""b of the formula where errors lie along a scanner's rays, and where they go in all directions."""
TURNED = 0.002
"""Where noise turned over more than this part of the faces, it goes in all directions: one in forty there, at most one
in three thousand where it lies along rays."""
SAMPLE = 100_000
"""Edges that are looked at: hundreds in each of the cells below."""

CELLS = 16
"""Strain is averaged over a sixteenth of the sheet's side: errors of the page are smooth over more than that."""


def expected_error(xy: Floats, sticks: Sticks, at_rest: Floats | None = None) -> tuple[Floats, Floats]:
    """Expected distance of every point from its true place on the page, rms.

        e^2 = (a s sqrt(h L))^2 + (b sigma)^2

    s is the rms strain of the edges around, h their median length, L the side of the sheet, sigma the scanner's noise
    as far as it is left in the lengths. Strain that changes sign from edge to edge at random adds up over the L / h
    edges of a side to s h sqrt(L / h), which is the first term; a = 1.6 was found for noise, folds cut short by a
    coarse mesh and surfaces that cannot lie flat alike. Noise moves a point along the sheet too, by the second term.
    Both were measured against the truth, see docs/benchmarks.md; the expectation is good to a factor of two.

    Parameters
    ----------
    xy : (n, 2) float64 [mm]
        The flat sheet.
    sticks : Sticks
        That were to be kept.
    at_rest : (n, 2) float64 [mm], optional
        The sheet before faces were turned over, if that moved points: what it moved them by is strain of slender faces
        that does not add up, and counts as it is.

    Returns
    -------
    error : (n,) float64 [mm]
    strain : (n,) float64
        s of the formula, at every point.
    """
    every = sticks.edges // SAMPLE + 1
    pairs, rest = sticks.pairs[: sticks.edges : every], sticks.rest[: sticks.edges : every]
    long = rest > 0
    pairs, rest = pairs[long], rest[long]
    moved = 0.0 if at_rest is None else ((xy - at_rest) ** 2).sum(axis=1)
    xy = xy if at_rest is None else at_rest
    arm = xy[pairs[:, 1]] - xy[pairs[:, 0]]
    squared = (np.hypot(arm[:, 0], arm[:, 1]) / rest - 1) ** 2
    low, high = bounds(xy)
    side = float(np.sqrt(np.prod(np.maximum(high - low, np.median(rest)))))
    local = _average_around(xy, (xy[pairs[:, 0]] + xy[pairs[:, 1]]) / 2, squared, side / CELLS)
    squared_error = STRAIN_WEIGHT**2 * local * float(np.median(rest)) * side + moved
    if sticks.noise_mm is not None:
        around = sticks.turned is not None and float(sticks.turned.mean()) > TURNED
        weight = ALL_AROUND if around else NOISE_WEIGHT
        squared_error = squared_error + (weight * sticks.noise_left * sticks.noise_mm) ** 2
    return np.sqrt(squared_error), np.sqrt(local)


def chords_shortfall(mesh: Mesh, topo: Topology) -> float:
    """Expected error of a page [mm], rms, from the chords that a coarse mesh draws across the bends of its sheet.

    A chord over an arc that turns by phi is shorter by phi^2 / 24. All chords are too short, so that the shortfall
    adds up along the whole side; the points of a page that is too small by a share s are s L / sqrt(12) off, rms, in
    each direction in which the sheet is bent.
    """
    normals = point_normals(mesh.points, mesh.faces)
    a, b = topo.edges.T
    turn = np.arccos(np.clip(np.einsum("ij,ij->i", normals[a], normals[b]), -1, 1))
    length = distances(mesh.points, topo.edges)
    side = float(np.sqrt(np.linalg.norm(area_vectors(mesh.points, mesh.faces), axis=1).sum()))
    return float(np.average(turn**2, weights=length)) / 24 * side / np.sqrt(12)


def _average_around(xy: Floats, places: Floats, values: Floats, radius: float) -> Floats:
    """At every point the mean of the values at places around it, weighted by a bell of the given radius."""
    from scipy.ndimage import gaussian_filter, map_coordinates

    low, high = bounds(xy)
    shape = np.ceil((high - low) / radius).astype(int) + 1
    cell = np.rint((places - low) / radius).astype(int).clip(0, shape - 1) @ [shape[1], 1]
    total, count = (
        gaussian_filter(np.bincount(cell, weight, shape.prod()).reshape(shape), 1.0, mode="constant")
        for weight in (values, np.ones_like(values))
    )
    mean = total / np.maximum(count, 1e-12)
    return np.maximum(map_coordinates(mean, ((xy - low) / radius).T, order=1, mode="nearest"), 0.0)
