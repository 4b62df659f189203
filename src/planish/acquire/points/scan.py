"""Points in any order, as photogrammetry makes them, become a scan: meshed, cut to the sheet, with a photo."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from planish.acquire.grid_mesh import AcquiredScan
from planish.acquire.points.crop import crop_to_sheet
from planish.acquire.points.normals import fit_tangent_planes, orient_normals
from planish.acquire.points.photo import PIXEL, camera_above, render_points
from planish.acquire.points.surface import CELL, import_marching_cubes, reconstruct_surface
from planish.acquire.range_image.depth import check_photo_size
from planish.acquire.range_image.grid import plausible_origin
from planish.document.sheet_outline import sheet_mask
from planish.errors import InputError
from planish.geometry import project
from planish.geometry.guards import TINY_MM
from planish.types import Bools, Camera, Diagnostic, Floats, Pixels, Scan

MIN_POINTS = 500
"""Points that a sheet must have: fewer do not even show a fold."""

MAX_POINTS = 600_000
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
) -> AcquiredScan:
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
    import_marching_cubes()
    if photo is not None and photo_camera is not None:
        check_photo_size(photo, photo_camera)
    known = np.isfinite(points).all(axis=1) & points.any(axis=1)
    if known.sum() < MIN_POINTS:
        raise InputError(
            f"{known.sum():,} of {len(points):,} points have a place (three finite numbers, not all 0); a sheet needs "
            f"at least {MIN_POINTS:,}"
        )
    points = points[known]
    colours = None if colours is None else colours[known]
    sample, hints = _subsample(points, None if normals is None else normals[known])
    found = fit_tangent_planes(sample)
    sample = sample[found.kept]
    outward, warnings = _printed_side(sample, None if hints is None else hints[found.kept], photo_camera, seen_from)
    oriented = orient_normals(sample, found.normals, found.spacing_mm, outward)
    mesh = reconstruct_surface(sample, oriented, found.spacing_mm)
    if photo is None and colours is not None:
        photo_camera = camera_above(mesh, PIXEL * found.spacing_mm)
        photo = render_points(mesh, photo_camera, points, colours)
    if photo is not None:
        sheet, mask_warnings = sheet_mask(photo, mask)
        warnings += mask_warnings
        assert photo_camera is not None
        if sheet is not None:
            mesh = crop_to_sheet(mesh, photo_camera, sheet, CELL * found.spacing_mm, found.noise_mm)
    camera = photo_camera or camera_above(mesh, found.spacing_mm)  # without a photo, places to draw a picture by
    scan = Scan(mesh, photo, project(camera, mesh.points), None if photo is None else photo_camera)
    return AcquiredScan(scan, _confidence(mesh.points, sample), found.noise_mm, tuple(warnings))


def _subsample(points: Floats, normals: Floats | None) -> tuple[Floats, Floats | None]:
    """At most about `MAX_POINTS` points: means over the cells of a grid."""
    if len(points) <= MAX_POINTS:
        return points, normals
    side = _spacing(points) * np.sqrt(len(points) / MAX_POINTS)
    cells = np.floor((points - points.min(axis=0)) / side).astype(np.int64)
    size = cells.max(axis=0) + 1
    cell = np.unique((cells[:, 0] * size[1] + cells[:, 1]) * size[2] + cells[:, 2], return_inverse=True)[1]
    count = np.bincount(cell)

    def means(values: Floats) -> Floats:
        return np.stack([np.bincount(cell, values[:, k]) / count for k in range(3)], axis=1)

    return means(points), None if normals is None else means(normals)


def _spacing(points: Floats) -> float:
    """Side of the square that belongs to a point, by the distance of the eighth neighbour of some."""
    sample = points[:: 1 + len(points) // 5000]
    return float(np.median(cKDTree(points).query(sample, 9, workers=2)[0][:, -1]) * np.sqrt(np.pi / 8))


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
