"""Functions in subprocesses: results, limits, crashes and cancellation."""

import os
import signal
import threading
from concurrent.futures import ThreadPoolExecutor

import pytest

import subprocess_tasks
from planish.errors import InputError
from planish.job.worker import InternalError, LimitError, Limits, StoppedError, WorkerDiedError, run_in_subprocess


def gone(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return True
    return False


@pytest.mark.slow
def test_the_function_runs_in_another_process_and_reports_progress():
    told = []
    assert run_in_subprocess(subprocess_tasks.add, 1, 2, progress=lambda stage, share: told.append((stage, share))) == 3
    assert told == [("adding", 0.5)]
    pid, group = run_in_subprocess(subprocess_tasks.where)
    assert pid == group != os.getpid()  # own process group: not reached by Ctrl-C in the terminal
    assert gone(pid)


def test_several_threads_may_call_at_once():
    with ThreadPoolExecutor(8) as threads:
        assert list(threads.map(lambda k: run_in_subprocess(subprocess_tasks.add, k, k), range(24))) == [
            2 * k for k in range(24)
        ]


def test_errors_of_planish_are_raised_in_the_caller():
    with pytest.raises(InputError, match=r"^scan\.obj is no scan$") as caught:
        run_in_subprocess(subprocess_tasks.refuse)
    assert type(caught.value) is InputError


def test_an_unexpected_exception_is_an_internal_error_with_traceback():
    with pytest.raises(InternalError, match=r"ZeroDivisionError: by nothing.*report") as caught:
        run_in_subprocess(subprocess_tasks.fail)
    assert "subprocess_tasks.py" in caught.value.trace


def test_the_time_limit():
    with pytest.raises(LimitError, match=r"time limit of 0\.5 s"):
        run_in_subprocess(subprocess_tasks.sleep, 60, limits=Limits(seconds=0.5))


def test_the_memory_limit():
    limits = Limits(memory_mb=1500)
    assert run_in_subprocess(subprocess_tasks.fill, 400, limits=limits) == 400 * 125_000
    with pytest.raises(LimitError, match="more than 1500 MB of memory"):
        run_in_subprocess(subprocess_tasks.fill, 4000, limits=limits)


def test_a_killed_process_is_reported_with_its_signal():
    with pytest.raises(WorkerDiedError, match="by signal 9") as caught:
        run_in_subprocess(subprocess_tasks.die)
    assert caught.value.signal == signal.SIGKILL


def test_cancellation():
    stop = threading.Event()
    with pytest.raises(StoppedError):
        run_in_subprocess(subprocess_tasks.sleep, 60, progress=lambda stage, share: stop.set(), stop=stop)
