"""Summary row of one item, and the order of rows: worst first."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from math import isfinite
from typing import Any, Literal

from planish.hints import as_flag
from planish.types import Report

Status = Literal["failed", "not good", "look at it", "good"]
STATUSES: tuple[Status, ...] = ("failed", "not good", "look at it", "good")
"""From worst to best."""
VARYING_FIELDS = ("seconds", "cpu_seconds", "peak_mb")
"""Fields that differ from run to run."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """One item of a batch.

    Attributes
    ----------
    name : str
    status : {"failed", "not good", "look at it", "good"}
        The verdict of the page, or that there is none.
    sentence : str
        Reason of the failure, or outcome.
    reasons : list of str
        Of the verdict.
    again : bool
        Whether the next run retries it even without --retry, because its process was killed from outside.
    warnings : list of str
        All of them, those that are reasons too.
    expected_error_mm, strain_rms, width_mm, height_mm, effective_ppi, known_fraction, noise_mm : float or None
        From the report; None for failed items.
    points, flipped_faces, overlaps : int or None
    files : list of str
        File names in the item's folder.
    seconds, cpu_seconds, peak_mb : float or None
        Wall-clock time, CPU time of all threads, and peak memory of the process.
    """

    name: str
    status: Status
    sentence: str = ""
    again: bool = False
    reasons: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    expected_error_mm: float | None = None
    strain_rms: float | None = None
    flipped_faces: int | None = None
    overlaps: int | None = None
    width_mm: float | None = None
    height_mm: float | None = None
    effective_ppi: float | None = None
    known_fraction: float | None = None
    noise_mm: float | None = None
    points: int | None = None
    files: list[str] = field(default_factory=list)
    seconds: float | None = None
    cpu_seconds: float | None = None
    peak_mb: float | None = None

    def plain(self) -> dict[str, Any]:
        """Fields as JSON values; non-finite numbers become None."""
        return {
            name: None if isinstance(value, float) and not isfinite(value) else value
            for name, value in asdict(self).items()
        }


def row_from_report(
    name: str, report: Report, files: list[str], *, seconds: float, cpu_seconds: float, peak_mb: float
) -> Row:
    """Row of an item that was restored."""
    flat, page, verdict = report.flatten, report.page, report.verdict
    return Row(
        name=name,
        status=verdict.word,
        sentence=report.outcome,
        reasons=[reason.message(as_flag) for reason in verdict.reasons],
        warnings=[warning.message(as_flag) for warning in report.warnings],
        expected_error_mm=flat.expected_error_mm,
        strain_rms=flat.strain_rms,
        flipped_faces=flat.flipped_faces,
        overlaps=flat.overlaps,
        width_mm=page.width_mm,
        height_mm=page.height_mm,
        effective_ppi=page.effective_ppi_median,
        known_fraction=page.known_fraction,
        noise_mm=report.scan.noise_mm,
        points=report.scan.points,
        files=files,
        seconds=seconds,
        cpu_seconds=cpu_seconds,
        peak_mb=peak_mb,
    )


def row_from_json(plain: dict[str, Any]) -> Row | None:
    """Row from its JSON object; None if the fields do not match, or the status is one of an older version."""
    try:
        row = Row(**plain)
    except TypeError:
        return None
    return row if row.status in STATUSES else None


def worst_first(rows: list[Row]) -> list[Row]:
    """Sort rows by status, then by expected error, then by name.

    Examples
    --------
    >>> rows = [Row(name="a", status="good"), Row(name="b", status="failed"), Row(name="c", status="not good")]
    >>> [row.name for row in worst_first(rows)]
    ['b', 'c', 'a']
    """
    return sorted(rows, key=lambda row: (STATUSES.index(row.status), -(row.expected_error_mm or 0.0), row.name))
