"""Worker pools: processes of this machine, or a Dask cluster."""

from __future__ import annotations

import multiprocessing
import os
import threading
from concurrent.futures import CancelledError, Executor, Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from math import isfinite
from pathlib import Path
from typing import Any, Protocol

from planish.batch.memory import memory_budget
from planish.batch.task import Task, TaskResult, run_task
from planish.errors import InputError, MissingExtraError, OutputError, PlanishError, install_command
from planish.system import kill_group, usable_cores
from planish.version import __version__

_TASKS_PER_SLOT = 2
"""Tasks submitted per worker thread of a cluster, so that no thread waits for the scheduler."""


class Pool(Protocol):
    """Interface of worker pools.

    Attributes
    ----------
    slots : int
        Maximum number of submitted tasks.
    memory : float
        Memory in bytes for all of them together; infinite if unknown.
    """

    slots: int
    memory: float

    def submit(self, task: Task) -> Future[TaskResult]:
        """Start or queue a task."""

    def close(self) -> None:
        """Cancel running tasks and release the workers."""

    def kill(self) -> None:
        """Kill running tasks without waiting; called when the program is about to exit."""


class LocalPool:
    """Worker processes on this machine.

    Parameters
    ----------
    jobs : int, optional
        Number of concurrent processes; by default one per core. The cores are divided among them.
    """

    def __init__(self, jobs: int | None = None) -> None:
        cores = usable_cores()
        self.slots = jobs or cores
        self.memory = memory_budget()
        self._threads = max(1, cores // self.slots)
        self._pool = ThreadPoolExecutor(self.slots)
        self._stop = threading.Event()

    def submit(self, task: Task) -> Future[TaskResult]:
        """Start or queue a task."""
        memory_mb = self.memory / 1e6 if isfinite(self.memory) else None
        limits = replace(task.limits, threads=self._threads, memory_mb=memory_mb)
        return self._pool.submit(run_task, replace(task, limits=limits), self._stop)

    def close(self) -> None:
        """Cancel running tasks and release the workers."""
        self._stop.set()
        self._pool.shutdown(cancel_futures=True)

    def kill(self) -> None:
        """Kill the worker processes; without this they would exit by themselves, but seconds later."""
        if self._stop.is_set():
            return
        with suppress(RuntimeError):  # a process is being started concurrently
            for process in multiprocessing.active_children():
                assert process.pid is not None
                kill_group(process.pid)


class DaskPool:
    """A Dask cluster whose workers share the file system under the same paths.

    Parameters
    ----------
    address : str
        Of the scheduler, for example tcp://host:8786.
    folder : Path
        Output folder, which all workers must be able to access.

    Raises
    ------
    MissingExtraError
        If Dask is not installed.
    InputError
        If no scheduler answers, it has no workers, or they run another version of planish.
    OutputError
        If a worker cannot access the folder.
    """

    def __init__(self, address: str, folder: Path) -> None:
        self._client = _connect(address)
        self._check_workers(address, folder)
        self.slots = _TASKS_PER_SLOT * sum(self._client.nthreads().values())
        self.memory = float("inf")
        self._executor: Executor = self._client.get_executor(pure=False)

    def submit(self, task: Task) -> Future[TaskResult]:
        """Queue a task; Dask reschedules it if its worker is lost."""
        target: Future[TaskResult] = Future()
        dask_future = self._executor.submit(_run_task_in_dask, replace(task, limits=replace(task.limits, threads=1)))
        dask_future.add_done_callback(lambda source: _copy_result(source, target))
        return target

    def close(self) -> None:
        """Disconnect from the cluster, which may still finish running tasks."""
        with suppress(OSError, TimeoutError):
            self._client.close(timeout=1)

    def kill(self) -> None:
        """Do nothing: Dask cancels tasks without a client."""

    def _check_workers(self, address: str, folder: Path) -> None:
        info = self._client.run(_worker_info, os.fspath(folder.resolve()))
        if not info:
            raise InputError(f"the Dask scheduler at {address} has no workers; start some: dask worker {address}")
        for worker, (version, sees_folder) in info.items():
            if version != __version__:
                raise InputError(
                    f"the Dask worker {worker} runs planish {version}, but this is {__version__}; install one version"
                )
            if not sees_folder:
                raise OutputError(
                    f"the Dask worker {worker} cannot access {folder.resolve()}; all workers need the same file system "
                    "under the same path"
                )


def _connect(address: str) -> Any:
    try:
        from distributed import Client
    except ImportError:
        raise MissingExtraError(
            f"--dask needs Dask, which is not installed: {install_command('dask')}, here and on every worker"
        ) from None
    try:
        return Client(address, timeout=10, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as problem:
        reason = " ".join(str(problem).split())
        raise InputError(f"no Dask scheduler answers at {address}: {reason[:200]}; start one: dask scheduler") from None


def _copy_result(source: Future[TaskResult], target: Future[TaskResult]) -> None:
    """Copy result or exception of a Dask future; errors of Dask itself become an `InputError`."""
    problem = CancelledError() if source.cancelled() else source.exception()
    if problem is None:
        target.set_result(source.result())
    elif isinstance(problem, PlanishError):
        target.set_exception(problem)
    else:
        reason = " ".join(f"{type(problem).__name__} {problem}".split())[:200]
        target.set_exception(
            InputError(f"the Dask cluster failed ({reason}); repair it and run the same command to resume")
        )


def _worker_info(folder: str) -> tuple[str, bool]:
    return __version__, Path(folder).is_dir()


def _run_task_in_dask(task: Task) -> TaskResult:
    # multiprocessing forbids children of daemonic processes such as Dask workers; ours exit with their parent anyway
    multiprocessing.current_process().daemon = False
    return run_task(task)
