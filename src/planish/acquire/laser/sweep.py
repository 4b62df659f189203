"""Scan from a swept laser line: one profile per photo, merged to one scan."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from planish.acquire.grid_mesh import AcquiredScan, grid_mesh
from planish.acquire.laser.crossings import Sweep
from planish.acquire.laser.stripes import Direction, find_stripes, laser_channel, laser_off_image
from planish.acquire.laser.sweep_grid import grid_cell_px, resample_to_grid
from planish.acquire.laser.sweep_order import check_order
from planish.acquire.range_image.depth import apply_mask, back_project
from planish.document.sheet_outline import sheet_mask
from planish.errors import InputError
from planish.geometry import depths, project
from planish.geometry.axes import principal_axes
from planish.geometry.guards import TINY_MM
from planish.geometry.triangulation import meet_plane, rays
from planish.types import Bools, Camera, Diagnostic, Floats, Pixels, Scan

DIRECTION_SAMPLES = 500
"""Rows or columns sampled to determine the direction of the lines."""

SEEN_SHARE = 0.02
"""Least share of rows with a line; below it a photo does not show the laser."""

CLIPPED_REFUSED, CLIPPED_WARNED = 0.7, 0.35
"""Share of saturated line pixels from which a sweep is refused, and from which a warning is given."""

MAX_RELATIVE_SD = 6.0
"""Crossings with more than so many times the median standard deviation are dropped: half lines at the sheet's edge."""

MIN_WALL_ROWS = 10
"""Least number of rows with a line on each known background plane."""

MAX_WALL_RMS = 0.005
"""Largest rms distance of background points from one plane, relative to their extent."""

Progress = Callable[[str, float], None]


def sweep_stripes(
    frame: Callable[[int], Pixels],
    names: list[str],
    photo: Pixels,
    *,
    lines: int = 1,
    divide: bool = True,
    progress: Progress = lambda name, share: None,
) -> Sweep:
    """Detect the laser lines in every photo of a sweep; one photo is in memory at a time.

    Parameters
    ----------
    frame : callable
        Index of the frame, from 0 -> photo (rows, cols, 3) uint8 or uint16.
    names : list of str
        Names of the frames, for messages.
    photo : (rows, cols, 3) uint8 or uint16
        The same view with the laser off.
    lines : int
        Laser lines in each photo.
    divide : bool
        Whether to divide out the print; False only to measure its effect.
    progress : callable
        Called with the stage's name and the completed share.

    Raises
    ------
    InputError
        If photos differ in size, show no laser, or are overexposed.
    """
    middle = frame(len(names) // 2)
    _check_size(middle, names[len(names) // 2], photo)
    channel = laser_channel(middle, photo)
    along = _direction(middle, photo, channel, lines)
    del middle  # frees 36 MB
    laser_off = laser_off_image(photo, channel, along, divide=divide)
    found = np.full((2, len(names), len(laser_off.light), lines), np.nan, np.float32)
    clipped = np.zeros(len(names))
    for k, name in enumerate(names):
        laser_on = frame(k)
        _check_size(laser_on, name, photo)
        stripes = find_stripes(laser_on, laser_off, channel, along, lines=lines)
        found[:, k] = stripes.at, stripes.sd
        clipped[k] = stripes.clipped_share
        progress("laser", (k + 1) / len(names))
    warnings: list[Diagnostic] = []
    _check_exposure(clipped, names, warnings)  # first: a wholly saturated line is not detected
    _check_seen(found[0], names, warnings)
    return Sweep(found[0], found[1], along, warnings)


def from_laser(
    sweep: Sweep,
    names: list[str],
    photo: Pixels,
    camera: Camera,
    planes: Floats,
    *,
    mask: Bools | str | None = "auto",
) -> AcquiredScan:
    """Make a scan from a sweep by intersecting pixel rays with the laser planes.

    The points of all photos are resampled to a grid of camera pixels with the step of the line from photo to photo. At
    each grid point a surface, curved only across the lines, is fitted to the inverse depths around it, which are linear
    over the image of a plane.

    Parameters
    ----------
    sweep : Sweep
        From `sweep_stripes`.
    names : list of str
    photo : (rows, cols, 3) uint8 or uint16
        The scan's photo, with the laser off.
    camera : Camera
    planes : (frames, lines, 4) float64
        a x + b y + c z + d = 0 [mm] of every line, from left to right (top to bottom) on the photo.
    mask : (rows, cols) bool, "auto" or None
        Sheet on the photo. auto: bright paper on a darker background, if it stands out; None: everything.

    Raises
    ------
    InputError
        If the camera has another size, planes and photos do not fit, or no line is detected.
    """
    _check_camera(photo, camera)
    sweep = sweep._replace(
        at=np.where(sweep.sd > MAX_RELATIVE_SD * np.nanmedian(sweep.sd), np.float32(np.nan), sweep.at)
    )
    inverse = _inverse_depths(sweep, camera, planes)
    check_order(sweep, camera, planes, inverse, names)
    cell = grid_cell_px(sweep)
    depth, agreement, noise = resample_to_grid(sweep, inverse, camera, cell)
    if sweep.along == "columns":
        depth, agreement, noise = depth.T, agreement.T, noise.T
    coarse = downscale_camera(camera, cell, depth.shape)
    points = back_project(coarse, depth)
    sheet, mask_warnings = sheet_mask(photo, mask)
    if sheet is not None:
        points = apply_mask(points, camera, sheet)
    noise_mm = float(np.nanmedian(np.where(np.isfinite(points[..., 0]), noise, np.nan)))
    mesh, pixel_xy = grid_mesh(points, coarse, noise_mm=noise_mm)
    column, row = pixel_xy.astype(int).T
    scan = Scan(mesh, photo, project(camera, mesh.points), camera)
    return AcquiredScan(scan, agreement[row, column], noise_mm, (*sweep.warnings, *mask_warnings))


def planes_from_background(sweep: Sweep, names: list[str], camera: Camera, known: Floats, regions: Floats) -> Floats:
    """Determine the laser plane of each photo from its line on two known planes beside the sheet.

    Parameters
    ----------
    sweep : Sweep
        With one line per photo.
    names : list of str
    camera : Camera
    known : (k, 4) float64
        Planes of the background [mm]; at least two different ones.
    regions : (k, 4) float64 [photo px]
        Left, top, right and bottom of each plane's region on the photos.

    Returns
    -------
    (frames, 1, 4) float64

    Raises
    ------
    InputError
        If a line is not detected on both, or its points are not coplanar.
    """
    planes = np.empty((len(names), 1, 4))
    for k, name in enumerate(names):
        xy = crossings_xy(sweep.at[k, :, 0], sweep.along)
        directions, eye = rays(camera, xy)
        points = []
        for plane, (left, top, right, bottom) in zip(known, regions, strict=True):
            inside = ((xy >= [left, top]) & (xy <= [right, bottom])).all(axis=1)
            if inside.sum() < MIN_WALL_ROWS:
                raise InputError(
                    f"in {name} the laser is seen in {inside.sum()} rows of the background's region [{left:g}, "
                    f"{top:g}, {right:g}, {bottom:g}]; at least {MIN_WALL_ROWS} are wanted. Leave the photo out, or "
                    "correct the region"
                )
            points.append(meet_plane(eye, directions[inside], plane))
        planes[k, 0], rms = fit_plane(np.concatenate(points))
        size = float(np.linalg.norm(np.ptp(np.concatenate(points), axis=0)))
        if not rms < MAX_WALL_RMS * size:
            raise InputError(
                f"in {name} what the laser lights on the background is {rms:.2f} mm rms off one plane; are its planes "
                "those of this setup, and is this the calibration of this camera?"
            )
    return planes


def fit_plane(points: Floats) -> tuple[Floats, float]:
    """Fit a plane (4,) to points (n, 3) by least squares; also return the rms distance [mm].

    The fit is repeated once without points beyond three times the rms.
    """
    points = points[np.isfinite(points).all(axis=1)]
    plane, rms = np.full(4, np.nan), np.inf
    for _ in range(2):
        middle = points.mean(axis=0)
        normal = principal_axes(points)[0][2]
        laser_off = (points - middle) @ normal
        plane, rms = np.array([*normal, -normal @ middle]), float(np.sqrt((laser_off**2).mean()))
        points = points[np.abs(laser_off) <= max(3 * rms, TINY_MM)]
    return plane, rms


def downscale_camera(camera: Camera, cell: int, shape_rc: tuple[int, ...]) -> Camera:
    """The camera with pixels `cell` times as large, pixel centres at integers."""
    matrix = camera.matrix.copy()
    matrix[:2] /= cell
    matrix[:2, 2] -= (cell - 1) / 2 / cell
    return replace(camera, matrix=matrix, shape_rc=(shape_rc[0], shape_rc[1]))


def crossings_xy(at: Floats, along: Direction) -> Floats:
    """Photo positions (count, 2) of one line's crossings (count,) with rows or columns."""
    count = np.arange(len(at), dtype=np.float64)
    return np.column_stack([at, count] if along == "rows" else [count, at]).astype(np.float64)


def _inverse_depths(sweep: Sweep, camera: Camera, planes: Floats) -> Floats:
    """1 / depth of every crossing, (frames, count, lines) [1/mm]; NaN behind the camera."""
    inverse = np.full(sweep.at.shape, np.nan)
    for k in range(len(planes)):
        for line in range(planes.shape[1]):
            directions, eye = rays(camera, crossings_xy(sweep.at[k, :, line], sweep.along))
            inverse[k, :, line] = 1 / depths(camera, meet_plane(eye, directions, planes[k, line]))
    seen = np.isfinite(sweep.at)
    share_in_front = np.isfinite(inverse[seen]).mean() if seen.any() else 0.0
    if share_in_front < 0.5:
        raise InputError(
            f"{100 * (1 - share_in_front):.0f} % of the laser points would be behind the camera with these planes; "
            "they belong to another camera or another frame of coordinates, or their unit is not mm"
        )
    return inverse


def _direction(laser_on: Pixels, photo: Pixels, channel: int, lines: int) -> Direction:
    """Search direction, rows or columns, in which lines are narrower and more often detected."""
    best: Direction = "rows"
    most = -1.0
    directions: tuple[Direction, ...] = ("rows", "columns")
    for along in directions:
        count = laser_on.shape[0 if along == "rows" else 1]
        sample = slice(None, None, max(1, count // DIRECTION_SAMPLES))
        with_laser, laser_off = (p[sample] if along == "rows" else p[:, sample] for p in (laser_on, photo))
        stripes = find_stripes(with_laser, laser_off_image(laser_off, channel, along), channel, along, lines=lines)
        detected = np.isfinite(stripes.at).all(axis=1)
        score = float(detected.mean() / np.median(stripes.width[detected])) if detected.any() else 0.0
        if score > most:
            best, most = along, score
    return best


def _check_size(laser_on: Pixels, name: str, photo: Pixels) -> None:
    if laser_on.shape != photo.shape:
        raise InputError(
            f"{name} is {laser_on.shape[1]} x {laser_on.shape[0]} pixels, the laser-off photo {photo.shape[1]} x "
            f"{photo.shape[0]}; give photos of one camera at one size"
        )
    if laser_on.dtype != photo.dtype:
        raise InputError(
            f"{name} has {8 * laser_on.itemsize} bits, the laser-off photo {8 * photo.itemsize}; give photos of one "
            "kind"
        )


def _check_camera(photo: Pixels, camera: Camera) -> None:
    rows, cols = camera.shape_rc
    if photo.shape[:2] != (rows, cols):
        raise InputError(
            f"the photos are {photo.shape[1]} x {photo.shape[0]} pixels, but the camera's numbers are for {cols} x "
            f"{rows}; give the calibration of this camera at this size"
        )


def _check_seen(at: Floats, names: list[str], warnings: list[Diagnostic]) -> None:
    without_line = np.flatnonzero(np.isfinite(at).all(axis=2).mean(axis=1) < SEEN_SHARE)
    if len(without_line) > len(names) / 2:
        raise InputError(
            f"no laser line is seen in {len(without_line)} of {len(names)} photos "
            f"({_name_some(without_line, names)}): they do not differ from the laser-off photo; is the laser "
            "on, the room dark enough, and the number of lines right?"
        )
    if len(without_line):
        sentence = (
            f"no laser line is seen in {len(without_line)} of {len(names)} photos: {_name_some(without_line, names)}"
        )
        warnings.append(Diagnostic("laser-not-seen", sentence))


def _check_exposure(clipped: Floats, names: list[str], warnings: list[Diagnostic]) -> None:
    share = float(np.median(clipped))
    if share > CLIPPED_REFUSED:
        raise InputError(
            f"the photos are overexposed: {100 * share:.0f} % of the laser line's pixels are saturated "
            f"({_name_some(np.flatnonzero(clipped > CLIPPED_REFUSED), names)}); expose for a shorter time, or dim the "
            "laser"
        )
    if share > CLIPPED_WARNED:
        warnings.append(
            Diagnostic(
                "laser-overexposed",
                f"{100 * share:.0f} % of the laser line's pixels are saturated",
                "expose for a shorter time to place the line better",
            )
        )


def _name_some(which: NDArray[np.int64], names: list[str]) -> str:
    shown = ", ".join(names[k] for k in which[:4])
    return f"{shown} and {len(which) - 4} more" if len(which) > 4 else shown
