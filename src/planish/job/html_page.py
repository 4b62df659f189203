"""`planish view`: the HTML page of a scan or of a finished restoration."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from time import perf_counter

from planish.io import check_writable, fingerprints, read_scan, way_up, write_bytes
from planish.job.from_report import JobInputs
from planish.job.runner import JobResult, check_html_name, with_file_info
from planish.pipeline import Progress, restore
from planish.types import Diagnostic
from planish.view import view_page

SIZE_TOLERANCE_MM = 0.01
"""A repeated restoration gives the same page size up to rounding, which differs between versions of numpy by less."""


def make_html(inputs: JobInputs, out: Path, progress: Progress | None = None, *, overwrite: bool = True) -> JobResult:
    """Restore a scan and write its HTML page, and no other file.

    Parameters
    ----------
    inputs : JobInputs
        A scan without a photo is accepted; the page then shows geometry alone.
    out : Path
        The HTML file.
    progress : callable, optional
        Called with (stage, fraction done).
    overwrite : bool

    Raises
    ------
    InputError, OutputError
    """
    check_html_name(out)
    check_writable(out, overwrite=overwrite)
    progress = progress or (lambda name, share: None)
    start = perf_counter()
    progress("read", 0.0)
    loaded = read_scan(
        inputs.scan,
        photo=inputs.photo or None,
        camera=inputs.camera or None,
        units=inputs.units,
        sheet=inputs.sheet,
    )
    sources = fingerprints(loaded.sources, loaded.digests)
    read_seconds = perf_counter() - start
    restoration = restore(loaded.scan, inputs.settings, progress, way_up)
    report = with_file_info(replace(restoration.report, sources=sources), loaded, read_seconds, 0.0)
    report = replace(report, warnings=[*report.warnings, *_size_warnings(inputs, restoration.flattening.size_mm)])
    progress("look", 0.0)
    write_bytes(out, view_page(replace(restoration, report=report), inputs.scan.name))
    return JobResult(report, [out])


def _size_warnings(inputs: JobInputs, size_mm: tuple[float, float]) -> list[Diagnostic]:
    """Warn if the repeated restoration differs in size from the report."""
    if inputs.size_mm is None or all(
        abs(a - b) <= SIZE_TOLERANCE_MM for a, b in zip(inputs.size_mm, size_mm, strict=True)
    ):
        return []
    (report_w, report_h), (new_w, new_h) = inputs.size_mm, size_mm
    sentence = (
        f"the page restored for this view is {new_w:.2f} x {new_h:.2f} mm, but the report says {report_w:.2f} x "
        f"{report_h:.2f}; the report was made by another version or with other settings"
    )
    return [Diagnostic("page-size-changed", sentence)]
