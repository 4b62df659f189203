"""Noise taken out of the points themselves, where it is known along which ray a point was measured."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planish.geometry.vectors import dot, minus, plus, row, unit
from planish.parallel import ParallelFor
from planish.surface.normals import OneRing
from planish.types import Floats

ROUNDS = 4
"""More do not help: 10 and 24 rounds leave the same error (book, 0.07 mm of noise: 0.0096, 0.0098, 0.0099 mm)."""

SAME_SIDE, SAME_SIDE_PER_NOISE, SAME_SIDE_AT_MOST = math.radians(1.0), math.radians(12.0), math.radians(12.0)
"""Neighbours whose normals differ by more lie across a crease and say nothing: by 1 degree, and 12 for noise as large
as the spacing. At 0.6 mm and 0.05 mm of noise (2 degrees) sheets with creases are 0.016 (spread), 0.017 (Miura) and
0.07 mm (crumpled) out; with 12 degrees 0.026, 0.023 and 0.10; with 0.6 degrees smooth ones half as much again."""

OWN, BREATH = 0.15, 0.3
"""Share of its last value that a height keeps, and weight that holds it at nought, both against overshooting."""

GRAZING = 0.15
"""Rays that meet the surface at less than 8.6 degrees are not followed: the shift would be many times the noise."""


def move_along_rays(
    points: Floats, normals: NDArray[np.float32], ring: OneRing, eye: Floats, noise: float, parallel_for: ParallelFor
) -> Floats:
    """Move every point along its ray to where the normals around it want the surface to be.

    If neither end had noise, an edge would be at right angles to the mean of its ends' normals (to third order in its
    length where the sheet is bent). What is missing there is the difference of the ends' heights over the surface,
    which a few rounds of averaging even out:

        d_i <- mean over the ring of (p_j - p_i) . (N_i + N_j) / 2 + d_j

    Parameters
    ----------
    points : (n, 3) float64 [mm]
    normals : (n, 3) float32
        Without noise.
    ring : OneRing
    eye : (3,) float64 [mm]
        Where the rays come from.
    noise : float
        Standard deviation, in spacings of the points.

    Returns
    -------
    (n, 3) float64 [mm]
    """
    height, further = np.zeros(len(points)), np.empty(len(points))
    same_side = 1 - math.cos(min(SAME_SIDE + SAME_SIDE_PER_NOISE * noise, SAME_SIDE_AT_MOST))
    for _ in range(ROUNDS):
        parallel_for(_level, len(points), points, normals, ring, same_side, height, further)
        height, further = further, height
    moved = np.empty_like(points)
    parallel_for(_follow_rays, len(points), points, normals, height, eye, moved)
    return moved


@njit(cache=True, nogil=True, error_model="numpy")
def _level(first, last, points, normals, ring, same_side, height, out):  # type: ignore[no-untyped-def]
    for i in range(first, last):
        p, n = row(points, i), row(normals, i)
        missing, total = 0.0, BREATH
        for q in range(ring.start[i], ring.start[i + 1]):
            j = ring.neighbour[q]
            m = row(normals, j)
            weight = max(1.0 - (1.0 - dot(n, m)) / same_side, 0.0) ** 2
            missing += weight * (0.5 * dot(minus(row(points, j), p), plus(n, 1.0, m)) + height[j])
            total += weight
        out[i] = OWN * height[i] + (1.0 - OWN) * missing / total


@njit(cache=True, nogil=True, error_model="numpy")
def _follow_rays(first, last, points, normals, height, eye, moved):  # type: ignore[no-untyped-def]
    for i in range(first, last):
        p, n = row(points, i), row(normals, i)
        ray = unit(minus(p, (eye[0], eye[1], eye[2])))
        towards = dot(n, ray)
        shift = height[i] / towards if abs(towards) > GRAZING else 0.0
        moved[i, 0], moved[i, 1], moved[i, 2] = plus(p, shift, ray)
