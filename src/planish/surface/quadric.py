"""The normal at the end of a surface, from a quadric fitted to the points of its own side."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from planish.geometry.vectors import dot, minus, plus, row, square, tangents, unit
from planish.parallel import ParallelFor
from planish.surface.normals import OneRing, VertexRecords
from planish.types import Floats, Ints

RINGS, MOST, LEAST = 4, 96, 12
"""How far points are taken from, how many at most, and how many it takes: twice the six unknowns. Three rings are as
good without noise, and 2 % worse with it."""

FOLD = (2 * math.sin(math.radians(20.0) / 2)) ** 2
"""Squared difference of normals 20 degrees apart. With 40, crumpled sheets are 0.07 % too small instead of 0.04; with
10, round folds of 1.5 mm radius are taken for sharp ones."""

FARTHEST = math.cos(math.radians(20.0))
"""A fit that turns the normal by more went wrong: its points were of both sides."""

ROUNDS, OUTLIER, DOUBT = 3, 4.0, 0.3
"""Of the fit: points off by OUTLIER times the mean do not count in the next one, but those off by less than
OUTLIER DOUBT of the noise always do."""

UNKNOWNS = 6


def refit(
    points: Floats,
    normals: VertexRecords,
    ring: OneRing,
    at: Ints,
    noise: float,
    spacing: float,
    parallel_for: ParallelFor,
) -> VertexRecords:
    """Fit the normals at some of the points anew, and leave the others.

    Parameters
    ----------
    normals : (n, 3) float32
    at : (k,) int32
    noise, spacing : float [mm]
        Standard deviation of the noise, and the typical length of an edge.
    """
    out = normals.copy()
    parallel_for(_refit, len(at), points, normals, ring, at, noise, 1 / max(spacing, 1e-30), out)
    return out


def points_at_folds(normals: VertexRecords, ring: OneRing, parallel_for: ParallelFor, rings: int = 0) -> Ints:
    """Points with a neighbour whose normal stands at more than 20 degrees to theirs, and those up to `rings` away."""
    at_fold, wider = np.empty(len(normals), np.bool_), np.empty(len(normals), np.bool_)
    parallel_for(_find_folds, len(normals), normals, ring, at_fold)
    for _ in range(rings):
        parallel_for(_widen, len(normals), ring, at_fold, wider)
        at_fold, wider = wider, at_fold
    return np.flatnonzero(at_fold).astype(np.int32)


@njit(cache=True, nogil=True)
def _find_folds(first, last, normals, ring, at_fold):  # type: ignore[no-untyped-def]
    for i in range(first, last):
        at_fold[i] = False
        for q in range(ring.start[i], ring.start[i + 1]):
            if square(minus(row(normals, ring.neighbour[q]), row(normals, i))) > FOLD:
                at_fold[i] = True


@njit(cache=True, nogil=True)
def _widen(first, last, ring, some, out):  # type: ignore[no-untyped-def]
    """The neighbours of some points, too."""
    for i in range(first, last):
        out[i] = some[i]
        for q in range(ring.start[i], ring.start[i + 1]):
            out[i] |= some[ring.neighbour[q]]


@njit(cache=True, nogil=True, error_model="numpy")
def _refit(first, last, points, normals, ring, at, noise, scale, out):  # type: ignore[no-untyped-def]
    near = np.empty(MOST, np.int32)
    terms, height, weight = np.empty((MOST, UNKNOWNS)), np.empty(MOST), np.empty(MOST)
    matrix = np.empty((UNKNOWNS, UNKNOWNS + 1))
    for k in range(first, last):
        i = at[k]
        count = _same_side(i, normals, ring, near)
        if count < LEAST:
            continue
        n = row(normals, i)
        s, t = tangents(n)
        for q in range(count):
            step = minus(row(points, near[q]), row(points, i))
            u, v = scale * dot(step, s), scale * dot(step, t)
            height[q], weight[q] = dot(step, n), 1.0
            terms[q, 0], terms[q, 1], terms[q, 2] = 1.0, u, v
            terms[q, 3], terms[q, 4], terms[q, 5] = u * u, u * v, v * v
        for _ in range(ROUNDS):
            _solve(terms, height, weight, count, matrix)
            _reweigh(terms, height, matrix[:, UNKNOWNS], noise, weight, count)
        fitted = unit(plus(plus(n, -scale * matrix[1, UNKNOWNS], s), -scale * matrix[2, UNKNOWNS], t))
        if dot(fitted, n) > FARTHEST:
            for c in range(3):
                out[i, c] = fitted[c]


@njit(cache=True, nogil=True)
def _same_side(i, normals, ring, near):  # type: ignore[no-untyped-def]
    """Points within RINGS rings that are reached without crossing a crease."""
    near[0], count, begin = i, 1, 0
    for _ in range(RINGS):
        end = count
        for a in range(begin, end):
            for q in range(ring.start[near[a]], ring.start[near[a] + 1]):
                j = ring.neighbour[q]
                if count == MOST or square(minus(row(normals, j), row(normals, i))) > FOLD:
                    continue
                known = False
                for b in range(count):
                    known = known or near[b] == j
                if not known:
                    near[count] = j
                    count += 1
        begin = end
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def _solve(terms, height, weight, count, matrix):  # type: ignore[no-untyped-def]
    """Weighted least squares by elimination; the unknowns are left in the last column."""
    matrix[:] = 0.0
    for q in range(count):
        for x in range(UNKNOWNS):
            scaled = weight[q] * terms[q, x]
            for y in range(x, UNKNOWNS):
                matrix[x, y] += scaled * terms[q, y]
            matrix[x, UNKNOWNS] += scaled * height[q]
    for x in range(UNKNOWNS):
        matrix[x, x] += 1e-9 * (1.0 + matrix[x, x])
        for y in range(x):
            matrix[x, y] = matrix[y, x]
    for x in range(UNKNOWNS):  # positive definite: needs no pivots
        for y in range(UNKNOWNS):
            if y != x:
                factor = matrix[y, x] / matrix[x, x]
                for c in range(x, UNKNOWNS + 1):
                    matrix[y, c] -= factor * matrix[x, c]
    for x in range(UNKNOWNS):
        matrix[x, UNKNOWNS] /= matrix[x, x]


@njit(cache=True, nogil=True, error_model="numpy")
def _reweigh(terms, height, unknown, noise, weight, count):  # type: ignore[no-untyped-def]
    """Tukey's weights: none to points that are off by several times what points are off by on average."""
    total, squares = 1e-30, 0.0
    for q in range(count):
        off = height[q]
        for x in range(UNKNOWNS):
            off -= unknown[x] * terms[q, x]
        total, squares = total + weight[q], squares + weight[q] * off * off
        weight[q] = off
    reach = OUTLIER * max(math.sqrt(squares / total), DOUBT * noise, 1e-9)
    for q in range(count):
        weight[q] = max(0.0, 1.0 - (weight[q] / reach) ** 2) ** 2
