"""Lengths of edges over a surface that is bent and creased."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planish.geometry.vectors import cross, dot, minus, plus, row, square, unit
from planish.parallel import ParallelFor
from planish.surface.curvature import CURVATURE, ShapeOperators
from planish.surface.normals import sample
from planish.types import Floats, Ints

GAUSS = (1 - 1 / math.sqrt(3)) / 2
"""Where on an edge its slope is taken: the two points of Gauss-Legendre quadrature, exact for polynomials to x^3."""

BEND, POLYGON = math.radians(20), math.radians(30)
"""An edge along which the sheet bends by more is no chord of an arc but the side of a polygon."""


MOSTLY, CHORD_SLACK = 0.9, 4.0
"""Lengths may be below the straight distance of their ends by what noise has made that longer: by as much as heights
CHORD_SLACK times those that all but a tenth of the edges have between their ends, across the surface."""


def lengths_over(
    points: Floats, normals: NDArray[np.float32], bends: ShapeOperators, edges: Ints, parallel_for: ParallelFor
) -> Floats:
    """(e,) lengths of edges whose ends lie on two planes that meet between them, once these are unfolded into one.

    With c along the fold and m between the two normals, which stand at an angle phi, an edge d is as long as

        L^2 = (d.c)^2 + (|d|^2 - (d.c)^2 - (d.m)^2) / cos^2(phi / 2)

    What noise adds to d along m drops out. On a bent sheet the planes are those at the edge's two Gauss points, which
    makes the rule exact to fourth order on arcs too.

    Parameters
    ----------
    points : (n, 3) float64 [mm]
    normals : (n, 3) float32
    bends : ShapeOperators
    edges : (e, 2) int32
    """
    rest = np.empty(len(edges))
    parallel_for(_lengths_over, len(edges), points, normals, bends, edges, rest)
    return rest


def not_below_chords(
    rest: Floats,
    points: Floats,
    normals: NDArray[np.float32],
    edges: Ints,
    noise_ratio: Floats,
    parallel_for: ParallelFor,
) -> Floats:
    """(e,) lengths, but none below the straight distance d of its ends as far as noise lets that be known.

        L >= sqrt(d^2 - (CHORD_SLACK h)^2)

    No way over a surface is shorter. Where more than two facets meet, lengths from two planes come out up to a half too
    short. h is what noise leaves between the ends of an edge across the surface, as most edges show it, times the local
    noise.

    Parameters
    ----------
    rest : (e,) float64 [mm]
    points : (n, 3) float64 [mm]
    normals : (n, 3) float32
    edges : (e, 2) int32
    noise_ratio : (n,) float64
        Local noise over the typical one; infinite where straight distances tell nothing.
    """
    some = edges[sample(len(edges))]
    between = (normals[some[:, 0]] + normals[some[:, 1]]).astype(np.float64)
    across = np.einsum("ij,ij->i", points[some[:, 1]] - points[some[:, 0]], between)
    across /= np.maximum(np.linalg.norm(between, axis=1), 1e-30)
    slack = CHORD_SLACK * float(np.quantile(np.abs(across), MOSTLY)) if len(some) else 0.0
    out = np.empty(len(edges))
    parallel_for(_not_below_chords, len(edges), rest, points, edges, slack, noise_ratio, out)
    return out


@njit(cache=True, nogil=True)
def _not_below_chords(first, last, rest, points, edges, slack, noise_ratio, out):  # type: ignore[no-untyped-def]
    for e in range(first, last):
        i, j = edges[e, 0], edges[e, 1]
        ratio, out[e] = max(noise_ratio[i], noise_ratio[j]), rest[e]
        if ratio < math.inf:
            squared = square(minus(row(points, j), row(points, i))) - (slack * ratio) ** 2
            if squared > rest[e] * rest[e]:
                out[e] = math.sqrt(squared)


@njit(cache=True, nogil=True, error_model="numpy")
def _lengths_over(first, last, points, normals, bends, edges, out):  # type: ignore[no-untyped-def]
    for e in range(first, last):
        i, j = edges[e, 0], edges[e, 1]
        d = minus(row(points, j), row(points, i))
        n, k = _at_gauss_point(normals, bends, i, d, 1.0), _at_gauss_point(normals, bends, j, d, -1.0)
        m, c = plus(n, 1.0, k), cross(n, k)
        mm, cc = square(m), square(c)  # 4 cos^2(phi / 2) and sin^2(phi)
        out[e] = math.sqrt(square(d))
        if mm > 1e-3:
            along = dot(d, c) ** 2 / cc if cc > 1e-14 else 0.0
            across = max(0.0, square(d) - along - dot(d, m) ** 2 / mm)
            out[e] = math.sqrt(along + 4.0 * across / mm)


@njit(cache=True, nogil=True)
def _at_gauss_point(normals, bends, i, d, sign):  # type: ignore[no-untyped-def]
    bend = row(bends, i)
    turn = bends[i, CURVATURE] * dot(bend, d)
    share = min(1.0, max(0.0, (POLYGON - abs(turn)) / (POLYGON - BEND)))
    return unit(plus(row(normals, i), sign * GAUSS * share * turn, bend))
