"""Restore one upload in a worker process. Imports nothing of the web framework, which the fork server does not load."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from planish.errors import PlanishError
from planish.hints import as_field
from planish.settings import NamedUnits, RestoreSettings

Format = Literal["tif", "png", "jpg", "pdf"]

PREVIEW = "preview.jpg"
_PREVIEW_PX = 1600


@dataclass(frozen=True, kw_only=True)
class UploadRequest:
    """Parameters of the restoration of an upload.

    Attributes
    ----------
    scan : str
        File name in the upload's folder; "." for a tifxyz, which is the folder itself.
    photo, camera : tuple of str
        Needed if the scan file does not reference them.
    settings : RestoreSettings
    units : NamedUnits
    view : bool
        Whether to write an HTML page.
    formats : tuple of Format
        Formats of the page.
    """

    scan: str
    photo: tuple[str, ...]
    camera: tuple[str, ...]
    settings: RestoreSettings
    units: NamedUnits
    view: bool
    formats: tuple[Format, ...]


def restore_upload(
    folder: Path, out: Path, request: UploadRequest, progress: Callable[[str, float], None]
) -> dict[str, Any]:
    """Restore one upload.

    Parameters
    ----------
    folder : Path
        Folder with the files of the scan and nothing else.
    out : Path
        Folder for the results; created by this function.
    request : UploadRequest
    progress : callable
        Called with (stage, fraction done).

    Returns
    -------
    dict
        settled, outcome, warnings, figures (pairs of label and value), files (names).
    """
    from planish.job import Job, Outputs, run
    from planish.report import summary

    pages = [out / f"page.{name}" for name in request.formats]
    outputs = Outputs(
        page=pages[0],
        copies=tuple(pages[1:]),
        binary=None if request.settings.binarize.binarize == "none" else out / "page-bw.png",
        flat=out / "flat.obj",
        report=out / "report.json",
        html=out / "view.html" if request.view else None,
    )
    os.chdir(folder)  # relative paths, so that no message or report reveals folders of the server
    job = Job(
        scan=Path(request.scan),
        photo=tuple(map(Path, request.photo)),
        camera=tuple(map(Path, request.camera)),
        units=request.units,
        inside=Path(),
        settings=request.settings,
        outputs=outputs,
    )
    out.mkdir()
    try:
        result = run(job, progress)
    except PlanishError as problem:
        raise type(problem)(problem.sentence.replace(f"{out}/", ""), problem.hint) from None
    _preview(out)
    files = sorted(path.name for path in out.iterdir())
    _fsync_all(out, files)
    return {
        "settled": result.report.settled,
        "outcome": result.report.outcome,
        "warnings": [warning.message(as_field) for warning in result.report.warnings],
        "figures": summary(result.report),
        "files": files,
    }


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
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
