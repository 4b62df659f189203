"""`planish acquire laser`: scan from photos of a laser line that sweeps over the sheet."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from planish.cli.acquire.common import Mask, ScanFiles, check_scan_files, print_scan_summary, sheet_mask, write_acquired


def laser(
    frames: Annotated[list[Path], Parameter(name="FRAMES")],
    /,
    *,
    photo: Path,
    camera: Path,
    planes: Path,
    motion: Path | None = None,
    mask: Mask = "auto",
    files: ScanFiles,
) -> None:
    """Make a scan from photos of a laser line that sweeps over the sheet.

    Parameters
    ----------
    frames
        The photos with the laser on, or a folder of them, in the order of their names. They are read one at a time.
    photo
        The same view with the laser off; the others are divided by it to remove the print, and it becomes the scan's
        photo.
    camera
        The camera (JSON).
    planes
        The laser plane of every photo: CSV with the columns a, b, c, d [mm], or JSON with planes, with an axis and
        angles, with a direction and positions, or with a background of two known planes (docs/formats.md).
    motion
        CSV with the columns photo and angle_deg (or position_mm), if --planes has only a laser and its axis (or
        direction), as written by `planish calibrate laser`.
    mask
        Region of the sheet in the photo: an image that is white there; auto: bright paper on a darker background; none:
        the whole photo.
    """
    from planish.acquire.laser.sweep import from_laser, planes_from_background, sweep_stripes
    from planish.cli.console import progress_bar
    from planish.io import read_camera, read_photo
    from planish.io.captures import image_files
    from planish.io.lasers import read_sweep

    check_scan_files(files)
    paths = [path for path in image_files(frames) if path.resolve() != photo.resolve()]
    names = [path.name for path in paths]
    with progress_bar(quiet=files.quiet) as progress:
        progress("read", 0.0)
        seen_from = read_camera(camera)
        laser_planes = read_sweep(planes, names, motion, seen_from)
        unlit_photo = read_photo(photo)
        lines = 1 if isinstance(laser_planes, tuple) else laser_planes.shape[1]
        sweep = sweep_stripes(
            lambda k: read_photo(paths[k]).pixels, names, unlit_photo.pixels, lines=lines, progress=progress
        )
        progress("acquire", 0.0)
        if isinstance(laser_planes, tuple):
            laser_planes = planes_from_background(sweep, names, seen_from, *laser_planes)
        acquired = from_laser(sweep, names, unlit_photo.pixels, seen_from, laser_planes, mask=sheet_mask(mask))
        progress("write", 0.0)
        written = write_acquired(acquired, files)
    print_scan_summary(acquired, unlit_photo.warnings, written, quiet=files.quiet)
