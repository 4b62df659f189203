"""One item: what happens in a process of its own, and what becomes of it where that fails."""

from __future__ import annotations

import resource
import secrets
import threading
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter

from planish.batch.inputs import Inputs, inputs_of
from planish.batch.items import Item
from planish.batch.journal import Entry, given
from planish.batch.order import Order
from planish.batch.preview import write_preview
from planish.batch.row import Row, row_of
from planish.batch.shelf import write_record
from planish.errors import OutputError, PlanishError
from planish.job import run
from planish.job.worker import DiedError, Limits, apart
from planish.pipeline import Progress


class NoRoomError(OutputError):
    """The disk or the system refused: this is no item's fault, and ends the run."""


@dataclass(frozen=True, kw_only=True)
class Task:
    """What a worker is given.

    Attributes
    ----------
    item : Item
    order : Order
    work : Path
        Where to make the item's folder.
    known : Entry or None
        What stands in place; it is kept where it was made from the same bytes in the same order.
    limits : Limits
    """

    item: Item
    order: Order
    work: Path
    known: Entry | None
    limits: Limits


@dataclass(frozen=True)
class Made:
    """What a worker gives back: the entry, and the folder to be moved to its place (None: what stands there holds)."""

    entry: Entry
    folder: Path | None


def attempt(task: Task, stop: threading.Event | None = None) -> Made:
    """Do an item in a process of its own; whatever happens to that becomes an entry.

    A process that was ended from outside gets a second try.

    Raises
    ------
    NoRoomError
        Where the disk or the system refuses.
    """
    for tries_left in (1, 0):
        try:
            return apart(restore_item, task, limits=task.limits, stop=stop)
        except NoRoomError:
            raise
        except OSError as problem:  # no more processes, no more files
            raise NoRoomError(f"{task.item.name} could not be begun: {problem.strerror or problem}") from problem
        except PlanishError as problem:
            if not (tries_left and isinstance(problem, DiedError)):
                return _failed(task, problem)
    raise AssertionError("the second try returns or raises")


def restore_item(task: Task, tell: Progress) -> Made:
    """Restore one item into a new folder, unless what stands in place was made from the same.

    Raises
    ------
    PlanishError
        As `planish.job.run` does.
    """
    start = perf_counter()
    inputs = inputs_of(task.item)
    if task.known is not None and (task.known.order, task.known.inputs) == _fingerprints(task, inputs):
        return Made(replace(task.known, given=given(task.item), stamps=inputs.stamps), None)
    folder = _new_folder(task)
    try:
        done = run(task.order.job(task.item, folder, inputs.photo, inputs.camera), tell)
        page = next(path for path in done.written if path.stem.startswith("page"))
        write_preview(folder / "preview.jpg", page)
    except OutputError as problem:
        if isinstance(problem.__cause__, OSError):
            raise NoRoomError(str(problem)) from problem
        raise
    used, helpers = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    row = row_of(
        task.item.name,
        done.report,
        sorted(path.name for path in folder.iterdir()),
        seconds=perf_counter() - start,
        cpu_seconds=used.ru_utime + used.ru_stime + helpers.ru_utime + helpers.ru_stime,
        peak_mb=used.ru_maxrss * 1024 / 1e6,
    )
    return _recorded(task, inputs, row, folder)


def _failed(task: Task, problem: PlanishError) -> Made:
    inputs = inputs_of(task.item)
    row = Row(name=task.item.name, status="failed", sentence=str(problem), again=isinstance(problem, DiedError))
    return _recorded(task, inputs, row, _new_folder(task))


def _recorded(task: Task, inputs: Inputs, row: Row, folder: Path) -> Made:
    entry = Entry(row, given(task.item), *_fingerprints(task, inputs), inputs.stamps)
    try:
        write_record(folder, entry)
    except OutputError as problem:
        raise NoRoomError(str(problem)) from problem
    return Made(entry, folder)


def _fingerprints(task: Task, inputs: Inputs) -> tuple[str, str]:
    return task.order.fingerprint(), inputs.fingerprint()


def _new_folder(task: Task) -> Path:
    folder = task.work / secrets.token_hex(8)
    try:
        folder.mkdir(parents=True)
    except OSError as problem:
        raise NoRoomError(f"{folder} cannot be made: {problem.strerror}") from problem
    return folder
