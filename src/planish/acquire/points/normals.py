"""Local planes of a point cloud: normals, spacing, noise, outliers, and consistent orientation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from planish.types import Bools, Floats

NEIGHBOURS = 24
"""Neighbours per plane fit; doubled up to three times if the noise is high."""

MIN_REACH = 4.0
"""Least radius of the neighbourhood in standard deviations of the noise; with less the normal is undetermined."""

ISOLATED = 4.0
"""Points whose eighth neighbour is this many times farther than the median are outliers..."""

OUTLIER = 4.0
"""...and so are those off their neighbours' plane by so many standard deviations of the noise..."""

CREASE = 0.5
"""...and by this share of the spacing: at creases good points lie off the plane."""

COARSE = 4.0
"""Spacing of the points among which orientation is propagated, in point spacings; the others follow the nearest."""

GRAPH_NEIGHBOURS = 10
"""Neighbours of each of them in the graph."""

BLOCK = 50_000


@dataclass(frozen=True, eq=False)
class TangentPlanes:
    """Tangent planes of a point cloud.

    Attributes
    ----------
    kept : (n,) bool
        Inliers; everything else refers to them.
    normals : (k, 3) float64
        Unoriented.
    spacing_mm : float
        Typical side of the square per point.
    noise_mm : float
        Standard deviation of the points off their neighbours' planes.
    """

    kept: Bools
    normals: Floats
    spacing_mm: float
    noise_mm: float


def fit_tangent_planes(points: Floats) -> TangentPlanes:
    """Fit a plane to the neighbours of every point, (n, 3) [mm], and reject outliers.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> sheet = np.column_stack([rng.uniform(0, 100, (10_000, 2)), 0.1 * rng.standard_normal(10_000)])
    >>> found = fit_tangent_planes(np.vstack([sheet, [50.0, 50, 30]]))
    >>> bool(found.kept[-1]), round(found.spacing_mm, 1), round(found.noise_mm, 1)
    (False, 1.0, 0.1)
    """
    count = NEIGHBOURS
    while True:
        normals, residual, reach, near = _fit_planes(points, min(count, len(points)))
        noise = 1.4826 * float(np.median(np.abs(residual)))
        if np.median(reach) >= MIN_REACH * noise or count >= 8 * NEIGHBOURS:
            break
        count *= 2
    spacing = float(np.median(reach) * np.sqrt(np.pi / count))
    kept = (near < ISOLATED * np.median(near)) & (np.abs(residual) < max(OUTLIER * noise, CREASE * spacing))
    return TangentPlanes(kept, normals[kept], spacing, noise)


def _fit_planes(points: Floats, count: int) -> tuple[Floats, Floats, Floats, Floats]:
    """Fit a plane to the nearest points of each: normals, residuals, distances of the last and the eighth neighbour."""
    tree = cKDTree(points)
    normals = np.empty_like(points)
    residual, reach, eighth = np.empty((3, len(points)))
    for first in range(0, len(points), BLOCK):
        some = slice(first, first + BLOCK)
        distance, near = tree.query(points[some], count, workers=2)
        around = points[near]
        middle = around.mean(axis=1)
        around -= middle[:, None]
        spread = np.matmul(around.swapaxes(1, 2), around)
        normals[some] = np.linalg.eigh(spread)[1][:, :, 0]
        residual[some] = ((points[some] - middle) * normals[some]).sum(axis=1)
        reach[some], eighth[some] = distance[:, -1], distance[:, 8]
    return normals, residual, reach, eighth


def orient_normals(points: Floats, normals: Floats, spacing_mm: float, towards: Floats) -> Floats:
    """Orient normals consistently; each component faces where most of its points should.

    Orientation is propagated along a minimum spanning tree of the neighbourhood graph, weighted by normal deviation
    (Hoppe et al. 1992), so that it follows curls.

    Parameters
    ----------
    points, normals : (n, 3) float64
    spacing_mm : float
    towards : (n, 3) float64
        Preferred direction of each normal.
    """
    cells = np.floor((points - points.min(axis=0)) / (COARSE * spacing_mm)).astype(np.int64)
    some = np.unique(cells, axis=0, return_index=True)[1]
    tree = cKDTree(points[some])
    near = tree.query(points[some], min(GRAPH_NEIGHBOURS + 1, len(some)), workers=2)[1].reshape(len(some), -1)[:, 1:]
    first_end = np.repeat(np.arange(len(some)), near.shape[1])
    second_end = near.ravel()
    agree = (normals[some][first_end] * normals[some][second_end]).sum(axis=1)
    links = sparse.coo_matrix((1.001 - np.abs(agree), (first_end, second_end)), shape=(len(some), len(some)))
    forest = sparse.csgraph.minimum_spanning_tree(links.tocsr())
    pieces, piece = sparse.csgraph.connected_components(forest, directed=False)
    sign = np.zeros(len(some))
    for k in range(pieces):
        root = int(np.argmax(piece == k))
        sign[root] = 1.0
        order, parent = sparse.csgraph.breadth_first_order(forest, root, directed=False)
        for at in order[1:]:
            same = normals[some[at]] @ normals[some[parent[at]]]
            sign[at] = sign[parent[at]] * (1.0 if same >= 0 else -1.0)
    leader_of = tree.query(points, workers=2)[1]
    leader = normals[some[leader_of]] * sign[leader_of, None]
    flipped = normals * np.where((normals * leader).sum(axis=1) >= 0, 1.0, -1.0)[:, None]
    votes = np.bincount(piece[leader_of], np.sign((flipped * towards).sum(axis=1)), pieces)
    return np.asarray(flipped * np.where(votes >= 0, 1.0, -1.0)[piece[leader_of], None])
