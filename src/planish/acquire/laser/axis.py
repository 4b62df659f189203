"""Calibrate the axis of a scanning mirror, from photos of a board at known mirror angles."""

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
"""Least range of angles: the axis is determined by the rotation of the plane."""

ROBUST_SCALE_MM = 0.2
"""Scale of the robust loss of point distances."""

MAX_RMS_MM = 0.5
"""Largest rms distance from the rotated planes; more means wrong angles, good calibrations have 0.1."""

MAX_LEAN_DEG = 15.0
"""Largest angle between axis and laser plane: a plane rotated about its normal does not move, so any angle would
fit."""

POSITION_STEP_MM = 100.0
"""Scaling of the axis position in the optimisation, per 1 rad of its direction."""


class LaserAxis(NamedTuple):
    """A laser plane and its rotation axis.

    Attributes
    ----------
    plane : (4,) float64
        At angle 0, a x + b y + c z + d = 0 [mm] in the camera's world.
    point : (3,) float64 [mm]
        A point on the axis.
    direction : (3,) float64
        Unit vector; the plane rotates right-handed about it with increasing angle.
    rms_mm : float
        Rms distance of the points from the rotated planes.
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
    """Calibrate the axis of a rotating mirror and the laser plane at angle 0.

    Starts from the planes at the smallest and the largest angle, then minimises the distances of all points from the
    rotated plane.

    Parameters
    ----------
    photos : list of (rows, cols, 3) uint8 or uint16
        Of a board with one laser line on it.
    names : list of str
        For messages.
    camera : Camera
    board : Board
    angles_deg : (photos,) float64
        Angles of the mirror, or of whatever rotates the light.

    Raises
    ------
    InputError
        If a photo shows no board or line, or the poses at an angle, or the angles, are too similar.
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
    """Rotate a plane (4,) right-handed about an axis by an angle [rad].

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
    """Optimise plane, point and direction; also return the rms distance."""
    across_normal = perpendicular_axes(plane[:3])  # parametrises small rotations of the normal and of the axis
    across_axis = perpendicular_axes(direction)

    def perturbed(x: Floats) -> tuple[Floats, Floats, Floats]:
        normal, axis = plane[:3] + x[:2] @ across_normal, direction + x[2:4] @ across_axis
        normal, axis = normalize(normal), normalize(axis)
        position = point + POSITION_STEP_MM * x[4:6] @ across_axis
        # x[6] is the change of the plane's distance from the initial axis point
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
