"""Calibrate two fixed lasers from one photo of their lines on squared paper, flat or bent like an open book."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial import cKDTree

from planish.acquire.laser.lines import (
    cylinder_axes,
    find_two_lines,
    intersect_cylinder,
    line_points,
    profile_gap,
    smooth_profile,
)
from planish.acquire.laser.squares import Squares, find_squares
from planish.errors import InputError
from planish.geometry.rigid_fit import fit_rigid
from planish.geometry.triangulation import rays
from planish.types import Camera, Floats, Pixels

CENTRE_SIGMA = 0.02
"""Prior standard deviation of the principal point, relative to the focal length. It weighs as much as one corner, so it
matters only where the squares leave the principal point open, as on flat paper."""

ROBUST_SCALE = 0.05
"""Scale of the robust loss of corner residuals [squares]."""

MAX_RMS = 0.4
"""Largest rms residual of the corners [squares]."""


class LaserRig(NamedTuple):
    """Two calibrated lasers.

    Attributes
    ----------
    camera : Camera
        As given, or with the estimated distortion and principal point.
    planes : (2, 4) float64
        Upper and lower, a x + b y + c z + d = 0 [mm] in the camera's world.
    rms_squares : float
        Rms distance of the unrolled corners from a regular lattice.
    corners : int
    """

    camera: Camera
    planes: Floats
    rms_squares: float
    corners: int


def calibrate_laser_rig(
    laser_on: Pixels, photo: Pixels | None, camera: Camera, square_mm: float, *, lens: bool = False
) -> LaserRig:
    """Calibrate the planes of two lasers such that squared paper unrolls to a regular lattice.

    Initial depths come from the heights of the squares, which are not foreshortened along the rulings. Then planes and
    ruling direction are optimised by least squares: unrolled corners against a lattice, and the profile of one line
    against that of the other.

    Parameters
    ----------
    laser_on : (rows, cols, 3) uint8 or uint16
        Squared paper, flat or bent like a book, with both lines across it.
    photo : (rows, cols, 3) uint8 or uint16, optional
        The same view with the lasers off.
    camera : Camera
    square_mm : float
        Side of a square.
    lens : bool
        Also estimate radial distortion (OpenCV's k1) and principal point, for a camera of which only the focal length
        is known.

    Raises
    ------
    InputError
        If there are no squares, no lines, or no planes that fit.
    """
    if laser_on.shape[:2] != tuple(camera.shape_rc):
        raise InputError(
            f"the photo is {laser_on.shape[1]} x {laser_on.shape[0]} pixels, but the camera's numbers are for "
            f"{camera.shape_rc[1]} x {camera.shape_rc[0]}; give the calibration of this camera at this size"
        )
    at = find_two_lines(laser_on, photo)
    lattices = find_squares(laser_on if photo is None else photo)
    if not lattices:
        raise InputError("no squares are seen on the photo; a sheet of squared paper, its lines upright, is wanted")
    camera_frame = replace(camera, rotation=np.eye(3), translation=np.zeros(3))

    initial = [_initial_plane(at[:, line], camera_frame, lattices) for line in range(2)]
    depth = float(np.mean([middle for _, middle in initial]))

    def residuals(parameters: Floats) -> Floats:
        seen_by = _with_lens(camera_frame, parameters[8:])
        upper, lower = line_points(at, seen_by, _planes(parameters, depth))
        axes = cylinder_axes(camera_frame, parameters[6:8])
        cylinder = smooth_profile(upper, lower, np.zeros(3), axes)
        residual = [_lattice_residual(intersect_cylinder(cylinder, rays(seen_by, s.xy)[0])[1], s) for s in lattices]
        prior = parameters[9:] / CENTRE_SIGMA * ROBUST_SCALE
        return np.concatenate(
            [prior, profile_gap(upper, lower, np.zeros(3), axes), *(part.ravel() for part in residual)]
        )

    parameters = np.concatenate([_about_depth(plane, depth) for plane, _ in initial] + [np.zeros(2 + 3 * lens)])
    half_range = np.array(2 * [0.3, 0.7, 0.3 * depth] + [0.3, 0.3] + lens * [0.4, 0.1, 0.1])
    bounds = parameters - half_range, parameters + half_range
    best = least_squares(
        residuals, parameters, bounds=bounds, x_scale=half_range, loss="soft_l1", f_scale=ROBUST_SCALE, max_nfev=60
    ).x
    corners = sum(len(squares.xy) for squares in lattices)
    residual = residuals(best)[-2 * corners :]
    rms = float(np.sqrt(2 * np.mean(residual**2)))
    if not rms < MAX_RMS:
        raise InputError(
            f"with the best planes of the lasers the squares' corners are still {rms:.2f} squares rms off a lattice; "
            "is this the camera's calibration, and the sheet bent along one direction only?"
        )
    planes = _planes(best, depth)
    planes[:, 3] *= square_mm
    # from the camera's frame into the world: n.(R x + t) + d
    world = np.column_stack(
        [planes[:, :3] @ camera.rotation, planes[:, :3] @ np.ravel(camera.translation) + planes[:, 3]]
    )
    return LaserRig(_with_lens(camera, best[8:]), world, rms, corners)


def _with_lens(camera: Camera, lens: Floats) -> Camera:
    """Apply k1 and a shift of the principal point, relative to the focal length; no change for an empty `lens`."""
    if not len(lens):
        return camera
    matrix = camera.matrix.copy()
    matrix[:2, 2] += lens[1:] * np.diag(matrix)[:2]
    return replace(camera, matrix=matrix, distortion=np.array([lens[0], 0.0, 0, 0]))


def _planes(parameters: Floats, depth: float) -> Floats:
    """Planes (2, 4) from y = p x + q (z - depth) + r each, in squares."""
    planes = np.array([[p, -1.0, q, r - q * depth] for p, q, r in (parameters[:3], parameters[3:6])])
    return np.asarray(planes / np.linalg.norm(planes[:, :3], axis=1, keepdims=True))


def _about_depth(plane: Floats, depth: float) -> Floats:
    """Convert p, q, r of y = p x + q z + r to those of y = p x + q (z - depth) + r."""
    return plane + [0, 0, plane[1] * depth]


def _initial_plane(at: Floats, camera: Camera, lattices: list[Squares]) -> tuple[Floats, float]:
    """Fit p, q, r of y = p x + q z + r [squares] to a line's points; also return their median depth.

    Depths come from the heights of the squares around them.
    """
    positions, depth = [], []
    for squares in lattices:
        row = {(i, j): k for k, (i, j) in enumerate(squares.ij.tolist())}
        pairs = np.array([(k, row[i, j + 1]) for (i, j), k in row.items() if (i, j + 1) in row])
        a, b = squares.xy[pairs[:, 0]], squares.xy[pairs[:, 1]]
        positions.append((a + b) / 2)
        depth.append(camera.matrix[1, 1] / np.linalg.norm(b - a, axis=1))
    known = np.isfinite(at)
    xy = np.column_stack([np.flatnonzero(known), at[known]])
    residual, near = cKDTree(np.concatenate(positions)).query(xy, k=8)
    z = np.median(np.concatenate(depth)[near], axis=1)
    nearby = residual[:, 0] < np.median(residual[:, 0]) * 4
    directions, _ = rays(camera, xy[nearby])
    points = directions * (z[nearby] / directions[:, 2])[:, None]
    basis = np.column_stack([points[:, 0], points[:, 2], np.ones(len(points))])
    return np.linalg.lstsq(basis, points[:, 1])[0], float(np.median(points[:, 2]))


def _lattice_residual(flat: Floats, squares: Squares) -> Floats:
    """Residuals (n, 2) of unrolled corners from the best-fitting lattice of unit squares; 0 if unknown."""
    known = np.isfinite(flat).all(axis=1)
    residual = np.zeros_like(flat)
    if known.sum() < 3:
        return residual
    observed, lattice = flat[known], squares.ij[known].astype(np.float64)
    rotation, shift = fit_rigid(lattice, observed)
    residual[known] = observed - (lattice @ rotation.T + shift)
    return residual
