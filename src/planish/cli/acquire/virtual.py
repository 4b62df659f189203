"""`planish acquire virtual`: synthetic captures of virtual devices, as examples."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

from planish.cli.acquire.virtual_files import BOARD_MM, SHEETS, write_camera, write_images
from planish.cli.options import Output, Quiet

if TYPE_CHECKING:
    from planish.gallery import Sheet
    from planish.types import Page


def virtual(
    device: Literal["depth", "gray-code", "boards", "laser", "laser-lines", "grid", "points", "photos"],
    /,
    *,
    output: Output,
    sheet: Literal["book", "folded", "curl", "crumpled"] = "book",
    small: bool = False,
    phase_steps: int = 0,
    quiet: Quiet = False,
) -> None:
    """Write the captures of a virtual device of a synthetic sheet, as input for the other commands.

    Parameters
    ----------
    device
        depth: 30 depth maps and a photo. gray-code: the photos under a projector's patterns. boards: photos of a
        board of 9 x 7 squares of 18 mm in eight poses, plain and under the patterns, by the same camera and projector.
        laser: a sweep, its angles, and photos of a board of 7 x 9 squares of 18 mm with and without the line.
        laser-lines: a page under two fixed lines, and squared paper of 8 mm under the same.
        grid: the range image of a scanner of 640 x 480 points. points: a photogrammetry cloud, and a photo.
        photos: ten photos of a phone from around, with a printed card of 40 mm beside the sheet.
    output
        Output folder; created if it does not exist. It also receives the true page and cameras.
    sheet
        book: a page of a thick bound book. folded: a letter folded in three. curl: a corner curled past vertical.
        crumpled: a sheet with random folds.
    small
        Half the resolution: a quarter of the time.
    phase_steps
        Phase-shift steps in addition to the Gray code, as for `planish acquire patterns`.
    quiet
        Print nothing but errors.
    """
    from planish.cli.acquire.virtual_clouds import grid, points
    from planish.cli.acquire.virtual_laser import laser, laser_lines
    from planish.cli.acquire.virtual_photos import photos
    from planish.cli.console import progress_bar
    from planish.gallery import sheet as known_sheet
    from planish.io import make_folder, write_page

    make_folder(output)
    with progress_bar(quiet=quiet) as progress:
        progress("scan", 0.0)
        if device == "boards":
            _boards(output, small, phase_steps)
            return
        shape = known_sheet(SHEETS[sheet])
        if device == "gray-code":
            page = _gray_code(output, shape, small, phase_steps)
        else:
            writers = {
                **{"depth": _depth, "laser": laser, "laser-lines": laser_lines},
                **{"grid": grid, "points": points, "photos": photos},
            }
            page = writers[device](output, shape, small)
        write_page(output / "page.png", page)


def _depth(folder: Path, sheet: Sheet, small: bool) -> Page:
    import numpy as np

    from planish.gallery.devices import depth_capture

    capture = depth_capture(sheet, shape_rc=(240, 320), photo_px=(1000, 750)) if small else depth_capture(sheet)
    write_images(folder / "depth", [frame.astype(np.uint16) for frame in capture.frames])
    write_images(folder, [capture.photo], "photo.png")
    write_camera(folder / "depth_camera.json", capture.camera)
    write_camera(folder / "photo_camera.json", capture.photo_camera)
    return capture.page


def _gray_code(folder: Path, sheet: Sheet, small: bool, phase_steps: int) -> Page:
    from planish.acquire.structured_light.phase import all_patterns
    from planish.gallery import typeset_sheet
    from planish.gallery.devices import SMALL_RIG, projector_rig, structured_light

    camera, projector = projector_rig(sheet, *SMALL_RIG) if small else projector_rig(sheet)
    page, _ = typeset_sheet(sheet)
    capture = structured_light(sheet, camera, projector, all_patterns(projector.shape_rc, phase_steps), page)
    write_images(folder / "photos", list(capture.frames))
    write_images(folder, [capture.photo], "photo.png")
    write_camera(folder / "camera.json", camera)
    write_camera(folder / "projector.json", projector)
    return page


def _boards(folder: Path, small: bool, phase_steps: int) -> None:
    from planish.acquire.calibration.boards import Board, board_pixels
    from planish.acquire.structured_light.phase import all_patterns
    from planish.gallery import sheet
    from planish.gallery.devices import SMALL_RIG, board_poses, posed_board, projector_rig, structured_light

    camera, projector = projector_rig(sheet("book"), *SMALL_RIG) if small else projector_rig(sheet("book"))
    pixels = board_pixels(Board(9, 7, BOARD_MM), 90)
    whites = []
    for k, (turn, middle) in enumerate(board_poses(8)):
        board, page = posed_board(pixels, 90, BOARD_MM, turn, middle)
        capture = structured_light(board, camera, projector, all_patterns(projector.shape_rc, phase_steps), page)
        write_images(folder / f"pose_{k}", list(capture.frames))
        whites.append(capture.frames[-2])
    write_images(folder / "camera", whites)
