"""Penalties on faces that lie on the page with next to no area, or with their back up, and on edges strained too much.

    P(x) = MU h^2 * sum over faces with s < 1 of (1 - s)^2,    s = A(x) / (SHARE A0)

with the signed area A of a face on the page, A0 the area that its edges give it and h a length of the mesh's edges.
Sticks alone do not tell a face from its mirror image; this does, and it stays finite where a face is turned over, so
that faces can be turned back by the same descent that brings the sticks to rest.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from planish.types import Floats, Ints

SHARE = 0.2
"""Part of its area below which a face is pushed open. With 0.1 and MU = 0.1 a face of 17,000 points keeps 9 flips and a
mask 4, with 0.2 they keep 62 and 18; with MU = 1 none."""

MU = 1.0
"""Weight of the penalty. With 0.1 the face keeps 62 flips and 12.8 % of strain, with 1 no flip and 13.8 %, with 10 no
flip and 14.6 %."""

STIFF = 10.0
"""How much stiffer than others edges are, beyond the strain that they may have. With 1 the worst edge of a mask is
strained by 163 %, with 10 by 80, with 100 by 65 at the price of
0.9 % more strain on the whole."""


def add_area_penalty(xy: Floats, faces: Ints, areas: Floats, scale: float, gradient: Floats) -> float:
    """The penalty; its gradient is added to (n, 2) `gradient`.

    Parameters
    ----------
    xy : (n, 2) float64 [mm]
        x right, y up.
    faces : (m, 3) int32
        Counter-clockwise seen from the printed side.
    areas : (m,) float64 [mm^2]
        A0; faces with 0 are left out.
    scale : float [mm^2]
        h^2.
    """
    return float(_add_penalty(xy, faces, areas, MU * scale, gradient))


@njit(cache=True, nogil=True)
def _add_penalty(xy, faces, areas, weight, gradient):  # type: ignore[no-untyped-def]
    total = 0.0
    for f in range(len(faces)):
        if areas[f] <= 0.0:
            continue
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        area = 0.5 * (xy[j, 0] - xy[i, 0]) * (xy[k, 1] - xy[i, 1])
        area -= 0.5 * (xy[k, 0] - xy[i, 0]) * (xy[j, 1] - xy[i, 1])
        lacking = 1.0 - area / (SHARE * areas[f])
        if lacking <= 0.0:
            continue
        total += weight * lacking * lacking
        push = -weight * lacking / (SHARE * areas[f])  # dP/dA, halved as dA/dx is half the opposite edge, turned
        gradient[i, 0] += push * (xy[j, 1] - xy[k, 1])
        gradient[i, 1] += push * (xy[k, 0] - xy[j, 0])
        gradient[j, 0] += push * (xy[k, 1] - xy[i, 1])
        gradient[j, 1] += push * (xy[i, 0] - xy[k, 0])
        gradient[k, 0] += push * (xy[i, 1] - xy[j, 1])
        gradient[k, 1] += push * (xy[j, 0] - xy[i, 0])
    return total


def add_stretch_penalty(xy: Floats, pairs: Ints, rest: Floats, weight: Floats, most: float, gradient: Floats) -> float:
    """A penalty on edges strained by more than `most`; its gradient is added to (n, 2) `gradient`.

        P(x) = STIFF / 2 * sum over edges with |l / r - 1| > most of w (l - (1 +- most) r)^2

    Parameters
    ----------
    xy : (n, 2) float64 [mm]
    pairs : (e, 2) int32
    rest : (e,) float64 [mm]
        Lengths r; edges with 0 are left out.
    weight : (e,) float64
        Of the edges' own energy.
    most : float
    """
    return float(_add_stretch(xy, pairs, rest, weight, most, gradient))


@njit(cache=True, nogil=True)
def _add_stretch(xy, pairs, rest, weight, most, gradient):  # type: ignore[no-untyped-def]
    total = 0.0
    for s in range(len(pairs)):
        i, j = pairs[s, 0], pairs[s, 1]
        dx, dy = xy[j, 0] - xy[i, 0], xy[j, 1] - xy[i, 1]
        length = np.sqrt(dx * dx + dy * dy)
        beyond = max(length - (1.0 + most) * rest[s], 0.0) + min(length - (1.0 - most) * rest[s], 0.0)
        if rest[s] <= 0.0 or length <= 0.0 or beyond == 0.0:
            continue
        total += 0.5 * STIFF * weight[s] * beyond * beyond
        pull = STIFF * weight[s] * beyond / length
        gradient[i, 0] -= pull * dx
        gradient[i, 1] -= pull * dy
        gradient[j, 0] += pull * dx
        gradient[j, 1] += pull * dy
    return total
