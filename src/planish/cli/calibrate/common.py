"""Options and functions shared by the commands of `planish calibrate`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

if TYPE_CHECKING:
    from planish.acquire.calibration.boards import Board
    from planish.acquire.calibration.camera import Calibration

Squares = Annotated[tuple[int, int], Parameter(name="--squares")]
SquareMm = Annotated[float, Parameter(name="--square-mm")]
Kind = Annotated[Literal["charuco", "chessboard"], Parameter(name="--kind")]


def write_calibration(
    calibration: Calibration, board: Board, output: Path, picture: Path | None, *, quiet: bool
) -> None:
    """Write the JSON and the picture, and print the accuracy of the calibration."""
    import sys

    import numpy as np
    from rich.console import Console

    from planish.acquire.calibration.poses import draw_poses
    from planish.hints import as_flag
    from planish.io import write_json, write_page
    from planish.io.cameras import camera_as_json
    from planish.types import Page

    note = (
        f"{len(calibration.errors_px)} photos of a board of {board.columns} x {board.rows} squares of "
        f"{board.square_mm:g} mm; reprojection error {calibration.rms_px:.3f} px rms; "
        f"focal length known to {100 * calibration.focal_sd:.2f} %"
    )
    write_json(output, {**camera_as_json(calibration.camera), "note": note})
    if picture is not None:
        pixels = draw_poses(calibration, board)
        write_page(picture, Page(pixels, np.ones(pixels.shape[:2], bool), 100.0))
    if quiet:
        return
    errors = Console(stderr=True, highlight=False, soft_wrap=True, markup=False)
    for warning in calibration.warnings:
        errors.print(f"planish: note: {warning.message(as_flag)}")
    if sys.stdout.isatty():
        print(note)
        print("each photo, px:", *(f"{error:.2f}" for error in calibration.errors_px))
        print(f"written  {output}")
