"""A batch: items go out to a pool, finished ones come back, take their places, and are noted."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass
from pathlib import Path

from planish.batch.items import Found, Item
from planish.batch.memory import need
from planish.batch.order import Order
from planish.batch.pools import Pool
from planish.batch.row import Row
from planish.batch.shelf import Shelf, opened
from planish.batch.summary import write_summary
from planish.batch.task import Made, Task
from planish.errors import OutputError
from planish.io.files import tidied
from planish.job import check
from planish.job.worker import Limits

Tell = Callable[[Row, int, int], None]
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
    found: Found,
    folder: Path,
    make_pool: Callable[[], Pool],
    order: Order | None = None,
    *,
    retry: bool = False,
    seconds: float | None = None,
    tell: Tell | None = None,
) -> Counts:
    """Restore every item that is not yet restored from the same files in the same order, and write the summary.

    It may be stopped at any moment and started again: what is done stays done, and nothing is half there.

    Parameters
    ----------
    found : Found
        The items, see `find_items` and `read_list`.
    folder : Path
        For the output; made if there is none. Only one run at a time may write to it.
    make_pool : callable
        Gives who does the work, `Local` or `Cluster`; called only where there is work.
    order : Order, optional
    retry : bool
        Try again what failed before, though nothing has changed.
    seconds : float, optional
        That an item may take.
    tell : callable, optional

    Raises
    ------
    OutputError
        Where the folder is in use by another run, or cannot be written to.
    UsageError, MissingExtraError
        Where the order contradicts itself, or needs what is not installed.

    Examples
    --------
    >>> import tempfile
    >>> from planish.batch import Local, find_items
    >>> from planish.gallery import sheet, virtual_scan
    >>> from planish.io import write_scan
    >>> with tempfile.TemporaryDirectory() as at:
    ...     for name in ("in", "in/1", "in/2"):
    ...         Path(at, name).mkdir()
    ...     scan = virtual_scan(sheet("book"), points=2000, photo_px=(600, 450)).scan
    ...     _ = write_scan(Path(at, "in/1/scan.obj"), scan)
    ...     _ = Path(at, "in/2/scan.obj").write_text("no scan")
    ...     counts = batch(find_items(Path(at, "in")), Path(at, "out"), Local)
    ...     counts.items, counts.failed, Path(at, "out/1/page.tif").exists()
    (2, 1, True)
    """
    order, folder = order or Order(), folder.absolute()
    _check_apart(found, folder)
    with opened(folder) as shelf:
        check(order.job(found.items[0], shelf.work, (), ()))
        run = _Run(shelf, order, retry, Limits(seconds=seconds), tell)
        tasks = deque(run.tasks(found.items))
        if tasks:
            pool = make_pool()
            with tidied(pool.abandon):
                try:
                    run.work(tasks, pool)
                finally:
                    pool.close()
        rows = [run.rows[item.name] for item in found.items]
        summary = write_summary(folder, rows, found.notes, found.folder)
    count = [row.status for row in rows].count
    return Counts(len(rows), count("failed"), count("not settled"), count("warnings"), run.made, summary)


class _Run:
    """The rows of the items that are settled, and what is needed to settle the others."""

    def __init__(self, shelf: Shelf, order: Order, retry: bool, limits: Limits, tell: Tell | None) -> None:
        self.shelf, self.order, self.retry, self.limits, self.tell = shelf, order, retry, limits, tell
        self.rows: dict[str, Row] = {}
        self.at_once = self.made = 0

    def tasks(self, items: list[Item]) -> Iterator[Task]:
        """What is to be done, or at least looked at; the others are settled."""
        fingerprint = self.order.fingerprint()
        for item in items:
            known = self.shelf.known(item)
            if known is not None and known.row.status == "failed" and (self.retry or known.row.again):
                known = None
            if known is not None and known.stamps and known.holds(item, fingerprint):
                self.at_once += 1
                self._settle(known.row)
            else:
                yield Task(item=item, order=self.order, work=self.shelf.work, known=known, limits=self.limits)

    def work(self, tasks: deque[Task], pool: Pool) -> None:
        """Keep the pool busy with as many tasks as its memory holds, at least one; put what comes back in its place."""
        under_way: dict[Future[Made], float] = {}
        while tasks or under_way:
            while tasks and len(under_way) < pool.slots:
                needed = need(tasks[0].item)
                if under_way and sum(under_way.values()) + needed > pool.memory:
                    break
                under_way[pool.submit(tasks.popleft())] = needed
            ended, _ = wait(under_way, return_when=FIRST_COMPLETED)
            for future in ended:
                del under_way[future]
                self._place(future.result())

    def _place(self, made: Made) -> None:
        if made.folder is not None:
            self.shelf.place(made.folder, made.entry.row.name)
            self.made += 1
        self.shelf.journal.add(made.entry)
        self._settle(made.entry.row)

    def _settle(self, row: Row) -> None:
        self.rows[row.name] = row
        if self.tell:
            self.tell(row, len(self.rows), len(self.rows) - self.at_once)


def _check_apart(found: Found, folder: Path) -> None:
    """Refuse an output among the scans: its flat meshes would be the next run's scans."""
    out = folder.resolve()
    searched = None if found.folder is None else found.folder.resolve()
    if searched is not None and (out.is_relative_to(searched) or searched.is_relative_to(out)):
        raise OutputError(
            f"{folder} and {found.folder} lie in one another; choose an output folder with -o that stands beside the "
            "scans"
        )
