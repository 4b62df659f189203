"""`planish calibrate board`, `camera` and `projector`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from planish.cli.calibrate.common import Kind, SquareMm, Squares, write_calibration
from planish.cli.options import Output, Quiet, check_files


def board(
    *,
    output: Output,
    squares: Squares = (7, 10),
    square_mm: SquareMm = 25.0,
    kind: Kind = "charuco",
    paper: Literal["a4", "letter"] = "a4",
    overwrite: bool = True,
) -> None:
    """Draw a calibration board, to be printed at 100 % and mounted on a flat surface.

    Parameters
    ----------
    output
        .pdf, or .png or .tif with its dpi as metadata.
    squares
        Number of squares horizontally and vertically.
    square_mm
        Side of a square. Measure the print, and give the measured value to the other commands.
    kind
        charuco: squares with markers, which may be partly occluded. chessboard: squares only.
    paper
        Paper size.
    overwrite
        Whether an existing file may be replaced.
    """
    from planish.acquire.calibration.boards import Board, board_page
    from planish.io import check_page_name, check_writable, write_page

    check_page_name(output)
    check_writable(output, overwrite=overwrite)
    write_page(output, board_page(Board(*squares, square_mm, kind), paper))


def camera(
    photos: Annotated[list[Path], Parameter(name="PHOTOS")],
    /,
    *,
    output: Output,
    squares: Squares = (7, 10),
    square_mm: SquareMm = 25.0,
    kind: Kind = "charuco",
    picture: Path | None = None,
    overwrite: bool = True,
    quiet: Quiet = False,
) -> None:
    """Calibrate a camera from photos of the board in ten or more poses.

    Parameters
    ----------
    photos
        A folder, or the files: the board tilted by 20 to 40 degrees in all directions, everywhere in the view. Zoom and
        focus must not change, neither between the photos nor afterwards.
    output
        The camera (JSON).
    squares
        Number of squares of the board, horizontally and vertically.
    square_mm
        Side of a square as measured on the print.
    kind
        charuco: squares with markers. chessboard: squares only.
    picture
        Also draw the detected corners and the poses of the board.
    overwrite
        Whether existing files may be replaced.
    quiet
        Print nothing but errors.
    """
    from planish.acquire.calibration.boards import Board
    from planish.acquire.calibration.camera import calibrate_camera
    from planish.cli.console import progress_bar
    from planish.io import read_captures

    check_files(output, picture, overwrite=overwrite)
    target = Board(*squares, square_mm, kind)
    with progress_bar(quiet=quiet) as progress:
        progress("read", 0.0)
        captured = read_captures(photos)
        progress("calibrate", 0.0)
        calibration = calibrate_camera(list(captured.frames), target, [path.name for path in captured.paths])
    write_calibration(calibration, target, output, picture, quiet=quiet)


def projector(
    poses: Annotated[list[Path], Parameter(name="POSES")],
    /,
    *,
    camera: Path,
    size: tuple[int, int],
    output: Output,
    squares: Squares = (7, 10),
    square_mm: SquareMm = 25.0,
    kind: Kind = "charuco",
    picture: Path | None = None,
    overwrite: bool = True,
    quiet: Quiet = False,
) -> None:
    """Calibrate a projector beside a calibrated camera, from photos of the board under its Gray code.

    Parameters
    ----------
    poses
        Folders, one for each pose of the board: the photos of all patterns, as for `planish acquire gray-code`.
        Camera and projector must not move from here on.
    camera
        The camera of the photos (JSON); its world frame becomes that of the projector.
    size
        Width and height of the projector's patterns in pixels.
    output
        The projector (JSON).
    squares
        Number of squares of the board, horizontally and vertically.
    square_mm
        Side of a square as measured on the print.
    kind
        charuco: squares with markers. chessboard: squares only.
    picture
        Also draw the corners in the projector image and the poses of the board.
    overwrite
        Whether existing files may be replaced.
    quiet
        Print nothing but errors.
    """
    from planish.acquire.calibration.boards import Board
    from planish.acquire.calibration.camera import calibrate_projector
    from planish.cli.console import progress_bar
    from planish.io import read_camera, read_captures

    check_files(output, picture, overwrite=overwrite)
    target = Board(*squares, square_mm, kind)
    with progress_bar(quiet=quiet) as progress:
        progress("read", 0.0)
        camera_model = read_camera(camera)
        captures = []
        for k, pose in enumerate(poses):
            progress("read", k / len(poses))
            captures.append(read_captures([pose]).frames)
        progress("calibrate", 0.0)
        calibration = calibrate_projector(captures, target, camera_model, (size[1], size[0]))
    write_calibration(calibration, target, output, picture, quiet=quiet)
