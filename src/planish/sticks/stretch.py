"""Stretch of a page over the surface that it was laid flat from."""

from __future__ import annotations

import numpy as np
from numba import njit

from planish.mesh.measures import LEAST_HEIGHT, relative_height
from planish.types import Floats, Ints


def stretch(points: Floats, faces: Ints, page_xy: Floats) -> tuple[float, float]:
    """Sander's stretch of the page over the surface: L2 (mean) and L-infinity (greatest); 1 is perfect.

    G and g, the singular values of each face's map from page to surface, give L2 = sqrt(mean of (G^2 + g^2) / 2
    weighted by the surface) and Linf = max G (Sander et al. 2001, eq. 2 and 3). Their scaling by the two areas is
    left out: here both are millimetres, and a page of the wrong size must show. Faces whose page place has no area
    have infinite stretch in principle; they are flips, counted by `flipped_faces`, and left out. So are faces without
    area on the surface (`planish.mesh.LEAST_HEIGHT`): where a needle or a cap lies on the page is a matter of errors
    much smaller than its sides, and its stretch would say nothing about the page.

    Parameters
    ----------
    points : (n, 3) float64 [mm]
    faces : (m, 3) int32
    page_xy : (n, 2) float64 [mm]
    """
    a, b, c = (points[faces[:, k]] for k in range(3))
    return _of_sides(np.stack([((q - p) ** 2).sum(axis=1) for p, q in ((a, b), (b, c), (c, a))], 1), faces, page_xy)


def stretch_over_lengths(lengths: Floats, face_edges: Ints, faces: Ints, page_xy: Floats) -> tuple[float, float]:
    """The same over a surface of which only the lengths of the edges are known, such as rest lengths without noise.

    Three lengths are a triangle, so they are all that stretch depends on. Faces whose lengths close to none are left
    out.

    Parameters
    ----------
    lengths : (e,) float64 [mm]
    face_edges : (m, 3) int32
        See `planish.mesh.Topology`: of corners 0 and 1, 1 and 2, 2 and 0.
    faces : (m, 3) int32
    page_xy : (n, 2) float64 [mm]

    Examples
    --------
    A right triangle with sides 3, 4, 5, drawn twice as large:

    >>> page = np.array([[0.0, 0.0], [6.0, 0.0], [0.0, 8.0]])
    >>> one = np.array([[0, 1, 2]], np.int32)
    >>> stretch_over_lengths(np.array([3.0, 5.0, 4.0]), one, one, page)
    (0.5, 0.5)
    """
    return _of_sides(lengths[face_edges] ** 2, faces, page_xy)


def _of_sides(squares: Floats, faces: Ints, page_xy: Floats) -> tuple[float, float]:
    l2, linf = _stretch(squares, faces, page_xy)
    return float(l2), float(linf)


@njit(cache=True)
def _stretch(squares, faces, page_xy):  # type: ignore[no-untyped-def]
    """`squares`: the squared sides of every face, of corners 0 and 1, 1 and 2, 2 and 0."""
    total, surface, greatest = 0.0, 0.0, 0.0
    mean_area = 0.0
    for f in range(len(faces)):
        mean_area += abs(_twice_area(page_xy, faces, f)) / (2 * len(faces))
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        twice = _twice_area(page_xy, faces, f)
        uu, vv = squares[f, 0], squares[f, 2]
        height = relative_height(np.sqrt(uu), np.sqrt(squares[f, 1]), np.sqrt(vv))
        if abs(twice) <= 2e-6 * mean_area or height < LEAST_HEIGHT:
            continue
        uv = 0.5 * (uu + vv - squares[f, 1])  # of the two sides at corner 0, by the law of cosines
        px, py = page_xy[b, 0] - page_xy[a, 0], page_xy[b, 1] - page_xy[a, 1]
        qx, qy = page_xy[c, 0] - page_xy[a, 0], page_xy[c, 1] - page_xy[a, 1]
        # Products of the surface's partial derivatives: along x (u qy - v py) / twice, along y (v px - u qx) / twice.
        xx = (uu * qy * qy - 2.0 * uv * qy * py + vv * py * py) / twice**2
        xy = (uv * (qy * px + py * qx) - uu * qy * qx - vv * py * px) / twice**2
        yy = (vv * px * px - 2.0 * uv * px * qx + uu * qx * qx) / twice**2
        area = 0.5 * abs(twice) * np.sqrt(max(xx * yy - xy * xy, 0.0))  # of the face on the surface
        total += area * 0.5 * (xx + yy)
        surface += area
        greatest = max(greatest, np.sqrt(0.5 * (xx + yy + np.sqrt((xx - yy) ** 2 + 4.0 * xy * xy))))
    return (np.sqrt(total / surface), greatest) if surface > 0.0 else (np.inf, np.inf)


@njit(cache=True)
def _twice_area(page_xy, faces, f):  # type: ignore[no-untyped-def]
    a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
    abx, aby = page_xy[b, 0] - page_xy[a, 0], page_xy[b, 1] - page_xy[a, 1]
    acx, acy = page_xy[c, 0] - page_xy[a, 0], page_xy[c, 1] - page_xy[a, 1]
    return abx * acy - acx * aby
