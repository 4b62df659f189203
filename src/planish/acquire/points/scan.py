"""Points in any order, as photogrammetry makes them, become a scan: meshed, cut to the sheet, with a photo."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from planish.acquire.grid_mesh import Acquired
from planish.acquire.points.cut import cut_out
from planish.acquire.points.normals import oriented, patches
from planish.acquire.points.photo import PIXEL, camera_above, photo_of_points
from planish.acquire.points.surface import CELL, mesher, surface
from planish.acquire.range_image.depth import check_photo_size
from planish.acquire.range_image.grid import plausible_origin
from planish.document.sheet_outline import sheet_mask
from planish.errors import InputError
from planish.geometry import project
from planish.geometry.guards import TINY_MM
from planish.types import Bools, Camera, Diagnostic, Floats, Pixels, Scan

FEWEST = 500
"""Points that a sheet must have: fewer do not even show a fold."""

MOST = 600_000
"""More points are averaged, cell by cell, down to about so many before they are meshed."""


def from_points(
    points: Floats,
    colours: Pixels | None = None,
    normals: Floats | None = None,
    photo: Pixels | None = None,
    photo_camera: Camera | None = None,
    *,
    seen_from: Floats | None = None,
    mask: Bools | str | None = "auto",
) -> Acquired:
    """Make a scan from points in any order.

    Which side is printed is told by `seen_from` or the camera, else by the normals, else by the origin if it lies in
    front of all points; else it is the side towards +z, and that is said.

    Parameters
    ----------
    points : (n, 3) float64 [mm]
        Those at 0 0 0 or not finite are left out.
    colours : (n, 3) uint8 or uint16, optional
        Become the photo, where no other is given.
    normals : (n, 3) float64, optional
        Away from the printed side, as rough as they may be.
    photo, photo_camera : (h, w, 3) uint8 or uint16, and Camera, optional
        A photo and the camera that took it, in the world of the points.
    seen_from : (3,) float64 [mm], optional
        Any place from which the printed side was seen.
    mask : (h, w) bool, "auto" or None
        Where on the photo the sheet is. auto: bright paper on darker ground, if it stands out; None: everywhere.

    Raises
    ------
    InputError
        If there are too few points, they make no surface, or the photo is not of its camera's size.
    MissingExtraError
        If scikit-image is not installed.
    """
    mesher()
    if photo is not None and photo_camera is not None:
        check_photo_size(photo, photo_camera)
    known = np.isfinite(points).all(axis=1) & points.any(axis=1)
    if known.sum() < FEWEST:
        raise InputError(
            f"{known.sum():,} of {len(points):,} points have a place (three finite numbers, not all 0); a sheet needs "
            f"at least {FEWEST:,}"
        )
    points = points[known]
    colours = None if colours is None else colours[known]
    some, hints = _thinned(points, None if normals is None else normals[known])
    found = patches(some)
    some = some[found.kept]
    towards, warnings = _printed_side(some, None if hints is None else hints[found.kept], photo_camera, seen_from)
    facing = oriented(some, found.normals, found.spacing_mm, towards)
    mesh = surface(some, facing, found.spacing_mm)
    if photo is None and colours is not None:
        photo_camera = camera_above(mesh, PIXEL * found.spacing_mm)
        photo = photo_of_points(mesh, photo_camera, points, colours)
    if photo is not None:
        sheet, told = sheet_mask(photo, mask)
        warnings += told
        assert photo_camera is not None
        if sheet is not None:
            mesh = cut_out(mesh, photo_camera, sheet, CELL * found.spacing_mm, found.noise_mm)
    camera = photo_camera or camera_above(mesh, found.spacing_mm)  # without a photo, places to draw a picture by
    scan = Scan(mesh, photo, project(camera, mesh.points), None if photo is None else photo_camera)
    return Acquired(scan, _confidence(mesh.points, some), found.noise_mm, tuple(warnings))


def _thinned(points: Floats, normals: Floats | None) -> tuple[Floats, Floats | None]:
    """At most about `MOST` points: means over the cells of a grid."""
    if len(points) <= MOST:
        return points, normals
    side = _spacing(points) * np.sqrt(len(points) / MOST)
    cells = np.floor((points - points.min(axis=0)) / side).astype(np.int64)
    size = cells.max(axis=0) + 1
    cell = np.unique((cells[:, 0] * size[1] + cells[:, 1]) * size[2] + cells[:, 2], return_inverse=True)[1]
    count = np.bincount(cell)

    def means(values: Floats) -> Floats:
        return np.stack([np.bincount(cell, values[:, k]) / count for k in range(3)], axis=1)

    return means(points), None if normals is None else means(normals)


def _spacing(points: Floats) -> float:
    """Side of the square that belongs to a point, by the distance of the eighth neighbour of some."""
    some = points[:: 1 + len(points) // 5000]
    return float(np.median(cKDTree(points).query(some, 9, workers=2)[0][:, -1]) * np.sqrt(np.pi / 8))


def _printed_side(
    points: Floats, normals: Floats | None, camera: Camera | None, seen_from: Floats | None
) -> tuple[Floats, list[Diagnostic]]:
    """For each point a direction towards the printed side, and what is to be said of it."""
    if seen_from is None and camera is not None:
        seen_from = -camera.rotation.T @ np.ravel(camera.translation)
    if seen_from is not None:
        return np.asarray(seen_from) - points, []
    if normals is not None and normals.any():
        return np.nan_to_num(normals), []
    origin = plausible_origin(points)
    if origin is not None:
        return origin - points, []
    guessed = Diagnostic(
        "printed-side-guessed",
        "nothing tells which side is printed, so it was taken to be the one towards +z",
        "give {seen_from} if the page comes out mirrored",
    )
    return np.tile([0.0, 0.0, 1.0], (len(points), 1)), [guessed]


def _confidence(vertices: Floats, points: Floats) -> Floats:
    """How dense the points are around each corner of the mesh, against the usual; at most 1."""
    reach = cKDTree(points).query(vertices, min(8, len(points)), workers=2)[0][:, -1]
    return np.clip((np.median(reach) / np.maximum(reach, TINY_MM)) ** 2, 0, 1)
