"""`planish demo`: restore a virtual scan, or virtual photos, of a synthetic sheet."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from planish.cli.acquire.virtual_files import SHEETS
from planish.cli.options import Quiet


def demo(
    sheet: Literal["book", "folded", "curl", "crumpled", "photos"] = "book",
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])] = Path("planish-demo"),
    quiet: Quiet = False,
) -> bool:
    """Scan a synthetic sheet virtually, restore it, and show the quality of the page.

    The scan has 300,000 points with 0.05 mm of noise and a 12-megapixel photo. It is written to the folder as well, as
    an example for `planish restore`.

    Parameters
    ----------
    sheet
        book: a page of a thick bound book. folded: a letter folded in three. curl: a corner curled past vertical.
        crumpled: a sheet with random folds. photos: the letter again, from ten photos of a phone instead of a scan;
        needs the extra `planish[photos]`, and two to five minutes.
    output
        Folder for the scan or photos, the page, the report and the images; created if it does not exist.
    quiet
        Print nothing but errors.
    """
    from planish.cli.console import pipeline_progress
    from planish.cli.restore import restore
    from planish.gallery import sheet as known_sheet
    from planish.gallery import virtual_scan
    from planish.io import make_folder, write_page, write_scan

    make_folder(output)
    if sheet == "photos":
        return _photos(output, quiet=quiet)
    with pipeline_progress(quiet=quiet) as progress:
        progress("scan", 0.0)
        capture = virtual_scan(known_sheet(SHEETS[sheet]), noise_mm=0.05)
        progress("write", 0.0)
        write_scan(output / "scan.obj", capture.scan)
        write_page(output / "truth.png", capture.page)
    return restore(
        output / "scan.obj",
        output=output / "page.tif",
        binary=output / "page-binary.png",
        flat=output / "flat.obj",
        report=output / "report.json",
        stages=output / "stages",
        html=output / "view.html",
        quiet=quiet,
        verbose=not quiet,
    )


def _photos(folder: Path, *, quiet: bool) -> bool:
    """Photograph the letter from around, with a card of 40 mm beside it, and measure it."""
    from planish.cli.acquire.virtual_photos import write_photo_shoot
    from planish.cli.console import progress_bar
    from planish.cli.photo import photo
    from planish.gallery import sheet as known_sheet
    from planish.io import write_page
    from planish.settings import PhotoSettings

    with progress_bar(quiet=quiet) as progress:
        progress("photograph", 0.0)
        shoot = write_photo_shoot(folder, known_sheet(SHEETS["folded"]))
        progress("write", 0.0)
        write_page(folder / "truth.png", shoot.page)
    usable = photo(
        [folder / "photos"],
        output=folder / "page.tif",
        shape=PhotoSettings(marker_mm=shoot.cards[0].side_mm),
        binary=folder / "page-binary.png",
        report=folder / "report.json",
        stages=folder / "stages",
        quiet=quiet,
        verbose=not quiet,
    )
    if not quiet:
        print(f"the true page: {folder / 'truth.png'}, {shoot.sheet.width_mm:.1f} x {shoot.sheet.height_mm:.1f} mm")
    return usable
