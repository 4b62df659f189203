"""Averaging normals along the rulings of a sheet, where they do not change however much the sheet is bent."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planish.geometry.vectors import cross, dot, minus, plus, row, square, times
from planish.parallel import ParallelFor
from planish.surface.curvature import ShapeOperators
from planish.surface.normals import AREA, NOISE, PLACE, OneRing, VertexRecords, closeness, sample, store

RulingNeighbours = NDArray[np.int32]
"""(n, 2) points some edges away from every point, one either way along its ruling; itself where there is none."""

HOPS, DOUBLINGS = 4, 3
"""Neighbours along the ruling are taken 4, 8 and 16 edges away, so that normals of up to 57 points are averaged. With 4
and 8 only, noise of 0.07 mm that is alike over three pixels leaves a sheet 0.03 % too large, instead of 0.015."""

STOP = 6.0
"""Neighbours whose normals differ by more typical steps are not on one ruling; from 4 to 10 is much alike."""

FAR, QUARTER = np.float32(np.inf), np.float32(0.25)
"""In single precision, as the rows are: kernels are a third slower if one double creeps in."""


def average_along(
    rows: VertexRecords, bends: ShapeOperators, ring: OneRing, out: VertexRecords, parallel_for: ParallelFor
) -> tuple[VertexRecords, VertexRecords]:
    """Average every normal with those of its neighbours along the ruling, in rounds of twice the reach each.

    N_i <- unit(2 A_i N_i + sum over the two neighbours of w_ij N_j), w as in `diffuse`

    Returns
    -------
    VertexRecords, VertexRecords
        The averages, and a buffer that is free: one is `rows`, the other `out`.
    """
    neighbours, further = np.empty((len(rows), 2), np.int32), np.empty((len(rows), 2), np.int32)
    parallel_for(_walk, len(rows), rows, bends, ring, neighbours)
    for level in range(DOUBLINGS):
        if level:
            parallel_for(_double, len(rows), rows, bends, neighbours, further)
            neighbours, further = further, neighbours
        scale = np.float32(1 / max(STOP**2 * _typical_step(rows, neighbours), 1e-10))
        parallel_for(_average, len(rows), rows, neighbours, scale, out)
        rows, out = out, rows
    return rows, out


def _typical_step(rows: VertexRecords, neighbours: RulingNeighbours) -> float:
    some = sample(len(neighbours))
    some = some[neighbours[some, 0] != some]
    step = rows[some, :3] - rows[neighbours[some, 0], :3]
    return float(np.median(np.einsum("ij,ij->i", step, step) / rows[some, NOISE])) if len(some) else 0.0


@njit(cache=True, nogil=True)
def _ruling(rows, bends, i, side):  # type: ignore[no-untyped-def]
    return times(np.float32(1 - 2 * side), cross(row(rows, i), row(bends, i)))


@njit(cache=True, nogil=True)
def _walk(first, last, rows, bends, ring, neighbours):  # type: ignore[no-untyped-def]
    """Go from neighbour to neighbour, always to the one that gains most for how far it is off the line."""
    for i in range(first, last):
        start = row(rows, i, PLACE)
        for side in range(2):
            ruling = _ruling(rows, bends, i, side)
            here, gone = np.int32(i), np.float32(0)
            for _ in range(HOPS):
                best, choice, reached = FAR, here, gone
                for q in range(ring.start[here], ring.start[here + 1]):
                    j = ring.neighbour[q]
                    step = minus(row(rows, j, PLACE), start)
                    along = dot(step, ruling)
                    off = square(step) - along * along
                    cost = off - QUARTER * (along - gone) * (along - gone)
                    if along > gone and off + off < along * along and cost < best:
                        best, choice, reached = cost, j, along
                if choice == here:
                    break
                here, gone = choice, reached
            neighbours[i, side] = here


@njit(cache=True, nogil=True)
def _double(first, last, rows, bends, neighbours, further):  # type: ignore[no-untyped-def]
    """Go on from the neighbour to that neighbour of its own which lies further along the ruling."""
    for i in range(first, last):
        for side in range(2):
            one, other = neighbours[neighbours[i, side], 0], neighbours[neighbours[i, side], 1]
            step = minus(row(rows, other, PLACE), row(rows, one, PLACE))
            further[i, side] = other if dot(step, _ruling(rows, bends, i, side)) > 0 else one


@njit(cache=True, nogil=True)
def _average(first, last, rows, neighbours, scale, out):  # type: ignore[no-untyped-def]
    for i in range(first, last):
        n, total, near = row(rows, i), np.float32(2) * rows[i, AREA], scale / rows[i, NOISE]
        normal, place = times(total, n), times(total, row(rows, i, PLACE))
        for side in range(2):
            j = neighbours[i, side]
            weight = closeness(n, row(rows, j), near) * rows[j, AREA]
            normal, place = plus(normal, weight, row(rows, j)), plus(place, weight, row(rows, j, PLACE))
            total += weight
        store(out, rows, i, normal, place, total)
