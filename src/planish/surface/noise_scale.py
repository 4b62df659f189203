"""Height and length of a scan's noise, white or not, from how far points lie off quadrics of growing radius."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from planish.geometry.guards import TINY
from planish.geometry.linear import solve_symmetric
from planish.geometry.vectors import dot, minus, plus, row, tangents, unit
from planish.parallel import ParallelFor
from planish.surface.normals import AREA, OneRing, VertexRecords
from planish.types import Floats

RADII = (2, 4, 8, 16)
"""Radii of the patches, in edges."""

PATCHES, ROOM = 200, 900
"""Patches that are looked at, and room for the points of the largest: 817 on a regular mesh of radius 16."""

UNKNOWNS = 6


SATURATED = (1.5, 2.1, 1.55)
"""Noise counts as found where patches of twice the radius show less than so many times as much: from 2 to 4, 4 to 8 and
8 to 16 edges. White noise grows by 1.0 to 1.1, a ripple of 7 points by 1.3 to 1.5 from 4 to 8; smooth sheets by 4 to 8,
wrinkled or creased ones by 2.2 or more (camel_b 2.2, cloth 2.9, curved_fold 1.7 from 2 to 4), noise over 3
points by 3.3. From 8 to 16 a crumpled sheet grows by 1.7 where its facets are 16 edges wide."""

TALL, GOES_ON = 0.2, 1.5
"""Noise of over 0.2 edges is followed to larger patches as long as these show less than 1.5 times as much (2 changes
nothing). A depth camera's is white at first and shared at length: 0.23, 0.31 and 0.39 edges in patches of 4, 8 and 16,
whose neighbours correlate by 0.14, 0.47 and 0.63. Lower noise is not followed, as bends show in large patches too."""

PATCH_OF_MESH = 4
"""Patches hold at most this part of the mesh's points."""


class NoiseScale(NamedTuple):
    """Noise of a scan, as patches of growing radius show it.

    Attributes
    ----------
    height : float [mm]
        Standard deviation across the surface; 0 where there is none.
    alike : float
        Correlation of the noise of two points that share an edge.
    """

    height: float
    alike: float


def noise_scale(
    points: Floats, rows: VertexRecords, ring: OneRing, spacing: float, least: float, parallel_for: ParallelFor
) -> NoiseScale:
    """Tell noise from bends: over `least` [mm], and no more of it in patches of twice the radius."""
    off, alike = patch_noise(points, rows, ring, parallel_for, RADII[:-1])
    for k in range(len(RADII) - 1):
        radius = RADII[k + 1]
        if PATCH_OF_MESH * 3 * radius * (radius + 1) > len(points):
            break
        if k + 1 == off.shape[1]:  # the largest patches take most of the time, and clean sheets do without
            if not np.nanmedian(off[:, k]) > least:
                break
            off, alike = patch_noise(points, rows, ring, parallel_for)
        known = np.isfinite(off[:, k]) & np.isfinite(off[:, k + 1])
        if not known.any():
            break
        small, large = np.median(off[known, k]), np.median(off[known, k + 1])
        if small > least and large < SATURATED[k] * small:
            if large > TALL * spacing and off.shape[1] < len(RADII):
                off, alike = patch_noise(points, rows, ring, parallel_for)
            k = _where_it_ends(off, k + 1, TALL * spacing)
            known = np.isfinite(off[:, k])
            return NoiseScale(float(np.median(off[known, k])), float(np.median(alike[known, k])))
    return NoiseScale(0.0, 0.0)


def _where_it_ends(off: Floats, k: int, tall: float) -> int:
    """The patches up to which tall noise goes on growing slowly, from those of column k on."""
    while k + 1 < off.shape[1]:
        known = np.isfinite(off[:, k]) & np.isfinite(off[:, k + 1])
        small, large = (np.median(off[known, j]) if known.any() else 0.0 for j in (k, k + 1))
        if not (small > tall and large < GOES_ON * small):
            break
        k += 1
    return k


def patch_noise(
    points: Floats, rows: VertexRecords, ring: OneRing, parallel_for: ParallelFor, radii: tuple[int, ...] = RADII
) -> tuple[Floats, Floats]:
    """Standard deviation [mm] of points from quadrics over patches of every radius, and how alike neighbours are.

    Returns
    -------
    off : (k, r) float64 [mm]
        NaN for patches with too few points.
    alike : (k, r) float64
        Correlation of the residuals of two points that share an edge: 0 for white noise, 1 for a smooth shape.
    """
    some = np.arange(0, len(points), max(1, len(points) // PATCHES))
    off, alike = np.full((len(some), len(radii)), np.nan), np.full((len(some), len(radii)), np.nan)
    parallel_for(_fit_patches, len(some), some, points, rows, ring, np.array(radii), off, alike, block=50)
    return off, alike


@njit(cache=True, nogil=True, error_model="numpy")
def _fit_patches(first, last, some, points, rows, ring, radii, off, alike):  # type: ignore[no-untyped-def]
    near, stamp = np.empty(ROOM, np.int32), np.zeros(len(points), np.int32)
    matrix = np.empty((UNKNOWNS, UNKNOWNS + 1))
    terms, residual, place = np.empty((ROOM, UNKNOWNS)), np.empty(ROOM), np.empty(len(points), np.int32)
    for k in range(first, last):
        i = some[k]
        near[0], stamp[i], place[i] = i, k + 1, 0
        count, begin, level = np.int64(1), 0, 0  # a literal 1 would have the kernels below compiled twice
        for r in range(len(radii)):
            while level < radii[r]:  # one more ring
                end = count
                for a in range(begin, end):
                    for q in range(ring.start[near[a]], ring.start[near[a] + 1]):
                        j = ring.neighbour[q]
                        if stamp[j] != k + 1 and count < ROOM:
                            stamp[j], near[count], place[j] = k + 1, j, count
                            count += 1
                begin, level = end, level + 1
            if count >= 2 * UNKNOWNS:
                _fit_patch(i, near, count, points, rows, terms, residual, matrix)
                off[k, r], alike[k, r] = _spread(near, count, place, stamp, k + 1, residual, ring)


@njit(cache=True, nogil=True, error_model="numpy")
def _fit_patch(i, near, count, points, rows, terms, residual, matrix):  # type: ignore[no-untyped-def]
    """Residuals of the patch's points from their quadric, across the mean of their area vectors."""
    axis, middle = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for q in range(count):
        j = near[q]
        axis = plus(axis, rows[j, AREA], row(rows, j))
        middle = plus(middle, 1.0 / count, minus(row(points, j), row(points, i)))
    axis = unit(axis)
    s, t = tangents(axis)
    spread = 0.0
    for q in range(count):
        step = minus(minus(row(points, near[q]), row(points, i)), middle)
        u, v = dot(step, s), dot(step, t)
        residual[q] = dot(step, axis)
        terms[q, 0], terms[q, 1], terms[q, 2] = 1.0, u, v
        spread += u * u + v * v
    scale = 1.0 / math.sqrt(max(spread / count, TINY))
    matrix[:] = 0.0
    for q in range(count):
        u, v = scale * terms[q, 1], scale * terms[q, 2]
        terms[q, 1], terms[q, 2], terms[q, 3], terms[q, 4], terms[q, 5] = u, v, u * u, u * v, v * v
        for x in range(UNKNOWNS):
            for y in range(x, UNKNOWNS):
                matrix[x, y] += terms[q, x] * terms[q, y]
            matrix[x, UNKNOWNS] += terms[q, x] * residual[q]
    solve_symmetric(matrix)
    for q in range(count):
        for x in range(UNKNOWNS):
            residual[q] -= matrix[x, UNKNOWNS] * terms[q, x]


@njit(cache=True, nogil=True, error_model="numpy")
def _spread(near, count, place, stamp, mark, residual, ring):  # type: ignore[no-untyped-def]
    squares, products, pairs = 0.0, 0.0, 0
    for q in range(count):
        squares += residual[q] * residual[q]
        for p in range(ring.start[near[q]], ring.start[near[q] + 1]):
            j = ring.neighbour[p]
            if stamp[j] == mark and place[j] > q:
                products, pairs = products + residual[q] * residual[place[j]], pairs + 1
    variance = squares / (count - UNKNOWNS)
    return math.sqrt(variance), products / max(pairs, 1) / max(squares / count, TINY)
