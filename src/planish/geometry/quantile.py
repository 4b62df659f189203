"""Quantiles of a few numbers inside kernels.

numpy's own take six seconds to compile, longer than the rest of the kernel that calls them.
"""

from __future__ import annotations

from numba import njit


@njit(cache=True, nogil=True)
def quantile(values, count, share):  # type: ignore[no-untyped-def]
    """Quantile of the first numbers of an array, which are sorted in place.

    Parameters
    ----------
    values : (n,) float64
        Without NaN. The time grows with the square of `count`: for some hundred numbers at most.
    count : int
        At least 1.
    share : float
        0 for the smallest, 0.5 for the median; linear between two numbers, as `numpy.quantile`.

    Examples
    --------
    >>> import numpy as np
    >>> quantile(np.array([3.0, 1.0, 2.0, 9.0]), 3, 0.75)
    2.5
    """
    for k in range(1, count):
        value, at = values[k], k
        while at > 0 and values[at - 1] > value:
            values[at] = values[at - 1]
            at -= 1
        values[at] = value
    place = share * (count - 1)
    below = int(place)
    above = min(below + 1, count - 1)
    return values[below] + (place - below) * (values[above] - values[below])
