"""A job, run: everything is written, or nothing."""

from __future__ import annotations

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
from planish.job.pages import check_pages, page_files, read_text, write_page_files
from planish.job.pictures import write_certificate, write_stages
from planish.pipeline import Progress, restore
from planish.types import Report
from planish.view import view_page


@dataclass(frozen=True)
class Done:
    """What a job left behind.

    Attributes
    ----------
    report : Report
    written : list of Path
    """

    report: Report
    written: list[Path]


def check(job: Job) -> None:
    """Refuse before long work what could not be done after it.

    Raises
    ------
    UsageError
        Where outputs contradict the settings.
    OutputError
        Where a file could not be written.
    MissingExtraError
        Where an optional part is needed and not installed.
    """
    out = job.outputs
    check_pages(out)
    if out.binary is not None and job.settings.binarize.binarize == "none":
        raise UsageError("--binary is for a page in black and white, and --binarize none makes none; name a method")
    if out.flat is not None:
        check_flat_name(out.flat)
    if out.certificate is not None:
        check_page_name(out.certificate)
    if out.html is not None:
        check_html_name(out.html)
    for path in [*page_files(out, most=1 if job.settings.pages == "1" else 2), *_others(job)]:
        check_writable(path, overwrite=out.overwrite)


def run(job: Job, progress: Progress | None = None) -> Done:
    """Read the scan, restore it, and write all outputs together at the end.

    Parameters
    ----------
    job : Job
    progress : callable, optional
        Told (stage, share done) now and then.

    Raises
    ------
    InputError
        Where the scan cannot be read or is not a sheet that can be flattened, or has no photo.
    UsageError, OutputError, MissingExtraError
        As `check` does.

    Examples
    --------
    >>> import tempfile
    >>> from planish.gallery import sheet, virtual_scan
    >>> from planish.io import write_scan
    >>> from planish.job import Outputs
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     at = Path(folder)
    ...     _ = write_scan(at / "scan.obj", virtual_scan(sheet("book"), points=3000, photo_px=(1000, 750)).scan)
    ...     done = run(Job(scan=at / "scan.obj", outputs=Outputs(page=at / "page.png", report=at / "report.json")))
    ...     done.report.settled, [path.name for path in done.written]
    (True, ['page.png', 'report.json'])
    """
    check(job)
    tell: Progress = progress or (lambda name, share: None)
    out = job.outputs
    with all_or_nothing():
        start = perf_counter()
        tell("read", 0.0)
        found = _read(job)
        sources = fingerprints(found.sources)
        read = perf_counter() - start
        done = restore(found.scan, job.settings, tell, way_up)
        text, seconds = [], dict(done.report.seconds)
        if out.ocr is not None:
            start = perf_counter()
            tell("text", 0.0)
            text = read_text(done, out.ocr)
            seconds["text"] = perf_counter() - start
        done = replace(done, report=replace(done.report, seconds=seconds, sources=sources))
        start = perf_counter()
        tell("write", 0.0)
        written = [*write_page_files(out, done, job.settings.binarize.binarize, text), *_others(job)]
        if out.flat is not None:
            write_flat(out.flat, found, done.flattening.page_xy)
        if out.stages is not None:
            written += write_stages(out.stages, done)
        report = with_files(done.report, found, read, perf_counter() - start)
        if out.certificate is not None:
            write_certificate(out.certificate, job.scan.name, replace(done, report=report))
        if out.html is not None:
            tell("look", 0.0)
            write_bytes(out.html, view_page(replace(done, report=report), job.scan.name))
        if out.report is not None:
            write_json(out.report, report)
    return Done(report, written)


def check_html_name(path: Path) -> None:
    """Refuse a name that a browser would not open as a page.

    Raises
    ------
    OutputError
    """
    if path.suffix.lower() not in (".html", ".htm"):
        raise OutputError(f"{path}: a page to look at is one HTML file; give it a name that ends in .html")


def with_files(report: Report, found: ReadScan, read: float, written: float) -> Report:
    """The report with what reading and writing add to it: seconds, the unit, warnings."""
    seconds = {"read": read, **report.seconds, "write": written}
    return replace(
        report,
        seconds=seconds,
        seconds_total=sum(seconds.values()),
        scan=replace(report.scan, unit=found.unit),
        warnings=[*found.warnings, *report.warnings],
    )


def _read(job: Job) -> ReadScan:
    found = read_scan(
        job.scan,
        photo=list(job.photo) or None,
        camera=list(job.camera) or None,
        units=job.units,
        inside=job.inside,
    )
    if found.scan.photo is None:
        why = "".join(f"; {warning}" for warning in found.warnings if "image" in warning or "photo" in warning)
        raise InputError(
            f"{job.scan} came without a photo that can be drawn{why}; give --photo, or use `planish flatten` for the "
            "geometry alone"
        )
    return found


def _others(job: Job) -> list[Path]:
    """The single files beside the page."""
    out = job.outputs
    return [path for path in (out.flat, out.report, out.certificate, out.html) if path is not None]
