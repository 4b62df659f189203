"""Console output shared by the commands: progress bar, report table and warnings."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from rich.console import Console

from planish import kernel_cache
from planish.display import progress as display
from planish.hints import as_flag
from planish.types import Diagnostic, Report


@contextmanager
def pipeline_progress(*, quiet: bool, draw: bool = True) -> Iterator[Callable[[str, float], None]]:
    """Progress bar for a command that flattens a sheet and may draw it: its first run compiles on two cores."""
    from planish.job.warm_up import compile_from_both_ends

    with compile_from_both_ends(draw=draw), progress_bar(quiet=quiet) as progress:
        yield progress


@contextmanager
def progress_bar(*, quiet: bool) -> Iterator[Callable[[str, float], None]]:
    """Progress bar on stderr with the name of the stage, if it is a terminal."""
    if kernel_cache.made is not None and not quiet:
        folder = kernel_cache.made
        sentence = f"neither planish's folder nor yours can be written, so compiled code is kept in {folder}"
        note = f"planish: note: {sentence}; set {kernel_cache.VARIABLE} to keep it elsewhere"
        Console(stderr=True, highlight=False, soft_wrap=True, markup=False).print(note)
    if quiet or not sys.stderr.isatty():
        yield lambda name, share: None
        return
    with display.progress_bar(Console(stderr=True, highlight=False, soft_wrap=True)) as progress:
        yield progress


class EarlyNotes:
    """Prints what reading found odd at once, before the work that it may make vain.

    Attributes
    ----------
    printed : list of Diagnostic
    """

    def __init__(self, *, quiet: bool):
        self.quiet = quiet
        self.printed: list[Diagnostic] = []

    def __call__(self, warnings: Sequence[Diagnostic]) -> None:
        """Print warnings to stderr."""
        _print_notes(warnings, quiet=self.quiet)
        self.printed += warnings


def print_report(
    report: Report, written: list[str], *, quiet: bool, verbose: bool, printed: Sequence[Diagnostic] = ()
) -> None:
    """Print verdict and reasons to stderr, then the notes, and the report table if stdout is a terminal.

    The reasons of anything but "good" are printed even if `quiet`.
    """
    from rich.table import Table

    from planish.report import summary, usual

    verdict = report.verdict
    errors = Console(stderr=True, highlight=False, soft_wrap=True, markup=False)
    for reason in verdict.reasons:
        errors.print(f"planish: {verdict.word}: {reason.message(as_flag)}")
    _print_notes([note for note in report.notes if note not in printed], quiet=quiet)
    if quiet or not (verbose or sys.stdout.isatty()):
        return
    table = Table(show_header=False, box=None, pad_edge=False)
    for what, how_much in [*summary(report), *(("written", name) for name in written)]:
        table.add_row(what, how_much, f"usual: {usual(what)}" if usual(what) else "")
    Console(highlight=False, markup=False).print(table)


def _print_notes(warnings: Sequence[Diagnostic], *, quiet: bool) -> None:
    errors = Console(stderr=True, highlight=False, soft_wrap=True, markup=False)
    for warning in warnings:
        if not quiet:
            errors.print(f"planish: note: {warning.message(as_flag)}")
