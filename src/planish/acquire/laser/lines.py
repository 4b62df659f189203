"""Two fixed laser lines across an open book, one photo: the page is a cylinder over the profile that both lines show.

A cylinder here is any surface of parallel straight lines (rulings), as the pages of a bound book are near enough. Seen
along the rulings, both laser lines lie on one curve. In polar coordinates around the camera, which sees every place of
the page at another angle, the curve is a function: distance by angle.
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
from planish.geometry import project
from planish.geometry.triangulation import meet_plane, rays
from planish.types import Bools, Camera, Diagnostic, Floats, Pixels, Scan

POINTS = 300_000
"""Of the scan, about: the profile is known much finer than it bends."""

SMOOTHED_PX = 8
"""Photo columns on either side over which the profile is fitted by a parabola."""

SEEN_SHARE = 0.2
"""Part of the photo's columns in which both lines must be seen."""

MAX_GAP = 0.01
"""Distance of the lines' profiles from each other, in parts of the page's width, that is still a cylinder (median)."""

GUTTER_DEG = 20.0
"""A turn by so much at the profile's deepest place is a spine, over which it is not smoothed."""


class Cylinder(NamedTuple):
    """A surface of parallel lines, as the camera sees it.

    Attributes
    ----------
    eye : (3,) float64 [mm]
        The camera.
    axes : (3, 3) float64
        Rows: across the page, away from the camera, and along the rulings; orthonormal.
    angle : (n,) float64 [rad]
        Ascending: directions from the camera, seen along the rulings; 0 is straight away.
    distance : (n,) float64 [mm]
        Of the surface from the camera in that direction.
    length : (n,) float64 [mm]
        Along the profile.
    """

    eye: Floats
    axes: Floats
    angle: Floats
    distance: Floats
    length: Floats


def without_laser(laser_on: Pixels, channel: int) -> Pixels:
    """What a photo would look like with the laser off, from the two colours that the laser does not have.

    Paper and ink are near enough grey; the laser's colour is told from theirs by the median of all pixels.
    """
    levels = np.iinfo(laser_on.dtype).max + 1
    light = linear_light(levels)[laser_on]
    others = light[..., [c for c in range(3) if c != channel]].mean(axis=2)
    bright = others > np.median(others) / 2
    estimate = np.clip(others * np.median(light[..., channel][bright] / others[bright]), 0, 1)
    code = np.where(estimate <= 0.0031308, 12.92 * estimate, 1.055 * estimate ** (1 / 2.4) - 0.055)
    return np.repeat(np.rint(code * (levels - 1)).astype(laser_on.dtype)[..., None], 3, axis=2)


def laser_colour(laser_on: Pixels) -> int:
    """Which of red, green and blue stands out most from the others somewhere: the laser's."""
    light = laser_on[::2, ::2].astype(np.float32)
    return int(np.argmax([np.quantile(2 * light[..., c] - light.sum(axis=2) + light[..., c], 0.995) for c in range(3)]))


def find_two_lines(laser_on: Pixels, photo: Pixels | None = None) -> Floats:
    """Find where two laser lines cross every column of a photo.

    Parameters
    ----------
    laser_on : (rows, cols, 3) uint8 or uint16
    photo : (rows, cols, 3) uint8 or uint16, optional
        The same view with the lasers off. Without it paper and print are taken to be grey.

    Returns
    -------
    (cols, 2) float64 [px]
        Upper and lower row; NaN where not both are seen.

    Raises
    ------
    InputError
        If photos differ, or the lines are seen in too few columns.
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
            "% are wanted; both must run across the photo, from side to side, and stand out from the light of the room"
        )
    return np.asarray(at)


def line_points(at: Floats, camera: Camera, planes: Floats) -> tuple[Floats, Floats]:
    """The points (n, 3) [mm] of both lines, from the columns in which both are seen."""
    both = np.isfinite(at).all(axis=1)
    found = []
    for line in range(2):
        directions, eye = rays(camera, crossings_xy(at[:, line], "columns")[both])
        found.append(meet_plane(eye, directions, planes[line]))
    good = np.isfinite(found[0]).all(axis=1) & np.isfinite(found[1]).all(axis=1)
    if good.mean() < 0.5:
        raise InputError(
            f"{100 * (1 - good.mean()):.0f} % of what the lasers lit would lie behind the camera by these planes; are "
            "they those of this camera, and in mm?"
        )
    return found[0][good], found[1][good]


def fit_cylinder(upper: Floats, lower: Floats, camera: Camera) -> Cylinder:
    """Find the cylinder that two lines on it show: the rulings along which they have one profile.

    Parameters
    ----------
    upper, lower : (n, 3) float64 [mm]
    camera : Camera

    Raises
    ------
    InputError
        If there is no such direction: the page is no cylinder, or the planes are wrong.
    """
    eye = -camera.rotation.T @ np.ravel(camera.translation)

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
    """Axes (3, 3) of a cylinder whose rulings run down the photo, but for a tilt (2,) to the side and away [rad]."""
    across, down, away = camera.rotation
    along = down + tilt[0] * across + tilt[1] * away
    along = along / np.linalg.norm(along)
    away = away - (away @ along) * along
    away = away / np.linalg.norm(away)
    return np.stack([np.cross(along, away), away, along])


def profile_gap(upper: Floats, lower: Floats, eye: Floats, axes: Floats) -> Floats:
    """Distance of the lower line's points from the upper line's profile, across it, (n,) [mm]; 0 beyond its ends."""
    (angle, distance), (other_angle, other_distance) = _polar(upper, eye, axes), _polar(lower, eye, axes)
    order = np.argsort(angle)
    angle, distance = angle[order], distance[order]
    slope = np.gradient(_box_filter(distance), np.maximum.accumulate(angle + 1e-9 * np.arange(len(angle)))) / distance
    gap = other_distance - np.interp(other_angle, angle, distance)
    inside = (other_angle > angle[0]) & (other_angle < angle[-1])
    return np.where(inside, gap / np.hypot(1, np.interp(other_angle, angle, slope)), 0.0)


def smooth_profile(upper: Floats, lower: Floats, eye: Floats, axes: Floats) -> Cylinder:
    """The cylinder over the smoothed profile of both lines, with given axes."""
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
    """Where rays from the camera meet the cylinder.

    Parameters
    ----------
    cylinder : Cylinder
    directions : (k, 3) float64

    Returns
    -------
    points : (k, 3) float64 [mm]
        NaN beside the profile.
    flat : (k, 2) float64 [mm]
        Place on the unrolled surface: along the profile, and along the rulings.
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
    """Make a scan of a book page, or of two, from one photo with two laser lines on it.

    Parameters
    ----------
    laser_on : (rows, cols, 3) uint8 or uint16
        With both lines, which run across the photo; the book's spine and page sides run down it.
    photo : (rows, cols, 3) uint8 or uint16, optional
        With the lasers off: the scan's photo. Without it the lines stay in the picture.
    camera : Camera
    planes : (2, 4) float64
        Of the upper and the lower laser, a x + b y + c z + d = 0 [mm].
    mask : (rows, cols) bool, "auto" or None
        As for `from_laser`.

    Raises
    ------
    InputError
        If sizes differ, lines are missing, or what they show is no cylinder.
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
    """Angle and distance of points around the camera, seen along the rulings."""
    across, away, _ = ((points - eye) @ axes.T).T
    return np.arctan2(across, away), np.hypot(across, away)


def _width(points: Floats) -> float:
    return float(np.linalg.norm(points[-1] - points[0]))


def _box_filter(values: Floats, width: int = 9) -> Floats:
    padded = np.pad(values, width // 2, mode="edge")
    return np.convolve(padded, np.full(width, 1 / width), mode="valid")


def _gutter_angle(angle: Floats, distance: Floats) -> float:
    """Angle of the deepest place, where the profile turns there sharply; else beyond the profile's end."""
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
    """Least squares of a parabola around every node, samples near it counting more; wider where there are few."""
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
