"""Run a function in a subprocess that can be killed, with limits on time, memory and threads.

Subprocesses are forked from a fork server (`multiprocessing`) that has imported planish and loaded its kernels
(`planish.job.preload`), so that a start takes hundredths of a second instead of seconds. The fork server runs a single
Python thread. Neither it nor the caller is affected by how a subprocess ends.
"""

from __future__ import annotations

import multiprocessing
import os
import threading
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from time import monotonic
from typing import Any, TypeVar

from planish.errors import InputError, PlanishError
from planish.memory import is_out_of_memory
from planish.system import (
    MEMORY_CAN_BE_LIMITED,
    kill_group,
    lead_own_group,
    limit_own_memory,
    memory_of,
    worker_context,
)

T = TypeVar("T")
Progress = Callable[[str, float], None]

_CONTEXT = worker_context(preload=["__main__", "planish.job.preload"])
_START_LOCK = threading.Lock()  # Process.start() and join() reap children, which is not thread-safe
_POLL_INTERVAL = 0.1
"""Seconds between two checks of the time limit and of `stop`; results are received at once."""
_PROGRESS_INTERVAL = 0.05
"""Minimum seconds between two progress messages of one stage."""
_KILL_TIMEOUT = 10.0
"""Seconds to wait for a killed process, which has to free its memory."""
_REDUCE = "give fewer {points}, a lower {dpi} or a smaller photo"


class LimitError(InputError):
    """The time or memory limit was exceeded."""


class WorkerDiedError(InputError):
    """The process was killed from outside or crashed in compiled code; a second try may succeed.

    Attributes
    ----------
    signal : int or None
        Signal that ended the process.
    """

    def __init__(self, sentence: str, hint: str = "", *, signal: int | None = None):
        super().__init__(sentence, hint)
        self.signal = signal


class InternalError(InputError):
    """An unexpected exception, that is a bug in planish.

    Attributes
    ----------
    trace : str
        Traceback.
    """

    def __init__(self, sentence: str, hint: str = "", *, trace: str = ""):
        super().__init__(sentence, hint)
        self.trace = trace


class StoppedError(Exception):
    """The caller set `stop`."""


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Limits of a subprocess; None means no limit.

    Attributes
    ----------
    seconds : float or None
        Wall-clock time from start to end.
    memory_mb : float or None
        Private memory in megabytes, which the system refuses to exceed; where it cannot (Windows), the process is ended
        within a second of taking more. planish itself takes about 400.
    threads : int or None
        For numba kernels and OpenCV.
    """

    seconds: float | None = None
    memory_mb: float | None = None
    threads: int | None = None


def run_in_subprocess(
    function: Callable[..., T],
    *arguments: Any,
    limits: Limits | None = None,
    progress: Progress | None = None,
    stop: threading.Event | None = None,
) -> T:
    """Call `function(*arguments, progress)` in a subprocess and return its result.

    May be called from several threads at once. The subprocess ends with its caller, also if the caller is killed.

    Parameters
    ----------
    function : callable
        A module-level function; arguments and result must be picklable. Its last argument is a callable that takes
        (stage, fraction done).
    limits : Limits, optional
    progress : callable, optional
        Called with (stage, fraction done).
    stop : threading.Event, optional
        Set by another thread to cancel.

    Raises
    ------
    PlanishError
        As raised by `function`.
    LimitError, DiedError, FaultError, StoppedError
    """
    limits = limits or Limits()
    receiver, sender = _CONTEXT.Pipe(duplex=False)
    process = _CONTEXT.Process(target=_run_child, args=(sender, limits, function, arguments), daemon=True)
    _start_process(process)
    sender.close()
    try:
        return _wait_for_result(
            process, receiver, limits, progress or (lambda stage, share: None), stop or threading.Event()
        )
    finally:
        receiver.close()
        _kill(process)


def preload_workers() -> None:
    """Start the fork server and wait until it is ready: seconds, or a minute if kernels must be compiled."""
    run_in_subprocess(_no_op)


def _no_op(progress: Progress) -> None:
    pass


def _start_process(process: BaseProcess) -> None:
    with _START_LOCK:
        os.environ["PLANISH_PRELOAD"] = "1"
        try:
            process.start()  # starts the fork server as well if it is not running
        except (EOFError, OSError) as problem:
            raise WorkerDiedError(
                f"no process could be started ({problem or 'the fork server ended'})", "try again"
            ) from None
        finally:
            del os.environ["PLANISH_PRELOAD"]


def _wait_for_result(
    process: BaseProcess, connection: Connection, limits: Limits, progress: Progress, stop: threading.Event
) -> Any:
    start = monotonic()
    while True:
        ready = wait([connection, process.sentinel], timeout=_POLL_INTERVAL)
        if stop.is_set():
            raise StoppedError
        if limits.seconds is not None and monotonic() - start > limits.seconds:
            raise LimitError(f"not finished within the time limit of {limits.seconds:g} s", _REDUCE)
        if limits.memory_mb is not None and not MEMORY_CAN_BE_LIMITED and _memory_mb(process) > limits.memory_mb:
            raise _too_large(limits)
        if not ready:
            continue
        try:
            kind, *payload = connection.recv()
        except (EOFError, OSError):
            raise _died_error(process, limits) from None
        if kind == "progress":
            progress(*payload)
        elif kind == "done":
            return payload[0]
        else:
            raise payload[0]


def _memory_mb(process: BaseProcess) -> float:
    return memory_of(process.pid or 0) / 1e6


def _too_large(limits: Limits) -> LimitError:
    needed = f"more than {limits.memory_mb:g} MB of memory" if limits.memory_mb else "more memory than there is"
    return LimitError(f"it takes {needed}", _REDUCE)


def _died_error(process: BaseProcess, limits: Limits) -> WorkerDiedError:
    _kill(process)
    code = process.exitcode
    number = -code if code is not None and code < 0 else None
    how = f"with exit code {code}" if number is None else f"by signal {number}"
    limit = "" if limits.memory_mb is None else f" (the limit is {limits.memory_mb:g} MB)"
    return WorkerDiedError(
        f"the worker process ended {how}, as happens when memory runs out{limit}",
        "try again, or give a smaller scan",
        signal=number,
    )


def _kill(process: BaseProcess) -> None:
    """Kill the process and its children if they still run, and reap it."""
    assert process.pid is not None
    kill_group(process.pid)
    wait([process.sentinel], _KILL_TIMEOUT)
    with _START_LOCK:
        process.join(0)


def _run_child(
    connection: Connection, limits: Limits, function: Callable[..., Any], arguments: tuple[Any, ...]
) -> None:
    """Entry point of the subprocess: set up, call the function, send the result."""
    lead_own_group()
    threading.Thread(target=_exit_with_parent, daemon=True).start()
    _apply_limits(limits)
    connection.send(_outcome(limits, function, arguments, _ProgressSender(connection)))


def _outcome(
    limits: Limits, function: Callable[..., Any], arguments: tuple[Any, ...], progress: Progress
) -> tuple[Any, ...]:
    try:
        return "done", function(*arguments, progress)
    except PlanishError as problem:
        return "failed", problem
    except Exception as problem:
        if is_out_of_memory(problem):
            return "failed", _too_large(limits)
        text = " ".join(f"{type(problem).__name__}: {problem}".split())
        hint = "please report this with the scan"
        return "failed", InternalError(f"planish itself failed ({text})", hint, trace=traceback.format_exc())


class _ProgressSender:
    """Sends progress to the caller, at a limited rate."""

    def __init__(self, connection: Connection):
        self.connection = connection
        self.stage, self.last = "", 0.0

    def __call__(self, stage: str, share: float) -> None:
        now = monotonic()
        if stage != self.stage or now - self.last > _PROGRESS_INTERVAL:
            self.stage, self.last = stage, now
            self.connection.send(("progress", stage, share))


def _exit_with_parent() -> None:
    caller = multiprocessing.parent_process()
    assert caller is not None
    wait([caller.sentinel])
    kill_group(os.getpid())


def _apply_limits(limits: Limits) -> None:
    import cv2
    import numba

    maximum = numba.config.NUMBA_NUM_THREADS
    threads = min(limits.threads or maximum, maximum)
    numba.set_num_threads(threads)
    cv2.setNumThreads(threads)
    if limits.memory_mb is not None:
        limit_own_memory(limits.memory_mb * 1e6)
