"""Compiling ahead, and from both ends of the pipeline."""

import subprocess
import sys

import pytest
from numba import njit

from planish.job import warm_up


@pytest.fixture
def started(monkeypatch):
    """The processes that were started, each of which only waits for its standard input to close."""
    processes = []

    def start(command, **how):
        processes.append(popen([sys.executable, "-c", "import sys; sys.stdin.read()"], **how))
        processes[-1].command = command
        return processes[-1]

    popen = subprocess.Popen
    monkeypatch.setattr(subprocess, "Popen", start)
    monkeypatch.setattr(warm_up, "get_num_threads", lambda: 2)
    return processes


def test_the_first_kernel_that_must_be_compiled_starts_a_second_process_which_ends_with_the_work(started):
    with warm_up.compile_from_both_ends():
        assert not started
        assert njit(lambda x: x + 1)(1) == 2
        assert njit(lambda x: x - 1)(1) == 0
        (process,) = started
        assert process.poll() is None
    assert process.command[-2:] == ["planish.job.warm_up", "draw"]
    assert process.poll() is not None


def test_on_one_core_there_is_no_second_process(started, monkeypatch):
    monkeypatch.setattr(warm_up, "get_num_threads", lambda: 1)
    with warm_up.compile_from_both_ends():
        njit(lambda x: x + 2)(1)
    assert not started


def test_the_last_stages_can_be_run_before_the_first():
    command = [sys.executable, "-m", "planish.job.warm_up", "draw"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.wait(300) == 0, process.stderr.read()


def test_the_second_process_ends_with_the_first():
    with subprocess.Popen([sys.executable, "-m", "planish.job.warm_up"], stdin=subprocess.PIPE) as process:
        process.stdin.close()
        assert process.wait(60) == 1
