"""Crop a meshed scene to the sheet by its photo; hidden parts follow their visible surroundings."""

from __future__ import annotations

import cv2
import numpy as np
from scipy import ndimage, sparse

from planish.acquire.range_image.depth import inside_mask
from planish.errors import InputError
from planish.geometry import depths, project
from planish.mesh import rasterize, without_small_components
from planish.types import Bools, Camera, Floats, Mesh

MIN_SHARE = 0.5
"""Least share of visible points on the sheet of a component that is kept."""

STEEP_PX = 2.0
"""Depth tolerance of the visibility test, in pixel widths, for steep surfaces."""


def crop_to_sheet(mesh: Mesh, camera: Camera, sheet: Bools, rim_mm: float, noise_mm: float) -> Mesh:
    """Remove what the photo shows outside of the sheet, and components that it does not show.

    Hidden parts, such as the table under a fold, are kept only if they are connected to a component that is mostly
    visible on the sheet.

    Parameters
    ----------
    mesh : Mesh
    camera : Camera
    sheet : (h, w) bool
        Mask of the sheet on the photo.
    rim_mm : float
        Width of the removed rim, where the mesh bends down to the table.
    noise_mm : float
        Standard deviation of the points.

    Raises
    ------
    InputError
        If nothing remains.
    """
    xy = project(camera, mesh.points)
    visible = _visible(mesh, camera, xy, rim_mm + 3 * noise_mm)
    rim_px = 2 * round(rim_mm * camera.matrix[0, 0] / float(np.median(depths(camera, mesh.points)))) + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (rim_px, rim_px))
    on_sheet = inside_mask(xy, cv2.erode(sheet.astype(np.uint8), disc).astype(bool))
    faces = mesh.faces[~(visible & ~on_sheet)[mesh.faces].any(axis=1)]
    ends = np.concatenate([faces[:, :2], faces[:, 1:]])
    links = sparse.coo_matrix((np.ones(len(ends), bool), tuple(ends.T)), shape=(len(xy), len(xy)))
    count, piece = sparse.csgraph.connected_components(links, directed=False)
    share = np.bincount(piece, visible & on_sheet, count) / np.bincount(piece, minlength=count)
    faces = faces[share[piece[faces[:, 0]]] >= MIN_SHARE]
    if not len(faces):
        raise InputError(
            "none of the points lie on the sheet that the photo shows; do photo, camera, mask and points belong "
            "together?"
        )
    used, faces = without_small_components(faces, len(xy))
    return Mesh.owned(mesh.points[used], faces)


def _visible(mesh: Mesh, camera: Camera, xy: Floats, reach_mm: float) -> Bools:
    """Which points of a mesh are not occluded."""
    depth = depths(camera, mesh.points)
    face, weights = rasterize(xy, mesh.faces, camera.shape_rc, nearness=1 / depth, perspective=True)
    rendered_depth = np.full(face.shape, np.inf)
    row, col = np.nonzero(face >= 0)
    w = weights[row, col].astype(np.float64)
    rendered_depth[row, col] = (np.column_stack([1 - w.sum(axis=1), w]) * depth[mesh.faces[face[row, col]]]).sum(axis=1)
    farthest = ndimage.maximum_filter(rendered_depth, 3)
    inside = inside_mask(xy, np.ones(face.shape, bool))
    col_of, row_of = np.rint(xy[inside]).astype(int).T
    visible = np.ones(len(xy), bool)
    pixel_mm = depth[inside] / camera.matrix[0, 0]
    visible[inside] = depth[inside] <= farthest[row_of, col_of] + reach_mm + STEEP_PX * pixel_mm
    return visible
