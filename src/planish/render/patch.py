"""Curved pieces of a coarse mesh, so that lines drawn over it do not kink at its edges."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from planish.types import Floats, Ints

PULL = 1e-10
"""Of a quadratic to flatness, against neighbours at weight 1 or more."""


def refine(page_xy: Floats, values: Floats, faces: Ints, pieces: int) -> tuple[Floats, Floats, Ints]:
    """Cut every face into pieces**2 and interpolate what the points carry over the page, smoothly.

    Around each point i a quadratic q_i runs through its value and as near as it can to those of its two rings.
    Inside a face the three are blended by b_i = w_i^2 / (w_0^2 + w_1^2 + w_2^2), w the barycentric weights: exact at
    the points, without kinks at the edges (b_i and its slope vanish on the edge opposite i), and exact where the
    values are quadratic in the page.

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
    >>> bool(np.allclose(squared[:, 0], fine[:, 0] ** 2))
    True
    """
    quadratics = _quadratics(page_xy, values, *_rings(faces, len(page_xy)))
    weights, small = _grid_of(pieces)
    fine, carried = _blend(page_xy, values, quadratics, faces, weights)
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


@njit(cache=True, parallel=True)
def _quadratics(page, values, start, ring):  # type: ignore[no-untyped-def]
    """(n, 5, d): slopes in x and y, then the terms of x^2, xy, y^2; weights fall off as 1 / distance^2.

    A plane is fitted first and the quadratic to what it leaves, so that a flat map stays exactly flat.
    """
    d = values.shape[1]
    found = np.zeros((len(page), 5, d))
    for i in prange(len(page)):
        near = ring[start[i] : start[i + 1]]
        reach = 0.0
        for j in near:
            reach = max(reach, np.hypot(page[j, 0] - page[i, 0], page[j, 1] - page[i, 1]))
        if reach == 0:
            continue
        terms, left = np.empty((len(near), 5)), np.empty((len(near), d))
        for k in range(len(near)):
            j = near[k]
            x, y = (page[j, 0] - page[i, 0]) / reach, (page[j, 1] - page[i, 1]) / reach
            terms[k, 0], terms[k, 1], terms[k, 2], terms[k, 3], terms[k, 4] = x, y, x * x, x * y, y * y
            for s in range(d):
                left[k, s] = values[j, s] - values[i, s]
        plane = _fitted(terms, left, 2)
        for k in range(len(near)):
            for s in range(d):
                left[k, s] -= terms[k, 0] * plane[0, s] + terms[k, 1] * plane[1, s]
        more = _fitted(terms, left, 5)
        for s in range(d):
            for r in range(5):
                plain = plane[r, s] if r < 2 else 0.0
                found[i, r, s] = (plain + more[r, s]) / (reach if r < 2 else reach * reach)
    return found


@njit(cache=True)
def _fitted(terms, values, count):  # type: ignore[no-untyped-def]
    """Weighted least squares by the first terms; a little pull to zero decides what too few neighbours leave open."""
    d = values.shape[1]
    left, right = PULL * np.eye(count), np.zeros((count, d))
    for k in range(len(terms)):
        square = terms[k, 0] ** 2 + terms[k, 1] ** 2
        weight = 1 / square if square > 0 else 0.0  # the point itself is met exactly, whatever the slopes
        for r in range(count):
            for s in range(count):
                left[r, s] += weight * terms[k, r] * terms[k, s]
            for s in range(d):
                right[r, s] += weight * terms[k, r] * values[k, s]
    return np.linalg.solve(left, right)


@njit(cache=True, parallel=True)
def _blend(page, values, quadratics, faces, weights):  # type: ignore[no-untyped-def]
    k, d = len(weights), values.shape[1]
    fine, carried = np.empty((len(faces), k, 2)), np.zeros((len(faces), k, d))
    for f in prange(len(faces)):
        for p in range(k):
            w = weights[p]
            total = w[0] ** 2 + w[1] ** 2 + w[2] ** 2
            x0, y0 = 0.0, 0.0
            for c in range(3):
                x0 += w[c] * page[faces[f, c], 0]
                y0 += w[c] * page[faces[f, c], 1]
            fine[f, p, 0], fine[f, p, 1] = x0, y0
            for c in range(3):
                i = faces[f, c]
                x, y, q, b = x0 - page[i, 0], y0 - page[i, 1], quadratics[i], w[c] ** 2 / total
                for s in range(d):
                    bend = q[2, s] * x * x + q[3, s] * x * y + q[4, s] * y * y
                    carried[f, p, s] += b * (values[i, s] + q[0, s] * x + q[1, s] * y + bend)
    return fine, carried
