"""`planish acquire`: one command for each kind of device, and what they share."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import App, Parameter

if TYPE_CHECKING:
    from planish.acquire.grid_mesh import Acquired
    from planish.types import Bools

app = App(name="acquire", help="Make a scan from what a device saw; `planish restore` takes it without options.")
app.command("planish.cli.acquire_depth:depth")
app.command("planish.cli.acquire_gray_code:gray_code")
app.command("planish.cli.acquire_gray_code:patterns")
app.command("planish.cli.acquire_laser:laser")
app.command("planish.cli.acquire_laser_lines:laser_lines")
app.command("planish.cli.acquire_virtual:virtual")

Mask = Annotated[str, Parameter(name="--mask")]
Picture = Annotated[Path | None, Parameter(name="--picture")]


def check_outputs(output: Path, picture: Path | None, *, overwrite: bool) -> None:
    """Refuse before any work what could not be written after it."""
    from planish.io import check_page_name, check_writable

    check_writable(output, overwrite=overwrite)
    if picture is not None:
        check_page_name(picture)
        check_writable(picture, overwrite=overwrite)


def sheet_on(mask: str) -> Bools | str | None:
    """What --mask asks for: "auto", None for everywhere, or the white part of an image."""
    if mask in ("auto", "none"):
        return "auto" if mask == "auto" else None
    from planish.io import read_photo

    pixels = read_photo(mask).pixels
    return pixels[..., 0] > pixels.max() // 2


def write_acquired(made: Acquired, output: Path, picture: Path | None) -> list[Path]:
    """Write the scan and, if it is asked for, the picture to look at."""
    import numpy as np

    from planish.acquire.picture import picture as drawn
    from planish.io import write_page, write_scan
    from planish.types import Page

    written = write_scan(output, made.scan)
    if picture is not None:
        pixels = drawn(made)
        write_page(picture, Page(pixels, np.ones(pixels.shape[:2], bool), 100.0))
        written.append(picture)
    return written


def say(made: Acquired, warnings: list[str], written: list[Path], *, quiet: bool) -> None:
    """Print what was found, for a person; notes go to stderr."""
    import sys

    from rich.console import Console

    if quiet:
        return
    errors = Console(stderr=True, highlight=False, soft_wrap=True, markup=False)
    for warning in [*warnings, *made.warnings]:
        errors.print(f"planish: note: {warning}")
    if sys.stdout.isatty():
        mesh = made.scan.mesh
        print(f"{len(mesh.points):,} points, {len(mesh.faces):,} faces, noise {made.noise_mm:.3f} mm")
        for path in written:
            print(f"written  {path}")
