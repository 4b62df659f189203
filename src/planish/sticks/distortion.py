"""Distortion of every face: how much a page changes area, angles and lengths of the surface that it was laid from."""

from __future__ import annotations

import numpy as np
from numba import njit

from planish.mesh.measures import LEAST_HEIGHT, relative_height
from planish.types import Floats, Ints


def face_distortion(points: Floats, faces: Ints, page_xy: Floats) -> Floats:
    """Changes of area, angles and lengths of every face, from the singular values s >= t of its map to the page.

    * Area: s t - 1.
    * Angle: 2 asin((s - t) / (s + t)) [degrees], the most that an angle between two directions changes (Tissot's
      indicatrix; Snyder 1987, Map Projections, eq. 4-1 and 4-9).
    * Length: s - 1 or t - 1, whichever is larger in size: the greatest change in any direction, with its sign.

    The winding of a face does not count: that a face lies face down is no matter of its measures.

    Parameters
    ----------
    points : (n, 3) float64 [mm]
    faces : (m, 3) int32
    page_xy : (n, 2) float64 [mm]

    Returns
    -------
    (m, 3) float64
        Area, angle [degrees], length; NaN for faces without area (`planish.mesh.LEAST_HEIGHT`).

    Examples
    --------
    A right triangle drawn twice as long in one direction:

    >>> triangle = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    >>> face_distortion(triangle, np.array([[0, 1, 2]], np.int32), triangle[:, :2] * [2.0, 1.0]).round(2).tolist()
    [[1.0, 38.94, 1.0]]
    """
    return np.asarray(_face_distortion(points, faces, page_xy))


@njit(cache=True, nogil=True)
def _face_distortion(points, faces, page_xy):  # type: ignore[no-untyped-def]
    out = np.full((len(faces), 3), np.nan)
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        uu, vv, uv, ww = 0.0, 0.0, 0.0, 0.0
        for d in range(3):
            u, v = points[b, d] - points[a, d], points[c, d] - points[a, d]
            uu, vv, uv, ww = uu + u * u, vv + v * v, uv + u * v, ww + (v - u) ** 2
        # NaN, too, is no height.
        if not relative_height(np.sqrt(uu), np.sqrt(ww), np.sqrt(vv)) >= LEAST_HEIGHT:
            continue
        # Side ab along the first axis of the face's own plane: b = (x1, 0), c = (x2, y2).
        x1 = np.sqrt(uu)
        x2 = uv / x1
        y2 = np.sqrt(max(vv - x2 * x2, 0.0))
        j00, j10 = (page_xy[b, 0] - page_xy[a, 0]) / x1, (page_xy[b, 1] - page_xy[a, 1]) / x1
        j01 = (page_xy[c, 0] - page_xy[a, 0] - j00 * x2) / y2
        j11 = (page_xy[c, 1] - page_xy[a, 1] - j10 * x2) / y2
        # Half the sum and half the difference of the singular values of a matrix of two rows.
        total = 0.5 * np.hypot(j00 + j11, j10 - j01)
        apart = 0.5 * np.hypot(j00 - j11, j10 + j01)
        larger, smaller = max(total, apart), min(total, apart)
        s, t = larger + smaller, larger - smaller
        out[f, 0] = s * t - 1.0
        out[f, 1] = np.degrees(2.0 * np.arcsin(smaller / larger)) if larger > 0.0 else 0.0
        out[f, 2] = s - 1.0 if s - 1.0 >= 1.0 - t else t - 1.0
    return out


def face_strain(xy: Floats, pairs: Ints, rest: Floats, face_edges: Ints) -> Floats:
    """(m,) rms of |l / r - 1| of the three edges of every face against their rest lengths; those of no length count 0.

    Parameters
    ----------
    xy : (n, 2) float64 [mm]
    pairs : (e, 2) int32
    rest : (e,) float64 [mm]
    face_edges : (m, 3) int32
        See `planish.mesh.Topology`.

    Examples
    --------
    >>> page, edges = np.array([[0.0, 0.0], [3.0, 0.0], [0.0, 4.0]]), np.array([[0, 1], [1, 2], [0, 2]])
    >>> face_strain(page, edges, np.array([3.0, 5.0, 2.0]), np.array([[0, 1, 2]])).round(3).tolist()
    [0.577]
    """
    length = np.linalg.norm(xy[pairs[:, 1]] - xy[pairs[:, 0]], axis=1)
    squares = np.where(rest > 0, length / np.where(rest > 0, rest, 1.0) - 1.0, 0.0) ** 2
    return np.asarray(np.sqrt(squares[face_edges].mean(axis=1)))
