"""A progress bar for terminals and notebooks, drawn by rich."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console

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
def progress_bar(console: Console | None = None) -> Iterator[Callable[[str, float], None]]:
    """Progress bar with the name of the stage, in a terminal or a notebook (there with ipywidgets).

    Where stderr is neither a terminal nor a notebook, such as in a log file, nothing is drawn.

    Parameters
    ----------
    console : rich.console.Console, optional
        Where to draw. By default stderr.

    Yields
    ------
    callable
        For the parameter `progress` of `planish.flatten`, `planish.restore` and others.

    Examples
    --------
    >>> import planish
    >>> mesh, _ = planish.gallery.sheet_mesh(planish.gallery.sheet("book"), points=500)
    >>> with planish.progress_bar() as progress:
    ...     flat = planish.flatten(mesh, progress=progress)
    """
    from numba.core.event import TimingListener, install_listener
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

    console = console or Console(stderr=True, highlight=False, soft_wrap=True)
    if not (console.is_terminal or console.is_jupyter):
        yield lambda stage, share: None
        return

    class Compiling(TimingListener):
        """Notified by numba when it compiles a kernel; on the first run this takes about a minute in total."""

        def on_start(self, event: object) -> None:
            super().on_start(event)
            display.update(task, description=f"{label} (compiling, on the first run only)")

    label = ""
    columns = (TextColumn("{task.description:<22}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
    compiling = Compiling()
    display = Progress(*columns, console=console, transient=True, redirect_stdout=False, redirect_stderr=False)
    with display, install_listener("numba:compile", compiling):
        task = display.add_task("", total=1.0)

        def progress(stage: str, share: float) -> None:
            nonlocal label
            label = STAGE_LABELS.get(stage, stage)
            display.update(task, description=label, completed=share)

        yield progress
    if compiling.done and compiling.duration > NOTE_COMPILE_SECONDS:
        console.print(f"planish: note: compiling took {compiling.duration:.0f} s of this, which happens only once")
