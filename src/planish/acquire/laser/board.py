"""Calibrate laser planes from photos of a calibration board with the lines on it."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from planish.acquire.calibration.boards import Board, corner_points, find_corners
from planish.acquire.laser.faint import faint_line
from planish.acquire.laser.lines import laser_colour, without_laser
from planish.acquire.laser.stripes import Direction, find_stripes, laser_off_image
from planish.acquire.laser.sweep import crossings_xy, fit_plane
from planish.color import to_grey
from planish.errors import InputError
from planish.geometry.axes import principal_axes
from planish.geometry.guards import normalize
from planish.geometry.triangulation import meet_plane, rays
from planish.types import Camera, Floats, Pixels

MIN_CROSSINGS = 20
"""Least number of rows or columns in which a line is detected on the board."""

COLLINEAR = 0.03
"""Least ratio of the second to the first principal extent of the points; below it they are collinear."""

LINE_TOLERANCE = 0.04
"""Largest distance from the straight line on the board, in squares; beyond it are reflections."""

FEW_ROWS = 0.5
"""Share of the board's rows below which a line counts as faint, and is looked for again by colour alone."""

FAINT_TOLERANCE_PX = 3.0
"""From a straight line in the photo: the lens bends lines by 1 or 2 pixels, colours of the room lie anywhere."""

TRIALS = 300
"""RANSAC trials: with half of the points outliers one pair in four is good."""

MAX_REPROJECTION_PX = 2.0
"""Largest rms reprojection error of the board's corners."""


class LaserPlanes(NamedTuple):
    """Calibrated laser planes.

    Attributes
    ----------
    planes : (lines, 4) float64
        a x + b y + c z + d = 0 [mm] in the camera's world, the upper or left one first.
    rms_mm : (lines,) float64
        Rms distance of the points from each plane.
    points : int
        Number of points.
    left_out : tuple of str
        Why photos were left out, a sentence each.
    """

    planes: Floats
    rms_mm: Floats
    points: int
    left_out: tuple[str, ...] = ()


def calibrate_laser_planes(
    photos: list[Pixels], names: list[str], camera: Camera, board: Board, *, lines: int = 1
) -> LaserPlanes:
    """Calibrate laser planes from photos of a board in different poses, with the lines on it.

    A photo without a usable board or line is left out where two others are left.

    Parameters
    ----------
    photos : list of (rows, cols, 3) uint8 or uint16
    names : list of str
        For messages.
    camera : Camera
    board : Board
    lines : int

    Raises
    ------
    InputError
        If a photo shows no board or no line, or the poses are too similar to determine a plane.
    """
    seen, left_out = [], []
    for photo, name in zip(photos, names, strict=True):
        try:
            seen += laser_points_on_boards([photo], [name], camera, board, lines)
        except InputError as problem:
            left_out.append(problem)
    if left_out and len(seen) < 2:
        raise left_out[0]
    planes, rms = [], []
    for line in range(lines):
        points = np.concatenate([parts[line] for parts in seen])
        length, spread, _ = principal_axes(points)[1]
        if spread < COLLINEAR * length:
            raise InputError(
                f"the laser's lines on {len(photos)} photos of the board are almost one line in space, "
                f"{100 * spread / length:.1f} % of their length apart; show the board nearer and farther, and tilted"
            )
        plane, plane_rms = fit_plane(points)
        planes.append(plane)
        rms.append(plane_rms)
    return LaserPlanes(
        np.array(planes), np.array(rms), sum(len(part) for parts in seen for part in parts), tuple(map(str, left_out))
    )


def laser_points_on_boards(
    photos: list[Pixels], names: list[str], camera: Camera, board: Board, lines: int = 1
) -> list[list[Floats]]:
    """Triangulate laser lines on a board: for every photo and line, points (k, 3) [mm] in the world.

    Raises
    ------
    InputError
        If a photo shows no board or no line, or does not fit the camera.
    """
    seen = []
    for photo, name in zip(photos, names, strict=True):
        if photo.shape[:2] != tuple(camera.shape_rc):
            raise InputError(
                f"{name} is {photo.shape[1]} x {photo.shape[0]} pixels, but the camera's numbers are for "
                f"{camera.shape_rc[1]} x {camera.shape_rc[0]}; give the calibration of this camera at this size"
            )
        plane, outline = _pose(photo, name, camera, board)
        parts = []
        for xy in _lines_on_board(photo, name, outline, lines):
            directions, eye = rays(camera, xy)
            points = _inliers_of_line(meet_plane(eye, directions, plane), LINE_TOLERANCE * board.square_mm)
            if len(points) < MIN_CROSSINGS:
                raise InputError(
                    f"in {name} no straight laser line is seen on the board; is the laser on, the number of lines "
                    "right, and does each cross the squares?"
                )
            parts.append(points)
        seen.append(parts)
    return seen


def _inliers_of_line(points: Floats, tolerance: float) -> Floats:
    """Inliers among points (k, 3) of the dominant straight line (RANSAC)."""
    points = points[np.isfinite(points).all(axis=1)]
    pairs = np.random.default_rng(0).integers(max(len(points), 1), size=(TRIALS, 2))
    best = np.zeros(len(points), bool)
    for a, b in points[pairs] if len(points) else ():
        direction = normalize(b - a)
        offset = points - a
        near = np.linalg.norm(offset - np.outer(offset @ direction, direction), axis=1) < tolerance
        best = near if near.sum() > best.sum() else best
    return points[best]


def _pose(photo: Pixels, name: str, camera: Camera, board: Board) -> tuple[Floats, Floats]:
    """Plane (4,) of the board in the world, and convex hull (k, 2) of its corners on the photo."""
    found = find_corners(board, to_grey(without_laser(photo, laser_colour(photo))))
    if found is None:
        raise InputError(
            f"{name} shows no {board.kind} of {board.columns} x {board.rows} squares; it must be in view, sharp, and "
            "its numbers right"
        )
    rows, xy = found
    object_points = corner_points(board)[rows]
    _, rotation_vector, shift = cv2.solvePnP(object_points, xy, camera.matrix, camera.distortion)
    reprojected = cv2.projectPoints(object_points, rotation_vector, shift, camera.matrix, camera.distortion)[0].reshape(
        -1, 2
    )
    rms = float(np.sqrt(((reprojected - xy) ** 2).sum(axis=1).mean()))
    if rms > MAX_REPROJECTION_PX:
        raise InputError(
            f"in {name} the board's corners are {rms:.1f} pixels rms from where this camera would see them; is this "
            "the calibration of this camera?"
        )
    normal = Rotation.from_rotvec(np.ravel(rotation_vector)).as_matrix()[:, 2]  # in the camera
    distance = float(normal @ (shift.ravel() - np.ravel(camera.translation)))
    outline = cv2.convexHull(xy.astype(np.float32)).reshape(-1, 2).astype(np.float64)
    return np.array([*(normal @ camera.rotation), -distance]), outline


def _lines_on_board(photo: Pixels, name: str, outline: Floats, lines: int) -> list[Floats]:
    """Photo positions (k, 2) of each line within the board."""
    channel = laser_colour(photo)
    laser_off = without_laser(photo, channel)
    inside = cv2.fillPoly(np.zeros(photo.shape[:2], np.uint8), [np.rint(outline).astype(np.int32)], 1).astype(bool)
    masked = np.where(inside[..., None], photo, laser_off)
    best: list[Floats] = []
    directions: tuple[Direction, ...] = ("rows", "columns")
    for along in directions:
        stripes = find_stripes(masked, laser_off_image(laser_off, channel, along), channel, along, lines=lines)
        good = np.isfinite(stripes.at).all(axis=1) & (stripes.sd < 1.0).all(axis=1)
        found = [crossings_xy(stripes.at[:, line], along)[good] for line in range(lines)]
        if not best or len(found[0]) > len(best[0]):
            best = found
    if lines == 1:
        for along in directions:
            if len(best[0]) < FEW_ROWS * inside.any(axis=1 if along == "rows" else 0).sum():
                at, _ = faint_line(photo, inside, along)
                straight = _inliers_of_line(crossings_xy(at, along)[np.isfinite(at)], FAINT_TOLERANCE_PX)
                best = [straight] if len(straight) > len(best[0]) else best
    if len(best[0]) < MIN_CROSSINGS:
        raise InputError(
            f"in {name} {lines} laser {'line is' if lines == 1 else 'lines are'} seen on the board in {len(best[0])} "
            f"rows; at least {MIN_CROSSINGS} are wanted. Is the laser on, and does its line cross the "
            "squares?"
        )
    return best
