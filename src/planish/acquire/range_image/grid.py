"""Make a scan from a range image: an organised point map, without its camera."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from planish.acquire.grid_mesh import NOISE_STEPS, STEEPEST, AcquiredScan, mesh_from_grid
from planish.acquire.range_image.depth import check_photo_size, flying_pixels, inside_mask, pixel_noise
from planish.acquire.range_image.steps import depth_step, step_warnings, with_rounding
from planish.acquire.range_image.trim import beside, trim_to_sheet
from planish.acquire.scan_quality import with_noise
from planish.document.sheet_outline import sheet_mask
from planish.errors import InputError
from planish.geometry import project
from planish.geometry.axes import principal_axes
from planish.geometry.guards import TINY_MM
from planish.types import Bools, Camera, Diagnostic, Floats, Pixels, Scan

MIN_DISTANCE = 0.3
"""The origin is the scanner position if it is farther from all points than this share of their extent..."""

MAX_DISTANCE_MM = 5000.0
"""Largest median distance: no scanner resolves the curvature of paper from farther."""
ALONG_AXIS = 0.94
"""Cosine of the largest angle, 20 degrees, between an axis and the direction of the points' centre. With 10 degrees
sheets beside the centre of the view would be flipped, with 40 a table 0.8 m above the origin would count as a view."""
MIN_COSINE = 0.5
"""...and sees all points within a cone of 60 degrees around the centre: its cosine."""


def from_grid(
    points: Floats,
    photo: Pixels | None,
    photo_camera: Camera | None = None,
    *,
    seen_from: Floats | None = None,
    mask: Bools | str | None = "auto",
) -> AcquiredScan:
    """Make a scan from a range image.

    The scanner position defines depth discontinuities and the visible side. Without it the points are treated as
    heights over a plane, seen in the order of rows and columns. Single missing pixels within a surface are filled.

    Parameters
    ----------
    points : (rows, cols, 3) float64 [mm]
        Row 0 at the top; 0 0 0 or NaN for missing points.
    photo : (h, w, 3) uint8 or uint16, or None
        Colours of the points or a registered photo, of their size or scaled by one factor; any photo if its camera
        is given.
    photo_camera : Camera, optional
        Camera of the photo, in the frame of the points.
    seen_from : (3,) float64 [mm], optional
        Scanner position; by default the origin, if it lies in front of all points and not among them.
    mask : (h, w) bool, "auto" or None
        Sheet on the photo. auto: bright paper on a darker background, if it stands out; None: everything.

    Raises
    ------
    InputError
        If there are no points, no three neighbours form a surface, or photo and points do not fit.

    Examples
    --------
    >>> row, col = np.mgrid[:40, :60]
    >>> points = np.stack([col - 30.0, row - 20.0, np.where(col < 30, 300.0, 250.0)], axis=-1)
    >>> acquired = from_grid(points, None)
    >>> len(acquired.scan.mesh.points), len(acquired.scan.mesh.faces)  # nothing is joined across the step of 50 mm
    (2400, 4524)
    """
    known: Bools = np.asarray(np.isfinite(points).all(axis=2) & points.any(axis=2))
    if not known.any():
        raise InputError(
            f"none of the {known.size:,} pixels holds a point: all are 0 or not finite; was the device covered, or "
            "nothing in its range?"
        )
    points = np.where(known[..., None], points, np.nan)
    eye = plausible_origin(points[known]) if seen_from is None else np.asarray(seen_from, np.float64)
    if eye is not None and _is_mirrored(points, eye):
        points, known = points[:, ::-1], known[:, ::-1]
        if photo is not None and photo_camera is None:  # it runs as the points do
            photo, mask = photo[:, ::-1], mask[:, ::-1] if isinstance(mask, np.ndarray) else mask
    relative, distance = _viewing_coordinates(points, known, eye)
    distance_map, pitch = relative[..., -1], _pitch(relative[..., :-1])
    step_mm = 0.0 if eye is None else depth_step(np.abs(points[..., 2] - eye[2]))  # devices round along their axis
    noise = with_rounding(pixel_noise(distance_map), step_mm / distance)
    step = max(STEEPEST * pitch, NOISE_STEPS * noise)
    points, relative, known = _fill_single_gaps(points, relative, known, step)
    pixel_xy = np.stack(np.meshgrid(*(np.arange(n, dtype=np.float64) for n in known.shape[::-1])), axis=-1)
    xy = _photo_positions(points, pixel_xy, photo, photo_camera)
    distance_map = relative[..., -1]
    keep = known & ~flying_pixels(distance_map, [np.full(distance_map.shape, max(STEEPEST / 2 * pitch, 4 * noise))] * 2)
    warnings: list[Diagnostic] = step_warnings(step_mm)
    sheet = None
    if photo is not None:
        sheet, more = sheet_mask(photo, mask, xy[keep], whole=True)
        warnings += more
        if sheet is not None:
            keep &= beside(inside_mask(xy.reshape(-1, 2), sheet).reshape(keep.shape) & keep)
    mesh, at = mesh_from_grid(points, keep, relative[keep], step)
    col, row = at.astype(int).T
    photo_xy = xy[row, col]
    if sheet is not None:
        mesh, photo_xy, used = trim_to_sheet(mesh, photo_xy, sheet)
        col, row = col[used], row[used]
    neighbours = ndimage.uniform_filter(keep.astype(np.float64), 3, mode="constant")
    scan = Scan(mesh, photo, photo_xy, photo_camera)
    acquired = AcquiredScan(scan, np.clip(neighbours[row, col], 0, 1), noise * distance, tuple(warnings))
    return with_noise(acquired, "average several scans of the same still sheet, or scan it from nearer")


def grid_photo(points: Floats, colours: Pixels) -> Pixels:
    """Photo from the colours (rows, cols, 3) of a range image; black pixels without points are filled.

    They take the nearest valid colour, so that no black bleeds into the border of the sheet.
    """
    empty = ~(np.isfinite(points).all(axis=2) & points.any(axis=2)) & ~colours.any(axis=2)
    if not empty.any() or empty.all():
        return colours
    row, col = ndimage.distance_transform_edt(empty, return_distances=False, return_indices=True)
    return np.asarray(colours[row, col])


def plausible_origin(points: Floats) -> Floats | None:
    """The origin if it is a plausible scanner position: in front of the points (k, 3), near, and not among them.

    Scanners look along one of their axes; points in a world frame are rarely along one of its axes, and those of
    surveys are kilometres away.
    """
    distance_mm = np.linalg.norm(points, axis=1)
    extent = float(np.linalg.norm(np.ptp(points, axis=0)))
    if not distance_mm.min() > MIN_DISTANCE * extent or np.median(distance_mm) > MAX_DISTANCE_MM:
        return None
    along = np.abs(np.median(points, axis=0)) / max(float(np.linalg.norm(np.median(points, axis=0))), TINY_MM)
    if not along.max() > ALONG_AXIS:
        return None
    directions = points / distance_mm[:, None]
    middle = directions.mean(axis=0)
    return np.zeros(3) if (directions @ middle).min() > MIN_COSINE * np.linalg.norm(middle) else None


def _is_mirrored(points: Floats, eye: Floats) -> bool:
    """Whether rows and columns are mirrored: right x down points away from the viewer."""
    here = points[:-1, :-1]
    outwards = np.cross(points[:-1, 1:] - here, points[1:, :-1] - here)
    return bool(np.nansum(outwards * (here - eye)) < 0)


def _viewing_coordinates(points: Floats, known: Bools, eye: Floats | None) -> tuple[Floats, float]:
    """Coordinates across the line of sight, then distance; and the typical mm per unit.

    With a viewpoint: directions and log distance. Without: coordinates in the best-fitting plane, and height above it.
    """
    if eye is None:
        flat = points[known]
        axes = principal_axes(flat[:: 1 + len(flat) // 100_000])[0]
        return np.asarray((points - flat.mean(axis=0)) @ axes.T), 1.0
    ray = points - eye
    distance_mm = np.maximum(np.linalg.norm(ray, axis=2, keepdims=True), TINY_MM)
    return np.concatenate([ray / distance_mm, np.log(distance_mm)], axis=2), float(np.nanmedian(distance_mm))


def _fill_single_gaps(points: Floats, relative: Floats, known: Bools, step: float) -> tuple[Floats, Floats, Bools]:
    """Fill single missing pixels with the mean of their four neighbours if these lie on one surface."""
    around = [np.full_like(relative, np.nan) for _ in range(4)]
    around[0][1:], around[1][:-1] = relative[:-1], relative[1:]
    around[2][:, 1:], around[3][:, :-1] = relative[:, :-1], relative[:, 1:]
    gap = ~known & (np.ptp([side[..., -1] for side in around], axis=0) <= step)  # false where one of them is NaN
    row, col = np.nonzero(gap)
    points, relative = points.copy(), relative.copy()
    points[gap] = (points[row - 1, col] + points[row + 1, col] + points[row, col - 1] + points[row, col + 1]) / 4
    relative[gap] = np.mean([side[gap] for side in around], axis=0)
    return points, relative, known | gap


def _pitch(across: Floats) -> float:
    """Typical distance of neighbouring pixels across the line of sight."""
    steps = [np.linalg.norm(np.diff(across, axis=axis), axis=2).ravel() for axis in (0, 1)]
    steps = [step[np.isfinite(step)] for step in steps]
    return max((float(np.median(step)) for step in steps if len(step)), default=0.0)


def _photo_positions(points: Floats, pixel_xy: Floats, photo: Pixels | None, camera: Camera | None) -> Floats:
    """Photo positions of the points, (rows, cols, 2) [photo px]; pixel coordinates without a photo."""
    if photo is None:
        return pixel_xy
    if camera is not None:
        check_photo_size(photo, camera)
        return np.asarray(project(camera, points.reshape(-1, 3)).reshape(pixel_xy.shape))
    rows, cols = pixel_xy.shape[:2]
    down, across = photo.shape[0] / rows, photo.shape[1] / cols
    if abs(down / across - 1) > 0.01:
        raise InputError(
            f"the photo is {photo.shape[1]} x {photo.shape[0]} pixels and the range image {cols} x {rows}: it is not "
            "registered to it",
            "give the photo's own camera with {camera}",
        )
    return np.asarray((pixel_xy + 0.5) * [across, down] - 0.5)
