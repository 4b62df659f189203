"""Plane curves with exact arc length from their slope angle."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

from planish.types import Floats

PANEL_MM = 1.0
"""Length of a quadrature panel."""

NODES, WEIGHTS = np.polynomial.legendre.leggauss(4)
"""Gauss-Legendre rule, exact to degree 7: within 1e-11 mm per panel, even at a radius of half a millimetre."""


def curve_of_angle(
    angle: Callable[[Floats], Floats], length_mm: float, creases: Sequence[float] = ()
) -> Callable[[Floats], Floats]:
    """Integrate a slope angle to a curve, C(s) = integral of (cos angle, sin angle) ds.

    Parameters
    ----------
    angle : callable
        (k,) arc length [mm] -> (k,) angle to the horizontal [rad]; smooth between creases.
    length_mm : float
    creases : sequence of float [mm]
        Where the angle jumps.

    Returns
    -------
    callable
        (k,) arc length [mm] -> (k, 2) horizontal position and height [mm]; extends beyond both ends.

    Examples
    --------
    >>> quarter = curve_of_angle(lambda s: s / 10, 10 * np.pi / 2)
    >>> quarter(np.array([10 * np.pi / 2])).round(9)
    array([[10., 10.]])
    """
    ends = np.array([0.0, *sorted(creases), length_mm])
    pieces = [np.linspace(a, b, 2 + int((b - a) / PANEL_MM)) for a, b in pairwise(ends)]
    knots = np.unique(np.concatenate(pieces))

    def stretch(start: Floats, stop: Floats) -> Floats:
        half = (stop - start) / 2
        at = angle((start + half)[:, None] + half[:, None] * NODES)
        return half[:, None] * np.stack([np.cos(at) @ WEIGHTS, np.sin(at) @ WEIGHTS], axis=1)

    at_knots = np.concatenate([np.zeros((1, 2)), np.cumsum(stretch(knots[:-1], knots[1:]), axis=0)])

    def curve(s: Floats) -> Floats:
        panel = np.clip(np.searchsorted(knots, s, side="right") - 1, 0, len(knots) - 2)
        result: Floats = at_knots[panel] + stretch(knots[panel], s)
        return result

    return curve
