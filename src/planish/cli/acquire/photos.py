"""`planish acquire photos`: scan from several photos of a sheet."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from planish.cli.acquire.common import ScanFiles, check_scan_files, print_scan_summary, write_acquired
from planish.settings import Paper


def photos(
    photos: Annotated[list[Path], Parameter(name="PHOTOS")],
    /,
    *,
    camera: Path | None = None,
    marker_mm: float | None = None,
    paper: Paper = "unknown",
    width_mm: float | None = None,
    distance_mm: float | None = None,
    between: tuple[str, float, float, float, float] | None = None,
    files: ScanFiles,
) -> None:
    """Make a scan from several photos of a sheet, taken from around. Needs the extra `planish[photos]`.

    Parameters
    ----------
    photos
        Two or more, better eight to twelve, of the sheet lying still, in any order; or a folder of them.
    camera
        One calibrated lens that took all of them (JSON), or a file with the cameras of all photos by name. Default:
        found from the photos.
    marker_mm
        Side of the black squares of printed ArUco markers (DICT_4X4_50) beside the sheet, for its true size.
    paper
        Size of the sheet, for its true size.
    width_mm
        Width of the sheet, for its true size.
    distance_mm
        Distance of two places of the sheet along the paper, for its true size; --between names them.
    between
        Name of one of the photos, and column and row of both places in it (px), as an image viewer shows it.
    """
    from planish.acquire.photos.scan import from_photos
    from planish.cli.console import progress_bar
    from planish.io.photo_set import photo_files, read_photo_set
    from planish.pipeline.scale import scaled_by_page
    from planish.settings import PhotoSettings

    check_scan_files(files)
    settings = PhotoSettings(
        marker_mm=marker_mm, paper=paper, width_mm=width_mm, distance_mm=distance_mm, between=between
    )
    with progress_bar(quiet=files.quiet) as progress:
        progress("read", 0.0)
        sources, cameras, warnings = read_photo_set(photo_files(photos), camera, between)
        progress("acquire", 0.0)
        found = from_photos(sources, settings, cameras=cameras, progress=lambda share: progress("acquire", share))
        found = scaled_by_page(found, settings)
        progress("write", 0.0)
        written = write_acquired(found.acquired, files)
    print_scan_summary(found.acquired, warnings, written, quiet=files.quiet)
