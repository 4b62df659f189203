"""Fidelity of a flattening: stretch and flipped faces."""

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
    l2, linf = _stretch(points, faces, page_xy)
    return float(l2), float(linf)


@njit(cache=True)
def _stretch(points, faces, page_xy):  # type: ignore[no-untyped-def]
    total, surface, greatest = 0.0, 0.0, 0.0
    mean_area = 0.0
    for f in range(len(faces)):
        mean_area += abs(_signed_area(page_xy, faces, f)) / len(faces)
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        twice = 2.0 * _signed_area(page_xy, faces, f)
        if abs(twice) <= 1e-6 * mean_area or not _has_area(points, faces, f, 0.0):
            continue
        xx, xy, yy = 0.0, 0.0, 0.0  # products of the surface's partial derivatives along page x and y
        for k in range(3):
            u, v = points[b, k] - points[a, k], points[c, k] - points[a, k]
            dx = (u * (page_xy[c, 1] - page_xy[a, 1]) - v * (page_xy[b, 1] - page_xy[a, 1])) / twice
            dy = (v * (page_xy[b, 0] - page_xy[a, 0]) - u * (page_xy[c, 0] - page_xy[a, 0])) / twice
            xx, xy, yy = xx + dx * dx, xy + dx * dy, yy + dy * dy
        area = 0.5 * abs(twice) * np.sqrt(max(xx * yy - xy * xy, 0.0))  # of the face on the surface
        total += area * 0.5 * (xx + yy)
        surface += area
        greatest = max(greatest, np.sqrt(0.5 * (xx + yy + np.sqrt((xx - yy) ** 2 + 4.0 * xy * xy))))
    return (np.sqrt(total / surface), greatest) if surface > 0.0 else (np.inf, np.inf)


def flipped_faces(faces: Ints, page_xy: Floats, points: Floats | None = None, thin_mm: float = 0.0) -> int:
    """Count faces that lie on the page with their back up (or without area).

    Parameters
    ----------
    faces : (m, 3) int32
    page_xy : (n, 2) float64 [mm]
    points : (n, 3) float64 [mm], optional
        Of the surface. Faces without area there (`planish.mesh.LEAST_HEIGHT`) may lie either way up and do not count.
    thin_mm : float
        Nor do faces that are less high there over their longest side, as noise may have turned them.

    Examples
    --------
    A triangle, and a cap of 179 degrees; both lie with their back up.

    >>> points = np.array([[0.0, 0, 0], [4, 0, 0], [0, 3, 0], [2, -0.01, 0]])
    >>> faces, page = np.array([[0, 1, 2], [0, 3, 1]]), points[:, :2]
    >>> flipped_faces(faces, page), flipped_faces(faces, page, points)
    (2, 1)
    """
    return int(_flipped(faces, page_xy, np.zeros((0, 3)) if points is None else points, thin_mm))


@njit(cache=True)
def _flipped(faces, page_xy, points, thin_mm):  # type: ignore[no-untyped-def]
    count = 0
    for f in range(len(faces)):
        back_up = _signed_area(page_xy, faces, f) >= 0.0  # negative shows the printed side, as y runs down
        if back_up and (len(points) == 0 or _has_area(points, faces, f, thin_mm)):
            count += 1
    return count


@njit(cache=True)
def _has_area(points, faces, f, thin_mm):  # type: ignore[no-untyped-def]
    a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
    ab, bc, ca = 0.0, 0.0, 0.0
    for k in range(3):
        ab += (points[b, k] - points[a, k]) ** 2
        bc += (points[c, k] - points[b, k]) ** 2
        ca += (points[a, k] - points[c, k]) ** 2
    height = relative_height(np.sqrt(ab), np.sqrt(bc), np.sqrt(ca))
    return height >= LEAST_HEIGHT and height * np.sqrt(max(ab, bc, ca)) >= thin_mm


@njit(cache=True)
def _signed_area(page_xy, faces, f):  # type: ignore[no-untyped-def]
    a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
    abx, aby = page_xy[b, 0] - page_xy[a, 0], page_xy[b, 1] - page_xy[a, 1]
    acx, acy = page_xy[c, 0] - page_xy[a, 0], page_xy[c, 1] - page_xy[a, 1]
    return 0.5 * (abx * acy - acx * aby)
