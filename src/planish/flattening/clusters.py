"""A sheet cut into small clusters of faces, each laid flat by itself from its rest lengths.

A cluster is so small that laying it out face by face cannot drift; how clusters fit together is the matter of
`joints`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planish.geometry.guards import TINY
from planish.mesh import Topology
from planish.mesh.adjacency import faces_around
from planish.parallel import ParallelFor
from planish.types import Floats, Ints

RADIUS = 26
"""Faces from a cluster's first face to its rim, at most: about 400 faces a cluster. With 300,000 points and edges wrong
by 1e-3 the layout is 0.004, 0.006, 0.009 and 0.016 mm out for 16, 22, 28 and 45; the time to join them falls with the
square."""

SHORT = 0.35
"""Edges shorter than this part of a face's longest side are not built upon, as errors of length turn them most. On a
random mesh of 100,000 points with 0.05 mm of noise the layout is 0.09 mm out with 0.3 or more, 0.5 mm with 0.02; with
more, regular meshes whose cells are three times as long as wide fall apart into strips."""

CLOSED = -1.0
"""Weight of a place that is settled."""


class Clusters(NamedTuple):
    """Copies of points: one for each cluster that has a face at the point.

    Attributes
    ----------
    total : int
        Number of clusters.
    start : (n + 1,) int32
        Copies of point i are rows `start[i]` to `start[i + 1]`.
    cluster : (k,) int32
        Cluster of each copy.
    place : (k,) complex128 [mm]
        x + iy of each copy in the frame of its cluster, whose origin is the middle of its copies.
    """

    total: int
    start: Ints
    cluster: Ints
    place: NDArray[np.complex128]


def lay_out_clusters(
    faces: Ints, topology: Topology, edge_rest: Floats, point_count: int, parallel_for: ParallelFor
) -> Clusters:
    """Cut a mesh into clusters and lay each one into a plane of its own.

    Parameters
    ----------
    faces : (m, 3) int32
    topology : Topology
    edge_rest : (e,) float64 [mm]
    point_count : int
    parallel_for : ParallelFor
    """
    passable = _passable(topology.face_edges, edge_rest)
    label, hops, base, count = _grow(topology.face_edges, topology.edge_faces, edge_rest, passable, RADIUS)
    row, order = _rows(label, hops, count, RADIUS)
    start, cluster = _copies(*faces_around(faces, point_count), label)
    place = np.zeros((len(cluster), 2))
    weight = np.zeros(len(cluster))
    corners = np.empty_like(faces)
    parallel_for(_find_copies, len(faces), faces, label, start, cluster, corners)
    parallel_for(
        _place_clusters, count, row, order, corners, base, topology.face_edges, edge_rest, place, weight, block=64
    )
    _centre(cluster, place, count)
    return Clusters(count, start, cluster, place.view(np.complex128)[:, 0])


@njit(cache=True, nogil=True)
def _passable(face_edges, rest):  # type: ignore[no-untyped-def]
    """Whether each edge is long enough, among those of either face at it, to lay the other face down by it."""
    passable = np.ones(len(rest), np.bool_)
    for f in range(len(face_edges)):
        a, b, c = face_edges[f, 0], face_edges[f, 1], face_edges[f, 2]
        least = SHORT * max(rest[a], rest[b], rest[c])
        passable[a] &= rest[a] > least
        passable[b] &= rest[b] > least
        passable[c] &= rest[c] > least
    return passable


@njit(cache=True, nogil=True)
def _grow(face_edges, edge_faces, rest, passable, radius):  # type: ignore[no-untyped-def]
    """Cluster of each face, that of the nearest first face; the steps from there; the edge of the last of them.

    First faces are taken wherever none is within `radius` steps over edges; their base is their longest side.
    """
    m = len(face_edges)
    label = np.full(m, -1, np.int32)
    hops = np.full(m, 255, np.uint8)
    base = np.full(m, -1, np.int32)
    queue = np.empty(m, np.int32)
    count = 0
    for first in range(m):
        if label[first] >= 0:
            continue
        label[first] = count
        base[first] = face_edges[first, np.argmax(rest[face_edges[first]])]
        hops[first] = 0
        queue[0] = first
        head, tail = 0, 1
        while head < tail and hops[queue[head]] < radius:
            f = queue[head]
            head += 1
            for k in range(3):
                e = face_edges[f, k]
                g = edge_faces[e, 0] + edge_faces[e, 1] - f
                # Faces that are nearer here than to the first face of their own cluster are taken over.
                if g >= 0 and passable[e] and hops[g] > hops[f] + 1:
                    hops[g] = hops[f] + 1
                    label[g] = count
                    base[g] = e
                    queue[tail] = g
                    tail += 1
        count += 1
    return label, hops, base, count


@njit(cache=True, nogil=True)
def _rows(label, hops, count, radius):  # type: ignore[no-untyped-def]
    """Faces of each cluster as compressed rows, the nearest to its first face first."""
    bins = radius + 1
    start = np.zeros(count * bins + 1, np.int32)
    for f in range(len(label)):
        start[label[f] * bins + hops[f] + 1] += 1
    for at in range(count * bins):
        start[at + 1] += start[at]
    row = start[::bins].copy()
    order = np.empty(len(label), np.int32)
    for f in range(len(label)):
        at = label[f] * bins + hops[f]
        order[start[at]] = f
        start[at] += 1
    return row, order


@njit(cache=True, nogil=True)
def _copies(around, face, label):  # type: ignore[no-untyped-def]
    """Copies that each point needs: one for each cluster among its faces."""
    n = len(around) - 1
    start = np.empty(n + 1, np.int32)
    cluster = np.empty(len(face), np.int32)
    count = 0
    for i in range(n):
        start[i] = count
        for at in range(around[i], around[i + 1]):
            c = label[face[at]]
            known = False
            for k in range(start[i], count):
                known |= cluster[k] == c
            if not known:
                cluster[count] = c
                count += 1
    start[n] = count
    return start, cluster[:count].copy()


@njit(cache=True, nogil=True)
def _find_copies(first, last, faces, label, start, cluster, corners):  # type: ignore[no-untyped-def]
    """Faces again, with copies for corners."""
    for f in range(first, last):
        for k in range(3):
            at = start[faces[f, k]]
            while cluster[at] != label[f]:
                at += 1
            corners[f, k] = at


@njit(cache=True, nogil=True, error_model="numpy")
def _place_clusters(first, last, row, order, corners, base, face_edges, rest, place, weight):  # type: ignore[no-untyped-def]
    """Lay each cluster down face by face, from its first face outwards.

    A face puts its far corner where its base, the edge towards the first face, wants it. Until a corner is built
    upon it takes the mean over all the faces that have put it somewhere, weighted by their bases squared, as longer
    bases tell directions more surely.
    """
    for c in range(first, last):
        for at in range(row[c], row[c + 1]):
            f = order[at]
            k = 0
            while face_edges[f, k] != base[f]:
                k += 1
            back, onward = (k + 2) % 3, (k + 1) % 3
            p, r, apex = corners[f, k], corners[f, onward], corners[f, back]
            length = rest[face_edges[f, k]]
            if at == row[c]:
                place[r, 0] = length
                weight[p] = weight[r] = CLOSED
            for k in (p, r):
                if weight[k] != CLOSED:
                    place[k, 0] /= weight[k]
                    place[k, 1] /= weight[k]
                    weight[k] = CLOSED
            if weight[apex] != CLOSED:
                px, py = place[p, 0], place[p, 1]
                dx, dy = place[r, 0] - px, place[r, 1] - py
                u, v = _apex(length, rest[face_edges[f, back]], rest[face_edges[f, onward]], dx * dx + dy * dy)
                share = max(length * length, TINY)
                place[apex, 0] += share * (px + 0.5 * dx + dx * u - dy * v)
                place[apex, 1] += share * (py + 0.5 * dy + dy * u + dx * v)
                weight[apex] += share
        for at in range(row[c], row[c + 1]):
            for corner in range(3):
                k = corners[order[at], corner]
                if weight[k] != CLOSED:
                    place[k, 0] /= weight[k]
                    place[k, 1] /= weight[k]
                    weight[k] = CLOSED


@njit(cache=True, nogil=True, error_model="numpy")
def _apex(base, from_p, from_r, placed):  # type: ignore[no-untyped-def]
    """Where a third corner lies at its distances from p and r: from the middle of the base, along it and across it.

    In units of the base as it was placed, whose length squared is `placed`. Measured from the middle, so that a base
    placed a little too long or too short errs alike at both ends.
    """
    if base <= 0.0 or placed <= 0.0:
        return 0.0, 0.0
    length = np.sqrt(placed)
    x = (from_p * from_p - from_r * from_r + base * base) / (2.0 * base)
    h = np.sqrt(max(from_p * from_p - x * x, 0.0))
    return (x - 0.5 * base) / length, h / length


@njit(cache=True, nogil=True)
def _centre(cluster, place, count):  # type: ignore[no-untyped-def]
    """Put the origin of each cluster's frame in the middle of its copies."""
    middle = np.zeros((count, 2))
    copies = np.zeros(count)
    for k in range(len(cluster)):
        c = cluster[k]
        middle[c, 0] += place[k, 0]
        middle[c, 1] += place[k, 1]
        copies[c] += 1
    for k in range(len(cluster)):
        c = cluster[k]
        place[k, 0] -= middle[c, 0] / copies[c]
        place[k, 1] -= middle[c, 1] / copies[c]
