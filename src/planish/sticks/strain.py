"""Lengths of sticks as they are, and how far they are from their rest lengths."""

from __future__ import annotations

import numpy as np
from numba import njit

from planish.types import Floats, Ints


def strain(points: Floats, pairs: Ints, rest: Floats) -> tuple[float, float]:
    """Root mean square and greatest |l / r - 1| of pairs of points against their rest lengths.

    Parameters
    ----------
    points : (n, 2) or (n, 3) float64 [mm]
    pairs : (s, 2) int32
    rest : (s,) float64 [mm]
        Pairs without length are left out.

    Examples
    --------
    >>> strain(np.array([[0.0, 0.0], [3.0, 4.4]]), np.array([[0, 1]], np.int32), np.array([5.0]))[1].__round__(3)
    0.065
    """
    rms, greatest = _strain(np.ascontiguousarray(points), pairs, rest)
    return float(rms), float(greatest)


@njit(cache=True)
def _strain(points, pairs, rest):  # type: ignore[no-untyped-def]
    total, greatest, count = 0.0, 0.0, 0
    for s in range(len(pairs)):
        if rest[s] <= 0.0:
            continue
        squared = 0.0
        for k in range(points.shape[1]):
            squared += (points[pairs[s, 1], k] - points[pairs[s, 0], k]) ** 2
        error = np.sqrt(squared) / rest[s] - 1.0
        total += error * error
        greatest = max(greatest, abs(error))
        count += 1
    return np.sqrt(total / max(count, 1)), greatest
