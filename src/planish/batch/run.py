"""A batch: items go out to a pool, finished ones come back, take their places, and are noted."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass
from pathlib import Path

from planish.batch.items import Item, ScanList
from planish.batch.memory import estimate_memory
from planish.batch.options import BatchOptions
from planish.batch.output_dir import OutputDir, open_output_dir
from planish.batch.pools import Pool
from planish.batch.row import Row
from planish.batch.summary import write_summary
from planish.batch.task import Task, TaskResult
from planish.errors import OutputError
from planish.io.files import tidied
from planish.job import check
from planish.job.worker import Limits

ProgressCallback = Callable[[Row, int, int], None]
"""Told of every item that is settled, with how many are by now, and how many of these by this run."""


@dataclass(frozen=True)
class Counts:
    """How a batch ended.

    Attributes
    ----------
    items, failed, not_settled, warned, done_now : int
        In all; of these; and how many of all were done by this run.
    summary : Path
        Of the summary to look at.
    """

    items: int
    failed: int
    not_settled: int
    warned: int
    done_now: int
    summary: Path


def batch(
    scans: ScanList,
    folder: Path,
    make_pool: Callable[[], Pool],
    options: BatchOptions | None = None,
    *,
    retry: bool = False,
    seconds: float | None = None,
    progress: ProgressCallback | None = None,
) -> Counts:
    """Restore every item that is not yet restored from the same files in the same order, and write the summary.

    It may be stopped at any moment and started again: what is done stays done, and nothing is half there.

    Parameters
    ----------
    scans : ScanList
        The items, see `find_items` and `read_list`.
    folder : Path
        For the output; made if there is none. Only one run at a time may write to it.
    make_pool : callable
        Gives who does the work, `LocalPool` or `DaskPool`; called only where there is work.
    options : BatchOptions, optional
    retry : bool
        Try again what failed before, though nothing has changed.
    seconds : float, optional
        That an item may take.
    progress : callable, optional

    Raises
    ------
    OutputError
        Where the folder is in use by another run, or cannot be written to.
    UsageError, MissingExtraError
        Where the order contradicts itself, or needs what is not installed.

    Examples
    --------
    >>> import tempfile
    >>> from planish.batch import LocalPool, find_items
    >>> from planish.gallery import sheet, virtual_scan
    >>> from planish.io import write_scan
    >>> with tempfile.TemporaryDirectory() as at:
    ...     for name in ("in", "in/1", "in/2"):
    ...         Path(at, name).mkdir()
    ...     scan = virtual_scan(sheet("book"), points=2000, photo_px=(600, 450)).scan
    ...     _ = write_scan(Path(at, "in/1/scan.obj"), scan)
    ...     _ = Path(at, "in/2/scan.obj").write_text("no scan")
    ...     counts = batch(find_items(Path(at, "in")), Path(at, "out"), LocalPool)
    ...     counts.items, counts.failed, Path(at, "out/1/page.tif").exists()
    (2, 1, True)
    """
    options, folder = options or BatchOptions(), folder.absolute()
    _check_output_outside_scans(scans, folder)
    with open_output_dir(folder) as output_dir:
        check(options.make_job(scans.items[0], output_dir.work_dir, (), ()))
        state = _BatchRun(output_dir, options, retry, Limits(seconds=seconds), progress)
        tasks = deque(state.tasks(scans.items))
        if tasks:
            pool = make_pool()
            with tidied(pool.kill):
                try:
                    state.process(tasks, pool)
                finally:
                    pool.close()
        rows = [state.rows[item.name] for item in scans.items]
        summary = write_summary(folder, rows, scans.notes, scans.folder)
    count = [row.status for row in rows].count
    return Counts(len(rows), count("failed"), count("not settled"), count("warnings"), state.restored, summary)


class _BatchRun:
    """The rows of the items that are settled, and what is needed to settle the others."""

    def __init__(
        self,
        output_dir: OutputDir,
        options: BatchOptions,
        retry: bool,
        limits: Limits,
        progress: ProgressCallback | None,
    ) -> None:
        self.output_dir, self.options, self.retry, self.limits, self.progress = (
            output_dir,
            options,
            retry,
            limits,
            progress,
        )
        self.rows: dict[str, Row] = {}
        self.skipped = self.restored = 0

    def tasks(self, items: list[Item]) -> Iterator[Task]:
        """What is to be done, or at least looked at; the others are settled."""
        fingerprint = self.options.fingerprint()
        for item in items:
            previous = self.output_dir.previous_entry(item)
            if previous is not None and previous.row.status == "failed" and (self.retry or previous.row.again):
                previous = None
            if previous is not None and previous.file_stamps and previous.is_current(item, fingerprint):
                self.skipped += 1
                self._record(previous.row)
            else:
                yield Task(
                    item=item,
                    options=self.options,
                    work_dir=self.output_dir.work_dir,
                    previous=previous,
                    limits=self.limits,
                )

    def process(self, tasks: deque[Task], pool: Pool) -> None:
        """Keep the pool busy with as many tasks as its memory holds, at least one; put what comes back in its place."""
        running: dict[Future[TaskResult], float] = {}
        while tasks or running:
            while tasks and len(running) < pool.slots:
                memory = estimate_memory(tasks[0].item)
                if running and sum(running.values()) + memory > pool.memory:
                    break
                running[pool.submit(tasks.popleft())] = memory
            ended, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in ended:
                del running[future]
                self._finish(future.result())

    def _finish(self, restored: TaskResult) -> None:
        if restored.folder is not None:
            self.output_dir.move_into_place(restored.folder, restored.entry.row.name)
            self.restored += 1
        self.output_dir.journal.add(restored.entry)
        self._record(restored.entry.row)

    def _record(self, row: Row) -> None:
        self.rows[row.name] = row
        if self.progress:
            self.progress(row, len(self.rows), len(self.rows) - self.skipped)


def _check_output_outside_scans(scans: ScanList, folder: Path) -> None:
    """Refuse an output among the scans: its flat meshes would be the next run's scans."""
    out = folder.resolve()
    searched = None if scans.folder is None else scans.folder.resolve()
    if searched is not None and (out.is_relative_to(searched) or searched.is_relative_to(out)):
        raise OutputError(
            f"{folder} and {scans.folder} lie in one another; choose an output folder with -o that stands beside the "
            "scans"
        )
