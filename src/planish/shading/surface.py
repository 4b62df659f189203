"""The sheet's shape under each cell of the page."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planish.mesh import project, rasterise
from planish.shading.cells import Cells
from planish.types import Bools, Floats, Ints, Scan


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


def surface_under(cells: Cells, scan: Scan, page_xy: Floats, normals: NDArray[np.floating[Any]]) -> Surface:
    """Carry points, normals and photo places of a scan to the middles of the cells.

    Parameters
    ----------
    cells : Cells
    scan : Scan
    page_xy : (n, 2) float64 [mm]
    normals : (n, 3) float64
    """
    faces = scan.mesh.faces
    face, w = rasterise(page_xy / cells.mm - 0.5, faces, cells.known.shape)
    corner = faces[np.maximum(face, 0)]
    carried = np.concatenate([scan.mesh.points, normals, _off_axis(scan)[:, None]], axis=1)
    first = carried[corner[..., 0]]
    at = first + w[..., :1] * (carried[corner[..., 1]] - first) + w[..., 1:] * (carried[corner[..., 2]] - first)
    length = np.linalg.norm(at[..., 3:6], axis=2, keepdims=True)
    return Surface(at[..., :3], at[..., 3:6] / np.maximum(length, 1e-9), at[..., 6], (face >= 0) & (length[..., 0] > 0))


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
