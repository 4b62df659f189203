"""`planish acquire grid`: scan from a range image, points in rows and columns."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from planish.cli.acquire.common import (
    Mask,
    ScanFiles,
    check_scan_files,
    print_scan_summary,
    read_optional_photo,
    sheet_mask,
    unit_of_cloud,
    write_acquired,
)
from planish.cli.options import FileUnit


def grid(
    file: Annotated[Path, Parameter(name="FILE")],
    /,
    *,
    photo: Path | None = None,
    camera: Path | None = None,
    size: tuple[int, int] | None = None,
    file_unit: FileUnit = FileUnit(),
    seen_from: tuple[float, float, float] | None = None,
    mask: Mask = "auto",
    files: ScanFiles,
) -> None:
    """Make a scan from a range image: an organised point cloud.

    Parameters
    ----------
    file
        PLY with a range grid, PCD, PTX, E57 with rows and columns, or a text with x y z in each line. Missing points
        are 0 0 0 or nan.
    photo
        A photo for the page: of the size of the range image or a multiple of it, or with --camera. Default: the colours
        of the points.
    camera
        The camera of the photo (JSON), in the world frame of the points; lengths in their unit.
    size
        Width and height of the range image, if neither the file nor the order of the points determines them.
    seen_from
        Position of the scanner, in the file's coordinates. Default: as the file says, or the origin, if it lies in
        front of the points; otherwise rows and columns are taken as seen from the printed side.
    mask
        Region of the sheet in the photo: an image that is white there; auto: bright paper on a darker background; none:
        the whole photo.
    """
    import numpy as np

    from planish.acquire.range_image.grid import from_grid, grid_photo
    from planish.acquire.range_image.grid_shape import grid_shape
    from planish.cli.console import progress_bar
    from planish.io import read_cloud

    check_scan_files(files)
    units = file_unit.unit()
    with progress_bar(quiet=files.quiet) as progress:
        progress("read", 0.0)
        cloud = read_cloud(file)
        shape_rc = grid_shape(cloud.points, cloud.shape_rc, size and (size[1], size[0]))
        mm_per_unit, warnings = unit_of_cloud(cloud, units)
        photo_image, seen_by, photo_warnings = read_optional_photo(photo, camera, mm_per_unit)
        progress("acquire", 0.0)
        points = (cloud.points * mm_per_unit).reshape(*shape_rc, 3)
        if photo_image is None and cloud.colours is not None:
            photo_image = grid_photo(points, cloud.colours.reshape(*shape_rc, 3))
        scanner_position = cloud.scanner if seen_from is None else np.array(seen_from)
        eye = None if scanner_position is None else scanner_position * mm_per_unit
        acquired = from_grid(points, photo_image, seen_by, seen_from=eye, mask=sheet_mask(mask))
        progress("write", 0.0)
        written = write_acquired(acquired, files)
    print_scan_summary(acquired, [*warnings, *photo_warnings], written, quiet=files.quiet)
