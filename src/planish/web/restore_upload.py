"""What is done in the process of a job. It imports nothing of a server, as it is forked from a process without one."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from planish.errors import PlanishError
from planish.settings import RestoreSettings, Units

Format = Literal["tif", "png", "jpg", "pdf"]

PREVIEW = "preview.jpg"
_PREVIEW_PX = 1600


@dataclass(frozen=True, kw_only=True)
class UploadRequest:
    """What is to be done with an upload.

    Attributes
    ----------
    scan : str
        Name of its file in the upload's folder; "." for a tifxyz, which is the folder itself.
    photo, camera : tuple of str
        Where the scan's file does not name them.
    settings : RestoreSettings
    units : Units
    view : bool
        Whether a page to look at is wanted.
    formats : tuple of Format
        Of the page.
    """

    scan: str
    photo: tuple[str, ...]
    camera: tuple[str, ...]
    settings: RestoreSettings
    units: Units
    view: bool
    formats: tuple[Format, ...]


def restore_upload(
    folder: Path, out: Path, request: UploadRequest, progress: Callable[[str, float], None]
) -> dict[str, Any]:
    """Restore one upload.

    Parameters
    ----------
    folder : Path
        With the files of the scan, and nothing else.
    out : Path
        Folder for the results; made here.
    request : UploadRequest
    progress : callable
        Told (stage, share done).

    Returns
    -------
    dict
        settled, outcome, warnings, figures: what and how much; files: their names.
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
    os.chdir(folder)  # so that no sentence and no report tells where the files lie here
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
        raise type(problem)(str(problem).replace(f"{out}/", "")) from None
    _preview(out)
    files = sorted(path.name for path in out.iterdir())
    _fsync_all(out, files)
    return {
        "settled": result.report.settled,
        "outcome": result.report.outcome,
        "warnings": result.report.warnings,
        "figures": summary(result.report),
        "files": files,
    }


def _preview(out: Path) -> None:
    """A small picture of the page for the browser."""
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
    """Have the disk keep the files before the table says that they are there."""
    for path in (*(out / name for name in files), out):
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
