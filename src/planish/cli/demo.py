"""`planish demo`: restore a virtual scan of a synthetic sheet."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from planish.cli.options import Quiet

SHEETS = {"book": "book", "folded": "letter", "curl": "curl", "crumpled": "crumpled"}


def demo(
    sheet: Literal["book", "folded", "curl", "crumpled"] = "book",
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
        crumpled: a sheet with random folds.
    output
        Folder for the scan, the page, the report and the images; created if it does not exist.
    quiet
        Print nothing but errors.
    """
    from planish.cli.console import progress_bar
    from planish.cli.restore import restore
    from planish.gallery import sheet as known_sheet
    from planish.gallery import virtual_scan
    from planish.io import make_folder, write_page, write_scan

    make_folder(output)
    with progress_bar(quiet=quiet) as progress:
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
