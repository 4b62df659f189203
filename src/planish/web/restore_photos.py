"""Restore the page of an upload of photos. Imports nothing of the web framework."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

from planish.web.upload_request import UploadRequest

if TYPE_CHECKING:
    from planish.types import Report


def restore_photos(out: Path, request: UploadRequest, progress: Callable[[str, float], None]) -> Report:
    """Measure a sheet from photos in the current folder and write its page, as `planish photo` does.

    Parameters
    ----------
    out : Path
        Folder for the results.
    request : UploadRequest
        Pages get a dpi only if its `size` tells one.
    progress : callable
        Called with (stage, fraction done).

    Returns
    -------
    Report
        With what the photos told, and what to photograph next.
    """
    from planish.io import way_up, write_bytes, write_json, write_unscaled_page
    from planish.job import Outputs
    from planish.job.page_files import write_page_files
    from planish.job.photo_sheet import shape_of_several
    from planish.pipeline import restore
    from planish.view import view_page

    def stages(stage: str, share: float) -> None:
        progress({"read": "photos", "shape": "photos"}.get(stage, stage), share)

    files, camera = [Path(name) for name in request.photo], [Path(name) for name in request.camera]
    sheet = shape_of_several(files, request.size, camera[0] if camera else None, stages)
    restoration = restore(sheet.scan, request.settings, progress, way_up)
    binarized = request.settings.binarize.binarize
    start = perf_counter()
    progress("write", 0.0)
    pages = [out / f"page.{suffix}" for suffix in request.formats]
    outputs = Outputs(
        page=pages[0], copies=tuple(pages[1:]), binary=None if binarized == "none" else out / "page-bw.png"
    )
    if sheet.scaled:
        write_page_files(outputs, restoration, binarized, [])
    else:
        assert restoration.page is not None
        for path in pages:
            write_unscaled_page(path, restoration.page)
        if outputs.binary is not None and restoration.binary is not None:
            write_unscaled_page(outputs.binary, restoration.binary)
    report = sheet.completed(restoration, perf_counter() - start)
    if request.view:
        progress("look", 0.0)
        write_bytes(out / "view.html", view_page(replace(restoration, report=report), f"{len(files)} photos"))
    write_json(out / "report.json", report)
    return report
