"""Directions: axes across a direction, and the principal axes of a set of points."""

from __future__ import annotations

import numpy as np

from planish.types import Floats


def perpendicular_axes(direction: Floats) -> Floats:
    """Complete a direction (3,) to an orthogonal frame: two unit vectors (2, 3) across it and each other.

    Examples
    --------
    >>> np.abs(perpendicular_axes(np.array([0.0, 0, 2])) @ [0, 0, 1]).max() < 1e-12
    np.True_
    """
    return np.asarray(np.linalg.svd(direction[None])[2][1:])


def principal_axes(points: Floats) -> tuple[Floats, Floats]:
    """Find the directions of greatest spread of points (n, 3), by singular values of their deviations.

    Returns
    -------
    axes : (3, 3) float64
        Unit vectors, from the longest extent to the thinnest; the last is the normal of the best-fitting plane.
    spread : (3,) float64
        Root of the sum of squared deviations along each.

    Examples
    --------
    >>> axes, spread = principal_axes(np.array([[0.0, 0, 5], [10, 0, 5], [0, 1, 5], [10, 1, 5]]))
    >>> np.abs(axes).round(9).argmax(axis=1), spread.round(9)
    (array([0, 1, 2]), array([10.,  1.,  0.]))
    """
    _, spread, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    return axes, spread
