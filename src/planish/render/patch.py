"""Curved pieces of a coarse mesh, so that lines drawn over it do not kink at its edges."""

from __future__ import annotations

import numpy as np
from numba import njit

from planish.geometry.linear import solve_symmetric
from planish.parallel import thread_pool
from planish.types import Floats, Ints

BLOCK = 1024
"""Points or faces that a thread takes at a time."""
PULL = 1e-6
PULL_CUBIC = 1e-3
"""Of a fit's terms to zero, against neighbours at weight 1 or more; of its cubic terms more, so that where neighbours
are few the lower terms explain what they can."""


def refine(page_xy: Floats, values: Floats, faces: Ints, pieces: int) -> tuple[Floats, Floats, Ints]:
    """Cut every face into pieces**2 and interpolate what the points carry over the page, smoothly.

    Around each point i a cubic q_i runs through its value and as near as it can to those of its two rings. Inside a
    face the three are blended by b_i = w_i^2 / (w_0^2 + w_1^2 + w_2^2), w the barycentric weights: exact at the
    points, without kinks at the edges (b_i and its slope vanish on the edge opposite i), and exact where the values
    are quadratic in the page, and all but exact where they are cubic.

    Parameters
    ----------
    page_xy : (n, 2) float64 [mm]
    values : (n, d) float64
    faces : (m, 3) int32
    pieces : int
        Of every edge.

    Returns
    -------
    page_xy : (k, 2) float64 [mm]
    values : (k, d) float64
    faces : (m * pieces**2, 3) int32
        Each face of the input has its own points.

    Examples
    --------
    >>> page = np.array([[x, y] for y in (0.0, 1, 2, 3) for x in (0.0, 1, 2, 3)])
    >>> corner = [i for i in range(11) if i % 4 < 3]
    >>> faces = np.array([[i, i + 4, i + 1] for i in corner] + [[i + 1, i + 4, i + 5] for i in corner], np.int32)
    >>> fine, squared, _ = refine(page, page[:, :1] ** 2, faces, 2)
    >>> bool(np.allclose(squared[:, 0], fine[:, 0] ** 2, atol=1e-3))
    True
    """
    cubics = np.zeros((len(page_xy), 9, values.shape[1]))
    with thread_pool() as parallel_for:
        parallel_for(_cubics, len(page_xy), page_xy, values, *_rings(faces, len(page_xy)), cubics, block=BLOCK)
    weights, small = _grid_of(pieces)
    fine = np.empty((len(faces), len(weights), 2))
    carried = np.zeros((len(faces), len(weights), values.shape[1]))
    with thread_pool() as parallel_for:
        parallel_for(_blend, len(faces), page_xy, values, cubics, faces, weights, fine, carried, block=BLOCK)
    first = np.arange(len(faces), dtype=np.int32) * len(weights)
    fine_faces = (first[:, None, None] + small[None]).reshape(-1, 3)
    return fine.reshape(-1, 2), carried.reshape(-1, values.shape[1]), fine_faces.astype(np.int32)


def _grid_of(pieces: int) -> tuple[Floats, Ints]:
    """Barycentric weights (k, 3) of the points of a cut triangle, and its small faces, turned as the whole is."""
    place: dict[tuple[int, int], int] = {}
    for i in range(pieces + 1):
        for j in range(pieces + 1 - i):
            place[i, j] = len(place)
    weights = np.array([[pieces - i - j, i, j] for i, j in place]) / pieces
    upright = [[place[i, j], place[i + 1, j], place[i, j + 1]] for i, j in place if i + j < pieces]
    hanging = [[place[i + 1, j], place[i + 1, j + 1], place[i, j + 1]] for i, j in place if i + j < pieces - 1]
    return weights, np.array(upright + hanging, np.int32)


def _rings(faces: Ints, count: int) -> tuple[Ints, Ints]:
    """Neighbours of each point up to two edges away: rows of `ring` from start[i] to start[i + 1]."""
    from scipy.sparse import csr_matrix

    i, j = faces.ravel(), np.roll(faces, 1, axis=1).ravel()
    ones = np.ones(2 * len(i), np.int8)
    near = csr_matrix((ones, (np.r_[i, j], np.r_[j, i])), shape=(count, count)).astype(bool)
    two = (near.astype(np.int32) @ near.astype(np.int32) + near.astype(np.int32)).tocsr()
    return two.indptr.astype(np.int32), two.indices.astype(np.int32)


@njit(cache=True, nogil=True)
def _cubics(begin, end, page, values, start, ring, found):  # type: ignore[no-untyped-def]
    """Fill in (n, 9, d), factors of the terms of `_terms`; neighbours weigh 1 / distance^2.

    A plane is fitted first and the cubic to what it leaves, so that a flat map stays flat where neighbours are few.
    """
    d = values.shape[1]
    plane, cubic, term = np.empty((2, 2 + d)), np.empty((9, 9 + d)), np.empty(9)
    most = 0
    for i in range(begin, end):
        most = max(most, start[i + 1] - start[i])
    terms, left = np.empty((most, 9)), np.empty((most, d))
    for i in range(begin, end):
        count = start[i + 1] - start[i]
        reach = 0.0
        for k in range(count):
            j = ring[start[i] + k]
            reach = max(reach, np.hypot(page[j, 0] - page[i, 0], page[j, 1] - page[i, 1]))
        if reach == 0:
            continue
        for k in range(count):
            j = ring[start[i] + k]
            _terms((page[j, 0] - page[i, 0]) / reach, (page[j, 1] - page[i, 1]) / reach, terms[k])
            for s in range(d):
                left[k, s] = values[j, s] - values[i, s]
        _fit(terms, left, count, plane)
        for k in range(count):
            for s in range(d):
                left[k, s] -= terms[k, 0] * plane[0, 2 + s] + terms[k, 1] * plane[1, 2 + s]
        _fit(terms, left, count, cubic)
        _terms(1 / reach, 1 / reach, term)
        for r in range(9):
            for s in range(d):
                found[i, r, s] = term[r] * (cubic[r, 9 + s] + (plane[r, 2 + s] if r < 2 else 0.0))


@njit(cache=True)
def _terms(x, y, terms):  # type: ignore[no-untyped-def]
    """Fill in x, y, then the three products of two and the four of three."""
    terms[0], terms[1] = x, y
    terms[2], terms[3], terms[4] = x * x, x * y, y * y
    terms[5], terms[6], terms[7], terms[8] = x * x * x, x * x * y, x * y * y, y * y * y


@njit(cache=True)
def _fit(terms, values, points, system):  # type: ignore[no-untyped-def]
    """Weighted least squares by the first terms; a little pull to zero decides what too few neighbours leave open.

    `system` is (terms, terms + d), and ends with the factors in its last d columns.
    """
    count, d = len(system), values.shape[1]
    for r in range(count):
        for s in range(count + d):
            system[r, s] = 0.0
        system[r, r] = PULL if r < 5 else PULL_CUBIC
    for k in range(points):
        square = terms[k, 0] ** 2 + terms[k, 1] ** 2
        weight = 1 / square if square > 0 else 0.0  # the point itself is met exactly, whatever the slopes
        for r in range(count):
            for s in range(r, count):
                system[r, s] += weight * terms[k, r] * terms[k, s]
            for s in range(d):
                system[r, count + s] += weight * terms[k, r] * values[k, s]
    solve_symmetric(system)


@njit(cache=True, nogil=True)
def _blend(begin, end, page, values, cubics, faces, weights, fine, carried):  # type: ignore[no-untyped-def]
    k, d = len(weights), values.shape[1]
    for f in range(begin, end):
        terms = np.empty(9)
        for p in range(k):
            w = weights[p]
            total = w[0] ** 2 + w[1] ** 2 + w[2] ** 2
            for c in range(2):
                fine[f, p, c] = w[0] * page[faces[f, 0], c] + w[1] * page[faces[f, 1], c] + w[2] * page[faces[f, 2], c]
            for c in range(3):
                i, b = faces[f, c], w[c] ** 2 / total
                _terms(fine[f, p, 0] - page[i, 0], fine[f, p, 1] - page[i, 1], terms)
                for s in range(d):
                    bend = 0.0
                    for r in range(9):
                        bend += cubics[i, r, s] * terms[r]
                    carried[f, p, s] += b * (values[i, s] + bend)
