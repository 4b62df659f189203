"""Run a job; all outputs are written together at the end, or none."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter

from planish.errors import InputError, OutputError, UsageError
from planish.io import (
    ReadScan,
    all_or_nothing,
    check_flat_name,
    check_page_name,
    check_writable,
    fingerprints,
    read_scan,
    way_up,
    write_bytes,
    write_flat,
    write_json,
)
from planish.job.job import Job
from planish.job.page_files import check_pages, page_files, recognize_text, write_page_files
from planish.job.stage_images import write_certificate, write_stages
from planish.pipeline import Progress, restore
from planish.report import graded
from planish.types import Diagnostic, Report
from planish.view import view_page

_WITHOUT_PHOTO = (
    *("image-missing", "image-no-photo", "texture-unreadable"),
    *("material-file-missing", "material-file-unreadable", "material-missing"),
)
"""Codes of warnings that explain why a scan has no photo."""


@dataclass(frozen=True)
class JobResult:
    """Outcome of a job.

    Attributes
    ----------
    report : Report
    written : list of Path
    """

    report: Report
    written: list[Path]


def check(job: Job) -> None:
    """Check outputs and settings before any long computation.

    Raises
    ------
    UsageError
        If outputs contradict the settings.
    OutputError
        If a file could not be written.
    MissingExtraError
        If an optional dependency is needed and not installed.
    """
    out = job.outputs
    check_pages(out)
    if out.binary is not None and job.settings.binarize.binarize == "none":
        raise UsageError(
            "a binarized page was requested, but the binarization method is none", "name a method with {binarize}"
        )
    if out.flat is not None:
        check_flat_name(out.flat)
    if out.certificate is not None:
        check_page_name(out.certificate)
    if out.html is not None:
        check_html_name(out.html)
    for path in [*page_files(out, max_pages=1 if job.settings.pages == "1" else 2), *_single_files(job)]:
        check_writable(path, overwrite=out.overwrite)


def run(
    job: Job,
    progress: Progress | None = None,
    announce: Callable[[Sequence[Diagnostic]], None] | None = None,
) -> JobResult:
    """Read a scan, restore it, and write all outputs together at the end.

    Parameters
    ----------
    job : Job
    progress : callable, optional
        Called with (stage, fraction done).
    announce : callable, optional
        Called with the warnings of reading, before the long computation begins.

    Raises
    ------
    InputError
        If the scan cannot be read, is not a sheet that can be flattened, or has no photo.
    UsageError, OutputError, MissingExtraError
        See `check`.

    Examples
    --------
    >>> import tempfile
    >>> from planish.gallery import sheet, virtual_scan
    >>> from planish.io import write_scan
    >>> from planish.job import Outputs
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     at = Path(folder)
    ...     _ = write_scan(at / "scan.obj", virtual_scan(sheet("book"), points=3000, photo_px=(1000, 750)).scan)
    ...     result = run(Job(scan=at / "scan.obj", outputs=Outputs(page=at / "page.png", report=at / "report.json")))
    ...     result.report.settled, [path.name for path in result.written]
    (True, ['page.png', 'report.json'])
    """
    check(job)
    progress = progress or (lambda name, share: None)
    out = job.outputs
    with all_or_nothing():
        start = perf_counter()
        progress("read", 0.0)
        loaded = _read_scan(job)
        if announce is not None:
            announce(loaded.warnings)
        sources = fingerprints(loaded.sources, loaded.digests)
        read_seconds = perf_counter() - start
        restoration = restore(loaded.scan, job.settings, progress, way_up)
        text, seconds = [], dict(restoration.report.seconds)
        if restoration.make_binary is not None and (out.binary or out.html or out.stages):
            start = perf_counter()
            progress("binarize", 0.0)
            restoration.make_binary()  # here, so that its time is told
            seconds["binarize"] = perf_counter() - start
        if out.ocr is not None:
            start = perf_counter()
            progress("text", 0.0)
            text = recognize_text(restoration, out.ocr)
            seconds["text"] = perf_counter() - start
        restoration = replace(restoration, report=replace(restoration.report, seconds=seconds, sources=sources))
        start = perf_counter()
        progress("write", 0.0)
        written = [*write_page_files(out, restoration, job.settings.binarize.binarize, text), *_single_files(job)]
        if out.flat is not None:
            write_flat(out.flat, loaded, restoration.flattening.page_xy)
        if out.stages is not None:
            written += write_stages(out.stages, restoration)
        report = with_file_info(restoration.report, loaded, read_seconds, perf_counter() - start)
        if out.certificate is not None:
            write_certificate(out.certificate, job.scan.name, replace(restoration, report=report))
        if out.html is not None:
            progress("look", 0.0)
            write_bytes(out.html, view_page(replace(restoration, report=report), job.scan.name))
        if out.report is not None:
            write_json(out.report, report)
    return JobResult(report, written)


def check_html_name(path: Path) -> None:
    """Refuse names that a browser would not open as HTML.

    Raises
    ------
    OutputError
    """
    if path.suffix.lower() not in (".html", ".htm"):
        raise OutputError(f"{path}: the view is one HTML file; give it a name that ends in .html")


def with_file_info(report: Report, loaded: ReadScan, read_seconds: float, write_seconds: float) -> Report:
    """Add to a report what reading and writing contribute: seconds, unit and warnings."""
    seconds = {"read": read_seconds, **report.seconds, "write": write_seconds}
    return graded(
        replace(
            report,
            seconds=seconds,
            seconds_total=sum(seconds.values()),
            scan=replace(report.scan, unit=loaded.unit, sheet_mask=_name(loaded.sheet_mask)),
            warnings=[*loaded.warnings, *report.warnings],
        )
    )


def _name(path: Path | None) -> str | None:
    return None if path is None else path.name


def _read_scan(job: Job) -> ReadScan:
    loaded = read_scan(
        job.scan,
        photo=list(job.photo) or None,
        camera=list(job.camera) or None,
        units=job.units,
        inside=job.inside,
        sheet=job.sheet,
    )
    if not loaded.scan.has_picture:
        why = "".join(f"; {warning.message()}" for warning in loaded.warnings if warning.code in _WITHOUT_PHOTO)
        raise InputError(
            f"{job.scan} has no usable photo{why}",
            "give {photo}, or use `planish flatten` for the geometry alone",
        )
    if job.cut is not None:
        mask, view = job.cut
        loaded = replace(loaded, scan=replace(loaded.scan, sheet=mask, sheet_view=view))
    return loaded


def _single_files(job: Job) -> list[Path]:
    """Output files other than the page."""
    out = job.outputs
    return [path for path in (out.flat, out.report, out.certificate, out.html) if path is not None]
