"""Spikes: lone points of a scan far off the surface, as reflections and depth edges leave them."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from planish.geometry.guards import TINY
from planish.geometry.linear import solve_symmetric
from planish.geometry.quantile import quantile
from planish.geometry.vectors import dot, minus, plus, row, tangents, times, unit
from planish.parallel import ParallelFor
from planish.surface.noise import ring_noise, robust_sigma
from planish.surface.noise_scale import UNKNOWNS
from planish.surface.normals import AREA, OneRing, VertexRecords
from planish.types import Floats, Ints

LOOKED_AT, OUTSTANDING = 0.35, 5.0
"""Points are looked at that stand out of their ring by this part of an edge and by so many times the typical noise."""

FAR_OFF = 6.0
"""A spike is off the quadric of its neighbourhood by more than this many times what the others are off (robustly)."""

MOST = 0.02
"""Share of spikes beyond which they are no spikes: the scan is that noisy, or its mesh that coarse."""

USUAL, USUAL_GAIN = 0.75, 1 / 1.15
"""Quantile that tells how far points are off, and what makes it a standard deviation. Half of all numbers rounded to
steps may be off by next to nothing."""

FEWEST_NEIGHBOURS = 3
"""A range image joins a spike to four neighbours or fewer, as its diagonals are the longer ones. Points with no more
neighbours than this are always looked at: of a lone triangle, not even its own normal tells."""

LONE = 0.05
"""Share of the neighbourhood that may be half as far off: across a crease many are, beside a spike none."""

RINGS, ROOM = 3, 64
"""Neighbourhood that a point is compared with."""

ROUNDS = 4
"""Of the robust fit."""


def find_spikes(
    points: Floats,
    rows: VertexRecords,
    ring: OneRing,
    spacing: float,
    parallel_for: ParallelFor,
) -> tuple[Ints, Floats, Floats]:
    """Find spikes, and where the surface is that they should lie on.

    Returns
    -------
    spikes : (k,) int32
    feet : (k, 3) float64 [mm]
        The middle of each spike's neighbours, moved onto the quadric fitted to its neighbourhood.
    axes : (k, 3) float64
        Unit normals there.
    """
    off = ring_noise(points, rows, ring, parallel_for, FEWEST_NEIGHBOURS)
    limit = max(LOOKED_AT * spacing, OUTSTANDING * robust_sigma(off))
    doubtful = np.zeros(len(points), np.bool_)
    parallel_for(_stand_out, len(points), off, ring, limit, doubtful)
    some = np.flatnonzero(doubtful | (np.diff(ring.start) <= FEWEST_NEIGHBOURS)).astype(np.int32)
    if doubtful.sum() > 2 * MOST * len(points):
        return some[:0], np.zeros((0, 3)), np.zeros((0, 3))
    feet, axes, far = np.empty((len(some), 3)), np.empty((len(some), 3)), np.zeros(len(some), np.bool_)
    parallel_for(
        _compare, len(some), some, points, rows, ring, doubtful, LOOKED_AT * spacing, feet, axes, far, block=256
    )
    if far.sum() > MOST * len(points):
        return some[:0], np.zeros((0, 3)), np.zeros((0, 3))
    return some[far], feet[far], axes[far]


@njit(cache=True, nogil=True)
def _stand_out(first, last, ring_off, ring, limit, doubtful):  # type: ignore[no-untyped-def]
    """Points over the limit, but for neighbours of a spike, which stand out because of it, by a fifth as much."""
    for i in range(first, last):
        most = np.float32(0)
        for q in range(ring.start[i], ring.start[i + 1]):
            if ring_off[ring.neighbour[q]] > most:
                most = ring_off[ring.neighbour[q]]
        doubtful[i] = ring_off[i] > limit and ring_off[i] > np.float32(0.4) * most


@njit(cache=True, nogil=True, error_model="numpy")
def _compare(first, last, some, points, rows, ring, doubtful, least, feet, axes, far):  # type: ignore[no-untyped-def]
    near, matrix = np.empty(ROOM, np.int32), np.empty((UNKNOWNS, UNKNOWNS + 1))
    terms, height = np.empty((ROOM, UNKNOWNS)), np.empty(ROOM)
    off, weight = np.empty(ROOM), np.empty(ROOM)
    for k in range(first, last):
        i = some[k]
        count = _neighbourhood(i, ring, near)
        if count < 2 * UNKNOWNS:
            continue
        axis, middle, trusted = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0
        for q in range(1, count):
            j = near[q]
            if not doubtful[j]:
                axis = plus(axis, rows[j, AREA], row(rows, j))
        axis = unit(axis)
        s, t = tangents(axis)
        for q in range(ring.start[i], ring.start[i + 1]):
            j = ring.neighbour[q]
            if not doubtful[j]:
                middle, trusted = plus(middle, 1.0, row(points, j)), trusted + 1
        if trusted < 2:  # it may be the spike that makes them doubtful
            middle, trusted = (0.0, 0.0, 0.0), ring.start[i + 1] - ring.start[i]
            for q in range(ring.start[i], ring.start[i + 1]):
                middle = plus(middle, 1.0, row(points, ring.neighbour[q]))
        middle = times(1.0 / trusted, middle)
        spread = 0.0
        for q in range(count):
            step = minus(row(points, near[q]), middle)
            u, v = dot(step, s), dot(step, t)
            terms[q, 0], terms[q, 1], terms[q, 2], height[q] = 1.0, u, v, dot(step, axis)
            weight[q] = 0.0 if q == 0 or doubtful[near[q]] else 1.0
            spread += weight[q] * (u * u + v * v)
        scale = 1.0 / math.sqrt(max(spread / count, TINY))
        for q in range(count):
            u, v = scale * terms[q, 1], scale * terms[q, 2]
            terms[q, 1], terms[q, 2], terms[q, 3], terms[q, 4], terms[q, 5] = u, v, u * u, u * v, v * v
        usual = 0.0
        for _ in range(ROUNDS):
            _fit(terms, height, weight, count, matrix, off)
            for q in range(1, count):
                weight[q - 1] = abs(off[q])
            usual = quantile(weight, count - 1, USUAL) * USUAL_GAIN
            for q in range(1, count):
                weight[q] = max(0.0, 1.0 - (off[q] / (5.0 * usual + 1e-12)) ** 2) ** 2
        alike = 0
        for q in range(1, count):
            if not doubtful[near[q]] and abs(off[q]) > 0.5 * abs(off[0]):
                alike += 1
        far[k] = abs(off[0]) > max(FAR_OFF * usual, least) and alike <= LONE * count
        foot = plus(middle, matrix[0, UNKNOWNS], axis)
        for c in range(3):
            feet[k, c], axes[k, c] = foot[c], axis[c]


@njit(cache=True, nogil=True, error_model="numpy")
def _fit(terms, height, weight, count, matrix, off):  # type: ignore[no-untyped-def]
    matrix[:] = 0.0
    for q in range(1, count):
        for x in range(UNKNOWNS):
            for y in range(x, UNKNOWNS):
                matrix[x, y] += weight[q] * terms[q, x] * terms[q, y]
            matrix[x, UNKNOWNS] += weight[q] * terms[q, x] * height[q]
    solve_symmetric(matrix)
    for q in range(count):
        off[q] = height[q]
        for x in range(UNKNOWNS):
            off[q] -= matrix[x, UNKNOWNS] * terms[q, x]


@njit(cache=True, nogil=True)
def _neighbourhood(i, ring, near):  # type: ignore[no-untyped-def]
    near[0], count, begin = i, 1, 0
    for _ in range(RINGS):
        end = count
        for a in range(begin, end):
            for q in range(ring.start[near[a]], ring.start[near[a] + 1]):
                j, known = ring.neighbour[q], False
                for b in range(count):
                    known = known or near[b] == j
                if not known and count < len(near):
                    near[count] = j
                    count += 1
        begin = end
    return count
