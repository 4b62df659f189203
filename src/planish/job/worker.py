"""Work in a process of its own that can be killed, with limits on its time and memory.

Each process is forked from a server of forks that has planish imported and its kernels loaded (`planish.job.preload`),
so that a start takes hundredths of a second instead of seconds. That server runs one thread of Python; whatever the
forked process does, and however it ends, touches neither it nor the caller.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import resource
import signal
import threading
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from time import monotonic
from typing import Any, TypeVar

from planish.errors import InputError, PlanishError

T = TypeVar("T")
Progress = Callable[[str, float], None]

_CONTEXT = multiprocessing.get_context("forkserver")
_STARTING = threading.Lock()  # a start also looks after ended processes, and two threads must not do so at once
_GLANCE = 0.1
"""Seconds between two looks at the clock and at `stop`; the end of the work is heard at once."""
_SELDOM = 0.05
"""Seconds between two words on one stage's progress."""
_PATIENCE = 10.0
"""Seconds that a killed process may take to end: it frees its memory."""


class LimitError(InputError):
    """The work needs more time or memory than it may have."""


class DiedError(InputError):
    """The process was ended from outside, or by a crash in compiled code; once more may go well.

    Attributes
    ----------
    signal : int or None
        That ended it.
    """

    def __init__(self, sentence: str, signal: int | None = None):
        super().__init__(sentence)
        self.signal = signal


class FaultError(InputError):
    """The work failed in a way that planish has no sentence for: a fault of planish.

    Attributes
    ----------
    trace : str
        Where, for who mends it.
    """

    def __init__(self, sentence: str, trace: str = ""):
        super().__init__(sentence)
        self.trace = trace


class StoppedError(Exception):
    """The caller wanted the work to end."""


@dataclass(frozen=True, kw_only=True)
class Limits:
    """What a process may use; None: as much as there is.

    Attributes
    ----------
    seconds : float or None
        From its start to its end.
    memory_mb : float or None
        Memory of its own, in megabytes; planish itself takes about 400 of them.
    threads : int or None
        For kernels and images.
    """

    seconds: float | None = None
    memory_mb: float | None = None
    threads: int | None = None


def apart(
    work: Callable[..., T],
    *arguments: Any,
    limits: Limits | None = None,
    progress: Progress | None = None,
    stop: threading.Event | None = None,
) -> T:
    """Call `work(*arguments, tell)` in a process of its own, and wait for what it returns.

    May be called by several threads at once. The process ends with its caller, also when that is killed.

    Parameters
    ----------
    work : callable
        A function at the top of a module; arguments and result must be picklable. Its last argument is to be called
        with (stage, share done).
    limits : Limits, optional
    progress : callable, optional
        Told (stage, share done) now and then.
    stop : threading.Event, optional
        Set by another thread to end the work.

    Raises
    ------
    PlanishError
        As `work` raised it.
    LimitError, DiedError, FaultError, StoppedError
    """
    limits = limits or Limits()
    ours, theirs = _CONTEXT.Pipe(duplex=False)
    process = _CONTEXT.Process(target=_child, args=(theirs, limits, work, arguments), daemon=True)
    _start(process)
    theirs.close()
    try:
        return _listen(process, ours, limits, progress or (lambda stage, share: None), stop or threading.Event())
    finally:
        ours.close()
        _end(process)


def warm_up() -> None:
    """Start the server of forks, and wait until it is ready: seconds; a minute where kernels must be compiled."""
    apart(_nothing)


def _nothing(tell: Progress) -> None:
    pass


def _start(process: BaseProcess) -> None:
    with _STARTING:
        _CONTEXT.set_forkserver_preload(["__main__", "planish.job.preload"])
        os.environ["PLANISH_WARM"] = "1"
        try:
            process.start()  # starts the server of forks as well, if it does not run
        except (EOFError, OSError) as problem:
            raise DiedError(
                f"no process could be begun ({problem or 'the server of forks ended'}); try again"
            ) from None
        finally:
            del os.environ["PLANISH_WARM"]


def _listen(
    process: BaseProcess, answers: Connection, limits: Limits, progress: Progress, stop: threading.Event
) -> Any:
    start = monotonic()
    while True:
        ready = wait([answers, process.sentinel], timeout=_GLANCE)
        if stop.is_set():
            raise StoppedError
        if limits.seconds is not None and monotonic() - start > limits.seconds:
            raise LimitError(
                f"not done after {limits.seconds:g} s, which is the limit here; give fewer points, a lower dpi or a "
                "smaller photo"
            )
        if not ready:
            continue
        try:
            kind, *said = answers.recv()
        except (EOFError, OSError):
            raise _death(process, limits) from None
        if kind == "progress":
            progress(*said)
        elif kind == "done":
            return said[0]
        else:
            error, *arguments = said
            raise error(*arguments)


def _death(process: BaseProcess, limits: Limits) -> DiedError:
    _end(process)
    code = process.exitcode
    number = -code if code is not None and code < 0 else None
    how = f"with exit code {code}" if number is None else f"by signal {number}"
    most = "" if limits.memory_mb is None else f" (at most {limits.memory_mb:g} MB here)"
    return DiedError(
        f"the process at work was ended {how}, as happens when memory runs out{most}; try again, or a smaller scan",
        number,
    )


def _end(process: BaseProcess) -> None:
    """Kill whatever still runs, with the programs that it called, and clear away what the system keeps of it."""
    assert process.pid is not None
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.kill(process.pid, signal.SIGKILL)
    wait([process.sentinel], _PATIENCE)
    with _STARTING:
        process.join(0)


def _child(answers: Connection, limits: Limits, work: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
    """What the process does: one piece of work, and an answer."""
    os.setpgrp()  # apart from the terminal, whose Ctrl-C is for the caller, and to be killed with what it calls
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_caller, daemon=True).start()
    _keep_within(limits)
    answers.send(_outcome(limits, work, arguments, _Teller(answers)))


def _outcome(limits: Limits, work: Callable[..., Any], arguments: tuple[Any, ...], tell: Progress) -> tuple[Any, ...]:
    try:
        return "done", work(*arguments, tell)
    except PlanishError as problem:
        return "failed", type(problem), str(problem)
    except Exception as problem:
        if isinstance(problem, MemoryError) or "Insufficient memory" in str(problem):  # OpenCV has its own class
            most = f"more than {limits.memory_mb:g} MB of memory" if limits.memory_mb else "more memory than there is"
            return "failed", LimitError, f"it takes {most}; give fewer points, a lower dpi or a smaller photo"
        text = " ".join(f"{type(problem).__name__}: {problem}".split())
        sentence = f"planish itself failed ({text}); please report this with the scan"
        return "failed", FaultError, sentence, traceback.format_exc()


class _Teller:
    """Passes progress on, not more often than anybody looks."""

    def __init__(self, answers: Connection):
        self.answers = answers
        self.stage, self.last = "", 0.0

    def __call__(self, stage: str, share: float) -> None:
        now = monotonic()
        if stage != self.stage or now - self.last > _SELDOM:
            self.stage, self.last = stage, now
            self.answers.send(("progress", stage, share))


def _end_with_caller() -> None:
    caller = multiprocessing.parent_process()
    assert caller is not None
    wait([caller.sentinel])
    os.killpg(0, signal.SIGKILL)


def _keep_within(limits: Limits) -> None:
    import cv2
    import numba

    most = numba.config.NUMBA_NUM_THREADS
    threads = min(limits.threads or most, most)
    numba.set_num_threads(threads)
    cv2.setNumThreads(threads)
    if limits.memory_mb is not None:
        size = int(limits.memory_mb * 1e6)
        resource.setrlimit(resource.RLIMIT_DATA, (size, size))
