"""Which side of a crease a point lies on: its normal is to be that side's, not a mixture of both.

A point on a crease is one whose normal differs from those of most of its ring. It takes the plane of a calm point near
by: of the two planes that meet at the crease, the one that it is on the right side of.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from planish.geometry.vectors import dot, minus, row, square
from planish.parallel import ParallelFor
from planish.surface.curvature import CURVATURE, ShapeOperators, rotate_along_bend
from planish.surface.normals import AREA, NOISE, PLACE, OneRing, VertexRecords, sample
from planish.types import Floats, Ints

PLACE_IN_RING = 0.6
"""Beside a straight crease up to half of a ring lies beyond it, and so more than this is on one side; 0.5 is as good,
with 0.75 points on clean creases pass for calm (spread 0.1 % too small)."""

ODD, LEAST_SPREAD = 9.0, 0.002
"""A point is examined if its spread is over so many times the typical one, and the normals differ by 2.6 degrees:
8 degrees would pass over half of the creases of a crumpled sheet, 4 or 20 times make no difference."""

CALM = 6.0
"""It may take the plane of a point with a spread so many times less; from 3 to 12 makes no difference."""

SAME_PLANE = math.cos(math.radians(6.0))
"""Normals at less than 6 degrees to each other are of one side."""

BLUR = 1e-4
"""Distance from a plane that counts for nothing, in spacings squared: without noise a hundredth of a spacing tells."""

NEAR, LONGEST = 48, 64
"""Room for two rings, which hold 18 points on a regular mesh, and for one; what is beyond is left out."""


def assign_crease_sides(
    points: Floats,
    rows: VertexRecords,
    bends: ShapeOperators,
    ring: OneRing,
    rings: int,
    noise: float,
    spacing: float,
    parallel_for: ParallelFor,
) -> Ints:
    """For every point the one whose plane it lies on: itself, or at a crease a calmer one near by.

    Parameters
    ----------
    bends : ShapeOperators
        How the planes are bent.
    rings : {1, 2}
        How far to look.
    noise, spacing : float [mm]
        Standard deviation of the noise, and the typical length of an edge.

    Returns
    -------
    (n,) int32
    """
    some = sample(len(rows))
    typical = max(float(np.median(_spreads(some, rows, ring))), 1e-12) if len(some) else 1.0
    blur = 2.0 * noise**2 + BLUR * spacing**2 + 1e-30
    source = np.empty(len(rows), np.int32)
    parallel_for(_choose, len(rows), points, rows, bends, ring, rings, typical, blur, source)
    return source


def take_side_normals(rows: VertexRecords, source: Ints, out: VertexRecords, parallel_for: ParallelFor) -> None:
    """Store the plane of each point's side, with the point's own area and noise."""
    parallel_for(_to_sides, len(rows), rows, source, out)


def normals_at_points(
    points: Floats, rows: VertexRecords, bends: ShapeOperators, source: Ints, parallel_for: ParallelFor
) -> VertexRecords:
    """(n, 3) normals at the points, from the planes they lie on, followed along their bend."""
    out = np.empty((len(rows), 3), np.float32)
    parallel_for(_carry, len(rows), points, rows, bends, source, out)
    return out


@njit(cache=True, nogil=True)
def _spreads(some, rows, ring):  # type: ignore[no-untyped-def]
    out, steps = np.empty(len(some)), np.empty(LONGEST, np.float32)
    for k in range(len(some)):
        out[k] = _spread(some[k], rows, ring, steps)
    return out


@njit(cache=True, nogil=True)
def _spread(i, rows, ring, steps):  # type: ignore[no-untyped-def]
    """|N_i - N_j|^2 over the local noise, at PLACE_IN_RING of the ring in ascending order."""
    count = min(ring.start[i + 1] - ring.start[i], len(steps))
    if count == 0:
        return 0.0
    for k in range(count):  # insertion sort: rings are short
        step, at = square(minus(row(rows, i), row(rows, ring.neighbour[ring.start[i] + k]))), k
        while at > 0 and steps[at - 1] > step:
            steps[at] = steps[at - 1]
            at -= 1
        steps[at] = step
    return steps[int(PLACE_IN_RING * count)] / rows[i, NOISE]


@njit(cache=True, nogil=True)
def _is_calm(i, rows, ring, limit):  # type: ignore[no-untyped-def]
    """Whether the spread is below a limit, which takes no sorting."""
    count, far = ring.start[i + 1] - ring.start[i], 0
    for q in range(ring.start[i], ring.start[i + 1]):
        if square(minus(row(rows, i), row(rows, ring.neighbour[q]))) > limit * rows[i, NOISE]:
            far += 1
    return far < max(count - int(PLACE_IN_RING * count), 1)


@njit(cache=True, nogil=True)
def _choose(first, last, points, rows, bends, ring, rings, typical, blur, source):  # type: ignore[no-untyped-def]
    near, cost, steps = np.empty(NEAR, np.int32), np.empty(NEAR), np.empty(LONGEST, np.float32)
    limit = max(ODD * typical, LEAST_SPREAD)
    for i in range(first, last):
        source[i] = i
        if _is_calm(i, rows, ring, limit):
            continue
        spread = _spread(i, rows, ring, steps)
        count = _gather(i, ring, rings, near)
        a = -1
        for q in range(count):
            j = near[q]
            cost[q] = np.inf
            height, calm = height_over(points, i, rows, bends, j), _spread(j, rows, ring, steps)
            if calm < spread / CALM:
                cost[q] = 3.0 * math.log(1.0 + calm / typical) + height * height / blur
                if a < 0 or cost[q] < cost[a]:
                    a = q
        if a < 0 or 3.0 * math.log(1.0 + spread / typical) < cost[a]:
            continue
        b = -1
        for q in range(count):
            apart = cost[q] < np.inf and dot(row(rows, near[q]), row(rows, near[a])) < SAME_PLANE
            if apart and (b < 0 or cost[q] < cost[b]):
                b = q
        source[i] = near[a] if b < 0 else _side(points, i, rows, bends, near[a], near[b])


@njit(cache=True, nogil=True)
def _side(points, i, rows, bends, a, b):  # type: ignore[no-untyped-def]
    """Of the planes of a and b that meet in a crease, the one that point i lies on.

    A ridge is the lower of its two planes everywhere, a valley the higher; so a point lies on the plane over which it
    is higher at a ridge, lower in a valley. Noise lifts it over both alike.
    """
    over_a, over_b = height_over(points, i, rows, bends, a), height_over(points, i, rows, bends, b)
    apart = minus(row(rows, b, PLACE), row(rows, a, PLACE))
    b_over_a, a_over_b = dot(row(rows, a), apart), -dot(row(rows, b), apart)
    if b_over_a < 0.0 and a_over_b < 0.0:
        return a if over_a > over_b else b
    if b_over_a > 0.0 and a_over_b > 0.0:
        return a if over_a < over_b else b
    return a


@njit(cache=True, nogil=True)
def height_over(points, i, rows, bends, j):  # type: ignore[no-untyped-def]
    """How high point i stands over the bent plane of point j."""
    step = minus(row(points, i), row(rows, j, PLACE))
    along = dot(row(bends, j), step)
    return dot(row(rows, j), step) + 0.5 * bends[j, CURVATURE] * along * along


@njit(cache=True, nogil=True)
def _gather(i, ring, rings, near):  # type: ignore[no-untyped-def]
    """Points within one or two rings around i."""
    count = 0
    for q in range(ring.start[i], ring.start[i + 1]):
        if count < len(near):
            near[count] = ring.neighbour[q]
            count += 1
    if rings == 1:
        return count
    for a in range(count):
        for q in range(ring.start[near[a]], ring.start[near[a] + 1]):
            j = ring.neighbour[q]
            known = j == i
            for b in range(count):
                known = known or near[b] == j
            if not known and count < len(near):
                near[count] = j
                count += 1
    return count


@njit(cache=True, nogil=True)
def _to_sides(first, last, rows, source, out):  # type: ignore[no-untyped-def]
    for i in range(first, last):
        for k in range(out.shape[1]):
            out[i, k] = rows[source[i], k]
        out[i, AREA], out[i, NOISE] = rows[i, AREA], rows[i, NOISE]


@njit(cache=True, nogil=True)
def _carry(first, last, points, rows, bends, source, out):  # type: ignore[no-untyped-def]
    for i in range(first, last):
        j = source[i]
        normal = rotate_along_bend(
            row(rows, j), row(bends, j), bends[j, CURVATURE], minus(row(points, i), row(rows, j, PLACE))
        )
        for k in range(3):
            out[i, k] = normal[k]
