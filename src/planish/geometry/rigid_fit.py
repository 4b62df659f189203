"""Rotations, rigid motions and similarities that fit one set of points to another by least squares."""

from __future__ import annotations

import numpy as np

from planish.geometry.guards import TINY
from planish.types import Floats


def nearest_rotation(matrix: Floats) -> Floats:
    """Find the rotation nearest to a square matrix in the Frobenius norm (Kabsch 1976; Umeyama 1991).

    Examples
    --------
    >>> nearest_rotation(np.array([[0.0, -2.0], [2.0, 0.1]])).round(3) + 0.0
    array([[ 0.025, -1.   ],
           [ 1.   ,  0.025]])
    """
    return _rotation(matrix)[0]


def fit_rigid(source: Floats, target: Floats) -> tuple[Floats, Floats]:
    """Fit a rotation and a shift: target ~ source @ rotation.T + shift.

    Parameters
    ----------
    source, target : (n, d) float64
        Corresponding points.

    Returns
    -------
    rotation : (d, d) float64
        Never a reflection.
    shift : (d,) float64

    Examples
    --------
    >>> source = np.array([[0.0, 0], [4, 0], [0, 2]])
    >>> rotation, shift = fit_rigid(source, source @ [[0, 1], [-1, 0]] + [5, 5])
    >>> rotation.round(9) + 0.0, shift.round(9)
    (array([[ 0., -1.],
           [ 1.,  0.]]), array([5., 5.]))
    """
    a, b = source.mean(axis=0), target.mean(axis=0)
    rotation = nearest_rotation((target - b).T @ (source - a))
    return rotation, b - rotation @ a


def fit_similarity(source: Floats, target: Floats) -> tuple[Floats, Floats]:
    """Fit a rotation, one scale and a shift: target ~ source @ matrix.T + shift (Umeyama 1991).

    Parameters
    ----------
    source, target : (n, d) float64

    Returns
    -------
    matrix : (d, d) float64
        Scale times rotation.
    shift : (d,) float64

    Examples
    --------
    >>> source = np.array([[0.0, 0], [4, 0], [0, 2]])
    >>> fit_similarity(source, 3 * source + [1, 2])[0].round(9) + 0.0
    array([[3., 0.],
           [0., 3.]])
    """
    middle = source.mean(axis=0), target.mean(axis=0)
    a, b = source - middle[0], target - middle[1]
    rotation, gain = _rotation(b.T @ a)
    matrix = gain / max(float((a**2).sum()), TINY) * rotation
    return matrix, middle[1] - matrix @ middle[0]


def _rotation(matrix: Floats) -> tuple[Floats, float]:
    """The nearest rotation, and the trace of its transpose times the matrix."""
    u, s, vt = np.linalg.svd(matrix)
    sign = np.ones(len(s))
    sign[-1] = 1.0 if np.linalg.det(u @ vt) > 0 else -1.0
    return np.asarray((u * sign) @ vt), float(s @ sign)
