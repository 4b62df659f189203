"""`planish acquire points`: points in any order, as photogrammetry makes them, to a scan."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from planish.cli.acquire.common import (
    Mask,
    ScanFiles,
    check_scan_files,
    cloud_in_mm,
    photo_for,
    say,
    sheet_on,
    write_acquired,
)
from planish.settings import Units


def points(
    file: Annotated[Path, Parameter(name="FILE")],
    /,
    *,
    photo: Path | None = None,
    camera: Path | None = None,
    units: Units = "auto",
    seen_from: tuple[float, float, float] | None = None,
    mask: Mask = "auto",
    files: ScanFiles,
) -> None:
    """Make a scan from points in any order, as photogrammetry makes them. Needs the extra `planish[points]`.

    Parameters
    ----------
    file
        PLY, PCD, E57, LAS, LAZ, or a text with x y z in each line; with colours, or with a photo beside it.
    photo
        A photo to draw on the page, with --camera. Without it one is made of the points' colours.
    camera
        The camera that took the photo (JSON), in the world of the points; lengths in their unit.
    units
        Of the file's numbers; auto: what the file says, else decided from the size.
    seen_from
        Any place from which the printed side was seen, in the file's numbers. Without it: where the file says, else
        the camera, else the points' normals, else the origin, if it lies in front of the points, else from +z.
    mask
        Where on the photo the sheet is: an image that is white there; auto: bright paper on darker ground; none:
        everywhere.
    """
    import numpy as np

    from planish.acquire.points.scan import from_points
    from planish.cli.console import progress
    from planish.errors import UsageError
    from planish.io import read_cloud

    check_scan_files(files)
    if photo is not None and camera is None:
        raise UsageError("--photo needs --camera here: nothing else tells where the points lie on it")
    with progress(quiet=files.quiet) as tell:
        tell("read", 0.0)
        cloud = read_cloud(file)
        mm_per_unit, warnings = cloud_in_mm(cloud, units)
        shot, seen_by, notes = photo_for(photo, camera, mm_per_unit)
        tell("acquire", 0.0)
        stood = cloud.scanner if seen_from is None else np.array(seen_from)
        eye = None if stood is None else stood * mm_per_unit
        made = from_points(
            cloud.points * mm_per_unit, cloud.colours, cloud.normals, shot, seen_by, seen_from=eye, mask=sheet_on(mask)
        )
        tell("write", 0.0)
        written = write_acquired(made, files)
    say(made, [*warnings, *notes], written, quiet=files.quiet)
