"""Calibrate cameras and projectors from photos of a board."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from planish.acquire.calibration.boards import MIN_CORNERS, Board, corner_points, find_corners
from planish.acquire.structured_light.gray_code import Grey
from planish.acquire.structured_light.scan import find_correspondence
from planish.errors import InputError
from planish.geometry.rigid_fit import nearest_rotation
from planish.types import Camera, Diagnostic, Floats

MIN_PHOTOS = 4

MIN_TILT_DEG = 12.0
"""Least angle between two of the board's poses; below it focal length and distance are ambiguous."""

MAX_FOCAL_SD = 0.01
"""Largest relative standard deviation of the focal length."""

OUTLIER_FACTOR = 3.0
"""Photos whose error exceeds so many times the median (and a pixel) are rejected."""

HOMOGRAPHY_REACH = 0.45
"""Radius of the local homography around a corner, in squares."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """A calibrated camera or projector, with its residuals.

    Attributes
    ----------
    camera : Camera
    errors_px : (n,) float64
        Rms reprojection error of the corners, per photo.
    rms_px : float
    focal_sd : float
        Relative standard deviation of the focal length, from the scatter of the corners.
    poses : list of ((3, 3), (3,)) float64
        Rotation and translation [mm] of the board in each photo, into the device's frame.
    corners : list of (k, 2) float64 [px]
        Detected corners.
    warnings : tuple of Diagnostic
    """

    camera: Camera
    errors_px: Floats
    rms_px: float
    focal_sd: float
    poses: list[tuple[Floats, Floats]]
    corners: list[Floats]
    warnings: tuple[Diagnostic, ...] = ()


def calibrate_camera(
    photos: Sequence[NDArray[np.uint8]], board: Board, names: Sequence[str] | None = None
) -> Calibration:
    """Calibrate a camera from photos of a board in different poses.

    Estimates focal lengths, principal point and OpenCV's k1 k2 p1 p2 (k3 stays 0: it needs corners at the very rim).

    Parameters
    ----------
    photos : sequence of (rows, cols) uint8
    board : Board
    names : sequence of str, optional
        Names of the photos, for messages.

    Raises
    ------
    InputError
        If photos differ in size, the board is detected in fewer than four, or its poses are too similar.
    """
    names = list(names or (f"photo {k + 1}" for k in range(len(photos))))
    _check_sizes(photos, names)
    calibration = [find_corners(board, photo) for photo in photos]
    lost = [name for name, one in zip(names, calibration, strict=True) if one is None]
    seen = [one for one in calibration if one is not None]
    if len(seen) < MIN_PHOTOS:
        raise InputError(
            f"the board of {board.columns} x {board.rows} squares ({board.kind}) was found in {len(seen)} of "
            f"{len(photos)} photos; at least {MIN_PHOTOS}, and better 10 or more, are wanted. Is it sharp, and are "
            "the numbers of its squares right?"
        )
    warnings = [Diagnostic("board-not-found", f"the board was not found in {', '.join(lost)}")] if lost else []
    object_points = [corner_points(board)[rows_of] for rows_of, _ in seen]
    return _calibrate(object_points, [xy for _, xy in seen], photos[0].shape, warnings)[0]


def calibrate_projector(
    captures: Sequence[Grey], board: Board, camera: Camera, shape_rc: tuple[int, int]
) -> Calibration:
    """Calibrate a projector from photos of a board under its Gray code, seen by a fixed, calibrated camera.

    Corners are detected in the photo under white and mapped to projector pixels by local homographies fitted to the
    decoded code (Moreno and Taubin 2012). The projector is then calibrated like a camera that sees the board.

    Parameters
    ----------
    captures : sequence of (n, rows, cols) uint8
        For each pose of the board, frames as for `find_correspondence`.
    board : Board
    camera : Camera
        Defines the world frame.
    shape_rc : (int, int)
        Rows and columns of the projector.

    Returns
    -------
    Calibration
        Of the projector, in the camera's frame.
    """
    object_points, on_camera, on_projector, lost = [], [], [], []
    for k, frames in enumerate(captures):
        if frames.shape[1:] != tuple(camera.shape_rc):
            raise InputError(
                f"pose {k + 1}: the photos are {frames.shape[2]} x {frames.shape[1]} pixels, but the camera's numbers "
                f"are for {camera.shape_rc[1]} x {camera.shape_rc[0]}; give the calibration of this camera at this size"
            )
        try:
            code = find_correspondence(frames, shape_rc).projector_xy
        except InputError as problem:
            raise InputError(f"pose {k + 1}: {problem.sentence}", problem.hint) from None
        found = find_corners(board, _stretch_to_8_bit(frames[-2]))
        observed = None if found is None else _corners_on_projector(code, found[1], _square_px(found, board))
        if found is None or observed is None or np.isfinite(observed[:, 0]).sum() < MIN_CORNERS:
            lost.append(str(k + 1))
            continue
        known = np.isfinite(observed[:, 0])
        object_points.append(corner_points(board)[found[0][known]])
        on_camera.append(found[1][known])
        on_projector.append(observed[known])
    if len(object_points) < MIN_PHOTOS:
        raise InputError(
            f"the board was found, and lit by the projector, in {len(object_points)} of {len(captures)} poses; at "
            f"least {MIN_PHOTOS} are wanted. Is it in the view of both, and are the numbers of its squares right?"
        )
    warnings = [Diagnostic("board-not-found", f"the board was not found in pose {', '.join(lost)}")] if lost else []
    projector_alone, kept = _calibrate(object_points, on_projector, shape_rc, warnings)
    return _register_to_camera(camera, projector_alone, [object_points[k] for k in kept], [on_camera[k] for k in kept])


def _calibrate(
    object_points: list[Floats], corners: list[Floats], shape_rc: tuple[int, ...], warnings: list[Diagnostic]
) -> tuple[Calibration, list[int]]:
    """Calibrate from corners, reject outlier photos, and refuse an uncertain result.

    Returns
    -------
    The calibration, and the indices of the photos used.
    """
    result = _solve(object_points, corners, shape_rc)
    kept = list(range(len(object_points)))
    outlier = result.errors_px > max(OUTLIER_FACTOR * float(np.median(result.errors_px)), 1.0)
    if outlier.any() and (~outlier).sum() >= MIN_PHOTOS:
        sentence = f"{outlier.sum()} photos do not fit the others and were left out; was the board bent there?"
        warnings = [*warnings, Diagnostic("photos-do-not-fit", sentence)]
        kept = [k for k in kept if not outlier[k]]
        result = _solve([object_points[k] for k in kept], [corners[k] for k in kept], shape_rc)
    normals = np.array([rotation[:, 2] for rotation, _ in result.poses])
    tilt_deg = float(np.degrees(np.arccos(np.clip((normals @ normals.T).min(), -1, 1))))
    if tilt_deg < MIN_TILT_DEG or result.focal_sd > MAX_FOCAL_SD:
        raise InputError(
            f"the board's poses are too alike: it turns by at most {tilt_deg:.0f} degrees from photo to photo (over "
            f"{MIN_TILT_DEG:g} are wanted) and the focal length is known to {100 * result.focal_sd:.1f} % only (1 % is "
            "wanted); tilt the board by 20 to 40 degrees to all sides, and fill the view with it"
        )
    return replace(result, warnings=tuple(warnings)), kept


def _solve(object_points: list[Floats], corners: list[Floats], shape_rc: tuple[int, ...]) -> Calibration:
    rows, cols = shape_rc[:2]
    start = np.array([[1.2 * cols, 0, (cols - 1) / 2], [0, 1.2 * cols, (rows - 1) / 2], [0, 0, 1]])
    rms, matrix, lens, rotations, shifts, deviations, _, errors = cv2.calibrateCameraExtended(
        [p.astype(np.float32) for p in object_points],
        [xy.astype(np.float32)[:, None] for xy in corners],
        (cols, rows),
        start,
        np.zeros(5),
        flags=cv2.CALIB_FIX_K3,
    )
    poses = [(_matrix(r), np.ravel(t)) for r, t in zip(rotations, shifts, strict=True)]
    focal_sd = float(np.ravel(deviations)[:2].max() / matrix[0, 0])
    camera = Camera(matrix, np.eye(3), np.zeros(3), (rows, cols), np.ravel(lens)[:4])
    return Calibration(camera, np.ravel(errors), float(rms), focal_sd, poses, corners)


def _register_to_camera(
    camera: Camera, calibration: Calibration, object_points: list[Floats], on_camera: list[Floats]
) -> Calibration:
    """Register the projector to the camera: the rigid motion between the board's poses in both frames.

    Starts from the mean over all poses, then minimises the reprojection error of all corners.
    """
    from scipy.optimize import least_squares

    poses = [_pose(camera, object_xyz, xy) for object_xyz, xy in zip(object_points, on_camera, strict=True)]
    rotations = [r @ rc.T for (r, _), (rc, _) in zip(calibration.poses, poses, strict=True)]
    rotation = nearest_rotation(np.sum(rotations, axis=0))
    shift = np.mean([t - rotation @ tc for (_, t), (_, tc) in zip(calibration.poses, poses, strict=True)], axis=0)
    start = np.concatenate([Rotation.from_matrix(rotation).as_rotvec(), shift])
    space = np.concatenate([object_xyz @ r.T + t for object_xyz, (r, t) in zip(object_points, poses, strict=True)])
    observed = np.concatenate(calibration.corners)

    def reprojection_errors(x: Floats) -> Floats:
        xy, _ = cv2.projectPoints(space, x[:3], x[3:], calibration.camera.matrix, calibration.camera.distortion)
        return np.asarray(xy.reshape(-1, 2) - observed).ravel()

    x = least_squares(reprojection_errors, start, x_scale=np.array([1e-3] * 3 + [1.0] * 3), loss="soft_l1").x
    projector = calibration.camera
    rotation = _matrix(x[:3])
    registered = replace(
        projector, rotation=rotation @ camera.rotation, translation=rotation @ np.ravel(camera.translation) + x[3:]
    )
    rms = float(np.sqrt((reprojection_errors(x).reshape(-1, 2) ** 2).sum(axis=1).mean()))
    return replace(calibration, camera=registered, rms_px=rms)


def _pose(camera: Camera, object_xyz: Floats, xy: Floats) -> tuple[Floats, Floats]:
    _, rotation_vector, shift = cv2.solvePnP(object_xyz, np.ascontiguousarray(xy), camera.matrix, camera.distortion)
    rotation_vector, shift = cv2.solvePnPRefineLM(
        object_xyz, np.ascontiguousarray(xy), camera.matrix, camera.distortion, rotation_vector, shift
    )
    return _matrix(rotation_vector), np.ravel(shift)


def _matrix(rotation_vector: Floats) -> Floats:
    return np.asarray(Rotation.from_rotvec(np.ravel(rotation_vector)).as_matrix())


def _corners_on_projector(code: Floats, corners: Floats, square_px: float) -> Floats:
    """Projector pixels (k, 2) of corners in the camera's photo; NaN outside of the projector's light.

    Code (rows, cols, 2) holds the projector pixel of each camera pixel.
    """
    known = np.argwhere(np.isfinite(code).all(axis=2))[:, ::-1].astype(np.float64)
    reach = max(4.0, HOMOGRAPHY_REACH * square_px)
    object_points = np.full((len(corners), 2), np.nan)
    for k, corner in enumerate(corners):
        near = known[(np.abs(known - corner) < reach).all(axis=1)]
        if len(near) < 30:
            continue
        observed = code[near[:, 1].astype(int), near[:, 0].astype(int)]
        homography, _ = cv2.findHomography(near - corner, observed, cv2.LMEDS)
        if homography is not None:
            object_points[k] = homography[:2, 2] / homography[2, 2]
    return object_points


def _square_px(calibration: tuple[NDArray[np.intp], Floats], board: Board) -> float:
    """Median side of the board's squares in the photo, from neighbouring corners in a row."""
    rows_of, xy = calibration
    neighbours = (np.diff(rows_of) == 1) & (rows_of[1:] % (board.columns - 1) != 0)
    sides = np.linalg.norm(np.diff(xy, axis=0), axis=1)[neighbours]
    return float(np.median(sides)) if len(sides) else 20.0


def _check_sizes(photos: Sequence[NDArray[np.uint8]], names: Sequence[str]) -> None:
    for photo, name in zip(photos, names, strict=True):
        if photo.shape != photos[0].shape:
            raise InputError(
                f"{name} is {photo.shape[1]} x {photo.shape[0]} pixels, {names[0]} {photos[0].shape[1]} x "
                f"{photos[0].shape[0]}; give photos of one camera at one setting"
            )


def _stretch_to_8_bit(grey: Grey) -> NDArray[np.uint8]:
    if grey.dtype == np.uint8:
        return np.asarray(grey, np.uint8)
    return (grey.astype(np.float32) * (255.0 / max(float(grey.max()), 1.0))).astype(np.uint8)
