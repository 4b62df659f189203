"""Make a scan from an unorganised point cloud: mesh it, crop it to the sheet, add a photo."""

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
from planish.geometry import camera_position, project
from planish.geometry.guards import TINY_MM
from planish.types import Bools, Camera, Diagnostic, Floats, Pixels, Scan

MIN_POINTS = 500
"""Least number of points of a sheet: fewer do not resolve a fold."""

MAX_POINTS = 600_000
"""Larger clouds are averaged per grid cell to about so many points before meshing."""


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
    """Make a scan from an unorganised point cloud.

    The printed side follows from `seen_from` or the camera, else from the normals, else from the origin if it lies in
    front of all points; else it is the side towards +z, with a warning.

    Parameters
    ----------
    points : (n, 3) float64 [mm]
        Those at 0 0 0 or not finite are ignored.
    colours : (n, 3) uint8 or uint16, optional
        Used to render a photo if none is given.
    normals : (n, 3) float64, optional
        Roughly outward from the printed side.
    photo, photo_camera : (h, w, 3) uint8 or uint16, and Camera, optional
        A photo and its camera, in the frame of the points.
    seen_from : (3,) float64 [mm], optional
        Any position from which the printed side is visible.
    mask : (h, w) bool, "auto" or None
        Sheet on the photo. auto: bright paper on a darker background, if it stands out; None: everything.

    Raises
    ------
    InputError
        If there are too few points, they form no surface, or photo and camera differ in size.
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
        assert photo_camera is not None
        sheet, mask_warnings = sheet_mask(photo, mask, project(photo_camera, mesh.points))
        warnings += mask_warnings
        if sheet is not None:
            mesh = crop_to_sheet(mesh, photo_camera, sheet, CELL * found.spacing_mm, found.noise_mm)
    camera = photo_camera or camera_above(mesh, found.spacing_mm)  # without a photo, positions for the preview
    scan = Scan(mesh, photo, project(camera, mesh.points), None if photo is None else photo_camera)
    return AcquiredScan(scan, _confidence(mesh.points, sample), found.noise_mm, tuple(warnings))


def _subsample(points: Floats, normals: Floats | None) -> tuple[Floats, Floats | None]:
    """Reduce to about `MAX_POINTS` points by averaging over grid cells."""
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
    """Side of the square per point, from the distance of the eighth neighbour of a sample."""
    sample = points[:: 1 + len(points) // 5000]
    return float(np.median(cKDTree(points).query(sample, 9, workers=2)[0][:, -1]) * np.sqrt(np.pi / 8))


def _printed_side(
    points: Floats, normals: Floats | None, camera: Camera | None, seen_from: Floats | None
) -> tuple[Floats, list[Diagnostic]]:
    """Direction towards the printed side for each point, and warnings."""
    if seen_from is None and camera is not None:
        seen_from = camera_position(camera)
    if seen_from is not None:
        return np.asarray(seen_from) - points, []
    if normals is not None and normals.any():
        return np.nan_to_num(normals), []
    origin = plausible_origin(points)
    if origin is not None:
        guessed = Diagnostic(
            "origin-as-scanner",
            "the origin of the points was taken as the scanner position, which determines the printed side",
            "give {seen_from} if the page comes out mirrored",
        )
        return origin - points, [guessed]
    guessed = Diagnostic(
        "printed-side-guessed",
        "the printed side is unknown and was assumed to be the one towards +z",
        "give {seen_from} if the page comes out mirrored",
    )
    return np.tile([0.0, 0.0, 1.0], (len(points), 1)), [guessed]


def _confidence(vertices: Floats, points: Floats) -> Floats:
    """Point density around each vertex, relative to the median, at most 1."""
    reach = cKDTree(points).query(vertices, min(8, len(points)), workers=2)[0][:, -1]
    return np.clip((np.median(reach) / np.maximum(reach, TINY_MM)) ** 2, 0, 1)
