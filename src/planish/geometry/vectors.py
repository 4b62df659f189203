"""Vectors as tuples of three floats, so that kernels read like formulas; inlined into their callers at no cost."""

from __future__ import annotations

import math

from numba import njit


@njit(cache=True, nogil=True)
def row(array, i, k=0):  # type: ignore[no-untyped-def]
    """Three numbers of row i, from column k on."""
    return array[i, k], array[i, k + 1], array[i, k + 2]


@njit(cache=True, nogil=True)
def minus(a, b):  # type: ignore[no-untyped-def]
    """The difference a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@njit(cache=True, nogil=True)
def times(scale, a):  # type: ignore[no-untyped-def]
    """The product scale a."""
    return scale * a[0], scale * a[1], scale * a[2]


@njit(cache=True, nogil=True)
def plus(a, scale, b):  # type: ignore[no-untyped-def]
    """Return a + scale b."""
    return a[0] + scale * b[0], a[1] + scale * b[1], a[2] + scale * b[2]


@njit(cache=True, nogil=True)
def dot(a, b):  # type: ignore[no-untyped-def]
    """The product a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True, nogil=True)
def square(a):  # type: ignore[no-untyped-def]
    """The product a . a."""
    return a[0] * a[0] + a[1] * a[1] + a[2] * a[2]


@njit(cache=True, nogil=True)
def cross(a, b):  # type: ignore[no-untyped-def]
    """The product a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(cache=True, nogil=True, error_model="numpy")
def unit(a):  # type: ignore[no-untyped-def]
    """Of length 1; a vector without length is left as it is."""
    length = math.sqrt(square(a))
    scale = 1.0 / length if length > 0.0 else 1.0
    return a[0] * scale, a[1] * scale, a[2] * scale


@njit(cache=True, nogil=True)
def tangents(n):  # type: ignore[no-untyped-def]
    """Two unit vectors that make a right-handed frame with the unit vector n."""
    s = unit((0.0, n[2], -n[1])) if abs(n[0]) < 0.9 else unit((-n[2], 0.0, n[0]))
    return s, cross(n, s)
