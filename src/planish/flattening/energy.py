"""The energy of the sticks in the plane, its gradient, and the stiffness of each point.

    E(x) = 1/2 sum of w (|x_j - x_i| - r)^2 over all sticks (i, j) of length r and weight w

Each slab of sticks adds up forces in rows of its own, which are then summed in order: so both cores can work, and
the sum does not depend on how many do.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planish.parallel import ParallelFor
from planish.types import Floats, Ints, Sticks

SLABS = 16
"""Parts that the sticks are cut into: enough to share out evenly, few enough to have short seams."""


class Net(NamedTuple):
    """Sticks, and the slabs they are visited in.

    Attributes
    ----------
    pairs, rest, weight : see `Sticks`
    begin : (SLABS + 1, 2) int64
        Where each slab begins among the edges and among the bending sticks.
    reach : (SLABS, 2) int64
        First point that a slab's sticks touch, and one past the last.
    row : (SLABS + 1,) int64
        Where each slab's own forces begin.
    """

    pairs: Ints
    rest: Floats
    weight: Floats
    begin: NDArray[np.int64]
    reach: NDArray[np.int64]
    row: NDArray[np.int64]


def make_net(sticks: Sticks, parallel_for: ParallelFor) -> Net:
    """Cut sticks, in the order of their points, into slabs."""
    share = np.arange(SLABS + 1)
    bends = len(sticks.rest) - sticks.edges
    begin = np.stack([share * sticks.edges // SLABS, sticks.edges + share * bends // SLABS], axis=1).astype(np.int64)
    reach = np.zeros((SLABS, 2), np.int64)
    parallel_for(_find_reach, SLABS, sticks.pairs, begin, reach, block=1)
    row = np.concatenate([np.zeros(1, np.int64), np.cumsum(reach[:, 1] - reach[:, 0])])
    return Net(sticks.pairs, sticks.rest, sticks.weight, begin, reach, row)


def energy(net: Net, xy: Floats, parallel_for: ParallelFor) -> tuple[float, Floats]:
    """Energy of the sticks, and its gradient (n, 2)."""
    gradient = np.empty_like(xy)
    forces = np.empty((net.row[-1], 2))
    parts = np.empty(SLABS)
    parallel_for(_slab_energy, SLABS, net, xy, forces, parts, block=1)
    parallel_for(_sum_slabs, len(xy), net.reach, net.row, forces, gradient)
    return float(parts.sum()), gradient


def stiffness(net: Net, xy: Floats, parallel_for: ParallelFor) -> Floats:
    """(n, 4) for each point the sums over its sticks of w u u^T, as xx, xy and yy, and of w r^2 / 2.

    The first is the point's own block of the Gauss-Newton Hessian, u being the stick's direction.
    """
    total = np.empty((len(xy), 4))
    parts = np.empty((net.row[-1], 4))
    parallel_for(_slab_stiffness, SLABS, net, xy, parts, block=1)
    parallel_for(_sum_slabs, len(xy), net.reach, net.row, parts, total)
    return total


@njit(cache=True, nogil=True)
def _find_reach(first, last, pairs, begin, reach):  # type: ignore[no-untyped-def]
    for slab in range(first, last):
        low, high = 1 << 62, 0
        for kind in range(2):
            for s in range(begin[slab, kind], begin[slab + 1, kind]):
                low = min(low, pairs[s, 0], pairs[s, 1])
                high = max(high, pairs[s, 0] + 1, pairs[s, 1] + 1)
        reach[slab, 0], reach[slab, 1] = min(low, high), high


@njit(cache=True, nogil=True, error_model="numpy")
def _slab_energy(first, last, net, xy, forces, parts):  # type: ignore[no-untyped-def]
    pairs, rest, weight, begin, reach, row = net
    for slab in range(first, last):
        low = reach[slab, 0]
        own = forces[row[slab] : row[slab + 1]]
        own[:] = 0.0
        total = 0.0
        for kind in range(2):
            for s in range(begin[slab, kind], begin[slab + 1, kind]):
                i, j = pairs[s, 0], pairs[s, 1]
                dx, dy = xy[j, 0] - xy[i, 0], xy[j, 1] - xy[i, 1]
                length = np.sqrt(dx * dx + dy * dy)
                error = length - rest[s]
                total += weight[s] * error * error
                pull = weight[s] * error / length if length > 0.0 else 0.0
                own[i - low, 0] -= pull * dx
                own[i - low, 1] -= pull * dy
                own[j - low, 0] += pull * dx
                own[j - low, 1] += pull * dy
        parts[slab] = 0.5 * total


@njit(cache=True, nogil=True, error_model="numpy")
def _slab_stiffness(first, last, net, xy, parts):  # type: ignore[no-untyped-def]
    pairs, rest, weight, begin, reach, row = net
    for slab in range(first, last):
        low = reach[slab, 0]
        own = parts[row[slab] : row[slab + 1]]
        own[:] = 0.0
        for kind in range(2):
            for s in range(begin[slab, kind], begin[slab + 1, kind]):
                i, j = pairs[s, 0], pairs[s, 1]
                dx, dy = xy[j, 0] - xy[i, 0], xy[j, 1] - xy[i, 1]
                square = dx * dx + dy * dy
                scale = weight[s] / square if square > 0.0 else 0.0
                half = 0.5 * weight[s] * rest[s] * rest[s]
                for end in (i - low, j - low):
                    own[end, 0] += scale * dx * dx
                    own[end, 1] += scale * dx * dy
                    own[end, 2] += scale * dy * dy
                    own[end, 3] += half


@njit(cache=True, nogil=True)
def _sum_slabs(first, last, reach, row, parts, total):  # type: ignore[no-untyped-def]
    total[first:last] = 0.0
    for slab in range(len(reach)):
        low = reach[slab, 0]
        shift = row[slab] - low
        for i in range(max(first, low), min(last, reach[slab, 1])):
            for k in range(total.shape[1]):
                total[i, k] += parts[i + shift, k]
