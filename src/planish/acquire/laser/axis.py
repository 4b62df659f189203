"""The axis about which a mirror turns a laser's light, from photos of a board at known angles of the mirror."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from planish.acquire.calibration.boards import Board
from planish.acquire.laser.board import COLLINEAR, laser_points_on_boards
from planish.acquire.laser.sweep import fit_plane
from planish.errors import InputError
from planish.geometry.axes import perpendicular_axes, principal_axes
from planish.geometry.guards import normalize
from planish.types import Camera, Floats, Pixels

MIN_RANGE_DEG = 2.0
"""Between the smallest and the largest angle, at least: the axis is known by how the plane turns."""

ROBUST_SCALE_MM = 0.2
"""Points farther from their plane count less: a stray one must not turn the axis."""

MAX_RMS_MM = 0.5
"""Points farther off the turned planes, rms, were not lit at the angles that were told; good ones have 0.1."""

MAX_LEAN_DEG = 15.0
"""An axis farther out of the laser's plane explains angles that are not true: turned about its normal a plane stays."""

POSITION_STEP_MM = 100.0
"""Step of the axis's place, beside a step of 1 rad of its direction, in the search."""


class LaserAxis(NamedTuple):
    """A laser's plane, and the axis that it turns about.

    Attributes
    ----------
    plane : (4,) float64
        At angle 0, a x + b y + c z + d = 0 [mm] in the camera's world.
    point : (3,) float64 [mm]
        On the axis.
    direction : (3,) float64
        Of length 1; the plane turns right-handed about it as the angle grows.
    rms_mm : float
        Distance of what was seen from the turned planes.
    points : int
    """

    plane: Floats
    point: Floats
    direction: Floats
    rms_mm: float
    points: int


def calibrate_laser_axis(
    photos: list[Pixels], names: list[str], camera: Camera, board: Board, angles_deg: Floats
) -> LaserAxis:
    """Find the axis of a turning mirror, and the laser's plane at angle 0.

    The planes at the smallest and the largest angle are the start; then all points at all angles are brought as near
    to the turned plane as can be (least squares).

    Parameters
    ----------
    photos : list of (rows, cols, 3) uint8 or uint16
        Of a board with one laser line on it.
    names : list of str
        For messages.
    camera : Camera
    board : Board
    angles_deg : (photos,) float64
        Of the mirror, or of what else carries the laser's light around.

    Raises
    ------
    InputError
        If a photo shows no board or line, poses are too alike at an angle, or angles are.
    """
    points = [parts[0] for parts in laser_points_on_boards(photos, names, camera, board)]
    low, high = float(angles_deg.min()), float(angles_deg.max())
    if high - low < MIN_RANGE_DEG:
        raise InputError(
            f"the board was shown at angles from {low:g} to {high:g} degrees; at least {MIN_RANGE_DEG:g} degrees "
            "between the smallest and the largest are wanted to know the axis"
        )
    first, last = (_plane_at(points, angles_deg, angle) for angle in (low, high))
    last *= np.sign(first[:3] @ last[:3])
    direction = normalize(np.cross(first[:3], last[:3]))
    point = np.linalg.lstsq(np.stack([first[:3], last[:3]]), -np.array([first[3], last[3]]))[0]
    point -= (point @ direction) * direction
    point += np.mean(np.concatenate(points) @ direction) * direction
    found, rms = _refine(rotate_plane(first, point, direction, -np.radians(low)), point, direction, points, angles_deg)
    lean = float(np.degrees(np.arcsin(np.clip(np.abs(found[0][:3] @ found[2]), 0, 1))))
    if rms > MAX_RMS_MM or lean > MAX_LEAN_DEG:
        raise InputError(
            f"what the laser lit is {rms:.2f} mm rms off a plane that turns about an axis, which leans {lean:.0f} "
            f"degrees out of that plane (below {MAX_RMS_MM:g} mm and {MAX_LEAN_DEG:g} degrees are wanted); are these "
            "the angles of the light, which a mirror turns by twice its own, and those of these photos?"
        )
    return LaserAxis(*found, rms, sum(map(len, points)))


def rotate_plane(plane: Floats, point: Floats, direction: Floats, angle: float) -> Floats:
    """A plane (4,) turned right-handed about an axis by an angle [rad].

    Examples
    --------
    >>> (rotate_plane(np.array([1.0, 0, 0, 0]), np.array([0.0, 0, 10]), np.array([0.0, 1, 0]), np.pi / 2) + 0).round(9)
    array([ 0.,  0., -1., 10.])
    """
    normal = Rotation.from_rotvec(angle * direction).apply(plane[:3])
    return np.append(normal, plane[:3] @ point + plane[3] - normal @ point)


def _plane_at(points: list[Floats], angles_deg: Floats, angle: float) -> Floats:
    here = [points[k] for k in np.flatnonzero(angles_deg == angle)]
    all_points = np.concatenate(here)
    length, spread, _ = principal_axes(all_points)[1]
    if spread < COLLINEAR * length:
        raise InputError(
            f"at {angle:g} degrees the laser's lines on {len(here)} photos of the board are almost one line in space; "
            "at the smallest and the largest angle show the board twice or more, nearer, farther and tilted"
        )
    return fit_plane(all_points)[0]


def _refine(
    plane: Floats, point: Floats, direction: Floats, points: list[Floats], angles_deg: Floats
) -> tuple[tuple[Floats, Floats, Floats], float]:
    """Plane at angle 0, point and direction with the least distances, and these, rms."""
    across_normal = perpendicular_axes(plane[:3])  # two directions across the plane's normal, and across the axis
    across_axis = perpendicular_axes(direction)

    def perturbed(x: Floats) -> tuple[Floats, Floats, Floats]:
        normal, axis = plane[:3] + x[:2] @ across_normal, direction + x[2:4] @ across_axis
        normal, axis = normalize(normal), normalize(axis)
        position = point + POSITION_STEP_MM * x[4:6] @ across_axis
        # the plane keeps its distance from the first point of the axis, but for x[6]
        return (
            np.append(normal, plane[:3] @ point + plane[3] - normal @ point + POSITION_STEP_MM * x[6]),
            position,
            axis,
        )

    def residuals(x: Floats) -> Floats:
        planes = [rotate_plane(*perturbed(x), np.radians(angle)) for angle in angles_deg]
        return np.concatenate([part @ at[:3] + at[3] for part, at in zip(points, planes, strict=True)])

    best = least_squares(residuals, np.zeros(7), loss="soft_l1", f_scale=ROBUST_SCALE_MM).x
    return perturbed(best), float(np.sqrt(np.mean(residuals(best) ** 2)))
