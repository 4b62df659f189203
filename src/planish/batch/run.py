"""Run a batch: submit items to a pool, publish finished ones, and record them in the journal."""

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
from planish.io.files import cleanup_on_exit
from planish.job import check
from planish.job.worker import Limits

ProgressCallback = Callable[[Row, int, int], None]
"""Called with the row of every finished item, the number of finished items, and how many of these by this run."""


@dataclass(frozen=True)
class Counts:
    """Result of a batch.

    Attributes
    ----------
    items, failed, not_good, to_look_at, done_now : int
        Number of items in total, by status, and number of items restored in this run.
    summary : Path
        Path of summary.html.
    """

    items: int
    failed: int
    not_good: int
    to_look_at: int
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
    """Restore all items that are not up to date, and write the summary.

    A batch may be interrupted at any moment and resumed by a second call; no partial results are visible.

    Parameters
    ----------
    scans : ScanList
        From `find_items` or `read_list`.
    folder : Path
        Output folder; created if it does not exist. Only one run at a time may write to it.
    make_pool : callable
        Returns a `LocalPool` or `DaskPool`; called only if there is work.
    options : BatchOptions, optional
    retry : bool
        Retry items that failed before, even if nothing has changed.
    seconds : float, optional
        Time limit of one item.
    progress : callable, optional

    Raises
    ------
    OutputError
        If the folder is in use by another run, or cannot be written to.
    UsageError, MissingExtraError
        If the options contradict each other, or need an extra that is not installed.

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
        output_dir.check_names(item.name for item in scans.items)
        check(options.make_job(scans.items[0], output_dir.work_dir, (), ()))
        state = _BatchRun(output_dir, options, retry, Limits(seconds=seconds), progress)
        tasks = deque(state.tasks(scans.items))
        if tasks:
            pool = make_pool()
            with cleanup_on_exit(pool.kill):
                try:
                    state.process(tasks, pool)
                finally:
                    pool.close()
        rows = [state.rows[item.name] for item in scans.items]
        summary = write_summary(folder, rows, scans.notes, scans.folder)
    count = [row.status for row in rows].count
    return Counts(len(rows), count("failed"), count("not good"), count("look at it"), state.restored, summary)


class _BatchRun:
    """State of a run: rows of finished items, and what is needed to process the others."""

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
        """Tasks for all items that are not known to be up to date; the others are recorded at once."""
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
        """Keep the pool busy with as many tasks as its memory allows, at least one, and publish their results."""
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
    """Refuse an output folder among the scans, where the next run would take flat meshes for scans."""
    out = folder.resolve()
    searched = None if scans.folder is None else scans.folder.resolve()
    if searched is not None and (out.is_relative_to(searched) or searched.is_relative_to(out)):
        raise OutputError(
            f"the output folder {folder} and the scans in {scans.folder} overlap; choose an output folder with -o "
            "outside of the scans"
        )
