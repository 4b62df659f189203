"""`planish calibrate laser` and `laser-lines`: laser planes, from photos of a board or of squared paper."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from planish.cli.calibrate.common import Kind, SquareMm, Squares
from planish.cli.options import Output, Quiet

GUESSED_SQUARE_MM = 5.0


def laser(
    photos: Annotated[list[Path], Parameter(name="PHOTOS")],
    /,
    *,
    camera: Path,
    output: Output,
    squares: Squares = (7, 10),
    square_mm: SquareMm = 25.0,
    kind: Kind = "charuco",
    lines: int = 1,
    motion: Path | None = None,
    overwrite: bool = True,
    quiet: Quiet = False,
) -> None:
    """Find the plane of a laser from photos of the board with the line on it, at various distances and tilts.

    With --motion, also find the axis about which a mirror rotates the laser plane.

    Parameters
    ----------
    photos
        Two or more, or a folder of them.
    camera
        The camera (JSON).
    output
        The JSON to write: “lasers”, their planes [mm], and the camera.
    squares
        Number of squares horizontally and vertically.
    square_mm
        Side of a square, as measured on the print.
    kind
        charuco: squares with markers, which may be partly occluded. chessboard: squares only.
    lines
        Number of laser lines in each photo.
    motion
        CSV with the columns photo and angle_deg: rotation of the laser plane in each photo. Two photos or more are
        needed at the smallest and at the largest angle.
    overwrite
        Whether existing files may be replaced.
    quiet
        Print nothing but errors.
    """
    from planish.acquire.calibration.boards import Board
    from planish.acquire.laser.axis import calibrate_laser_axis
    from planish.acquire.laser.board import calibrate_laser_planes
    from planish.errors import UsageError
    from planish.io import check_writable, read_camera, read_photo
    from planish.io.captures import image_files
    from planish.io.lasers import read_motion, write_rig

    check_writable(output, overwrite=overwrite)
    paths = image_files(photos)
    camera_model = read_camera(camera)
    pixels = [read_photo(path).pixels for path in paths]
    names = [path.name for path in paths]
    target = Board(*squares, square_mm, kind)
    if motion is None:
        calibration = calibrate_laser_planes(pixels, names, camera_model, target, lines=lines)
        write_rig(output, calibration.planes, camera_model)
        for sentence in () if quiet else calibration.left_out:
            print(f"planish: note: a photo was left out: {sentence}", file=sys.stderr)
        points, rms_mm = calibration.points, " and ".join(f"{rms:.3f}" for rms in calibration.rms_mm)
    else:
        moved, angles = read_motion(motion, names)
        if moved != "angles_deg" or lines != 1:
            raise UsageError("the axis needs one laser line and angles: --lines 1, and a column angle_deg")
        axis = calibrate_laser_axis(pixels, names, camera_model, target, angles)
        write_rig(output, axis.plane[None], camera_model, axis=(axis.point, axis.direction))
        points, rms_mm = axis.points, f"{axis.rms_mm:.3f}"
    if not quiet:
        print(f"{points:,} points on {len(paths)} boards, {rms_mm} mm rms from the laser plane")
        print(f"written  {output}")


def laser_lines(
    lit: Path,
    /,
    *,
    photo: Path | None = None,
    camera: Path | None = None,
    square_mm: float | None = None,
    output: Output,
    overwrite: bool = True,
    quiet: Quiet = False,
) -> None:
    """Find two fixed lasers from one photo of their lines on squared paper, flat or in an open book.

    Parameters
    ----------
    lit
        The photo with the lasers on; the lines run horizontally.
    photo
        The same view with the lasers off.
    camera
        The camera (JSON). Without it, the focal length is read from the photo's EXIF data. If no lens distortion is
        given, it is estimated together with the principal point.
    square_mm
        Side of a square [mm]. Without it, squares of 5 mm are assumed: pages have the right shape, but not true size.
    output
        The JSON to write: “lasers”, their planes [mm], and the camera.
    overwrite
        Whether existing files may be replaced.
    quiet
        Print nothing but errors.
    """
    import sys

    from planish.acquire.laser.rig import calibrate_laser_rig
    from planish.cli.acquire.laser_lines import camera_of
    from planish.io import check_writable, read_camera, read_photo
    from planish.io.lasers import write_rig

    check_writable(output, overwrite=overwrite)
    lit_pixels, unlit_pixels = read_photo(lit).pixels, None if photo is None else read_photo(photo).pixels
    camera_model = camera_of(lit, lit_pixels.shape[:2]) if camera is None else read_camera(camera)
    side = GUESSED_SQUARE_MM if square_mm is None else square_mm
    rig = calibrate_laser_rig(lit_pixels, unlit_pixels, camera_model, side, lens=not camera_model.distortion.any())
    note = None
    if square_mm is None:
        note = f"the squares are assumed to be {side:g} mm, so that pages are not at true size (--square-mm)"
    write_rig(output, rig.planes, rig.camera, note)
    if not quiet:
        if note:
            print(f"planish: note: {note}", file=sys.stderr)
        print(f"{rig.corners:,} corners of squares, {rig.rms_squares:.3f} squares rms from their grid")
        print(f"written  {output}")
