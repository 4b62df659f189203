"""How the sheet is bent at every point: paper bends in one direction only, and not at all along its rulings."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planish.geometry.vectors import dot, minus, plus, row, tangents, times, unit
from planish.parallel import ParallelFor
from planish.surface.normals import AREA, NOISE, PLACE, OneRing, VertexRecords, closeness

ShapeOperators = NDArray[np.float32]
"""(n, 4): unit vector a of the direction in which the sheet is bent most, and its curvature there [1/mm].

A step d along the surface turns the normal by dN = curvature (a . d) a; the ruling runs across a.
"""

CURVATURE = 3


def shape_operators(
    rows: VertexRecords, ring: OneRing, reach: float, rounds: int, parallel_for: ParallelFor
) -> ShapeOperators:
    """Fit the shape operator to every ring, smooth it within the creases, and keep its greater curvature.

    Parameters
    ----------
    reach : float
        Neighbours with |N_i - N_j|^2 over this are across a crease.
    rounds : int
        Of smoothing.
    """
    scale = np.float32(1 / max(reach, 1e-10))
    shape, smooth = np.empty_like(rows), np.empty_like(rows)
    parallel_for(_fit_shape, len(rows), rows, ring, scale, shape)
    for _ in range(rounds):
        parallel_for(_smooth_shape, len(rows), rows, ring, scale, shape, smooth)
        shape, smooth = smooth, shape
    bends = np.empty((len(rows), 4), np.float32)
    parallel_for(_greatest_bend, len(rows), rows, shape, bends)
    return bends


@njit(cache=True, nogil=True)
def rotate_along_bend(normal, bend, curvature, step):  # type: ignore[no-untyped-def]
    """Normal of a bent surface a step away."""
    return unit(plus(normal, curvature * dot(bend, step), bend))


@njit(cache=True, nogil=True, error_model="numpy")
def _fit_shape(first, last, rows, ring, scale, shape):  # type: ignore[no-untyped-def]
    """Least squares of |N_j - N_i - S (x_j - x_i)|^2 over the ring, as a symmetric 3 x 3 matrix times its weight."""
    for i in range(first, last):
        n, x, near = row(rows, i), row(rows, i, PLACE), scale / rows[i, NOISE]
        s, t = tangents(n)
        ss, st, tt, gss, gst, gtt = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for q in range(ring.start[i], ring.start[i + 1]):
            j = ring.neighbour[q]
            weight = closeness(n, row(rows, j), near) * rows[j, AREA]
            step, turn = minus(row(rows, j, PLACE), x), minus(row(rows, j), n)
            u, v = dot(step, s), dot(step, t)
            nu, nv = dot(turn, s), dot(turn, t)
            ss, st, tt = ss + weight * u * u, st + weight * u * v, tt + weight * v * v
            gss, gst, gtt = gss + weight * u * nu, gst + weight * (u * nv + v * nu), gtt + weight * v * nv
        # Normal equations of the unknowns (S_ss, S_st, S_tt), by elimination of the outer two.
        breath = 1e-3 * (ss + tt) + 1e-30
        ss, tt = ss + breath, tt + breath
        middle = ss + tt - st * st / ss - st * st / tt
        mixed = (gst - st * gss / ss - st * gtt / tt) / max(middle, 1e-30)
        first_bend, second_bend = (gss - st * mixed) / ss, (gtt - st * mixed) / tt
        weight = ss + tt
        a = plus(times(first_bend, s), mixed, t)
        b = plus(times(second_bend, t), mixed, s)
        for k in range(3):  # S = S_ss s s' + S_st (s t' + t s') + S_tt t t'
            shape[i, k] = weight * (a[k] * s[k] + b[k] * t[k])
        shape[i, 3] = weight * (a[0] * s[1] + b[0] * t[1])
        shape[i, 4] = weight * (a[0] * s[2] + b[0] * t[2])
        shape[i, 5] = weight * (a[1] * s[2] + b[1] * t[2])
        shape[i, 6], shape[i, 7] = weight, 0.0


@njit(cache=True, nogil=True)
def _product(shape, i, v):  # type: ignore[no-untyped-def]
    """Matrix i, kept as xx, yy, zz, xy, xz, yz, times a vector."""
    m = shape[i]
    return (
        m[0] * v[0] + m[3] * v[1] + m[4] * v[2],
        m[3] * v[0] + m[1] * v[1] + m[5] * v[2],
        m[4] * v[0] + m[5] * v[1] + m[2] * v[2],
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _smooth_shape(first, last, rows, ring, scale, shape, out):  # type: ignore[no-untyped-def]
    for i in range(first, last):
        n, near = row(rows, i), scale / rows[i, NOISE]
        for k in range(out.shape[1]):
            out[i, k] = shape[i, k]
        total = np.float32(1)
        for q in range(ring.start[i], ring.start[i + 1]):
            j = ring.neighbour[q]
            weight = closeness(n, row(rows, j), near)
            if weight > 0:
                total += weight
                for k in range(7):
                    out[i, k] += weight * shape[j, k]
        for k in range(7):
            out[i, k] /= total


@njit(cache=True, nogil=True, error_model="numpy")
def _greatest_bend(first, last, rows, shape, bends):  # type: ignore[no-untyped-def]
    for i in range(first, last):
        s, t = tangents(row(rows, i))
        a, b = _product(shape, i, s), _product(shape, i, t)
        ss, st, tt = dot(a, s), dot(a, t), dot(b, t)
        mean, half = 0.5 * (ss + tt), 0.5 * (ss - tt)
        away = math.sqrt(half * half + st * st)
        curvature = mean + away if mean >= 0.0 else mean - away
        # (S - curvature) v = 0 has two rows; the one of greater size says better what v is.
        u, v = (st, curvature - ss) if abs(curvature - ss) > abs(curvature - tt) else (curvature - tt, st)
        length = math.sqrt(u * u + v * v)
        u, v = (u / length, v / length) if length > 0.0 else (1.0, 0.0)
        bend = plus(times(u, s), v, t)
        for k in range(3):
            bends[i, k] = bend[k]
        bends[i, CURVATURE] = curvature / max(shape[i, 6], np.float32(1e-30))
