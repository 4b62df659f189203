"""`planish acquire points`: scan from an unorganised point cloud, for example from photogrammetry."""

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


def points(
    file: Annotated[Path, Parameter(name="FILE")],
    /,
    *,
    photo: Path | None = None,
    camera: Path | None = None,
    file_unit: FileUnit = FileUnit(),
    seen_from: tuple[float, float, float] | None = None,
    mask: Mask = "auto",
    files: ScanFiles,
) -> None:
    """Make a scan from an unorganised point cloud, for example from photogrammetry. Needs the extra `planish[points]`.

    Parameters
    ----------
    file
        PLY, PCD, E57, LAS, LAZ, or a text with x y z in each line; with colours, or with a photo beside it.
    photo
        A photo for the page, with --camera. Default: one rendered from the colours of the points.
    camera
        The camera of the photo (JSON), in the world frame of the points; lengths in their unit.
    seen_from
        Any position on the printed side, in the file's coordinates. Default: as the file says, else the camera, else
        from the normals of the points, else the origin, if it lies in front of the points, else from +z.
    mask
        Region of the sheet in the photo: an image that is white there; auto: bright paper on a darker background; none:
        the whole photo.
    """
    import numpy as np

    from planish.acquire.points.scan import from_points
    from planish.cli.console import progress_bar
    from planish.errors import UsageError
    from planish.io import read_cloud

    check_scan_files(files)
    units = file_unit.unit()
    if photo is not None and camera is None:
        raise UsageError("--photo needs --camera here, to project the points to it")
    with progress_bar(quiet=files.quiet) as progress:
        progress("read", 0.0)
        cloud = read_cloud(file)
        mm_per_unit, warnings = unit_of_cloud(cloud, units)
        photo_image, seen_by, photo_warnings = read_optional_photo(photo, camera, mm_per_unit)
        progress("acquire", 0.0)
        scanner_position = cloud.scanner if seen_from is None else np.array(seen_from)
        eye = None if scanner_position is None else scanner_position * mm_per_unit
        acquired = from_points(
            cloud.points * mm_per_unit,
            cloud.colours,
            cloud.normals,
            photo_image,
            seen_by,
            seen_from=eye,
            mask=sheet_mask(mask),
        )
        progress("write", 0.0)
        written = write_acquired(acquired, files)
    print_scan_summary(acquired, [*warnings, *photo_warnings], written, quiet=files.quiet)
