"""How far the page is likely to be from the truth, from what is left in the sticks and from the scanner's noise."""

from __future__ import annotations

import numpy as np
from numba import njit

from planish.flattening.lengths import median_edge
from planish.geometry.distances import distances
from planish.geometry.guards import TINY
from planish.mesh import Topology, area_vectors, bounds, point_normals
from planish.types import Floats, Ints, Mesh, Sticks

STRAIN_WEIGHT, EDGE_WEIGHT = 1.0, 1.6
COARSE = 32
NOISE_WEIGHT, ALL_AROUND = 0.36, 2**0.5
"""a, c, n and b of the formula; b where errors lie along a scanner's rays, and where they go in all directions."""
TURNED = 0.002
"""Where noise turned over more than this part of the faces, it goes in all directions: one in forty there, at most one
in three thousand where it lies along rays."""

SMALLEST, LARGEST = 4.0, 0.25
"""Patches are 4, 8, 16 ... median edges wide, up to a quarter of the sheet's side."""

MOST_PATCHES = 500
"""Of the smallest patches side by side, at most."""

FEWEST = 0.25
"""Patches with less than this part of the usual number of edges lie at the border, and are left out."""

NODES = 16
"""Both maps are averaged over a sixteenth of the sheet's side: errors of the page are smooth over more than that."""

TERMS = 11
"""Sums of a patch: six of its matrix, three of its right side, squares of strain, edges."""


def expected_error(xy: Floats, sticks: Sticks, at_rest: Floats | None = None) -> tuple[Floats, Floats]:
    """Expected distance of every point from its true place on the page, rms.

        e^2 = max over R of (a s_R sqrt(R L))^2 + (c s sqrt(h L))^2 min(n h / L, 1)^2 + (b sigma)^2 + beta^2

    s_R is the strain tensor of patches of width R, fitted to all edges in each and averaged around the point (norm,
    rms), L the side of the sheet, sigma the scanner's noise as far as it is left in the lengths. Strain that changes
    sign from patch to patch at random adds up over the L / R patches of a side to s_R R sqrt(L / R), which is the first
    term; strain that changes sign from edge to edge, as white noise leaves it, all but cancels in patches, and strain
    that is alike over many points, as noise that neighbours share leaves it, does not. A mesh of a thousand points or
    so, with edges h long, has no patches to speak of: there the strain s of its edges counts by itself, as folds cut
    short leave it. Noise moves a point along the sheet too, by the third term. What makes the whole sheet too small
    leaves no strain at all, so that it must be known from elsewhere: beta is what smoothing takes off the sheet's bends
    (`Sticks.bias_mm`). All were measured against the truth, see
    docs/benchmarks-noise.md; the expectation is good to a factor of two.

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
        Rms strain of the edges around every point.
    """
    pairs, rest = sticks.pairs[: sticks.edges], sticks.rest[: sticks.edges]
    moved = 0.0 if at_rest is None else ((xy - at_rest) ** 2).sum(axis=1)
    xy = xy if at_rest is None else at_rest
    low, high = bounds(xy)
    edge = max(median_edge(rest), TINY)
    side = float(np.sqrt(np.prod(np.maximum(high - low, edge))))
    spread, square = _strain_maps(xy, pairs, rest, edge, side)
    squared_error = STRAIN_WEIGHT**2 * side * spread + moved + sticks.bias_mm**2
    squared_error += (EDGE_WEIGHT * min(COARSE * edge / side, 1.0)) ** 2 * edge * side * square
    if sticks.noise_mm is not None:
        around = sticks.turned is not None and float(sticks.turned.mean()) > TURNED
        weight = ALL_AROUND if around else NOISE_WEIGHT
        squared_error = squared_error + (weight * sticks.noise_left * sticks.noise_mm) ** 2
    return np.sqrt(squared_error), np.sqrt(square)


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


def _strain_maps(xy: Floats, pairs: Ints, rest: Floats, edge: float, side: float) -> tuple[Floats, Floats]:
    """At every point the greatest R s_R^2 over the widths R of patches, and the mean square strain of edges."""
    from scipy.ndimage import map_coordinates

    low, high = bounds(xy)
    width = max(min(SMALLEST * edge, LARGEST * side), side / MOST_PATCHES)
    # An even number of patches, again and again, as four at a time are joined.
    levels = max(int(np.log2(LARGEST * side / width)) + 1, 1)
    whole = 2 ** (levels - 1)
    shape = (np.ceil((high - low) / (width * whole)).astype(np.int64) + 1) * whole
    sums = np.zeros((*shape, TERMS))
    _sum_strain(xy, pairs, rest, edge, low, 1 / width, sums)
    step = side / NODES
    nodes = np.stack(np.meshgrid(*(np.arange(n) for n in np.ceil((high - low) / step).astype(int) + 1), indexing="ij"))
    places = (nodes * step).reshape(2, -1)
    square = _at_places(sums[..., 9], sums[..., 10], width, step, places)
    spread = np.zeros(places.shape[1])
    for level in range(levels):
        if level > 0:
            sums = sums.reshape(sums.shape[0] // 2, 2, sums.shape[1] // 2, 2, TERMS).sum(axis=(1, 3))
            width *= 2
        count = sums[..., 10]
        known = count > max(FEWEST * _usual(count), 3.0)
        norm = np.zeros(count.shape)
        norm[known] = _squared_norms(sums[known])
        spread = np.maximum(spread, width * _at_places(norm * count, count * known, width, step, places))
    at = (xy - low).T / step
    spread, square = (
        np.maximum(map_coordinates(values.reshape(nodes.shape[1:]), at, order=1, mode="nearest"), 0.0)
        for values in (spread, square)
    )
    return spread, square


def _at_places(values: Floats, weights: Floats, width: float, step: float, places: Floats) -> Floats:
    """Ratio of two sums over patches, each weighted by a bell around the places [mm from the corner]."""
    from scipy.ndimage import gaussian_filter, map_coordinates

    bell = max(step / width, 0.7)
    at = places / width - 0.5
    total, weight = (
        map_coordinates(gaussian_filter(v, bell, mode="constant"), at, order=1, mode="nearest")
        for v in (values, weights)
    )
    return np.asarray(total / np.maximum(weight, 1e-12))


def _usual(count: Floats) -> float:
    return float(np.median(count[count > 0])) if count.any() else 0.0


def _squared_norms(sums: Floats) -> Floats:
    """(k,) squared Frobenius norm of the strain tensor that fits the edges of each patch best."""
    matrix = sums[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3)
    ridge = 1e-6 * sums[:, 10, None, None] * np.eye(3)
    tensor = np.linalg.solve(matrix + ridge, sums[:, 6:9, None])[..., 0]
    return np.asarray(tensor**2 @ [1.0, 2.0, 1.0])


@njit(cache=True, nogil=True)
def _sum_strain(xy, pairs, rest, edge, low, scale, sums):  # type: ignore[no-untyped-def]
    """Normal equations of c^2 e_xx + 2 c s e_xy + s^2 e_yy = strain of an edge in direction (c, s), patch by patch.

    Short edges weigh less, as their strain is less certain.
    """
    terms = np.empty(3)
    for e in range(len(pairs)):
        i, j = pairs[e, 0], pairs[e, 1]
        dx, dy = xy[j, 0] - xy[i, 0], xy[j, 1] - xy[i, 1]
        length = np.sqrt(dx * dx + dy * dy)
        if rest[e] <= 0.0 or length <= 0.0:
            continue
        strain, c, s = length / rest[e] - 1.0, dx / length, dy / length
        terms[0], terms[1], terms[2] = c * c, 2.0 * c * s, s * s
        cell = sums[
            int(scale * (0.5 * (xy[i, 0] + xy[j, 0]) - low[0])), int(scale * (0.5 * (xy[i, 1] + xy[j, 1]) - low[1]))
        ]
        at, weight = 0, min(rest[e] / edge, 1.0) ** 2
        for x in range(3):
            for y in range(x, 3):
                cell[at] += weight * terms[x] * terms[y]
                at += 1
            cell[6 + x] += weight * terms[x] * strain
        cell[9] += strain * strain
        cell[10] += 1.0
