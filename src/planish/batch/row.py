"""What is told of one item, in one line of a table; the worst come first."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from math import isfinite
from typing import Any, Literal

from planish.types import Report

Status = Literal["failed", "not settled", "warnings", "good"]
STATUSES: tuple[Status, ...] = ("failed", "not settled", "warnings", "good")
"""From worst to best."""
VARYING_FIELDS = ("seconds", "cpu_seconds", "peak_mb")
"""Of a row: what is not the same in every run."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """One item of a batch.

    Attributes
    ----------
    name : str
    status : {"failed", "not settled", "warnings", "good"}
    sentence : str
        Why it failed, or how it ended.
    again : bool
        Whether the next run shall try it again without being asked: its process was ended from outside.
    warnings : list of str
    expected_error_mm, strain_rms, width_mm, height_mm, effective_ppi, known_fraction, noise_mm : float or None
        As the report has them; None for what failed.
    points, flipped_faces, overlaps : int or None
    files : list of str
        In the item's folder.
    seconds, cpu_seconds, peak_mb : float or None
        Start to end, of all threads together, and the greatest memory of the process.
    """

    name: str
    status: Status
    sentence: str = ""
    again: bool = False
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
        """What JSON holds; numbers that are not finite as None."""
        return {
            name: None if isinstance(value, float) and not isfinite(value) else value
            for name, value in asdict(self).items()
        }


def row_from_report(
    name: str, report: Report, files: list[str], *, seconds: float, cpu_seconds: float, peak_mb: float
) -> Row:
    """The row of an item that has a page."""
    flat, page = report.flatten, report.page
    return Row(
        name=name,
        status="not settled" if not report.settled else "warnings" if report.warnings else "good",
        sentence=report.outcome,
        warnings=report.warnings,
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
    """A row from its JSON; None where it is none."""
    try:
        return Row(**plain)
    except TypeError:
        return None


def worst_first(rows: list[Row]) -> list[Row]:
    """By status, then by expected error, then by name.

    Examples
    --------
    >>> rows = [Row(name="a", status="good"), Row(name="b", status="failed"), Row(name="c", status="not settled")]
    >>> [row.name for row in worst_first(rows)]
    ['b', 'c', 'a']
    """
    return sorted(rows, key=lambda row: (STATUSES.index(row.status), -(row.expected_error_mm or 0.0), row.name))
