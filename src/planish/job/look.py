"""A page to look at, made of a scan or of a finished restoration."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from time import perf_counter

from planish.io import check_writable, fingerprints, read_scan, way_up, write_bytes
from planish.job.from_report import Again
from planish.job.runner import Done, check_html_name, with_files
from planish.pipeline import Progress, restore
from planish.view import view_page

ALIKE_MM = 0.01
"""A page made once more has the same size; other versions of planish or of numpy round otherwise, by less than this."""


def look(again: Again, out: Path, progress: Progress | None = None, *, overwrite: bool = True) -> Done:
    """Restore a scan (once more), and write the page to look at, and nothing else.

    Parameters
    ----------
    again : Again
        Scans without a photo will do too.
    out : Path
        The HTML file.
    progress : callable, optional
        Told (stage, share done) now and then.
    overwrite : bool

    Raises
    ------
    InputError, OutputError
    """
    check_html_name(out)
    check_writable(out, overwrite=overwrite)
    tell: Progress = progress or (lambda name, share: None)
    start = perf_counter()
    tell("read", 0.0)
    found = read_scan(again.scan, photo=again.photo or None, camera=again.camera or None, units=again.units)
    sources = fingerprints(found.sources)
    read = perf_counter() - start
    done = restore(found.scan, again.settings, tell, way_up)
    report = with_files(replace(done.report, sources=sources), found, read, 0.0)
    report = replace(report, warnings=[*report.warnings, *_said_of_size(again, done.flattening.size_mm)])
    tell("look", 0.0)
    write_bytes(out, view_page(replace(done, report=report), again.scan.name))
    return Done(report, [out])


def _said_of_size(again: Again, size_mm: tuple[float, float]) -> list[str]:
    """Whether what is shown is what the report tells of."""
    if again.size_mm is None or all(abs(a - b) <= ALIKE_MM for a, b in zip(again.size_mm, size_mm, strict=True)):
        return []
    (then_w, then_h), (now_w, now_h) = again.size_mm, size_mm
    return [
        f"restored once more, the page is {now_w:.2f} x {now_h:.2f} mm, but the report says {then_w:.2f} x "
        f"{then_h:.2f}; it was made by another version, or other settings"
    ]
