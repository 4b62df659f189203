"""Whole batch runs: interrupted and killed, local and on a Dask cluster; the output is always the same."""

import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from planish.cli.main import run
from small_scans import digests, write_small_scan

pytestmark = pytest.mark.slow

FLAGS = ["--dpi", "40", "--rotate", "0"]
BAD = 2
GOOD = 6


@pytest.fixture(scope="module")
def scans(tmp_path_factory):
    """Six good scans of two sheets, a truncated one, and one that is not a mesh."""
    folder = tmp_path_factory.mktemp("batch") / "in"
    for k, name in enumerate(["book", "wave"]):
        first = folder / f"{name}-0"
        write_small_scan(first, name)
        for copy in range(1, GOOD // 2):  # a comment makes the bytes differ
            shutil.copytree(first, folder / f"{name}-{copy}")
            with (folder / f"{name}-{copy}" / "scan.obj").open("a") as file:
                file.write(f"# {k} {copy}\n")
    whole = (folder / "book-0" / "scan.obj").read_bytes()
    for name, data in {"short": whole[: len(whole) // 2], "none": bytes(range(256))}.items():
        (folder / name).mkdir()
        (folder / name / "scan.obj").write_bytes(data)
    return folder


@pytest.fixture(scope="module")
def uninterrupted(scans, tmp_path_factory):
    out = tmp_path_factory.mktemp("whole") / "out"
    assert run(["batch", str(scans), "-o", str(out), *FLAGS]) == 3
    return out


def places(out):
    """Published items with an id that changes when they are published again."""
    return {path.parent.name: path.parent.stat().st_ino for path in out.glob("*/item.json")}


def started(scans, out, *flags):
    command = [sys.executable, "-m", "planish", "batch", scans.name, "-o", str(out), *FLAGS, *flags]
    return subprocess.Popen(
        command,
        cwd=scans.parent,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # background processes ignore it
    )


def processes_of(session):
    """Processes of a session, without zombies."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            state, *numbers = stat.read_text().rpartition(")")[2].split()[:4]
            if int(numbers[2]) == session and state != "Z":
                found.append(int(stat.parent.name))
    return found


def gone(session):
    """Wait until no process is left."""
    for _ in range(200):
        if not processes_of(session):
            return True
        time.sleep(0.05)
    return False


def test_uninterrupted_run(scans, uninterrupted, capsys):
    assert len(places(uninterrupted)) == GOOD + BAD
    assert len(list(uninterrupted.glob("*/page.tif"))) == GOOD
    assert run(["batch", str(scans), "-o", str(uninterrupted), *FLAGS, "--verbose"]) == 3
    said = capsys.readouterr()
    assert "2 failed; 0 done now" in said.out
    assert f"2 of 8 scans failed; {uninterrupted}/summary.html lists the reasons" in said.err


def test_an_interrupted_run_has_the_same_output(scans, uninterrupted, tmp_path):
    out, seen = tmp_path / "out", {}
    for number, code in ((signal.SIGINT, 130), (signal.SIGKILL, -9)):
        process = started(scans, out)
        while process.poll() is None and len(places(out)) <= len(seen):
            time.sleep(0.01)
        os.killpg(process.pid, number)
        with process:
            said = process.stderr.read()
        assert process.returncode == code, said
        assert gone(process.pid)
        now = places(out)
        assert now.items() >= seen.items()  # nothing lost, nothing restored twice
        for name in now:
            record = json.loads((out / name / "item.json").read_text())
            assert all((out / name / file).exists() for file in record["row"]["files"])
        seen = now
    assert run(["batch", str(scans), "-o", str(out), *FLAGS]) == 3
    assert places(out).items() >= seen.items()
    assert digests(out) == digests(uninterrupted)


def test_the_time_limit_fails_a_scan(scans, tmp_path):
    (tmp_path / "in").mkdir()
    shutil.copytree(scans / "wave-0", tmp_path / "in" / "wave")
    assert run(["batch", str(tmp_path / "in"), "-o", str(tmp_path / "out"), *FLAGS, "--timeout", "0.05"]) == 3
    row = json.loads((tmp_path / "out" / "summary.jsonl").read_text())
    assert row["status"] == "failed"
    assert "0.05 s" in row["sentence"]


def test_a_page_as_pdf_has_a_preview_too(scans, tmp_path):
    (tmp_path / "in").mkdir()
    shutil.copytree(scans / "wave-0", tmp_path / "in" / "wave")
    assert run(["batch", str(tmp_path / "in"), "-o", str(tmp_path / "out"), *FLAGS, "--format", "pdf"]) == 0
    made = {path.name for path in (tmp_path / "out" / "wave").iterdir()}
    assert made == {"item.json", "page.pdf", "preview.jpg", "report.json"}


@contextlib.contextmanager
def cluster(folder):
    """A Dask scheduler with two workers, each with a nanny that restarts it."""
    told = folder / "scheduler.json"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "start_new_session": True}
    ours = ["--scheduler-file", str(told), "--no-dashboard"]
    with contextlib.ExitStack() as stack:

        def start(module, *flags):
            process = subprocess.Popen([sys.executable, "-m", f"distributed.cli.{module}", *ours, *flags], **quiet)
            stack.callback(process.wait)
            stack.callback(os.killpg, process.pid, signal.SIGKILL)

        start("dask_scheduler", "--host", "127.0.0.1", "--port", "0")
        while not told.exists() or not told.read_text():
            time.sleep(0.05)
        start("dask_worker", "--nworkers", "2", "--nthreads", "1", "--local-directory", str(folder))
        yield json.loads(told.read_text())["address"]


@pytest.mark.filterwarnings("default")  # Dask's own
def test_a_cluster_has_the_same_output_also_if_a_worker_is_killed(scans, uninterrupted, tmp_path):
    distributed = pytest.importorskip("distributed", reason="the extra planish[dask] is not installed here")
    out = tmp_path / "out"
    with cluster(tmp_path) as address, distributed.Client(address, set_as_default=False) as client:
        client.wait_for_workers(2)
        worker = next(iter(client.run(os.getpid).values()))
        process = started(scans, out, "--dask", address)
        while process.poll() is None and not places(out):
            time.sleep(0.01)
        os.kill(worker, signal.SIGKILL)
        with process:
            said = process.stderr.read()
    assert process.returncode == 3, said
    assert "2 of 8 scans failed" in said
    assert digests(out) == digests(uninterrupted)
