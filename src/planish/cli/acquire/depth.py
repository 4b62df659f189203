"""`planish acquire depth`: scan from depth maps and a photo."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from planish.cli.acquire.common import (
    Mask,
    ScanFiles,
    check_scan_files,
    print_scan_summary,
    scale_warnings,
    sheet_mask,
    write_acquired,
)


def depth(
    depth_maps: Annotated[list[Path], Parameter(name="DEPTH")],
    /,
    *,
    photo: Path,
    camera: Path,
    photo_camera: Path | None = None,
    scale: float
    | Literal["auto", "realsense", "kinect", "azure", "redwood", "d405", "l515", "tum", "sun", "mm", "m"] = "auto",
    depth_along: Literal["z", "ray"] = "z",
    mask: Mask = "auto",
    files: ScanFiles,
) -> None:
    """Make a scan from the depth maps of a depth camera and a colour photo.

    Parameters
    ----------
    depth_maps
        16-bit PNG or TIFF, float TIFF, EXR, or .npy; or a folder of them. Several of the same scene are averaged.
    photo
        The colour photo.
    camera
        The depth camera (JSON).
    photo_camera
        The camera of the photo (JSON), in the same world frame; lengths in mm. Without it, the photo must be registered
        to the depth maps.
    scale
        Depth units per metre: realsense, kinect, azure and redwood 1000, d405 10000, l515 4000, tum 5000; sun: depths
        of SUN RGB-D, whose bits are shifted. auto: 1000 for integers; floating-point values below 20 are metres,
        others millimetres.
    depth_along
        What the depths are measured along. z: the axis of the camera, as depth cameras give them. ray: the line of
        sight of each pixel, as some renderers, time-of-flight and laser scanners do.
    mask
        Region of the sheet in the photo: an image that is white there; auto: bright paper on a darker background; none:
        the whole photo.
    """
    from planish.acquire.range_image.depth import from_depth
    from planish.cli.console import progress_bar
    from planish.io import read_camera, read_depths, read_photo, scaled_camera

    check_scan_files(files)
    with progress_bar(quiet=files.quiet) as progress:
        progress("read", 0.0)
        frames, warnings = read_depths(depth_maps, scale)
        photo_image = read_photo(photo)
        photo_shape = photo_image.pixels.shape[:2]
        depth_camera = read_camera(camera, photo_shape=photo_shape, warnings=warnings)
        depth_camera = scaled_camera(depth_camera, frames[0].shape) or depth_camera
        seen_from = None
        if photo_camera:
            seen_from = read_camera(photo_camera, photo.name, photo_shape=photo_shape, warnings=warnings)
            seen_from = scaled_camera(seen_from, photo_shape) or seen_from
        progress("acquire", 0.0)
        acquired = from_depth(
            frames, depth_camera, photo_image.pixels, seen_from, mask=sheet_mask(mask), depth_along=depth_along
        )
        progress("write", 0.0)
        written = write_acquired(acquired, files)
    if frames:
        warnings += scale_warnings(acquired.scan.mesh.points, scale)
    print_scan_summary(acquired, [*warnings, *photo_image.warnings], written, quiet=files.quiet)
