"""Fewer points for a method that cannot take all of them: the paper's 1,000 of 307,000."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from planish.geometry.guards import normalize
from planish.mesh.adjacency import neighbours
from planish.mesh.measures import area_vectors
from planish.mesh.topology import Topology, topology
from planish.types import Floats, Ints, Mesh

CREASE = np.cos(np.radians(30))
"""Points at edges that bend more than this are kept first, so that coarse edges run along a fold and not across it.
Noise of a tenth of the spacing bends edges by 15 degrees; a fold that is less sharp is cut short by under 2 %."""

DISK_PACKING = 1.45
"""Points placed at random over h apart until none fits any more lie so densely: this many times n h^2 = area."""


@dataclass(frozen=True, eq=False)
class Coarse:
    """A sub-sampled mesh.

    Attributes
    ----------
    mesh : Mesh
        Its points are points of the fine mesh.
    nearest : (n,) int32
        For every point of the fine mesh the coarse point in whose cell it lies.
    """

    mesh: Mesh
    nearest: Ints


def subsample(mesh: Mesh, fine: Topology, count: int) -> Coarse:
    """Keep about `count` points, evenly spread, and join those whose cells meet.

    Points are taken in the order border, folds, all others, each at random, wherever none was taken within a
    distance h. Every fine point belongs to the taken point nearest to it; a fine face between three cells makes a
    coarse face. So the triangles are near the Delaunay triangles of the sheet, close to equilateral, where
    quadric edge collapse on flat or singly curved paper leaves needles and folds triangles over.

    Parameters
    ----------
    mesh : Mesh
        Clean (see `clean`).
    fine : Topology
        Of `mesh`.
    count : int
        At least 3.
    """
    points = mesh.points
    start, around = neighbours(fine.edges, len(points))
    order = _most_telling_first(mesh, fine)
    area = float(np.linalg.norm(area_vectors(points, mesh.faces), axis=1).sum())
    apart = np.sqrt(area / (DISK_PACKING * count)) * 1.2
    best: tuple[Ints, Ints] | None = None
    for _ in range(4):  # the border takes more than its share, so the distance is corrected by what came out
        taken, cell = _take(points, start, around, order, apart)
        if best is None or abs(len(taken) - count) < abs(len(best[0]) - count):
            best = taken, cell
        if abs(len(taken) - count) <= 0.01 * count:
            break
        apart *= np.sqrt(len(taken) / count)
    assert best is not None
    taken, cell = best
    faces = _faces_between_cells(points[taken], cell[mesh.faces])
    return _without_lonely(points, taken, faces, cell, start, around)


def _most_telling_first(mesh: Mesh, fine: Topology) -> Ints:
    """All points in the order in which they are offered: border, folds, the rest; at random within each."""
    normals = area_vectors(mesh.points, mesh.faces)
    normals = normalize(normals)
    inner = fine.edge_uses == 2
    left, right = fine.edge_faces[inner].T
    folded = np.einsum("ij,ij->i", normals[left], normals[right]) < CREASE
    rank = np.full(len(mesh.points), 2)
    rank[fine.edges[inner][folded]] = 1
    rank[fine.edges[~inner]] = 0
    return np.lexsort((np.random.default_rng(20050829).random(len(rank)), rank)).astype(np.int32)


@njit(cache=True)
def _take(points, start, around, order, apart):  # type: ignore[no-untyped-def]
    """Points over `apart` from each other along the mesh, and for every point the row of the nearest of them."""
    n = len(points)
    cell = np.full(n, -1, np.int32)
    distance = np.full(n, np.inf)
    reached = np.full(n, -1, np.int32)
    taken = np.empty(n, np.int32)
    todo = np.empty(n, np.int32)
    count = 0
    for i in order:
        if cell[i] >= 0:
            continue
        taken[count] = i
        reached[i] = count
        cell[i] = count
        distance[i] = 0.0
        todo[0] = i
        end = 1
        at = 0
        while at < end:
            j = todo[at]
            at += 1
            for q in range(start[j], start[j + 1]):
                k = around[q]
                if reached[k] == count:
                    continue
                reached[k] = count
                d = 0.0
                for c in range(3):
                    d += (points[k, c] - points[i, c]) ** 2
                if d >= apart * apart:
                    continue
                if d < distance[k]:
                    distance[k] = d
                    cell[k] = count
                todo[end] = k
                end += 1
        count += 1
    return taken[:count].copy(), cell


def _faces_between_cells(points: Floats, cells: Ints) -> Ints:
    """Coarse faces (m, 3) from the cells (k, 3) at the corners of the fine faces.

    Where cells meet in a tangle, faces can come out twice, in both directions, or three at an edge; of those the
    smallest are left out until every edge has two at most.
    """
    a, b, c = cells.T
    found = cells[(a != b) & (b != c) & (c != a)]
    first = np.argmin(found, axis=1)
    found = np.take_along_axis(found, (first[:, None] + [0, 1, 2]) % 3, axis=1)
    faces = np.unique(found, axis=0)
    _, group, size = np.unique(np.sort(faces, axis=1), axis=0, return_inverse=True, return_counts=True)
    faces = faces[size[group.ravel()] == 1].astype(np.int32)
    while len(faces):
        topo = topology(faces, len(points))
        crowded = (topo.edge_uses > 2)[topo.face_edges].any(axis=1)
        if not crowded.any():
            break
        area = np.linalg.norm(area_vectors(points, faces), axis=1)
        faces = np.delete(faces, np.argmin(np.where(crowded, area, np.inf)), axis=0)
    return faces


def _without_lonely(points: Floats, taken: Ints, faces: Ints, cell: Ints, start: Ints, around: Ints) -> Coarse:
    """Leave out taken points that got no face; their cells go to the neighbour whose cell they touch."""
    used = np.zeros(len(taken), bool)
    used[faces] = True
    row = np.where(used, np.cumsum(used) - 1, -1).astype(np.int32)
    nearest = row[cell]
    _spread(nearest, start, around)
    return Coarse(Mesh.owned(points[taken[used]], row[faces]), nearest)


@njit(cache=True)
def _spread(nearest, start, around):  # type: ignore[no-untyped-def]
    """Hand the value of a neighbour to points that have none (-1), ring by ring; what nothing reaches gets 0."""
    todo = np.empty(len(nearest), np.int32)
    end = 0
    for i in range(len(nearest)):
        if nearest[i] >= 0:
            todo[end] = i
            end += 1
    at = 0
    while at < end:
        i = todo[at]
        at += 1
        for q in range(start[i], start[i + 1]):
            j = around[q]
            if nearest[j] < 0:
                nearest[j] = nearest[i]
                todo[end] = j
                end += 1
    for i in range(len(nearest)):
        nearest[i] = max(nearest[i], 0)
