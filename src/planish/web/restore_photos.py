"""Restore the page of an upload of photos. Imports nothing of the web framework."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

from planish.web.upload_request import UploadRequest

if TYPE_CHECKING:
    from planish.job.photo_sheet import PhotographedSheet
    from planish.types import Report


def restore_photos(out: Path, request: UploadRequest, progress: Callable[[str, float], None]) -> list[Report]:
    """Restore the page of the photos in the current folder, as `planish photo` does.

    Parameters
    ----------
    out : Path
        Folder for the results.
    request : UploadRequest
        Of one photo its shape is estimated, several measure it. Pages get a dpi only if its `size` tells one.
    progress : callable
        Called with (stage, fraction done).

    Returns
    -------
    list of Report
        One, or two of facing pages on one photo.
    """
    from planish.job.photo_sheet import shape_of_several, shapes_of_one

    def stages(stage: str, share: float) -> None:
        progress({"read": "photos", "shape": "photos"}.get(stage, stage), share)

    files, camera = [Path(name) for name in request.photo], [Path(name) for name in request.camera]
    if len(files) > 1:
        sheet = shape_of_several(files, request.size, camera[0] if camera else None, stages)
        return [_restore(sheet, out, request, progress)]
    settings = replace(request.size, pages="2" if request.settings.pages == "2" else "auto")
    outline = None if request.outline is None else request.outline.mask()
    one_page = replace(request, settings=replace(request.settings, pages="1"))
    return [_restore(sheet, out, one_page, progress) for sheet in shapes_of_one(files[0], settings, stages, outline)]


def _restore(
    sheet: PhotographedSheet, out: Path, request: UploadRequest, progress: Callable[[str, float], None]
) -> Report:
    """Restore one page and write its files; those of facing pages are numbered."""
    from planish.io import way_up, write_bytes, write_json, write_unscaled_page
    from planish.job import Outputs
    from planish.job.page_files import write_page_files
    from planish.pipeline import restore
    from planish.view import view_page

    number = "" if sheet.number is None else f"-{sheet.number}"
    restoration = restore(sheet.scan, request.settings, progress, way_up)
    binarized = request.settings.binarize.binarize
    start = perf_counter()
    progress("write", 0.0)
    pages = [out / f"page{number}.{suffix}" for suffix in request.formats]
    outputs = Outputs(
        page=pages[0], copies=tuple(pages[1:]), binary=None if binarized == "none" else out / f"page-bw{number}.png"
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
        name = request.photo[0] if len(request.photo) == 1 else f"{len(request.photo)} photos"
        write_bytes(out / f"view{number}.html", view_page(replace(restoration, report=report), name))
    write_json(out / f"report{number}.json", report)
    return report
