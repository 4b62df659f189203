"""`planish view`: interactive HTML page of a restoration."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from planish.cli.options import FileUnit, OpenBrowser, Quiet, open_in_browser


def view(
    result: Path,
    /,
    *,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    photo: list[Path] | None = None,
    camera: list[Path] | None = None,
    file_unit: FileUnit = FileUnit(),
    open_browser: OpenBrowser = None,
    overwrite: bool = True,
    quiet: Quiet = False,
) -> bool:
    """View a restoration in the browser: the scan in 3D, page and photo side by side, and quality maps.

    Writes one self-contained HTML file, which can be opened from disk, sent and printed. The scan is restored again
    for it, with the settings of the report if there is one, because page files do not contain all data that is shown.

    Parameters
    ----------
    result
        A scan; or a finished restoration, given as its report or the folder of its report.json, with the scan beside
        it; or an HTML file that was written before.
    output
        The HTML file to write. Default: view.html in the folder of the report, or the name of the scan with .html
        beside the scan.
    photo
        The photo, if the scan file does not reference it.
    camera
        The camera of the photo (JSON), if the scan has no texture coordinates.
    open_browser
        Open the file in the browser. By default only if there is a display.
    overwrite
        Whether an existing file may be replaced.
    quiet
        Print nothing but errors.
    """
    from dataclasses import replace

    from planish.cli.console import print_report, progress_bar
    from planish.job.from_report import inputs_from_report
    from planish.job.html_page import make_html

    if result.suffix.lower() in (".html", ".htm") and result.is_file():
        open_in_browser(result.resolve().as_uri(), wanted=open_browser)
        return True
    inputs, units = inputs_from_report(result), file_unit.unit()
    if photo or camera or units != "auto":
        inputs = replace(inputs, photo=tuple(photo or ()), camera=tuple(camera or ()), units=units)
    out = output or _beside(result, inputs.scan)
    with progress_bar(quiet=quiet) as progress:
        job_result = make_html(inputs, out, progress, overwrite=overwrite)
    print_report(job_result.report, [str(path) for path in job_result.written], quiet=quiet, verbose=False)
    open_in_browser(out.resolve().as_uri(), wanted=open_browser)
    return job_result.report.verdict.usable


def _beside(result: Path, scan: Path) -> Path:
    if scan == result:
        return scan.with_name(f"{scan.stem or scan.name}.html")
    return (result if result.is_dir() else result.parent) / "view.html"
