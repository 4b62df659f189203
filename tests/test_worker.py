"""Processes that can be killed, and what their caller hears."""

import os
import signal
import threading
from concurrent.futures import ThreadPoolExecutor

import pytest

import errands
from planish.errors import InputError
from planish.job.worker import DiedError, FaultError, LimitError, Limits, StoppedError, apart


def gone(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return True
    return False


def test_work_is_done_in_another_process_with_progress():
    told = []
    assert apart(errands.add, 1, 2, progress=lambda stage, share: told.append((stage, share))) == 3
    assert told == [("adding", 0.5)]
    pid, group = apart(errands.where)
    assert pid == group != os.getpid()  # a group of its own: Ctrl-C in the terminal does not reach it
    assert gone(pid)


def test_several_threads_may_ask_at_once():
    with ThreadPoolExecutor(8) as threads:
        assert list(threads.map(lambda k: apart(errands.add, k, k), range(24))) == [2 * k for k in range(24)]


def test_what_planish_refuses_there_is_refused_here_in_the_same_words():
    with pytest.raises(InputError, match=r"^scan\.obj is no scan$") as caught:
        apart(errands.refuse)
    assert type(caught.value) is InputError


def test_a_fault_is_told_as_one_with_its_place():
    with pytest.raises(FaultError, match=r"ZeroDivisionError: by nothing.*report") as caught:
        apart(errands.fail)
    assert "errands.py" in caught.value.trace


def test_work_beyond_its_time_is_ended():
    with pytest.raises(LimitError, match=r"not done after 0\.5 s"):
        apart(errands.sleep, 60, limits=Limits(seconds=0.5))


def test_work_beyond_its_memory_is_refused_and_other_work_is_not():
    limits = Limits(memory_mb=1500)
    assert apart(errands.fill, 400, limits=limits) == 400 * 125_000
    with pytest.raises(LimitError, match="more than 1500 MB of memory"):
        apart(errands.fill, 4000, limits=limits)


def test_a_killed_process_is_told_with_the_signal():
    with pytest.raises(DiedError, match="by signal 9") as caught:
        apart(errands.die)
    assert caught.value.signal == signal.SIGKILL


def test_work_can_be_stopped():
    stop = threading.Event()
    with pytest.raises(StoppedError):
        apart(errands.sleep, 60, progress=lambda stage, share: stop.set(), stop=stop)
