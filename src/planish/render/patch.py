"""Curved pieces of a coarse mesh, so that lines drawn over it do not kink at its edges."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from planish.types import Floats, Ints


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
    >>> faces = np.array([[i, i + 4, i + 1] for i in range(11) if i % 4 < 3], np.int32)
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
    place = {}
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
    """(n, 5, d): slopes in x and y, then the terms of x^2, xy, y^2; weights fall off as 1 / distance^2."""
    d = values.shape[1]
    found = np.zeros((len(page), 5, d))
    for i in prange(len(page)):
        left, right = np.zeros((5, 5)), np.zeros((5, d))
        reach, row = 0.0, np.empty(5)
        for k in range(start[i], start[i + 1]):
            reach = max(reach, np.hypot(page[ring[k], 0] - page[i, 0], page[ring[k], 1] - page[i, 1]))
        for k in range(start[i], start[i + 1]):
            j = ring[k]
            if j == i or reach == 0:
                continue
            x, y = (page[j, 0] - page[i, 0]) / reach, (page[j, 1] - page[i, 1]) / reach
            row[0], row[1], row[2], row[3], row[4] = x, y, x * x, x * y, y * y
            weight = 1 / (x * x + y * y + 1e-3)
            for r in range(5):
                for s in range(5):
                    left[r, s] += weight * row[r] * row[s]
                for s in range(d):
                    right[r, s] += weight * row[r] * (values[j, s] - values[i, s])
        for r in range(5):  # a little pull to flatness decides what too few neighbours leave open
            left[r, r] += 1e-9 + (1e-6 if r > 1 else 0.0)
        solved = np.linalg.solve(left, right)
        for s in range(d):
            for r in range(5):
                found[i, r, s] = solved[r, s] / (reach if r < 2 else reach * reach) if reach > 0 else 0.0
    return found


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
