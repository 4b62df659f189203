"""Captures of a virtual laser scanner, including photos of boards for its calibration."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from planish.cli.acquire.virtual_files import BOARD_MM, write_camera, write_images

if TYPE_CHECKING:
    from planish.gallery import Sheet
    from planish.types import Floats, Page

SQUARE_MM = 8.0

FEET_MM = -20.0, 50.0, 120.0
"""x positions of the laser plane on the table; at each, two boards are held into the light."""

LOWER_MM, ASIDE_MM = 40.0, 55.0
"""Boards are lower than those before the projector and limited in x, so that the camera sees them completely."""


def laser(folder: Path, sheet: Sheet, small: bool) -> Page:
    """Write a sweep with its angles, and photos of boards with and without the line."""
    import numpy as np

    from planish.gallery.devices import board_poses
    from planish.gallery.laser import MIRROR_MM, laser_on_sheet, mirror_angle_deg, plane_through, virtual_sweep

    count, photo_px, line_mm = (48, (640, 480), 0.8) if small else (200, (2000, 1500), 0.35)
    capture = virtual_sweep(sheet, frames=count, photo_px=photo_px, line_mm=line_mm)
    write_images(folder / "frames", (capture.frame(k) for k in range(count)))
    write_images(folder, [capture.photo], "off.png")
    _write_angles(folder / "frames.csv", mirror_angle_deg(capture.planes[:, 0]))
    feet = np.repeat(FEET_MM, 2)
    boards = []
    for foot, (turn, middle) in zip(feet, board_poses(len(feet)), strict=True):
        middle[2] -= LOWER_MM
        # x of the laser plane at the height of the board, between mirror and table
        light = MIRROR_MM[0] + (foot - MIRROR_MM[0]) * (1 - middle[2] / MIRROR_MM[2])
        middle[0] = np.clip(light, -ASIDE_MM, ASIDE_MM)
        board, print_ = _board((turn, middle))
        plane = plane_through(MIRROR_MM, (foot, 0.0, 0.0))[None, None]
        boards.append(laser_on_sheet(board, plane, printed=(print_, ""), camera=capture.camera, line_mm=line_mm))
    write_images(folder / "camera", (board.photo for board in boards))
    write_images(folder / "boards", (board.frame(0) for board in boards))
    _write_angles(folder / "boards.csv", mirror_angle_deg(np.concatenate([board.planes[:, 0] for board in boards])))
    write_camera(folder / "camera.json", capture.camera)
    return capture.page


def laser_lines(folder: Path, sheet: Sheet, small: bool) -> Page:
    """Write photos of a page and of squared paper under two fixed laser lines."""
    from planish.gallery.laser import squared_paper, virtual_lines

    photo_px, line_mm = ((900, 700), 0.8) if small else ((2000, 1500), 0.5)
    capture = virtual_lines(sheet, photo_px=photo_px, line_mm=line_mm)
    squared = virtual_lines(
        sheet, photo_px=photo_px, line_mm=line_mm, printed=squared_paper(sheet, SQUARE_MM), camera=capture.camera
    )
    for name, taken in (("book", capture), ("squared", squared)):
        write_images(folder, [taken.frame(0)], f"{name}_on.png")
        write_images(folder, [taken.photo], f"{name}_off.png")
    write_camera(folder / "camera.json", capture.camera)
    return capture.page


def _board(pose: tuple[Floats, Floats]) -> tuple[Sheet, Page]:
    """A rigid board of 7 x 9 squares in a pose."""
    from planish.acquire.calibration.boards import Board, board_pixels
    from planish.gallery.devices import posed_board

    return posed_board(board_pixels(Board(7, 9, BOARD_MM), 90), 90, BOARD_MM, *pose)


def _write_angles(path: Path, angles_deg: Floats) -> None:
    from planish.io.files import write_bytes

    rows = (f"{k:03d}.png,{angle:.6f}\n" for k, angle in enumerate(angles_deg))
    write_bytes(path, ("photo,angle_deg\n" + "".join(rows)).encode())
