"""Console output of `planish batch`: progress and counts."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import timedelta
from time import monotonic
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

if TYPE_CHECKING:
    from planish.batch import Counts, Row


@contextmanager
def progress_bar(count: int, *, quiet: bool, verbose: bool) -> Iterator[Callable[[Row, int, int], None]]:
    """Progress bar on stderr with rate and remaining time, if it is a terminal; verbose: a line per item on stdout."""
    with Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}"),
        TimeElapsedColumn(),
        console=Console(stderr=True),
        transient=True,
        disable=quiet or not sys.stderr.isatty(),
    ) as progress_display:
        task = progress_display.add_task("Restoring", total=count, rate="")
        start, failed = monotonic(), 0

        def progress(row: Row, settled: int, now: int) -> None:
            nonlocal failed
            failed += row.status == "failed"
            description = f"Restoring, {failed} failed" if failed else "Restoring"
            progress_display.update(
                task, completed=settled, description=description, rate=_rate(now, monotonic() - start, count - settled)
            )
            if verbose:
                error = "" if row.expected_error_mm is None else f"{row.expected_error_mm:.3f} mm"
                print(row.name, row.status, error or row.sentence, sep="\t", flush=True)

        yield progress


def _rate(done: int, seconds: float, left: int) -> str:
    """Rate and remaining time, from the items processed by this run only.

    Examples
    --------
    >>> _rate(20, 60, 100)
    '1,200 an hour, 0:05:00 left'
    """
    if not done:
        return ""
    return f"{3600 * done / seconds:,.0f} an hour, {timedelta(seconds=round(left * seconds / done))} left"


def print_counts(counts: Counts, notes: list[str], *, quiet: bool, verbose: bool) -> None:
    """Print the number of items by status if stdout is a terminal; notes, and pages that are not good, go to stderr."""
    errors = Console(stderr=True, highlight=False, soft_wrap=True, markup=False)
    doubtful = {"not good": counts.not_good, "to look at": counts.to_look_at}
    if any(doubtful.values()):
        numbers = ", ".join(f"{count:,} {which}" for which, count in doubtful.items() if count)
        errors.print(f"planish: of {counts.items:,} pages {numbers}; {counts.summary} says why")
    if quiet:
        return
    for note in notes:
        errors.print(f"planish: note: {note}")
    if verbose or sys.stdout.isatty():
        good = counts.items - counts.failed - counts.not_good - counts.to_look_at
        print(
            f"{counts.items:,} scans: {good:,} good, {counts.to_look_at:,} to look at, {counts.not_good:,} not good, "
            f"{counts.failed:,} failed; {counts.done_now:,} done now"
        )
        print(f"written  {counts.summary}")
