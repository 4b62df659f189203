"""Position and normal of the surface at each cell of the page."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planish.geometry import project
from planish.geometry.guards import TINY
from planish.illumination.cells import Cells
from planish.mesh import rasterize
from planish.parallel import thread_pool
from planish.types import Bools, Floats, Ints, Mesh, Scan


@dataclass(frozen=True, eq=False)
class Surface:
    """Where the cells lie in space and how they are turned.

    Attributes
    ----------
    points : (rows, cols, 3) float64 [mm]
    normals : (rows, cols, 3) float64
        Of length 1, away from the printed side.
    off_axis : (rows, cols) float64
        Distance of the cell from the photo's middle, 1 at its corners; 0 where no photo places are known.
    known : (rows, cols) bool
        Where the scan has a surface.
    """

    points: Floats
    normals: Floats
    off_axis: Floats
    known: Bools


def surface_at_pixels(cells: Cells, scan: Scan, page_xy: Floats, normals: NDArray[np.floating[Any]]) -> Surface:
    """Carry points, normals and photo places of a scan to the middles of the cells.

    Parameters
    ----------
    cells : Cells
    scan : Scan
    page_xy : (n, 2) float64 [mm]
    normals : (n, 3) float64
    """
    faces = scan.mesh.faces
    face, w = rasterize(page_xy / cells.mm - 0.5, faces, cells.known.shape)
    at, normal = np.zeros((2, *face.shape, 3))
    off_axis, known = np.zeros(face.shape), np.zeros(face.shape, bool)
    values = scan.mesh.points, normals, _off_axis(scan)
    with thread_pool() as parallel_for:
        parallel_for(_interpolate, len(face), face, w, faces, *values, at, normal, off_axis, known, block=16)
    return Surface(at, normal, off_axis, known)


@njit(cache=True, nogil=True, error_model="numpy")
def _interpolate(  # type: ignore[no-untyped-def]
    first, last, face, w, faces, points, normals, off_axis, at, normal, off, known
):
    for r in range(first, last):
        for q in range(face.shape[1]):
            if face[r, q] < 0:
                continue
            weight = 1.0 - w[r, q, 0] - w[r, q, 1]
            for k in range(3):
                i = faces[face[r, q], k]
                off[r, q] += weight * off_axis[i]
                for d in range(3):
                    at[r, q, d] += weight * points[i, d]
                    normal[r, q, d] += weight * normals[i, d]
                weight = float(w[r, q, min(k, 1)])
            length = math.sqrt(normal[r, q, 0] ** 2 + normal[r, q, 1] ** 2 + normal[r, q, 2] ** 2)
            known[r, q] = length > 0
            for d in range(3):
                normal[r, q, d] /= max(length, TINY)


def coarse_mesh(surface: Surface, step: int) -> Mesh:
    """A mesh of every so many known cells: enough to throw a shadow."""
    some = surface.known[::step, ::step]
    index = np.full(some.shape, -1, np.int32)
    index[some] = np.arange(some.sum())
    a, b, c, d = (k.ravel() for k in (index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]))
    faces = np.concatenate([np.stack([a, c, b], axis=1), np.stack([b, c, d], axis=1)])
    return Mesh.owned(surface.points[::step, ::step][some], faces[(faces >= 0).all(axis=1)])


def _off_axis(scan: Scan) -> Floats:
    """Distance of every point from the photo's middle, 1 at its corners."""
    if scan.photo is None or (scan.photo_xy is None and scan.camera is None):
        return np.zeros(len(scan.mesh.points))
    photo_xy = scan.photo_xy if scan.photo_xy is not None else project(scan.camera, scan.mesh.points)  # type: ignore[arg-type]
    if photo_xy.ndim == 3:
        photo_xy = _at_points(photo_xy, scan.mesh.faces, len(scan.mesh.points))
    middle = (np.array(scan.photo.shape[1::-1]) - 1) / 2
    away = np.linalg.norm(photo_xy - middle, axis=1) / np.linalg.norm(middle)
    return np.where(np.isfinite(away), np.minimum(away, 1.0), 0.0)


def _at_points(corner_xy: Floats, faces: Ints, count: int) -> Floats:
    one = np.zeros((count, 2))
    one[faces.reshape(-1)] = corner_xy.reshape(-1, 2)
    return one
