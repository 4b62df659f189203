"""Who does the work: processes of this machine, or a Dask cluster. Both are executors of `concurrent.futures`."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from concurrent.futures import CancelledError, Executor, Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from math import isfinite
from pathlib import Path
from typing import Any, Protocol

from planish.batch.memory import memory_budget
from planish.batch.task import Task, TaskResult, run_task
from planish.errors import InputError, MissingExtraError, OutputError, PlanishError
from planish.version import __version__

_TASKS_PER_SLOT = 2
"""Tasks that a cluster is given per slot, so that none waits for us."""


class Pool(Protocol):
    """Takes tasks.

    Attributes
    ----------
    slots : int
        Tasks that it should have at a time.
    memory : float
        Bytes for all of them together; infinite where that is not known here.
    """

    slots: int
    memory: float

    def submit(self, task: Task) -> Future[TaskResult]:
        """Begin a task, or queue it."""

    def close(self) -> None:
        """Stop what is under way."""

    def kill(self) -> None:
        """End what is under way without waiting, for a program that is about to end in the middle of it."""


class LocalPool:
    """Processes of this machine.

    Parameters
    ----------
    jobs : int, optional
        How many at a time; by default one for each core. The cores are divided among them.
    """

    def __init__(self, jobs: int | None = None) -> None:
        cores = len(os.sched_getaffinity(0))
        self.slots = jobs or cores
        self.memory = memory_budget()
        self._threads = max(1, cores // self.slots)
        self._pool = ThreadPoolExecutor(self.slots)
        self._stop = threading.Event()

    def submit(self, task: Task) -> Future[TaskResult]:
        """Begin a task, or queue it."""
        memory_mb = self.memory / 1e6 if isfinite(self.memory) else None
        limits = replace(task.limits, threads=self._threads, memory_mb=memory_mb)
        return self._pool.submit(run_task, replace(task, limits=limits), self._stop)

    def close(self) -> None:
        """Stop what is under way."""
        self._stop.set()
        self._pool.shutdown(cancel_futures=True)

    def kill(self) -> None:
        """End what is under way without waiting; the processes would notice by themselves, but seconds later."""
        if self._stop.is_set():
            return
        with suppress(RuntimeError):  # one was being started just now
            for process in multiprocessing.active_children():
                assert process.pid is not None
                with suppress(ProcessLookupError, PermissionError):
                    os.killpg(process.pid, signal.SIGKILL)


class DaskPool:
    """A Dask cluster whose workers see the same files under the same paths.

    Parameters
    ----------
    address : str
        Of the scheduler, as tcp://host:8786.
    folder : Path
        The output, which all workers must see.

    Raises
    ------
    MissingExtraError
        Where Dask is not installed.
    InputError
        Where no scheduler answers, or it has no workers, or they have another version of planish.
    OutputError
        Where a worker does not see the folder.
    """

    def __init__(self, address: str, folder: Path) -> None:
        self._client = _connect(address)
        self._check_workers(address, folder)
        self.slots = _TASKS_PER_SLOT * sum(self._client.nthreads().values())
        self.memory = float("inf")
        self._executor: Executor = self._client.get_executor(pure=False)

    def submit(self, task: Task) -> Future[TaskResult]:
        """Queue a task; Dask gives it to another worker where one is lost."""
        target: Future[TaskResult] = Future()
        dask_future = self._executor.submit(_run_task_in_dask, replace(task, limits=replace(task.limits, threads=1)))
        dask_future.add_done_callback(lambda source: _copy_result(source, target))
        return target

    def close(self) -> None:
        """Take leave of the cluster, which may still finish what it has begun."""
        with suppress(OSError, TimeoutError):
            self._client.close(timeout=1)

    def kill(self) -> None:
        """Nothing: Dask takes back what nobody waits for."""

    def _check_workers(self, address: str, folder: Path) -> None:
        info = self._client.run(_worker_info, os.fspath(folder.resolve()))
        if not info:
            raise InputError(f"the Dask scheduler at {address} has no workers; start some: dask worker {address}")
        for worker, (version, sees_folder) in info.items():
            if version != __version__:
                raise InputError(
                    f"the Dask worker {worker} has planish {version}, and here is {__version__}; make them one"
                )
            if not sees_folder:
                raise OutputError(
                    f"the Dask worker {worker} does not see {folder.resolve()}; all workers need the same file system "
                    "under the same path"
                )


def _connect(address: str) -> Any:
    try:
        from distributed import Client
    except ImportError:
        raise MissingExtraError(
            "--dask needs Dask, which is not installed: pip install 'planish[dask]', here and on every worker"
        ) from None
    try:
        return Client(address, timeout=10, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as problem:
        reason = " ".join(str(problem).split())
        raise InputError(f"no Dask scheduler answers at {address}: {reason[:200]}; start one: dask scheduler") from None


def _copy_result(source: Future[TaskResult], target: Future[TaskResult]) -> None:
    """What Dask answers; where it gives up, a sentence."""
    problem = CancelledError() if source.cancelled() else source.exception()
    if problem is None:
        target.set_result(source.result())
    elif isinstance(problem, PlanishError):
        target.set_exception(problem)
    else:
        reason = " ".join(f"{type(problem).__name__} {problem}".split())[:200]
        target.set_exception(
            InputError(f"the Dask cluster gave up ({reason}); look after it and run the same again: what is done stays")
        )


def _worker_info(folder: str) -> tuple[str, bool]:
    return __version__, Path(folder).is_dir()


def _run_task_in_dask(task: Task) -> TaskResult:
    # Dask's workers are daemons to multiprocessing, which lets these have no processes; ours end with their parent
    multiprocessing.current_process().daemon = False
    return run_task(task)
