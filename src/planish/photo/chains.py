"""Chains of letters: each linked to its neighbours, and a smooth curve through them."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from planish.geometry.guards import TINY_PX
from planish.photo.letters import Letters
from planish.types import Floats, Ints

WORD_GAP = 2.2
"""Widest gap within a line, in letter heights; wider ones are closed once the sheet's shape is known."""
LIKE_HEIGHT = 2.6
"""Largest ratio of heights of neighbouring letters."""
OVERLAP = 0.4
"""Least vertical overlap of neighbouring letters, relative to the lower one."""


def link_letters(letters: Letters, widest_gap: float = WORD_GAP) -> list[Ints]:
    """Link letters that are mutual nearest neighbours to the right and left; return the chains, in order.

    Parameters
    ----------
    letters : Letters
    widest_gap : float
        Widest gap within a chain, in letter heights.
    """
    count = len(letters.left)
    if count < 2:
        return []
    height, middle = letters.height, letters.middle
    squeezed = middle * [1.0, 2.5]  # prefers neighbours to the side over those above and below
    _, near = cKDTree(squeezed).query(squeezed, k=min(10, count))
    one, other = np.repeat(np.arange(count), near.shape[1]), near.ravel()
    gap = letters.left[other] - letters.right[one]
    lower, higher = np.minimum(height[one], height[other]), np.maximum(height[one], height[other])
    shared = np.minimum(letters.bottom[one], letters.bottom[other]) - np.maximum(letters.top[one], letters.top[other])
    good = (middle[other, 0] > middle[one, 0]) & (gap > -0.4 * lower) & (gap < widest_gap * higher)
    good &= (shared > OVERLAP * lower) & (higher < LIKE_HEIGHT * lower)
    one, other, gap = one[good], other[good], gap[good]
    right = _nearest(one, other, gap, count)
    left = _nearest(other, one, gap, count)
    here = np.flatnonzero(right >= 0)
    here = here[left[right[here]] == here]
    links = coo_array((np.ones(len(here)), (here, right[here])), shape=(count, count))
    _, chain = connected_components(links, directed=False)
    order = np.lexsort((middle[:, 0], chain))
    return np.split(order.astype(np.int32), np.flatnonzero(np.diff(chain[order])) + 1)


def _nearest(one: Ints, other: Ints, gap: Floats, count: int) -> Ints:
    """For each of `one` the `other` with the smallest gap; -1 if there is none."""
    order = np.argsort(-gap, kind="stable")
    found = np.full(count, -1, np.int32)
    found[one[order]] = other[order]  # the last assignment has the smallest gap
    return found


def fit_baseline(x: Floats, y: Floats, height: float, most_degree: int = 3) -> tuple[Floats, float]:
    """Fit a smooth curve to a line of letters, robustly.

    Parameters
    ----------
    x, y : (k,) float64 [px]
    height : float [px]
        Of the letters.
    most_degree : int
        Highest degree of the polynomial.

    Returns
    -------
    weight : (k,) float64
        0 for letters off the curve.
    residual : float
        Median distance from the curve, in letter heights.
    """
    t = (x - x.mean()) / max(float(np.ptp(x)), TINY_PX)
    powers = t[:, None] ** np.arange(1 + min(most_degree, max(1, len(x) // 6)))
    weight = np.ones(len(x))
    for scale in (0.4, 0.25, 0.15, 0.15):
        root = np.sqrt(weight)[:, None]
        residual = y - powers @ np.linalg.lstsq(powers * root, y * root[:, 0], rcond=None)[0]
        weight = np.clip(1 - (residual / (2 * scale * height)) ** 2, 0, 1) ** 2 + 1e-3
    return np.where(np.abs(residual) < 0.15 * height, weight, 0.0), float(np.median(np.abs(residual))) / height
