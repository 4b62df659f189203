"""Fidelity of a flattening: flipped faces."""

from __future__ import annotations

import numpy as np
from numba import njit

from planish.mesh.measures import LEAST_HEIGHT, relative_height
from planish.types import Floats, Ints


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
