"""Make a scan from noisy depth maps and a colour photo."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planish.acquire.grid_mesh import NOISE_STEPS, STEEPEST, AcquiredScan, grid_mesh
from planish.acquire.range_image.mirror_check import mirrored_warnings
from planish.acquire.range_image.ray_check import depth_direction_warnings
from planish.acquire.range_image.steps import depth_step, step_warnings, with_rounding
from planish.acquire.range_image.trim import beside, trim_to_sheet
from planish.acquire.scan_quality import with_noise
from planish.document.sheet_outline import sheet_mask
from planish.errors import InputError
from planish.geometry import project
from planish.geometry.quantile import quantile
from planish.geometry.triangulation import rays
from planish.parallel import thread_pool
from planish.types import Bools, Camera, Floats, Pixels, Scan

REMEDY = "give {} frames of the same still scene, or bring the camera nearer"

OUTLIER = 3.5
"""Outlier threshold of frames against the median, in standard deviations."""

MIN_TOLERANCE = 0.005
"""Deviations below this share of the depth are no outliers: depths are often whole millimetres."""

MIN_FRAME_SHARE = 0.5
"""Least share of frames with a depth at a valid pixel."""


def from_depth(
    frames: Sequence[Floats],
    camera: Camera,
    photo: Pixels,
    photo_camera: Camera | None = None,
    *,
    mask: Bools | str | None = "auto",
    depth_along: Literal["z", "ray"] = "z",
) -> AcquiredScan:
    """Make a scan from depth maps and a colour photo.

    Parameters
    ----------
    frames : sequence of (rows, cols) float64 [mm]
        0 or NaN where there is none. Frames of the same static scene are averaged.
    camera : Camera
        The depth camera.
    photo : (h, w, 3) uint8 or uint16
    photo_camera : Camera, optional
        Camera of the photo, in the frame of `camera`. By default the photo is registered to the depth maps: of their
        size, or scaled by one factor.
    mask : (h, w) bool, "auto" or None
        Sheet on the photo. auto: bright paper on a darker background, if it stands out; None: everything.
    depth_along : {"z", "ray"}
        Whether depths are measured along the camera's axis or along each pixel's line of sight.

    Raises
    ------
    InputError
        If maps differ in size, have no depth, or do not fit the cameras.
    """
    if depth_along == "ray":
        frames = [along_axis(frame, camera) for frame in frames]
    stack = _stack_frames(frames, camera)
    seen_from = _photo_camera(camera, photo, photo_camera)
    depth, agreement = average_frames(stack)
    step_mm = depth_step(depth)
    noise_mm = with_rounding(pixel_noise(depth), step_mm)
    depth = fill_single_gaps(depth, np.maximum(STEEPEST / camera.matrix[0, 0] * depth, NOISE_STEPS * noise_mm))
    depth = remove_flying_pixels(depth, camera, noise_mm)
    points = back_project(camera, depth)
    seen = points.reshape(-1, 3)
    sheet, warnings = sheet_mask(photo, mask, project(seen_from, seen[np.isfinite(seen).all(axis=1)]), whole=True)
    warnings = [*warnings, *step_warnings(step_mm)]
    if sheet is not None:
        known = np.isfinite(points).all(axis=2)
        on_sheet = np.isfinite(apply_mask(points, seen_from, sheet)).all(axis=2)
        warnings += mirrored_warnings(depth, np.asarray(on_sheet), step_mm)
        warnings += depth_direction_warnings(depth, camera, np.asarray(known & ~on_sheet), depth_along)
        points = np.where(beside(np.asarray(on_sheet))[..., None], points, np.nan)
    mesh, pixel_xy = grid_mesh(points, camera, noise_mm=noise_mm)
    if sheet is not None:
        mesh, _, used = trim_to_sheet(mesh, project(seen_from, mesh.points), sheet)
        pixel_xy = pixel_xy[used]
    column, row = pixel_xy.astype(int).T
    scan = Scan(mesh, photo, project(seen_from, mesh.points), seen_from)
    acquired = AcquiredScan(scan, agreement[row, column], noise_mm, tuple(warnings))
    return with_noise(acquired, REMEDY.format("more" if len(frames) > 1 else "several"))


def along_axis(distance: Floats, camera: Camera) -> Floats:
    """Depths along the camera's axis, (rows, cols) [mm], of distances along the rays of its pixels.

    Raises
    ------
    InputError
        If the map is not of the camera's size.

    Examples
    --------
    >>> camera = Camera(np.array([[100.0, 0, 0], [0, 100, 0], [0, 0, 1]]), np.eye(3), np.zeros(3), (1, 101))
    >>> depth = along_axis(np.full((1, 101), 500.0), camera)
    >>> depth[0, [0, 100]].round(1).tolist()
    [500.0, 353.6]
    """
    if distance.shape != tuple(camera.shape_rc):
        raise InputError(
            f"the depth map has {distance.shape[1]} x {distance.shape[0]} pixels, but its camera "
            f"{camera.shape_rc[1]} x {camera.shape_rc[0]}; give the camera of this map"
        )
    row, col = np.mgrid[: distance.shape[0], : distance.shape[1]]
    directions, _ = rays(camera, np.stack([col.ravel(), row.ravel()], axis=1).astype(np.float64))
    return np.asarray(distance * (directions @ camera.rotation[2]).reshape(distance.shape))


def average_frames(stack: Floats | NDArray[np.float32]) -> tuple[Floats, Floats]:
    """Average depth maps: the mean of the frames that lie near their median.

    Parameters
    ----------
    stack : (frames, rows, cols) float32 or float64 [mm]
        0 or NaN where a frame has no depth.

    Returns
    -------
    depth : (rows, cols) float64 [mm]
        NaN where fewer than half of the frames have one.
    agreement : (rows, cols) float64
        Share of frames in the mean.

    Examples
    --------
    >>> stack = np.array([500.0, 501, 0, 499, 720, 500, 500, 501]).reshape(8, 1, 1)
    >>> depth, agreement = average_frames(stack)
    >>> depth.round(2).tolist(), agreement.tolist()
    ([[500.17]], [[0.75]])
    """
    frames, rows, cols = stack.shape
    depth, agreement = np.empty(rows * cols), np.empty(rows * cols)
    with thread_pool() as parallel_for:
        parallel_for(_average, rows * cols, stack.reshape(frames, -1), depth, agreement, block=1 << 13)
    return depth.reshape(rows, cols), agreement.reshape(rows, cols)


@njit(cache=True, nogil=True)
def _average(first, last, stack, depth, agreement):  # type: ignore[no-untyped-def]
    frames = len(stack)
    values, deviation = np.empty(frames), np.empty(frames)
    for i in range(first, last):
        count = 0
        for k in range(frames):
            if stack[k, i] > 0.0 and stack[k, i] < np.inf:
                values[count] = stack[k, i]
                count += 1
        depth[i], agreement[i] = np.nan, 0.0
        if count == 0 or count < MIN_FRAME_SHARE * frames:
            continue
        middle = quantile(values, count, 0.5)
        for k in range(count):
            deviation[k] = abs(values[k] - middle)
        tolerance = max(OUTLIER * 1.4826 * quantile(deviation, count, 0.5), MIN_TOLERANCE * middle)
        total, used = 0.0, 0
        for k in range(count):
            if abs(values[k] - middle) <= tolerance:
                total += values[k]
                used += 1
        depth[i], agreement[i] = total / used, used / frames


def fill_single_gaps(depth: Floats, step: Floats) -> Floats:
    """Fill missing pixels with the mean of their neighbours above, below, left and right, if these are on one surface.

    At least three of them must be known: lone pixels and pairs are filled, which a camera drops here and there, and
    which would be holes in letters on the page. Larger gaps stay.

    Parameters
    ----------
    depth : (rows, cols) float64 [mm]
        NaN where there is none.
    step : (rows, cols) float64 [mm]
        Neighbours that differ by more are on two surfaces; NaN where there is no depth.

    Examples
    --------
    >>> depth = np.array([[1.0, 1, 1], [1, np.nan, 1.2], [1, 1, 1]])
    >>> float(fill_single_gaps(depth, 0.5 * depth)[1, 1].round(3))
    1.05
    """
    around, limit = (np.full((4, *depth.shape), np.nan) for _ in range(2))
    for out, values in ((around, depth), (limit, step)):
        out[0, 1:], out[1, :-1], out[2, :, 1:], out[3, :, :-1] = values[:-1], values[1:], values[:, :-1], values[:, 1:]
    row, col = np.nonzero(np.isnan(depth) & (np.isfinite(around).sum(axis=0) >= 3))
    beside = around[:, row, col]
    one_surface = np.nanmax(beside, axis=0) - np.nanmin(beside, axis=0) <= np.nanmin(limit[:, row, col], axis=0)
    filled = depth.copy()
    filled[row[one_surface], col[one_surface]] = np.nanmean(beside[:, one_surface], axis=0)
    return filled


def remove_flying_pixels(depth: Floats, camera: Camera, noise_mm: float = 0.0) -> Floats:
    """Remove flying pixels: interpolated depths between a near and a far surface at edges.

    Opposite neighbours of a flying pixel lie in front of and behind it, each by more than half the discontinuity
    threshold.

    Parameters
    ----------
    depth : (rows, cols) float64 [mm]
    camera : Camera
    noise_mm : float

    Returns
    -------
    (rows, cols) float64 [mm]
    """
    half = [np.maximum(STEEPEST / 2 * depth / camera.matrix[k, k], 4 * noise_mm) for k in (1, 0)]
    return np.where(flying_pixels(depth, half), np.nan, depth)


def flying_pixels(distance: Floats, half: Sequence[Floats]) -> Bools:
    """Detect pixels between a nearer and a farther neighbour, more than `half` a discontinuity from both.

    Parameters
    ----------
    distance : (rows, cols) float64
        Distance of each pixel's point; NaN where there is none.
    half : two of (rows, cols) float64
        For the neighbours above and below, and for those to the left and right.
    """
    flying = np.zeros(distance.shape, bool)
    for axis in (0, 1):
        d, h = np.moveaxis(distance, axis, 0), np.moveaxis(half[axis], axis, 0)[1:-1]
        before, after = d[1:-1] - d[:-2], d[2:] - d[1:-1]
        between = (np.minimum(before, after) > h) | (np.maximum(before, after) < -h)
        np.moveaxis(flying, axis, 0)[1:-1] |= between
    return flying


def back_project(camera: Camera, depth: Floats) -> Floats:
    """Back-project depths (rows, cols) [mm] along the optical axis to world points (rows, cols, 3) [mm]."""
    rows, cols = depth.shape
    xy = np.stack(np.meshgrid(np.arange(cols), np.arange(rows)), axis=-1).reshape(-1, 2).astype(np.float64)
    directions, eye = rays(camera, xy)
    along = depth.ravel() / (directions @ camera.rotation[2])
    return np.asarray(eye + along[:, None] * directions).reshape(rows, cols, 3)


def apply_mask(points: Floats, camera: Camera, mask: Bools) -> Floats:
    """Set points (rows, cols, 3) to NaN where a photo's mask (h, w) is false or the photo ends."""
    keep = inside_mask(project(camera, points.reshape(-1, 3)), mask)
    return np.where(keep.reshape(*points.shape[:2], 1), points, np.nan)


def inside_mask(xy: Floats, mask: Bools) -> Bools:
    """Which positions (k, 2) [px] lie inside a mask (h, w); False if not finite or outside of the image."""
    column, row = np.rint(np.nan_to_num(xy, nan=-1, posinf=-1, neginf=-1)).T
    inside = (row >= 0) & (row < mask.shape[0]) & (column >= 0) & (column < mask.shape[1])
    keep = np.zeros(len(row), bool)
    keep[inside] = mask[row[inside].astype(int), column[inside].astype(int)]
    return keep


def pixel_noise(depth: Floats) -> float:
    """Standard deviation of the noise from pixel to pixel, in the unit of the depths (rows, cols).

    Estimated from second differences along the rows, which are small on a surface.
    """
    second = depth[:, :-2] - 2 * depth[:, 1:-1] + depth[:, 2:]
    second = second[np.isfinite(second)]
    return float(1.4826 * np.median(np.abs(second)) / np.sqrt(6)) if len(second) else 0.0


def _stack_frames(frames: Sequence[Floats], camera: Camera) -> NDArray[np.float32]:
    shapes = [frame.shape for frame in frames]
    odd = next((k for k, shape in enumerate(shapes) if shape != shapes[0]), None)
    if odd is not None:
        raise InputError(
            f"depth map {odd + 1} is {_size(shapes[odd])} pixels, the first {_size(shapes[0])}; give maps of one camera"
        )
    if shapes[0] != tuple(camera.shape_rc):
        raise InputError(
            f"the depth maps are {_size(shapes[0])} pixels, but the depth camera's numbers are for "
            f"{_size(camera.shape_rc)}; give the calibration of this camera at this size"
        )
    with np.errstate(over="ignore"):
        stack = np.stack([np.asarray(frame, np.float32) for frame in frames])
    stack[~np.isfinite(stack)] = np.nan
    if not (stack > 0).any():
        raise InputError(
            f"no pixel of the {len(frames)} depth maps holds a depth: all are 0 or not finite; was the camera covered, "
            "or the wrong channel saved?"
        )
    return stack


def _photo_camera(camera: Camera, photo: Pixels, photo_camera: Camera | None) -> Camera:
    """Camera of the photo: the given one, or the depth camera scaled to the photo's size."""
    shape = photo.shape[:2]
    if photo_camera is not None:
        check_photo_size(photo, photo_camera)
        return photo_camera
    down, across = (photo_side / side for photo_side, side in zip(shape, camera.shape_rc, strict=True))
    if abs(down / across - 1) > 0.01:
        raise InputError(
            f"the photo is {_size(shape)} pixels and the depth maps {_size(camera.shape_rc)}: it is not registered to "
            "them",
            "give the photo's own camera with {photo_camera}",
        )
    matrix = camera.matrix.copy()
    for k, factor in enumerate((across, down)):
        matrix[k] *= factor
        matrix[k, 2] += (factor - 1) / 2  # pixel centres lie at integers
    return replace(camera, matrix=matrix, shape_rc=(shape[0], shape[1]))


def check_photo_size(photo: Pixels, camera: Camera) -> None:
    """Refuse a photo whose size differs from its camera's."""
    if photo.shape[:2] != tuple(camera.shape_rc):
        raise InputError(
            f"the photo is {_size(photo.shape)} pixels, but its camera's numbers are for {_size(camera.shape_rc)}; "
            "give the calibration of this camera at this size"
        )


def _size(shape_rc: tuple[int, ...]) -> str:
    return f"{shape_rc[1]} x {shape_rc[0]}"
