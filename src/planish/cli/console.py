"""Console output shared by the commands: progress bar, report table and warnings."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

from planish import kernel_cache
from planish.hints import as_flag
from planish.types import Diagnostic, Report

STAGE_LABELS = {
    "read": "Reading",
    "scan": "Scanning the sheet",
    "laser": "Detecting the laser",
    "acquire": "Reconstructing the scan",
    "calibrate": "Calibrating",
    "shape": "Estimating the sheet's shape",
    "compile": "Compiling",
    "clean": "Repairing the mesh",
    "flatten": "Flattening",
    "turn": "Orienting the page",
    "render": "Rendering the page",
    "split": "Splitting the pages",
    "unshade": "Removing the shading",
    "sharpen": "Sharpening",
    "binarize": "Binarizing",
    "measure": "Measuring",
    "text": "Recognizing text",
    "write": "Writing",
    "look": "Writing the HTML page",
}

NOTE_COMPILE_SECONDS = 5.0
"""Seconds of compilation from which on a note is printed."""


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
    from numba.core.event import TimingListener, install_listener

    class Compiling(TimingListener):
        """Notified by numba when it compiles a kernel; on the first run this takes about a minute in total."""

        def on_start(self, event: object) -> None:
            super().on_start(event)
            display.update(task, description=f"{stage} (compiling, on the first run only)")

    stage = ""
    columns = (TextColumn("{task.description:<22}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
    console = Console(stderr=True, highlight=False, soft_wrap=True)
    compiling = Compiling()
    display = Progress(*columns, console=console, transient=True, redirect_stdout=False, redirect_stderr=False)
    with display, install_listener("numba:compile", compiling):
        task = display.add_task("", total=1.0)

        def progress(name: str, share: float) -> None:
            nonlocal stage
            stage = STAGE_LABELS.get(name, name)
            display.update(task, description=stage, completed=share)

        yield progress
    if compiling.done and compiling.duration > NOTE_COMPILE_SECONDS:
        console.print(f"planish: note: compiling took {compiling.duration:.0f} s of this, which happens only once")


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
