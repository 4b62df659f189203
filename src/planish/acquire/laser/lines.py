"""Scan of an open book from one photo with two laser lines: a cylinder over their common profile.

A cylinder here is any surface of parallel straight rulings, a good model of pages of a bound book. Seen along the
rulings, both laser lines lie on one curve. In polar coordinates around the camera the curve is a function, distance by
angle, because the camera sees every position of the page at another angle.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from scipy.optimize import least_squares

from planish.acquire.grid_mesh import AcquiredScan, grid_mesh
from planish.acquire.laser.stripes import find_stripes, laser_channel, laser_off_image
from planish.acquire.laser.sweep import crossings_xy, downscale_camera
from planish.color import linear_light
from planish.document.sheet_outline import sheet_mask
from planish.errors import InputError
from planish.geometry import camera_position, project
from planish.geometry.triangulation import meet_plane, rays
from planish.types import Bools, Camera, Diagnostic, Floats, Pixels, Scan

POINTS = 300_000
"""Approximate number of points of the scan."""

SMOOTHED_PX = 8
"""Half width of the local parabola fits to the profile [photo columns]."""

SEEN_SHARE = 0.2
"""Least share of photo columns in which both lines are detected."""

MAX_GAP = 0.01
"""Largest median distance between both profiles of a cylinder, relative to the page width."""

GUTTER_DEG = 20.0
"""A kink of this angle at the deepest point of the profile is a gutter; it is not smoothed."""


class Cylinder(NamedTuple):
    """A surface of parallel rulings, in polar coordinates around the camera.

    Attributes
    ----------
    eye : (3,) float64 [mm]
        Camera centre.
    axes : (3, 3) float64
        Rows: across the page, away from the camera, and along the rulings; orthonormal.
    angle : (n,) float64 [rad]
        Directions from the camera across the rulings, ascending; 0 is the viewing direction.
    distance : (n,) float64 [mm]
        Distance of the surface in each direction.
    length : (n,) float64 [mm]
        Arc length along the profile.
    """

    eye: Floats
    axes: Floats
    angle: Floats
    distance: Floats
    length: Floats


def without_laser(laser_on: Pixels, channel: int) -> Pixels:
    """Estimate the photo without laser light from the two other channels.

    Paper and ink are assumed to be nearly grey; channels are balanced by the median over all pixels.
    """
    levels = np.iinfo(laser_on.dtype).max + 1
    light = linear_light(levels)[laser_on]
    others = light[..., [c for c in range(3) if c != channel]].mean(axis=2)
    bright = others > np.median(others) / 2
    estimate = np.clip(others * np.median(light[..., channel][bright] / others[bright]), 0, 1)
    code = np.where(estimate <= 0.0031308, 12.92 * estimate, 1.055 * estimate ** (1 / 2.4) - 0.055)
    return np.repeat(np.rint(code * (levels - 1)).astype(laser_on.dtype)[..., None], 3, axis=2)


def laser_colour(laser_on: Pixels) -> int:
    """Channel of the laser: the one that exceeds the others most somewhere."""
    light = laser_on[::2, ::2].astype(np.float32)
    return int(np.argmax([np.quantile(2 * light[..., c] - light.sum(axis=2) + light[..., c], 0.995) for c in range(3)]))


def find_two_lines(laser_on: Pixels, photo: Pixels | None = None) -> Floats:
    """Detect two laser lines in every column of a photo.

    Parameters
    ----------
    laser_on : (rows, cols, 3) uint8 or uint16
    photo : (rows, cols, 3) uint8 or uint16, optional
        The same view with the lasers off. Without it paper and print are assumed to be grey.

    Returns
    -------
    (cols, 2) float64 [px]
        Row of the upper and the lower line; NaN unless both are detected.

    Raises
    ------
    InputError
        If photos differ in size, or the lines are detected in too few columns.
    """
    if photo is not None and photo.shape != laser_on.shape:
        raise InputError(
            f"the photo with the lasers on is {laser_on.shape[1]} x {laser_on.shape[0]} pixels, the laser-off photo "
            f"{photo.shape[1]} x {photo.shape[0]}; give photos of one camera at one size"
        )
    channel = laser_colour(laser_on) if photo is None else laser_channel(laser_on, photo)
    laser_off = without_laser(laser_on, channel) if photo is None else photo
    found = find_stripes(laser_on, laser_off_image(laser_off, channel, "columns"), channel, "columns", lines=2)
    at = np.where((found.sd > 1.0).any(axis=1, keepdims=True), np.nan, found.at)
    share = float(np.isfinite(at[:, 0]).mean())
    if share < SEEN_SHARE:
        raise InputError(
            f"two laser lines are seen in {100 * share:.0f} % of the photo's columns, at least {100 * SEEN_SHARE:.0f} "
            "% are wanted; both must cross the photo from side to side and stand out from ambient light"
        )
    return np.asarray(at)


def line_points(at: Floats, camera: Camera, planes: Floats) -> tuple[Floats, Floats]:
    """Triangulate both lines, in columns in which both are detected: two of (n, 3) [mm]."""
    both = np.isfinite(at).all(axis=1)
    found = []
    for line in range(2):
        directions, eye = rays(camera, crossings_xy(at[:, line], "columns")[both])
        found.append(meet_plane(eye, directions, planes[line]))
    good = np.isfinite(found[0]).all(axis=1) & np.isfinite(found[1]).all(axis=1)
    if good.mean() < 0.5:
        raise InputError(
            f"{100 * (1 - good.mean()):.0f} % of the laser points would be behind the camera with these planes; are "
            "they those of this camera, and in mm?"
        )
    return found[0][good], found[1][good]


def fit_cylinder(upper: Floats, lower: Floats, camera: Camera) -> Cylinder:
    """Fit a cylinder to two lines: the ruling direction along which their profiles agree.

    Parameters
    ----------
    upper, lower : (n, 3) float64 [mm]
    camera : Camera

    Raises
    ------
    InputError
        If there is none: the page is no cylinder, or the planes are wrong.
    """
    eye = camera_position(camera)

    def residuals(tilt: Floats) -> Floats:
        return profile_gap(upper, lower, eye, cylinder_axes(camera, tilt))

    tilt = least_squares(residuals, np.zeros(2), loss="soft_l1", f_scale=1e-3 * _width(upper)).x
    gap = float(1.4826 * np.median(np.abs(residuals(tilt))))
    if not gap < MAX_GAP * _width(upper):
        raise InputError(
            f"the profiles under the two laser lines are {gap:.1f} mm apart along the best common direction, on "
            f"a page {_width(upper):.0f} mm wide; it is no cylinder, or camera and lasers are not those of the photo"
        )
    return smooth_profile(upper, lower, eye, cylinder_axes(camera, tilt))


def cylinder_axes(camera: Camera, tilt: Floats) -> Floats:
    """Axes (3, 3) of a cylinder, rulings vertical on the photo up to a tilt (2,) sideways and in depth [rad]."""
    across, down, away = camera.rotation
    along = down + tilt[0] * across + tilt[1] * away
    along = along / np.linalg.norm(along)
    away = away - (away @ along) * along
    away = away / np.linalg.norm(away)
    return np.stack([np.cross(along, away), away, along])


def profile_gap(upper: Floats, lower: Floats, eye: Floats, axes: Floats) -> Floats:
    """Distance (n,) [mm] of the lower line's points from the upper line's profile; 0 beyond its ends."""
    (angle, distance), (other_angle, other_distance) = _polar(upper, eye, axes), _polar(lower, eye, axes)
    order = np.argsort(angle)
    angle, distance = angle[order], distance[order]
    slope = np.gradient(_box_filter(distance), np.maximum.accumulate(angle + 1e-9 * np.arange(len(angle)))) / distance
    gap = other_distance - np.interp(other_angle, angle, distance)
    inside = (other_angle > angle[0]) & (other_angle < angle[-1])
    return np.where(inside, gap / np.hypot(1, np.interp(other_angle, angle, slope)), 0.0)


def smooth_profile(upper: Floats, lower: Floats, eye: Floats, axes: Floats) -> Cylinder:
    """Cylinder with given axes over the smoothed profile of both lines."""
    pairs = [_polar(points, eye, axes) for points in (upper, lower)]
    angle, distance = (np.concatenate([pair[k] for pair in pairs]) for k in (0, 1))
    order = np.argsort(angle, kind="stable")
    angle, distance = angle[order], distance[order]
    nodes = np.linspace(angle[0], angle[-1], len(upper))
    gutter = _gutter_angle(angle, distance)
    smooth = np.empty(len(nodes))
    reach = SMOOTHED_PX * (nodes[1] - nodes[0])
    for left, first, last in ((True, angle[0], gutter), (False, gutter, angle[-1])):
        samples = (angle < gutter) if left else (angle >= gutter)
        targets = (nodes < gutter) if left else (nodes >= gutter)
        if targets.any():
            smooth[targets] = _local_parabola(nodes[targets], angle[samples], distance[samples], reach, first, last)
    position = smooth[:, None] * np.column_stack([np.sin(nodes), np.cos(nodes)])
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(position, axis=0), axis=1))])
    return Cylinder(eye, axes, nodes, smooth, length)


def intersect_cylinder(cylinder: Cylinder, directions: Floats) -> tuple[Floats, Floats]:
    """Intersect rays from the camera with the cylinder.

    Parameters
    ----------
    cylinder : Cylinder
    directions : (k, 3) float64

    Returns
    -------
    points : (k, 3) float64 [mm]
        NaN outside of the profile.
    flat : (k, 2) float64 [mm]
        Position on the unrolled surface: along the profile, and along the rulings.
    """
    across, away, along = (directions @ cylinder.axes.T).T
    angle = np.arctan2(across, away)
    distance_mm = np.interp(angle, cylinder.angle, cylinder.distance, left=np.nan, right=np.nan)
    scale = distance_mm / np.hypot(across, away)
    flat = np.column_stack([np.interp(angle, cylinder.angle, cylinder.length), along * scale])
    return cylinder.eye + scale[:, None] * directions, flat


def from_laser_lines(
    laser_on: Pixels, photo: Pixels | None, camera: Camera, planes: Floats, *, mask: Bools | str | None = "auto"
) -> AcquiredScan:
    """Make a scan of one or two book pages from one photo with two laser lines.

    Parameters
    ----------
    laser_on : (rows, cols, 3) uint8 or uint16
        With both lines, which run across the photo; gutter and page sides are vertical.
    photo : (rows, cols, 3) uint8 or uint16, optional
        With the lasers off: the scan's photo. Without it the lines remain visible.
    camera : Camera
    planes : (2, 4) float64
        Of the upper and the lower laser, a x + b y + c z + d = 0 [mm].
    mask : (rows, cols) bool, "auto" or None
        As for `from_laser`.

    Raises
    ------
    InputError
        If sizes differ, lines are missing, or the page is no cylinder.
    """
    if laser_on.shape[:2] != tuple(camera.shape_rc):
        raise InputError(
            f"the photo is {laser_on.shape[1]} x {laser_on.shape[0]} pixels, but the camera's numbers are for "
            f"{camera.shape_rc[1]} x {camera.shape_rc[0]}; give the calibration of this camera at this size"
        )
    upper, lower = line_points(find_two_lines(laser_on, photo), camera, planes)
    cylinder = fit_cylinder(upper, lower, camera)
    warnings = []
    if photo is None:
        sentence = "no laser-off photo was given, so the laser lines stay on the page"
        warnings.append(Diagnostic("laser-on-page", sentence))
    photo_used = laser_on if photo is None else photo
    sheet, mask_warnings = sheet_mask(photo_used, mask)
    rows, cols = camera.shape_rc
    cell = max(1, round(float(np.sqrt((rows * cols if sheet is None else sheet.sum()) / POINTS))))
    coarse = downscale_camera(camera, cell, (rows // cell, cols // cell))
    xy = np.stack(np.meshgrid(np.arange(cols // cell) + 0.0, np.arange(rows // cell)), axis=-1).reshape(-1, 2)
    points, _ = intersect_cylinder(cylinder, rays(coarse, xy)[0])
    points = points.reshape(rows // cell, cols // cell, 3)
    if sheet is not None:
        small = cv2.resize(sheet.astype(np.uint8), points.shape[1::-1], interpolation=cv2.INTER_NEAREST)
        points[small == 0] = np.nan
    gap = profile_gap(upper, lower, cylinder.eye, cylinder.axes)
    mesh, _ = grid_mesh(points, coarse)
    scan = Scan(mesh, photo_used, project(camera, mesh.points), camera)
    noise_mm = float(1.4826 * np.median(np.abs(gap)) / np.sqrt(2))
    return AcquiredScan(scan, np.ones(len(mesh.points)), noise_mm, (*warnings, *mask_warnings))


def _polar(points: Floats, eye: Floats, axes: Floats) -> tuple[Floats, Floats]:
    """Polar coordinates of points around the camera, across the rulings."""
    across, away, _ = ((points - eye) @ axes.T).T
    return np.arctan2(across, away), np.hypot(across, away)


def _width(points: Floats) -> float:
    return float(np.linalg.norm(points[-1] - points[0]))


def _box_filter(values: Floats, width: int = 9) -> Floats:
    padded = np.pad(values, width // 2, mode="edge")
    return np.convolve(padded, np.full(width, 1 / width), mode="valid")


def _gutter_angle(angle: Floats, distance: Floats) -> float:
    """Angle of the deepest point if the profile has a kink there; else beyond its end."""
    deepest = int(np.argmax(distance))
    reach = max(10, len(angle) // 40)
    turn = 0.0
    if reach < deepest < len(angle) - reach:
        slopes = []
        for side in (slice(deepest - reach, deepest), slice(deepest + 1, deepest + 1 + reach)):
            slope = np.polyfit(angle[side], distance[side], 1)[0] / distance[deepest]
            slopes.append(np.arctan(slope))
        turn = slopes[0] - slopes[1]
    return float(angle[deepest]) if turn > np.radians(GUTTER_DEG) else float(angle[-1] + 1e-9)


def _local_parabola(nodes: Floats, angle: Floats, distance: Floats, reach: float, first: float, last: float) -> Floats:
    """Local weighted parabola fit at every node; wider where samples are sparse."""
    out = np.empty(len(nodes))
    for k, node in enumerate(nodes):
        wide = reach
        low, high = np.searchsorted(angle, [node - wide, node + wide])
        while high - low < 6 and (low > 0 or high < len(angle)):
            wide *= 2
            low, high = np.searchsorted(angle, [node - wide, node + wide])
        x = (angle[low:high] - node) / wide
        weight = np.maximum(1 - x * x, 0.05)
        basis = np.column_stack([np.ones_like(x), x, x * x])[:, : min(3, max(1, high - low))]
        normal = (basis * weight[:, None]).T @ basis
        normal.flat[:: len(normal) + 1] += 1e-9 * weight.sum()
        out[k] = np.linalg.solve(normal, basis.T @ (weight * distance[low:high]))[0]
    return out
