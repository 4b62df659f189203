"""Options and functions shared by the commands of `planish acquire`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from planish.cli.options import Output, Quiet, check_files

if TYPE_CHECKING:
    from planish.acquire.grid_mesh import AcquiredScan
    from planish.io.filecloud import FileCloud
    from planish.types import Bools, Camera, Diagnostic, Floats, Pixels

USUAL_SIZES = 2.5
"""Sheets under depth cameras are so many times larger or smaller than A4 at most: A7 to A2. With 4 the depths of an
L515 taken for millimetres would pass."""

Mask = Annotated[str, Parameter(name="--mask")]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class ScanFiles:
    """Output options of the acquire commands.

    Attributes
    ----------
    output : Path
        The scan to write: .ply or .obj with the photo beside it, or .glb.
    picture : Path, optional
        Also write an image of the scan: shaded relief, texture, and confidence of every point.
    overwrite : bool
        Whether existing files may be replaced.
    quiet : bool
        Print nothing but errors.
    """

    output: Output
    picture: Path | None = None
    overwrite: bool = True
    quiet: Quiet = False


def check_scan_files(files: ScanFiles) -> None:
    """Check before any computation that the scan and its picture can be written."""
    from planish.io.scan_write import check_scan_name

    check_scan_name(files.output)
    check_files(files.output, files.picture, overwrite=files.overwrite)


def sheet_mask(mask: str) -> Bools | str | None:
    """Decode --mask: "auto", None for no mask, or the white pixels of an image."""
    if mask in ("auto", "none"):
        return "auto" if mask == "auto" else None
    from planish.io import read_photo

    pixels = read_photo(mask).pixels
    return pixels[..., 0] > pixels.max() // 2


def unit_of_cloud(cloud: FileCloud, units: str) -> tuple[float, list[Diagnostic]]:
    """Millimetres per unit of a point cloud, and warnings."""
    from planish.io.units import decide_unit
    from planish.settings import mm_per_unit

    unit, unit_warnings = decide_unit(cloud.points[cloud.points.any(axis=1)], units, cloud.unit)
    return mm_per_unit(unit), [*cloud.warnings, *unit_warnings]


def read_optional_photo(
    photo: Path | None, camera: Path | None, mm_per_unit: float
) -> tuple[Pixels | None, Camera | None, list[Diagnostic]]:
    """Read the optional photo of a point cloud: pixels, camera, and warnings."""
    from planish.errors import UsageError
    from planish.io import read_camera, read_photo, scaled_camera

    if photo is None:
        if camera is not None:
            raise UsageError("--camera is the camera of a photo; give the photo with --photo")
        return None, None, []
    photo_image = read_photo(photo)
    warnings, shape_rc = list(photo_image.warnings), photo_image.pixels.shape[:2]
    if camera is None:
        return photo_image.pixels, None, warnings
    taken_by = read_camera(camera, photo.name, mm_per_unit=mm_per_unit, photo_shape=shape_rc, warnings=warnings)
    return photo_image.pixels, scaled_camera(taken_by, shape_rc) or taken_by, warnings


def scale_warnings(points: Floats, scale: float | str) -> list[Diagnostic]:
    """A warning where a scan of a depth camera has no size of a sheet, with the depth scale that would give it one."""
    from planish.io.depths import PER_METRE
    from planish.io.units import A4_MM, sheet_diagonal
    from planish.types import Diagnostic

    size = sheet_diagonal(points)
    usual = A4_MM / USUAL_SIZES, A4_MM * USUAL_SIZES
    if not size > 0 or usual[0] <= size <= usual[1]:
        return []
    per_metre = PER_METRE.get(scale, 1000.0) if isinstance(scale, str) else float(scale)
    sizes = {name: size * per_metre / PER_METRE[name] for name in ("realsense", "l515", "tum", "d405")}
    better = [f"{{scale={name}}} makes it {mm:.0f} mm" for name, mm in sizes.items() if usual[0] <= mm <= usual[1]]
    names = "d405 10000, tum 5000, l515 4000; sun for SUN RGB-D"
    hint = ", ".join(better) or f"give {{scale}} as numbers per metre ({names}), or {{mask}} as an image"
    sentence = f"the scan is {size:.4g} mm from corner to corner; is the depth scale right"
    return [Diagnostic("scan-size-unusual", sentence, hint)]


def write_acquired(acquired: AcquiredScan, files: ScanFiles) -> list[Path]:
    """Write the scan and, if requested, its picture."""
    import numpy as np

    from planish.acquire.scan_preview import preview
    from planish.io import write_page, write_scan
    from planish.types import Page

    written = write_scan(files.output, acquired.scan)
    if files.picture is not None:
        pixels = preview(acquired)
        write_page(files.picture, Page(pixels, np.ones(pixels.shape[:2], bool), 100.0))
        written.append(files.picture)
    return written


def print_scan_summary(acquired: AcquiredScan, warnings: list[Diagnostic], written: list[Path], *, quiet: bool) -> None:
    """Print warnings to stderr, and a summary if stdout is a terminal."""
    import sys

    from rich.console import Console

    from planish.hints import as_flag
    from planish.types import Diagnostic

    if quiet:
        return
    errors = Console(stderr=True, highlight=False, soft_wrap=True, markup=False)
    if acquired.scan.photo is None:
        warnings = [
            *warnings,
            Diagnostic(
                "scan-without-photo",
                "the scan has neither colours nor a photo",
                "use `planish flatten`, or `planish restore` with {photo}",
            ),
        ]
    for warning in [*warnings, *acquired.warnings]:
        errors.print(f"planish: note: {warning.message(as_flag)}")
    if sys.stdout.isatty():
        mesh = acquired.scan.mesh
        length = "" if acquired.noise_length_mm is None else f", alike over {acquired.noise_length_mm:.2g} mm"
        print(f"{len(mesh.points):,} points, {len(mesh.faces):,} faces, noise {acquired.noise_mm:.3f} mm{length}")
        for path in written:
            print(f"written  {path}")
