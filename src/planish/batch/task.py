"""Process one item in a subprocess, and turn failures into results."""

from __future__ import annotations

import os
import secrets
import threading
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter

from planish.batch.inputs import Inputs, find_inputs
from planish.batch.items import Item
from planish.batch.journal import Entry, item_as_json
from planish.batch.options import BatchOptions
from planish.batch.output_dir import write_record
from planish.batch.preview import write_preview
from planish.batch.row import Row, row_from_report
from planish.errors import OutputError, PlanishError
from planish.hints import as_flag
from planish.job import run
from planish.job.worker import Limits, WorkerDiedError, run_in_subprocess
from planish.pipeline import Progress
from planish.system import peak_memory


class BatchAbortError(OutputError):
    """A disk or system error that no item is responsible for; it ends the run."""


@dataclass(frozen=True, kw_only=True)
class Task:
    """Arguments of a worker.

    Attributes
    ----------
    item : Item
    options : BatchOptions
    work_dir : Path
        Where to create the item's folder.
    previous : Entry or None
        Entry of an earlier run; it is kept if inputs and options are the same.
    limits : Limits
    """

    item: Item
    options: BatchOptions
    work_dir: Path
    previous: Entry | None
    limits: Limits


@dataclass(frozen=True)
class TaskResult:
    """Result of a worker: the entry, and the folder to publish (None if the existing one is up to date)."""

    entry: Entry
    folder: Path | None


def run_task(task: Task, stop: threading.Event | None = None) -> TaskResult:
    """Process an item in a subprocess; failures become entries.

    A subprocess that was killed from outside gets a second try.

    Raises
    ------
    BatchAbortError
        On disk or system errors.
    """
    for tries_left in (1, 0):
        try:
            return run_in_subprocess(restore_item, task, limits=task.limits, stop=stop)
        except BatchAbortError:
            raise
        except PlanishError as problem:  # before OSError, which an OutputError is too
            if not (tries_left and isinstance(problem, WorkerDiedError)):
                return _failed_result(task, problem)
        except OSError as problem:  # out of processes or file descriptors
            raise BatchAbortError(f"{task.item.name} could not be started: {problem.strerror or problem}") from problem
    raise AssertionError("the second try returns or raises")


def restore_item(task: Task, progress: Progress) -> TaskResult:
    """Restore one item into a new folder, unless it is up to date.

    Raises
    ------
    PlanishError
        See `planish.job.run`.
    """
    start = perf_counter()
    inputs = find_inputs(task.item)
    if task.previous is not None and (task.previous.options, task.previous.inputs) == _fingerprints(task, inputs):
        return TaskResult(replace(task.previous, item=item_as_json(task.item), file_stamps=inputs.file_stamps), None)
    folder = _new_folder(task)
    try:
        result = run(task.options.make_job(task.item, folder, inputs.photo, inputs.camera), progress)
        page = next(path for path in result.written if path.stem.startswith("page"))
        write_preview(folder / "preview.jpg", page)
    except OutputError as problem:
        if isinstance(problem.__cause__, OSError):
            raise BatchAbortError(problem.sentence, problem.hint) from problem
        raise
    times = os.times()
    row = row_from_report(
        task.item.name,
        result.report,
        sorted(path.name for path in folder.iterdir()),
        seconds=perf_counter() - start,
        cpu_seconds=times.user + times.system + times.children_user + times.children_system,
        peak_mb=peak_memory() / 1e6,
    )
    return _record_result(task, inputs, row, folder)


def _failed_result(task: Task, problem: PlanishError) -> TaskResult:
    inputs = find_inputs(task.item)
    again = isinstance(problem, WorkerDiedError)
    row = Row(name=task.item.name, status="failed", sentence=problem.message(as_flag), again=again)
    return _record_result(task, inputs, row, _new_folder(task))


def _record_result(task: Task, inputs: Inputs, row: Row, folder: Path) -> TaskResult:
    entry = Entry(row, item_as_json(task.item), *_fingerprints(task, inputs), inputs.file_stamps)
    try:
        write_record(folder, entry)
    except OutputError as problem:
        raise BatchAbortError(problem.sentence, problem.hint) from problem
    return TaskResult(entry, folder)


def _fingerprints(task: Task, inputs: Inputs) -> tuple[str, str]:
    return task.options.fingerprint(), inputs.fingerprint()


def _new_folder(task: Task) -> Path:
    folder = task.work_dir / secrets.token_hex(8)
    try:
        folder.mkdir(parents=True)
    except OSError as problem:
        raise BatchAbortError(f"{folder} cannot be created: {problem.strerror}") from problem
    return folder
