"""The program without fcntl, resource, fork, fork server and the signals of POSIX, as on Windows."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from serve_process import Server
from small_scans import digests, write_small_scan

WITHOUT_POSIX = Path(__file__).parent / "without_posix"


@pytest.fixture
def scans(tmp_path):
    write_small_scan(tmp_path / "in" / "one")
    return tmp_path / "in"


@pytest.fixture
def without_posix(monkeypatch):
    """Every Python that is started from here on."""
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(WITHOUT_POSIX), os.environ.get("PYTHONPATH", "")]))


def planish(*words):
    return subprocess.run([sys.executable, "-m", "planish", *map(str, words)], capture_output=True, text=True)


def python(code, *words):
    return subprocess.run([sys.executable, "-c", code, *map(str, words)], capture_output=True, text=True)


def test_batch_writes_what_it_writes_on_linux(scans, tmp_path, monkeypatch):
    write_small_scan(scans / "two", seed=1)
    flags = ["--jobs", "1", "-q"]
    assert planish("batch", scans, "-o", tmp_path / "here", *flags).returncode == 0
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(WITHOUT_POSIX), os.environ.get("PYTHONPATH", "")]))
    done = planish("batch", scans, "-o", tmp_path / "there", *flags)
    assert (done.returncode, done.stderr) == (0, "")
    assert digests(tmp_path / "here") == digests(tmp_path / "there")


def test_restore_and_flatten(scans, tmp_path, without_posix):
    page, flat = tmp_path / "page.tif", tmp_path / "flat.ply"
    done = planish("restore", scans / "one" / "scan.obj", "-o", page, "-q")
    assert (done.returncode, done.stderr) == (0, "")
    done = planish("flatten", scans / "one" / "scan.obj", "-o", flat, "-q")
    assert (done.returncode, done.stderr) == (0, "")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["flat.ply", "in", "page.tif"]


def test_serve(scans, tmp_path, without_posix):
    server = Server(tmp_path / "data")
    try:
        job = server.send(sorted((scans / "one").iterdir()))
        assert server.until(job, lambda state: state["state"] in ("done", "failed"))["state"] == "done"
        second = planish("serve", "--data", tmp_path / "data", "--port", "0")
        assert (second.returncode, second.stderr.count("used by another server")) == (4, 1)
    finally:
        assert server.end(signal.SIGTERM) == 0


def test_what_a_process_that_ended_left_behind_is_taken_away_and_no_other(tmp_path, without_posix):
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    names = [f".a.txt.{pid}-0.part" for pid in (ended.pid, os.getpid())]
    for name in names:
        (tmp_path / name).touch()
    code = "import sys; from planish.io.files import write_bytes; write_bytes(sys.argv[1], b'new')"
    assert python(code, tmp_path / "a.txt").returncode == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([names[1], "a.txt"])
    assert (tmp_path / "a.txt").read_bytes() == b"new"


def test_a_limit_of_memory_holds_where_the_system_keeps_none(without_posix):
    code = """
import time
from planish.job.worker import LimitError, Limits, run_in_subprocess
if __name__ == "__main__":
    try:
        run_in_subprocess(time.sleep, 60, limits=Limits(memory_mb=50))
    except LimitError as problem:
        print(problem)
"""
    assert "more than 50 MB" in python(code).stdout
