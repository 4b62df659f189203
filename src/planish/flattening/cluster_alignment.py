"""Clusters turned and shifted until their copies of the same points meet: nonlinear least squares.

With a turn rho = exp(i theta) and a shift tau for each cluster, what must become small is

    E = sum of |rho_a z_a + tau_a - rho_b z_b - tau_b|^2

over all points that two clusters a and b share and have placed at z_a and z_b. The sums over points are taken once,
as moments of each pair of clusters; after that the work depends on the number of clusters alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csc_array
from scipy.sparse.linalg import splu

from planish.flattening.clusters import Clusters
from planish.geometry.guards import TINY
from planish.types import Floats, Ints, Outcome

Complex = NDArray[np.complex128]

ROUNDS = 8
"""Gauss-Newton steps at most."""

STILL = 1e-3
"""No further step when the large clusters turned by no more than this [rad] on average: the next step would turn them
by about its square. Slivers that hang on by a short edge may spin for ever."""

AMISS = 0.1
"""Constraints whose points miss each other by more than this part of their spread count less, as one of the two
clusters came out folded. On a Miura fold of 150,000 points with 0.2 mm of noise (0.5 to 1 at the worst constraints) one
of them puts the layout 6 mm out, 0.3 with this. From 0.05 to 0.3 is much alike, on clean sheets too, where creases that
run through faces make points miss by up to 0.15."""

HINGED = 1e-10
"""Share of the greatest stiffness added to all, as a cluster that hangs on by a single point can turn freely."""


class ClusterConstraints(NamedTuple):
    """Moments of the points that two clusters share, one row for each such pair; points that meet badly count less.

    Attributes
    ----------
    pairs : (j, 2) int32
        Clusters a < b.
    number : (j,) float64
        Points shared, as far as they count.
    sums : (j, 2) complex128 [mm]
        Sums of z_a and of z_b.
    squares : (j, 2) float64 [mm^2]
        Sums of |z_a|^2 and of |z_b|^2.
    product : (j,) complex128 [mm^2]
        Sum of conj(z_a) z_b.
    """

    pairs: Ints
    number: Floats
    sums: Complex
    squares: Floats
    product: Complex


def align_clusters(clusters: Clusters) -> tuple[Complex, Complex, Ints, Outcome]:
    """Find the frame of every cluster.

    Returns
    -------
    rho, tau : (c,) complex128
        Rotation and shift [mm] of each cluster: its copy at z lies at rho z + tau.
    piece : (c,) int32
        Clusters that hang together have the same number, that of one of them; each piece lies anywhere.
    outcome : Outcome
        SETTLED; OUT_OF_STEPS where clusters still turned after the last step; DIVERGED where a step was no finite
        number or its matrix singular, and the frames before it were kept.
    """
    constraints = _find_constraints(clusters)
    rho, tau, piece = _chain(clusters.total, *constraints, np.argsort(-_spread(constraints), kind="stable"))
    if not len(constraints.pairs):
        return rho, tau, piece, Outcome.SETTLED
    size = np.bincount(clusters.cluster)
    large = size >= 0.5 * size.max()
    for _ in range(ROUNDS):
        try:
            turn, shift = _gauss_newton_step(constraints, rho, tau, np.unique(piece))
        except RuntimeError:  # "Factor is exactly singular"
            return rho, tau, piece, Outcome.DIVERGED
        if not (np.isfinite(turn).all() and np.isfinite(shift).all()):
            return rho, tau, piece, Outcome.DIVERGED
        rho *= np.exp(1j * turn)
        tau += shift
        if np.abs(turn[large]).mean() <= STILL:
            return rho, tau, piece, Outcome.SETTLED
    return rho, tau, piece, Outcome.OUT_OF_STEPS


def average_copies(clusters: Clusters, rho: Complex, tau: Complex) -> Floats:
    """(n, 2) places [mm] of all points: the mean over the copies of each."""
    xy = np.empty((len(clusters.start) - 1, 2))
    _average_copies(clusters.start, clusters.cluster, clusters.place, rho, tau, xy)
    return xy


def _spread(joints: ClusterConstraints) -> Floats:
    """Spread of the shared points about their middle [mm^2]: how surely a joint tells directions."""
    return np.asarray(joints.squares.sum(1) - (np.abs(joints.sums) ** 2).sum(1) / joints.number)


def _find_constraints(clusters: Clusters) -> ClusterConstraints:
    """Collect the pairs of clusters that share points, and the moments of those points."""
    row, other, first, second = _meetings(clusters.start, clusters.cluster, clusters.total)
    joints = ClusterConstraints(*_moments(row, other, first, second, clusters.place))
    share = _trust(joints)
    return ClusterConstraints(
        joints.pairs,
        joints.number * share,
        joints.sums * share[:, None],
        joints.squares * share[:, None],
        joints.product * share,
    )


def _trust(joints: ClusterConstraints) -> Floats:
    """(j,) 1 / (1 + m / (0.01 s)), m the mean square by which shared points miss each other at best, s their spread."""
    product = joints.product - joints.sums[:, 0].conj() * joints.sums[:, 1] / joints.number
    spread = _spread(joints)
    return np.asarray(1 / (1 + np.maximum(spread - 2 * np.abs(product), 0) / np.maximum(AMISS**2 * spread, TINY)))


@njit(cache=True, nogil=True)
def _meetings(start, cluster, count):  # type: ignore[no-untyped-def]
    """Pairs of copies of one point, as compressed rows by the smaller cluster: the larger one, the two copies."""
    row = np.zeros(count + 1, np.int64)
    for i in range(len(start) - 1):
        for k in range(start[i], start[i + 1]):
            for j in range(k + 1, start[i + 1]):
                row[min(cluster[k], cluster[j]) + 1] += 1
    for c in range(count):
        row[c + 1] += row[c]
    fill = row[:-1].copy()
    other = np.empty(row[count], np.int32)
    first = np.empty(row[count], np.int32)
    second = np.empty(row[count], np.int32)
    for i in range(len(start) - 1):
        for k in range(start[i], start[i + 1]):
            for j in range(k + 1, start[i + 1]):
                a, b = (k, j) if cluster[k] < cluster[j] else (j, k)
                at = fill[cluster[a]]
                fill[cluster[a]] += 1
                other[at], first[at], second[at] = cluster[b], a, b
    return row, other, first, second


@njit(cache=True, nogil=True)
def _moments(row, other, first, second, place):  # type: ignore[no-untyped-def]
    pairs = np.empty((len(other), 2), np.int32)
    number = np.zeros(len(other))
    sums = np.zeros((len(other), 2), np.complex128)
    squares = np.zeros((len(other), 2))
    product = np.zeros(len(other), np.complex128)
    total = 0
    for a in range(len(row) - 1):
        begin = total
        for at in range(row[a], row[a + 1]):
            j = begin
            while j < total and pairs[j, 1] != other[at]:
                j += 1
            if j == total:
                pairs[j, 0], pairs[j, 1] = a, other[at]
                total += 1
            za, zb = place[first[at]], place[second[at]]
            number[j] += 1
            sums[j, 0] += za
            sums[j, 1] += zb
            squares[j, 0] += za.real**2 + za.imag**2
            squares[j, 1] += zb.real**2 + zb.imag**2
            product[j] += za.conjugate() * zb
    return (
        pairs[:total].copy(),
        number[:total].copy(),
        sums[:total].copy(),
        squares[:total].copy(),
        product[:total].copy(),
    )


@njit(cache=True, nogil=True)
def _chain(count, pairs, number, sums, squares, product, order):  # type: ignore[no-untyped-def]
    """First frames: joints are made good one by one, the surest first, each moving the smaller of two groups.

    ClusterConstraints between clusters that already hang together are passed over, so this is a walk along the maximum
    spanning tree.
    """
    rho = np.ones(count, np.complex128)
    tau = np.zeros(count, np.complex128)
    group = np.arange(count).astype(np.int32)
    size = np.ones(count, np.int32)
    following = np.full(count, -1, np.int32)  # clusters of a group form a list that begins with its number
    last = np.arange(count)
    for j in order:
        a, b = pairs[j, 0], pairs[j, 1]
        ga, gb = group[a], group[b]
        if ga == gb:
            continue
        middle_a, middle_b = sums[j, 0] / number[j], sums[j, 1] / number[j]
        product_about_middle = product[j] - number[j] * middle_a.conjugate() * middle_b
        if size[ga] < size[gb]:
            a, b, ga, gb = b, a, gb, ga
            middle_a, middle_b = middle_b, middle_a
            product_about_middle = product_about_middle.conjugate()
        turn = 1.0 + 0j
        if abs(product_about_middle) > 0.0:
            turn = rho[a] * product_about_middle.conjugate() / abs(product_about_middle) / rho[b]
        shift = rho[a] * middle_a + tau[a] - turn * (rho[b] * middle_b + tau[b])
        c = gb
        while c >= 0:
            rho[c] *= turn
            tau[c] = turn * tau[c] + shift
            group[c] = ga
            c = following[c]
        following[last[ga]] = gb
        last[ga] = last[gb]
        size[ga] += size[gb]
    return rho, tau, group


def _gauss_newton_step(joints: ClusterConstraints, rho: Complex, tau: Complex, roots: Ints) -> tuple[Floats, Complex]:
    """One step on E for all turns and shifts together; the roots, one cluster of each piece, stay where they are."""
    count = len(rho)
    blocks, gradient = _normal_equations(*joints, rho, tau)
    a, b = joints.pairs.T
    rows, columns = np.concatenate([np.arange(count), a, b]), np.concatenate([np.arange(count), b, a])
    diagonal = blocks[:count, [0, 1, 2], [0, 1, 2]]
    greatest = np.where(diagonal.max(0) > 0, diagonal.max(0), 1.0)
    diagonal += HINGED * greatest
    diagonal[roots] += greatest
    blocks[:count, [0, 1, 2], [0, 1, 2]] = diagonal
    matrix = _block_matrix(rows, columns, blocks, count)
    step = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    solution = step.solve(-gradient.ravel()).reshape(-1, 3)
    return solution[:, 0], solution[:, 1] + 1j * solution[:, 2]


def _block_matrix(rows: Ints, columns: Ints, blocks: Floats, count: int) -> csc_array:
    """Sparse matrix of 3 x 3 blocks."""
    order = np.lexsort((columns, rows))
    start = np.searchsorted(rows[order], np.arange(count + 1))
    return bsr_array((blocks[order], columns[order], start), shape=(3 * count, 3 * count)).tocsc()


@njit(cache=True, nogil=True)
def _normal_equations(pairs, number, sums, squares, product, rho, tau):  # type: ignore[no-untyped-def]
    """Gauss-Newton blocks over (theta, tau_x, tau_y): on the diagonal first, then (a, b), then (b, a); the gradient.

    With A = rho_a z_a, B = rho_b z_b the residual r = A + tau_a - B - tau_b changes by
    iA dtheta_a + dtau_a - iB dtheta_b - dtau_b.
    """
    count, joints = len(rho), len(pairs)
    blocks = np.zeros((count + 2 * joints, 3, 3))
    gradient = np.zeros((count, 3))
    for j in range(joints):
        a, b, n = pairs[j, 0], pairs[j, 1], number[j]
        sum_a, sum_b = rho[a] * sums[j, 0], rho[b] * sums[j, 1]
        ab = rho[a].conjugate() * rho[b] * product[j]
        apart = tau[a] - tau[b]
        for c, s, q in ((a, sum_a, squares[j, 0]), (b, sum_b, squares[j, 1])):
            block = blocks[c]
            block[0, 0] += q
            block[0, 1] -= s.imag
            block[1, 0] -= s.imag
            block[0, 2] += s.real
            block[2, 0] += s.real
            block[1, 1] += n
            block[2, 2] += n
        block = blocks[count + j]
        block[0, 0] = -ab.real
        block[0, 1], block[0, 2] = sum_a.imag, -sum_a.real
        block[1, 0], block[2, 0] = sum_b.imag, -sum_b.real
        block[1, 1] = block[2, 2] = -n
        for p in range(3):
            for q in range(3):
                blocks[count + joints + j, p, q] = block[q, p]
        gradient[a, 0] += (sum_a.conjugate() * apart).imag - ab.imag
        gradient[b, 0] -= (sum_b.conjugate() * apart).imag - ab.imag
        total = sum_a - sum_b + n * apart
        gradient[a, 1] += total.real
        gradient[a, 2] += total.imag
        gradient[b, 1] -= total.real
        gradient[b, 2] -= total.imag
    return blocks, gradient


@njit(cache=True, nogil=True)
def _average_copies(start, cluster, place, rho, tau, xy):  # type: ignore[no-untyped-def]
    for i in range(len(xy)):
        total = 0j
        for k in range(start[i], start[i + 1]):
            total += rho[cluster[k]] * place[k] + tau[cluster[k]]
        copies = start[i + 1] - start[i]
        xy[i, 0] = total.real / copies
        xy[i, 1] = total.imag / copies
