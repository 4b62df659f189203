"""Straight distances between pairs of points."""

from __future__ import annotations

import numpy as np
from numba import njit

from planish.types import Floats, Ints


def distances(points: Floats, pairs: Ints) -> Floats:
    """(s,) straight distance [mm] of pairs of points."""
    return np.asarray(_distances(np.ascontiguousarray(points), pairs))


@njit(cache=True)
def _distances(points, pairs):  # type: ignore[no-untyped-def]
    out = np.empty(len(pairs))
    for s in range(len(pairs)):
        squared = 0.0
        for k in range(points.shape[1]):
            squared += (points[pairs[s, 1], k] - points[pairs[s, 0], k]) ** 2
        out[s] = np.sqrt(squared)
    return out
