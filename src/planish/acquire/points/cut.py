"""The sheet cut out of a meshed scene by what its photo shows; what that does not see goes with its surroundings."""

from __future__ import annotations

import cv2
import numpy as np
from scipy import ndimage, sparse

from planish.acquire.range_image.depth import on_white
from planish.errors import InputError
from planish.geometry import depths, project
from planish.mesh import rasterize, without_small_components
from planish.types import Bools, Camera, Floats, Mesh

MOSTLY = 0.5
"""A piece belongs to the sheet if at least this part of its points is seen, and seen on the sheet."""

STEEP_PX = 2.0
"""A point is not hidden by what lies before it by less than so many pixels' width: a slope covers itself."""


def cut_out(mesh: Mesh, camera: Camera, sheet: Bools, rim_mm: float, noise_mm: float) -> Mesh:
    """Take out what a photo sees beside the sheet, and pieces that it does not see.

    What hides behind the sheet, as the table under a fold, is not seen at all: it stays only if it hangs together with
    a piece most of which is seen on the sheet.

    Parameters
    ----------
    mesh : Mesh
    camera : Camera
    sheet : (h, w) bool
        Where on its photo the sheet is.
    rim_mm : float
        So much of the sheet's border is left out, where a mesh of points runs down to the table.
    noise_mm : float
        By which the points may be off.

    Raises
    ------
    InputError
        If nothing is left.
    """
    xy = project(camera, mesh.points)
    seen = _seen(mesh, camera, xy, rim_mm + 3 * noise_mm)
    rim_px = 2 * round(rim_mm * camera.matrix[0, 0] / float(np.median(depths(camera, mesh.points)))) + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (rim_px, rim_px))
    on = on_white(xy, cv2.erode(sheet.astype(np.uint8), disc).astype(bool))
    faces = mesh.faces[~(seen & ~on)[mesh.faces].any(axis=1)]
    ends = np.concatenate([faces[:, :2], faces[:, 1:]])
    links = sparse.coo_matrix((np.ones(len(ends), bool), tuple(ends.T)), shape=(len(xy), len(xy)))
    count, piece = sparse.csgraph.connected_components(links, directed=False)
    share = np.bincount(piece, seen & on, count) / np.bincount(piece, minlength=count)
    faces = faces[share[piece[faces[:, 0]]] >= MOSTLY]
    if not len(faces):
        raise InputError(
            "none of the points lie on the sheet that the photo shows; do photo, camera, mask and points belong "
            "together?"
        )
    used, faces = without_small_components(faces, len(xy))
    return Mesh(mesh.points[used], faces)


def _seen(mesh: Mesh, camera: Camera, xy: Floats, reach_mm: float) -> Bools:
    """Which points of a mesh have nothing before them."""
    depth = depths(camera, mesh.points)
    face, weights = rasterize(xy, mesh.faces, camera.shape_rc, nearness=1 / depth, perspective=True)
    drawn = np.full(face.shape, np.inf)
    row, col = np.nonzero(face >= 0)
    w = weights[row, col].astype(np.float64)
    drawn[row, col] = (np.column_stack([1 - w.sum(axis=1), w]) * depth[mesh.faces[face[row, col]]]).sum(axis=1)
    farthest = ndimage.maximum_filter(drawn, 3)
    inside = on_white(xy, np.ones(face.shape, bool))
    at_col, at_row = np.rint(xy[inside]).astype(int).T
    seen = np.ones(len(xy), bool)
    pixel_mm = depth[inside] / camera.matrix[0, 0]
    seen[inside] = depth[inside] <= farthest[at_row, at_col] + reach_mm + STEEP_PX * pixel_mm
    return seen
