"""A scan as a picture seen straight from above, for meshes whose texture is no single photo of the scene."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from planish.color import to_uint8
from planish.geometry.axes import perpendicular_axes, principal_axes
from planish.geometry.guards import TINY
from planish.mesh import area_vectors, rasterize
from planish.types import Floats, Ints, Pixels, Scan

LONG_PX = 800
"""Long side of the picture: on a table of 600 mm the outline of a sheet is known to half a millimetre."""

PX_PER_POINT = 0.5
"""Pixels for each point of a coarse mesh at least: with fewer, its faces would show as jagged edges."""


@dataclass(frozen=True, eq=False)
class TopView:
    """A mesh seen along the normal of its best-fitting plane.

    Attributes
    ----------
    places : (n, 2) float64 [px]
        Of all points in the picture; NaN for points without finite coordinates.
    face : (rows, cols) int32
        The face at every pixel, -1 for none.
    weights : (rows, cols, 2) float32
        Of its second and third corner.
    right, down : (3,) float64
        Directions in space of columns and rows.
    """

    places: Floats
    face: Ints
    weights: NDArray[np.float32]
    right: Floats
    down: Floats


def top_view(scan: Scan, normal: Floats | None = None) -> TopView:
    """See a mesh from the side its faces show, along a normal (3,); where parts overlap, the topmost counts."""
    faces = scan.mesh.faces
    points = np.where(np.isfinite(scan.mesh.points), scan.mesh.points, np.nan)  # infinite ones would warn below
    normals = area_vectors(points, faces)
    centres = points[faces].mean(axis=1)
    some = np.isfinite(centres).all(axis=1)
    up = principal_axes(centres[some][:: 1 + int(some.sum()) // 50_000])[0][[0, 1, 2]]
    if normal is not None:
        up = np.vstack([perpendicular_axes(normal), normal])
    elif np.nansum(normals @ up[2]) < 0:
        up[[0, 2]] *= -1
    up[0] = np.cross(up[1], up[2])
    seen = points @ up.T
    low, high = np.nanmin(seen, axis=0), np.nanmax(seen, axis=0)
    px_per_mm = LONG_PX / max(float((high - low)[:2].max()), TINY)
    places = np.stack([seen[:, 0] - low[0], high[1] - seen[:, 1]], axis=1) * px_per_mm
    cols, rows = (int(np.ceil(side * px_per_mm)) + 1 for side in (high - low)[:2])
    face, weights = rasterize(places, faces, (rows, cols), nearness=seen[:, 2] - low[2] + 1)
    return TopView(places, face, weights, up[0], -up[1])


def picture(scan: Scan, view: TopView) -> Pixels | None:
    """The colours of a scan in a top view; pixels without a face take the nearest colour.

    Returns
    -------
    (rows, cols, 3) uint8, or None
        None where the scan has neither a photo, textures nor colours.
    """
    row, col = np.nonzero(view.face >= 0)
    if not len(row):
        return None
    face = view.face[row, col]
    w = view.weights[row, col].astype(np.float64)
    shares = np.column_stack([1 - w.sum(axis=1), w])
    out = np.zeros((*view.face.shape, 3), np.uint8)
    drawn = np.zeros(view.face.shape, bool)
    corner_xy = _corner_places(scan)
    if corner_xy is not None:
        at = np.einsum("pk,pkc->pc", shares, corner_xy[face])
        number = np.zeros(len(face), int) if scan.texture_of_face is None else scan.texture_of_face[face]
        for k in range(max(1, len(scan.textures))):
            mine = (number == k) & np.isfinite(at).all(axis=1)
            if mine.any():
                image = scan.textures[k].read() if scan.photo is None else scan.photo
                r, c = (np.rint(v).astype(int) for v in at[mine][:, ::-1].T)
                inside = (r >= 0) & (r < image.shape[0]) & (c >= 0) & (c < image.shape[1])
                out[row[mine][inside], col[mine][inside]] = to_uint8(image[r[inside], c[inside]][None])[0]
                drawn[row[mine][inside], col[mine][inside]] = True
    elif scan.colours is not None:
        colours = to_uint8(scan.colours[None])[0].astype(np.float64)
        out[row, col] = np.rint(np.einsum("pk,pkc->pc", shares, colours[scan.mesh.faces[face]]))
        drawn[row, col] = True
    if not drawn.any():
        return None
    nearest = ndimage.distance_transform_edt(~drawn, return_distances=False, return_indices=True)
    return np.asarray(out[nearest[0], nearest[1]])


def _corner_places(scan: Scan) -> Floats | None:
    """(m, 3, 2) places of the faces' corners on their images [px]."""
    if scan.photo_xy is None or (scan.photo is None and not scan.textures):
        return None
    return scan.photo_xy if scan.photo_xy.ndim == 3 else scan.photo_xy[scan.mesh.faces]
