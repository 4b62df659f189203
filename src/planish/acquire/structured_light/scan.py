"""Make scans from Gray code captures: check, decode, refine, triangulate, and mesh on the camera's grid."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from planish.acquire.grid_mesh import AcquiredScan, grid_mesh
from planish.acquire.range_image.depth import pixel_noise
from planish.acquire.scan_quality import with_noise
from planish.acquire.structured_light.frames import check_frames, unresolved_bits
from planish.acquire.structured_light.gray_code import Grey, decode, frame_count
from planish.acquire.structured_light.phase import decode_phase, phase_steps
from planish.acquire.structured_light.phase_frames import check_count, check_waves
from planish.acquire.structured_light.projector import USUAL_GAP_PX, check_fit, projector_of_code, triangulate_pairs
from planish.acquire.structured_light.subpixel import refine_subpixel
from planish.document.sheet_outline import sheet_mask
from planish.errors import InputError, UsageError
from planish.types import Bools, Camera, Diagnostic, Floats, Pixels, Scan

SAMPLED_SIDE = 50
"""Approximate rows and columns of the pixels sampled for the consistency check."""

SHOW_WAVES = "show waves as well (patterns with {phase_steps=8}), focus, or give more light"
MORE_WAVES = "show more waves (patterns with a larger {phase_steps}), focus, or give more light"

MAX_EXTRA_ERROR_PX = 3.0
"""Points whose epipolar error exceeds the median by more are rejected [code px]."""


class Correspondence(NamedTuple):
    """Projector position seen by each camera pixel.

    Attributes
    ----------
    projector_xy : (rows, cols, 2) float64 [projector px]
        x right, y down, pixel centres at integers; NaN where unknown.
    confidence : (rows, cols) float64
        0 to 1.
    warnings : list of Diagnostic
    """

    projector_xy: Floats
    confidence: Floats
    warnings: list[Diagnostic]


def from_gray_code(
    frames: Grey,
    camera: Camera,
    projector: Camera,
    photo: Pixels | None = None,
    *,
    projector_scale: float = 1.0,
    mask: Bools | str | None = "auto",
) -> AcquiredScan:
    """Make a scan from photos of a sheet under a projector's Gray code.

    Parameters
    ----------
    frames : (n, rows, cols) uint8 or uint16
        Grey, in the order of `gray_code.patterns`; optionally the photos of `phase.patterns` before white.
    camera, projector : Camera
        In one frame.
    photo : (rows, cols, 3) uint8 or uint16, optional
        From the same camera; by default the frame under white.
    projector_scale : float
        Calibrated projector pixels per code pixel.
    mask : (rows, cols) bool, "auto" or None
        Sheet on the photo. auto: bright paper on a darker background, if it stands out; None: everything.

    Raises
    ------
    InputError
        If photos are missing, duplicated, out of order, overexposed or of another size, or the calibration does not
        fit.
    """
    if not projector_scale > 0:
        raise UsageError(f"the projector scale is {projector_scale:g}; it must be above 0")
    check_size(frames.shape[1:], camera)
    code_projector = projector_of_code(projector, projector_scale)
    photo = _three_channels(frames[-2]) if photo is None else photo
    sheet, warnings = sheet_mask(photo, mask)
    sparse = _sparse(camera.shape_rc)
    correspondence = find_correspondence(frames, code_projector.shape_rc, None if sheet is None else sheet | sparse)
    warnings = correspondence.warnings + warnings
    points, median_error_px = triangulate(camera, code_projector, correspondence.projector_xy, sparse)
    if sheet is not None:
        points[~sheet] = np.nan
    if median_error_px > USUAL_GAP_PX:
        warnings.append(
            Diagnostic(
                "calibration-poor",
                f"rays of camera and projector have a median error of {median_error_px:.1f} code pixels (a "
                f"good calibration has below {USUAL_GAP_PX:g}): sizes may be off by a percent or more",
            )
        )
    noise_mm = pixel_noise(points @ camera.rotation[2])
    mesh, pixel_xy = grid_mesh(points, camera, noise_mm=noise_mm)
    column, row = pixel_xy.astype(int).T
    scan = Scan(mesh, photo, pixel_xy, camera)
    acquired = AcquiredScan(scan, correspondence.confidence[row, column], noise_mm, tuple(warnings))
    steps = phase_steps(len(frames), code_projector.shape_rc)
    return with_noise(acquired, MORE_WAVES if steps else SHOW_WAVES)


def find_correspondence(frames: Grey, shape_rc: tuple[int, int], where: Bools | None = None) -> Correspondence:
    """Decode the projector position of each camera pixel from all photos.

    Parameters
    ----------
    frames : (n, rows, cols) uint8 or uint16
        In the order of `gray_code.patterns`; optionally the photos of `phase.patterns` before white.
    shape_rc : (int, int)
        Rows and columns of the projector.
    where : (rows, cols) bool, optional
        Pixels to decode; the others stay NaN.

    Raises
    ------
    InputError
        If photos are missing, duplicated, out of order or overexposed, or nothing can be decoded.
    """
    code, waves = frames, None
    check_count(frames, shape_rc)
    if steps := phase_steps(len(frames), shape_rc):
        bits = frame_count(shape_rc) - 2
        code, waves = np.concatenate([frames[:bits], frames[-2:]]), frames[bits:-2]
        assert len(waves) == 2 * steps
    warnings = check_frames(code, shape_rc)
    skipped_bits = unresolved_bits(code, shape_rc) if waves is None else (0, 0)
    codes = decode(code, shape_rc, skipped_bits=skipped_bits)
    if waves is None:
        if not (codes.column >= 0).any():
            raise InputError(
                "no pixel's code could be read: the finest stripes, two pixels of the projector wide, must be seen; "
                "are camera and projector in focus, and is the camera near enough?",
                "if so, show waves as well (patterns with {phase_steps=8}), with which stripes of 16 pixels are enough",
            )
        warnings += [
            Diagnostic(
                "stripes-unresolved",
                f"the camera does not resolve the projector's finest {name}, only stripes of {2 << bits} pixels and "
                "wider, so places are less exact",
                "focus, come nearer, or show waves as well",
            )
            for name, bits in zip(("columns", "rows"), skipped_bits, strict=True)
            if bits
        ]
        return Correspondence(
            refine_subpixel(code, codes, shape_rc, where, skipped_bits=skipped_bits), codes.confidence, warnings
        )
    check_waves(code, waves, shape_rc)
    shown = decode_phase(code, waves, shape_rc)
    confidence = np.where(shown.confidence > 0, shown.confidence, codes.confidence)
    return Correspondence(refine_subpixel(code, codes, shape_rc, where, shown), confidence, warnings)


def triangulate(
    camera: Camera, projector: Camera, projector_xy: Floats, sparse: Bools | None = None
) -> tuple[Floats, float]:
    """Triangulate all camera pixels with a known projector position.

    Parameters
    ----------
    camera, projector : Camera
        Projector in code pixels.
    projector_xy : (rows, cols, 2) float64 [projector px]
    sparse : (rows, cols) bool, optional
        Pixels sampled for the consistency check; by default all.

    Returns
    -------
    points : (rows, cols, 3) float64 [mm]
        NaN where unknown, or where the epipolar error is too large.
    median_error_px : float
        Median epipolar error [code px].

    Raises
    ------
    InputError
        If calibration and code do not fit, see `projector.check_fit`.
    """
    known = np.isfinite(projector_xy).all(axis=2)
    if not known.any():
        raise InputError("no stripe's edge was found; are the projector's patterns in focus and its pixels in view?")
    camera_xy = np.argwhere(known)[:, ::-1].astype(np.float64)
    sampled = sparse[known] if sparse is not None and sparse[known].any() else np.ones(len(camera_xy), bool)
    median_error = check_fit(camera, projector, camera_xy[sampled], projector_xy[known][sampled])
    triangulate, errors_px = triangulate_pairs(camera, projector, camera_xy, projector_xy[known])
    triangulate[~(errors_px <= median_error + MAX_EXTRA_ERROR_PX)] = np.nan
    points = np.full((*known.shape, 3), np.nan)
    points[known] = triangulate
    return points, median_error


def _sparse(shape_rc: tuple[int, int]) -> Bools:
    """Mask of regularly sampled pixels."""
    sparse = np.zeros(shape_rc, bool)
    step = max(1, min(shape_rc) // SAMPLED_SIDE)
    sparse[::step, ::step] = True
    return sparse


def check_size(shape_rc: tuple[int, ...], camera: Camera) -> None:
    """Refuse photos whose size differs from the calibrated one."""
    if tuple(shape_rc) != tuple(camera.shape_rc):
        (rows, cols), (wanted_rows, wanted_cols) = shape_rc, camera.shape_rc
        raise InputError(
            f"the photos are {cols} x {rows} pixels, but the camera's numbers are for {wanted_cols} x {wanted_rows}; "
            "give the calibration of this camera at this size"
        )


def _three_channels(grey: Grey) -> Pixels:
    colours: Pixels = np.repeat(grey[..., None], 3, axis=2)  # type: ignore[assignment]
    return colours
