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

from planish.acquire.grid_mesh import Acquired, grid_mesh
from planish.acquire.laser.stripes import find_stripes, laser_channel, print_of
from planish.acquire.laser.sweep import coarser, crossings_xy
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

MISFIT = 0.01
"""Distance of the lines' profiles from each other, in parts of the page's width, that is still a cylinder (median)."""

SPINE_DEG = 20.0
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


def without_laser(lit: Pixels, channel: int) -> Pixels:
    """What a photo would look like with the laser off, from the two colours that the laser does not have.

    Paper and ink are near enough grey; the laser's colour is told from theirs by the median of all pixels.
    """
    levels = np.iinfo(lit.dtype).max + 1
    light = linear_light(levels)[lit]
    others = light[..., [c for c in range(3) if c != channel]].mean(axis=2)
    bright = others > np.median(others) / 2
    guess = np.clip(others * np.median(light[..., channel][bright] / others[bright]), 0, 1)
    code = np.where(guess <= 0.0031308, 12.92 * guess, 1.055 * guess ** (1 / 2.4) - 0.055)
    return np.repeat(np.rint(code * (levels - 1)).astype(lit.dtype)[..., None], 3, axis=2)


def brightest_colour(lit: Pixels) -> int:
    """Which of red, green and blue stands out most from the others somewhere: the laser's."""
    light = lit[::2, ::2].astype(np.float32)
    return int(np.argmax([np.quantile(2 * light[..., c] - light.sum(axis=2) + light[..., c], 0.995) for c in range(3)]))


def two_lines(lit: Pixels, photo: Pixels | None = None) -> Floats:
    """Find where two laser lines cross every column of a photo.

    Parameters
    ----------
    lit : (rows, cols, 3) uint8 or uint16
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
    if photo is not None and photo.shape != lit.shape:
        raise InputError(
            f"the photo with the lasers on is {lit.shape[1]} x {lit.shape[0]} pixels, the laser-off photo "
            f"{photo.shape[1]} x {photo.shape[0]}; give photos of one camera at one size"
        )
    channel = brightest_colour(lit) if photo is None else laser_channel(lit, photo)
    off = without_laser(lit, channel) if photo is None else photo
    found = find_stripes(lit, print_of(off, channel, "columns"), channel, "columns", lines=2)
    at = np.where((found.sd > 1.0).any(axis=1, keepdims=True), np.nan, found.at)
    share = float(np.isfinite(at[:, 0]).mean())
    if share < SEEN_SHARE:
        raise InputError(
            f"two laser lines are seen in {100 * share:.0f} % of the photo's columns, at least {100 * SEEN_SHARE:.0f} "
            "% are wanted; both must run across the photo, from side to side, and stand out from the light of the room"
        )
    return np.asarray(at)


def points_of(at: Floats, camera: Camera, planes: Floats) -> tuple[Floats, Floats]:
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


def cylinder_of(upper: Floats, lower: Floats, camera: Camera) -> Cylinder:
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

    def apart(tilt: Floats) -> Floats:
        return profile_gap(upper, lower, eye, axes_of(camera, tilt))

    tilt = least_squares(apart, np.zeros(2), loss="soft_l1", f_scale=1e-3 * _width(upper)).x
    gap = float(1.4826 * np.median(np.abs(apart(tilt))))
    if not gap < MISFIT * _width(upper):
        raise InputError(
            f"the profiles under the two laser lines are {gap:.1f} mm apart along the best common direction, on "
            f"a page {_width(upper):.0f} mm wide; it is no cylinder, or camera and lasers are not those of the photo"
        )
    return profiled(upper, lower, eye, axes_of(camera, tilt))


def axes_of(camera: Camera, tilt: Floats) -> Floats:
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
    slope = np.gradient(_box(distance), np.maximum.accumulate(angle + 1e-9 * np.arange(len(angle)))) / distance
    gap = other_distance - np.interp(other_angle, angle, distance)
    inside = (other_angle > angle[0]) & (other_angle < angle[-1])
    return np.where(inside, gap / np.hypot(1, np.interp(other_angle, angle, slope)), 0.0)


def profiled(upper: Floats, lower: Floats, eye: Floats, axes: Floats) -> Cylinder:
    """The cylinder over the smoothed profile of both lines, with given axes."""
    pairs = [_polar(points, eye, axes) for points in (upper, lower)]
    angle, distance = (np.concatenate([pair[k] for pair in pairs]) for k in (0, 1))
    order = np.argsort(angle, kind="stable")
    angle, distance = angle[order], distance[order]
    nodes = np.linspace(angle[0], angle[-1], len(upper))
    spine = _spine(angle, distance)
    smooth = np.empty(len(nodes))
    reach = SMOOTHED_PX * (nodes[1] - nodes[0])
    for left, first, last in ((True, angle[0], spine), (False, spine, angle[-1])):
        mine = (angle < spine) if left else (angle >= spine)
        here = (nodes < spine) if left else (nodes >= spine)
        if here.any():
            smooth[here] = _local_parabola(nodes[here], angle[mine], distance[mine], reach, first, last)
    place = smooth[:, None] * np.column_stack([np.sin(nodes), np.cos(nodes)])
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(place, axis=0), axis=1))])
    return Cylinder(eye, axes, nodes, smooth, length)


def on_cylinder(cylinder: Cylinder, directions: Floats) -> tuple[Floats, Floats]:
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
    far = np.interp(angle, cylinder.angle, cylinder.distance, left=np.nan, right=np.nan)
    scale = far / np.hypot(across, away)
    flat = np.column_stack([np.interp(angle, cylinder.angle, cylinder.length), along * scale])
    return cylinder.eye + scale[:, None] * directions, flat


def from_laser_lines(
    lit: Pixels, photo: Pixels | None, camera: Camera, planes: Floats, *, mask: Bools | str | None = "auto"
) -> Acquired:
    """Make a scan of a book page, or of two, from one photo with two laser lines on it.

    Parameters
    ----------
    lit : (rows, cols, 3) uint8 or uint16
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
    if lit.shape[:2] != tuple(camera.shape_rc):
        raise InputError(
            f"the photo is {lit.shape[1]} x {lit.shape[0]} pixels, but the camera's numbers are for "
            f"{camera.shape_rc[1]} x {camera.shape_rc[0]}; give the calibration of this camera at this size"
        )
    upper, lower = points_of(two_lines(lit, photo), camera, planes)
    cylinder = cylinder_of(upper, lower, camera)
    warnings = []
    if photo is None:
        sentence = "no laser-off photo was given, so the laser lines stay on the page"
        warnings.append(Diagnostic("laser-on-page", sentence))
    shown = lit if photo is None else photo
    sheet, said = sheet_mask(shown, mask)
    rows, cols = camera.shape_rc
    cell = max(1, round(float(np.sqrt((rows * cols if sheet is None else sheet.sum()) / POINTS))))
    coarse = coarser(camera, cell, (rows // cell, cols // cell))
    xy = np.stack(np.meshgrid(np.arange(cols // cell) + 0.0, np.arange(rows // cell)), axis=-1).reshape(-1, 2)
    points, _ = on_cylinder(cylinder, rays(coarse, xy)[0])
    points = points.reshape(rows // cell, cols // cell, 3)
    if sheet is not None:
        small = cv2.resize(sheet.astype(np.uint8), points.shape[1::-1], interpolation=cv2.INTER_NEAREST)
        points[small == 0] = np.nan
    gap = profile_gap(upper, lower, cylinder.eye, cylinder.axes)
    mesh, _ = grid_mesh(points, coarse)
    scan = Scan(mesh, shown, project(camera, mesh.points), camera)
    noise_mm = float(1.4826 * np.median(np.abs(gap)) / np.sqrt(2))
    return Acquired(scan, np.ones(len(mesh.points)), noise_mm, (*warnings, *said))


def _polar(points: Floats, eye: Floats, axes: Floats) -> tuple[Floats, Floats]:
    """Angle and distance of points around the camera, seen along the rulings."""
    across, away, _ = ((points - eye) @ axes.T).T
    return np.arctan2(across, away), np.hypot(across, away)


def _width(points: Floats) -> float:
    return float(np.linalg.norm(points[-1] - points[0]))


def _box(values: Floats, width: int = 9) -> Floats:
    padded = np.pad(values, width // 2, mode="edge")
    return np.convolve(padded, np.full(width, 1 / width), mode="valid")


def _spine(angle: Floats, distance: Floats) -> float:
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
    return float(angle[deepest]) if turn > np.radians(SPINE_DEG) else float(angle[-1] + 1e-9)


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
