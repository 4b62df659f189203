"""`planish acquire gray-code` and `planish acquire patterns`: scan with a camera and a projector."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from planish.cli.acquire.common import Mask, ScanFiles, check_scan_files, print_scan_summary, sheet_mask, write_acquired
from planish.cli.options import Output, Quiet


def gray_code(
    photos: Annotated[list[Path], Parameter(name="PHOTOS")],
    /,
    *,
    camera: Path,
    projector: Path,
    projector_scale: float = 1.0,
    photo: Path | None = None,
    mask: Mask = "auto",
    files: ScanFiles,
) -> None:
    """Make a scan from photos of a sheet under a projector's Gray code.

    Parameters
    ----------
    photos
        A folder, or the files, in the order of `planish acquire patterns` (OpenCV's): for every bit of the column a
        pattern and its inverse, then of the row; then the phase-shift patterns, if any; white; black.
    camera
        The camera (JSON).
    projector
        The projector (JSON), in the same world frame; its image_size is that of the patterns.
    projector_scale
        Projector pixels, as calibrated, per pattern pixel.
    photo
        A photo by the same camera, for the page. Default: the photo under white light.
    mask
        Region of the sheet in the photo: an image that is white there; auto: bright paper on a darker background; none:
        the whole photo.
    """
    from planish.acquire.structured_light.scan import check_size, from_gray_code
    from planish.cli.console import progress_bar
    from planish.io import read_camera, read_captures, read_photo

    check_scan_files(files)
    with progress_bar(quiet=files.quiet) as progress:
        progress("read", 0.0)
        cameras = read_camera(camera), read_camera(projector)
        captured = read_captures(photos)
        photo_image = captured.photo if photo is None else read_photo(photo).pixels
        check_size(photo_image.shape[:2], cameras[0])
        progress("acquire", 0.0)
        acquired = from_gray_code(
            captured.frames, *cameras, photo_image, projector_scale=projector_scale, mask=sheet_mask(mask)
        )
        progress("write", 0.0)
        written = write_acquired(acquired, files)
    print_scan_summary(acquired, [*captured.warnings], written, quiet=files.quiet)


def patterns(
    *,
    size: tuple[int, int],
    phase_steps: int = 0,
    output: Output,
    quiet: Quiet = False,
) -> None:
    """Write the Gray code images for a projector, to be shown one after the other.

    Parameters
    ----------
    size
        Width and height of the projector in pixels.
    phase_steps
        Also write phase-shift patterns with a period of 16 pixels and this number of steps, for columns and for rows:
        twice as many images. 3 to 16; 8 steps tolerate the gamma curve of any projector. Useful if the camera blurs the
        finest stripes.
    output
        Folder for the images; created if it does not exist.
    quiet
        Print nothing but errors.
    """
    import sys

    from planish.acquire.structured_light.phase import all_patterns
    from planish.errors import UsageError
    from planish.io import make_folder
    from planish.io.files import write_bytes
    from planish.io.pages import png_bytes

    width, height = size
    if not (2 <= width <= 16384 and 2 <= height <= 16384):
        raise UsageError(f"--size is {width} x {height}; expected width and height of the projector, 2 to 16384")
    images = list(all_patterns((height, width), phase_steps))
    make_folder(output)
    for count, image in enumerate(images):
        write_bytes(output / f"pattern_{count:02d}.png", png_bytes(image))
    if not quiet and sys.stdout.isatty():
        print(f"written  {len(images)} images to {output}; show each at full size, and take one photo of each")
