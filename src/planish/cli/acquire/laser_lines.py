"""`planish acquire laser-lines`: scan of a book from one photo with two laser lines across it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from planish.cli.acquire.common import Mask, ScanFiles, check_scan_files, print_scan_summary, sheet_mask, write_acquired

if TYPE_CHECKING:
    from planish.types import Camera


def laser_lines(
    lit: Path,
    /,
    *,
    lasers: Path,
    photo: Path | None = None,
    camera: Path | None = None,
    mask: Mask = "none",
    files: ScanFiles,
) -> None:
    """Make a scan of a book from one photo with two fixed laser lines across it.

    Parameters
    ----------
    lit
        The photo with the lasers on; the lines run horizontally, the spine vertically.
    lasers
        The laser planes (JSON), from `planish calibrate laser-lines` or `planish calibrate laser`.
    photo
        The same view with the lasers off, for the page. Without it, the lines remain visible on the page.
    camera
        The camera (JSON). Default: the camera in the lasers' file.
    mask
        Region of the sheet in the photo: an image that is white there; auto: bright paper on a darker background; none:
        the whole photo, including the surroundings of the book.
    """
    from planish.acquire.laser.lines import from_laser_lines
    from planish.cli.console import progress_bar
    from planish.io import read_camera, read_photo
    from planish.io.lasers import check_camera, read_rig

    check_scan_files(files)
    with progress_bar(quiet=files.quiet) as progress:
        progress("read", 0.0)
        planes, rig_camera, photo_warnings = read_rig(lasers)
        seen_from = rig_camera if camera is None else read_camera(camera)
        check_camera(lasers, rig_camera, seen_from)
        lit_photo, unlit_photo = read_photo(lit), None if photo is None else read_photo(photo)
        progress("acquire", 0.0)
        acquired = from_laser_lines(
            lit_photo.pixels,
            None if unlit_photo is None else unlit_photo.pixels,
            seen_from,
            planes,
            mask=sheet_mask(mask),
        )
        progress("write", 0.0)
        written = write_acquired(acquired, files)
    print_scan_summary(
        acquired,
        [*photo_warnings, *lit_photo.warnings, *([] if unlit_photo is None else unlit_photo.warnings)],
        written,
        quiet=files.quiet,
    )


def camera_of(photo: Path, shape_rc: tuple[int, int]) -> Camera:
    """Camera with the focal length of a photo's EXIF data and the principal point in the centre."""
    import numpy as np

    from planish.errors import InputError
    from planish.io.exif import focal_length_px
    from planish.types import Camera

    focal = focal_length_px(photo)
    if focal is None:
        raise InputError(
            f"{photo} has no focal length in its EXIF data; calibrate the camera and give it with --camera"
        )
    rows, cols = shape_rc
    matrix = np.array([[focal, 0, (cols - 1) / 2], [0, focal, (rows - 1) / 2], [0, 0, 1]])
    return Camera(matrix, np.eye(3), np.zeros(3), shape_rc)
