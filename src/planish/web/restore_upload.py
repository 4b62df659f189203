"""Restore one upload in a worker process. Imports nothing of the web framework, which the fork server does not load."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from planish.errors import PlanishError, UsageError
from planish.system import flush_to_disk
from planish.types.verdict import Word
from planish.web.restore_photos import restore_photos
from planish.web.upload_request import UploadRequest
from planish.web.wording import in_browser

if TYPE_CHECKING:
    from planish.types import Report

PREVIEW, POINTS = "preview.jpg", "points.json"
_PREVIEW_PX = 1600


def restore_upload(
    folder: Path, out: Path, request: UploadRequest, progress: Callable[[str, float], None]
) -> dict[str, Any]:
    """Restore one upload.

    Parameters
    ----------
    folder : Path
        Folder with the files of the scan, or photos, and nothing else.
    out : Path
        Folder for the results; created by this function.
    request : UploadRequest
    progress : callable
        Called with (stage, fraction done).

    Returns
    -------
    dict
        settled, outcome, verdict, reasons, warnings (other notes), figures (label, value, what is usual), files
        (names). Where points of the scan alone were asked for, files only.
    """
    from planish.report import summary, usual

    os.chdir(folder)  # relative paths, so that no message or report reveals folders of the server
    out.mkdir()
    try:
        if request.points_only:
            return {"files": _write_points(out, request, progress)}
        reports = [_restore_scan(out, request, progress)] if request.scan else restore_photos(out, request, progress)
    except PlanishError as problem:
        raise type(problem)(problem.sentence.replace(f"{out}/", ""), problem.hint) from None
    _preview(out)
    files = sorted(path.name for path in out.iterdir())
    _fsync_all(out, files)
    worst = max(reports, key=lambda report: get_args(Word).index(report.verdict.word))
    return {
        "settled": all(report.settled for report in reports),
        "outcome": worst.outcome,
        "verdict": worst.verdict.word,
        "reasons": _each(in_browser(reason) for report in reports for reason in report.verdict.reasons),
        "warnings": _each(in_browser(note) for report in reports for note in report.notes),
        "figures": [
            (f"page {k + 1}: {what}" if len(reports) > 1 else what, how_much, usual(what))
            for k, report in enumerate(reports)
            for what, how_much in summary(report)
        ],
        "files": files,
    }


def _each(sentences: Iterable[str]) -> list[str]:
    return list(dict.fromkeys(sentences))


def _restore_scan(out: Path, request: UploadRequest, progress: Callable[[str, float], None]) -> Report:
    from PIL import Image

    from planish.job import Job, Outputs, run

    sheet = None
    if request.outline is not None:
        sheet = Path("outline-of-the-sheet.png")
        Image.fromarray(request.outline.mask()).save(sheet)
    pages = [out / f"page.{name}" for name in request.formats]
    outputs = Outputs(
        page=pages[0],
        copies=tuple(pages[1:]),
        binary=None if request.settings.binarize.binarize == "none" else out / "page-bw.png",
        flat=out / "flat.obj",
        report=out / "report.json",
        html=out / "view.html" if request.view else None,
    )
    job = Job(
        scan=Path(request.scan),
        cut=None if request.cut is None else request.cut.mask_and_view(),
        photo=tuple(map(Path, request.photo)),
        camera=tuple(map(Path, request.camera)),
        units=request.units,
        sheet=sheet,
        inside=Path(),
        settings=request.settings,
        outputs=outputs,
    )
    return run(job, progress).report


def _write_points(out: Path, request: UploadRequest, progress: Callable[[str, float], None]) -> list[str]:
    """Write points of the scan that a browser can show, and cut."""
    from planish.io import read_scan, write_bytes
    from planish.web.scan_points import scan_points

    if not request.scan:
        raise UsageError("photos have no points to look at; send a scan")
    progress("read", 0.0)
    photo, camera = (list(map(Path, files)) or None for files in (request.photo, request.camera))
    scan = read_scan(Path(request.scan), photo=photo, camera=camera, units=request.units, inside=Path()).scan
    write_bytes(out / POINTS, json.dumps(scan_points(scan)).encode())
    _fsync_all(out, [POINTS])
    return [POINTS]


def _preview(out: Path) -> None:
    """Write a preview of the page for the browser."""
    from PIL import Image

    pages = sorted(path for path in out.glob("page*") if path.suffix in (".png", ".jpg", ".tif"))
    pages = [path for path in pages if not path.stem.startswith("page-bw")] or pages
    if not pages:
        return
    Image.MAX_IMAGE_PIXELS = None
    with Image.open(pages[0]) as image:
        small = image.convert("RGB")
        small.thumbnail((_PREVIEW_PX, _PREVIEW_PX))
        small.save(out / PREVIEW, quality=85)


def _fsync_all(out: Path, files: list[str]) -> None:
    """Flush the files to disk before the job table refers to them."""
    for path in (*(out / name for name in files), out):
        flush_to_disk(path)
