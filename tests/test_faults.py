"""Full disks, killed processes, signals, clocks that jump: never a half-written file, never a traceback."""

import errno
import hashlib
import itertools
import json
import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from planish.cli.main import run
from planish.errors import OutputError
from planish.io import all_or_nothing, pipes, read_scan, write_json, write_page, write_scan
from planish.io.atomic import AtomicFile
from planish.io.cameras import camera_as_json
from planish.io.encode import png_bytes
from planish.io.files import write_bytes, writing, writing_folder
from planish.types import Page
from samples import camera_above, picture, sheet_scan

KILLED_WHILE_WRITING = """
import os, signal, sys
from pathlib import Path
from planish.io.files import {manner}
with {manner}(sys.argv[1]) as beside:
    (beside / "x.tif" if beside.is_dir() else beside).write_text("half")
    os.kill(os.getpid(), signal.SIGKILL)
"""


def names(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.fixture(scope="module")
def sheet(tmp_path_factory):
    return write_scan(tmp_path_factory.mktemp("scan") / "sheet.obj", sheet_scan(12, 9))[0]


class FillingDisk:
    """A disk that holds so many more writes, and then none."""

    def __init__(self, monkeypatch, writes):
        self.left, self.full = writes, False
        open_truly = Path.open

        def opened(path, mode="r", *args, **kw):
            file = open_truly(path, mode, *args, **kw)
            if "w" in mode and path.suffix != "":
                file = _Counted(file, self)
            return file

        monkeypatch.setattr(Path, "open", opened)

    def write(self):
        self.left -= 1
        if self.left < 0:
            self.full = True
            raise OSError(errno.ENOSPC, "No space left on device")


class _Counted:
    """A file on a disk that fills up; the write that fails has put half of its bytes there."""

    def __init__(self, file, disk):
        self.file, self.disk = file, disk

    def write(self, data):
        try:
            self.disk.write()
        except OSError:
            self.file.write(data[: len(data) // 2])
            raise
        return self.file.write(data)

    def __getattr__(self, name):
        return getattr(self.file, name)

    def __enter__(self):
        return self

    def __exit__(self, *told):
        self.file.close()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["flat.obj", "flat.ply", "flat.glb"])
def test_a_disk_that_is_full_after_any_write_of_a_mesh(sheet, tmp_path, monkeypatch, capsys, name):
    flat, report = tmp_path / name, tmp_path / "report.json"
    flat.write_bytes(b"old")
    for writes in itertools.count():
        with monkeypatch.context() as patch:
            disk = FillingDisk(patch, writes)
            code = run(["flatten", str(sheet), "-o", str(flat), "--report", str(report)])
        if not disk.full:
            break
        assert code == 4
        assert capsys.readouterr().err.strip().splitlines()[-1].endswith("free some, or write elsewhere")
        assert names(tmp_path) == [name]
        assert flat.read_bytes() == b"old"
    assert code == 0
    assert writes >= 2  # the mesh and the report


def test_a_disk_that_is_full_after_any_write_of_several_files_takes_none(tmp_path, monkeypatch):
    page = Page(np.full((40, 30), 200, np.uint8), np.ones((40, 30), bool), 300.0)
    for path in (tmp_path / name for name in ("page.tif", "page.png", "page.pdf", "report.json")):
        path.write_text("old")

    def write():
        with all_or_nothing():
            for suffix in (".tif", ".png", ".pdf"):
                write_page(tmp_path / f"page{suffix}", page)
            write_json(tmp_path / "report.json", {"outcome": "good"})

    for writes in range(4):
        with monkeypatch.context() as patch:
            FillingDisk(patch, writes)
            with pytest.raises(OutputError, match="no room left"):
                write()
        assert {path.read_text() for path in tmp_path.iterdir()} == {"old"}
        assert len(names(tmp_path)) == 4


@pytest.mark.parametrize("call", ["fsync", "mkdir", "open", "replace"])
@pytest.mark.parametrize("manner", [writing, writing_folder])
def test_whatever_the_system_refuses_is_said_in_a_sentence(tmp_path, monkeypatch, call, manner):
    """On some disks it is known only at the end that they are full or were taken away."""

    def refused(*args, **kw):
        raise OSError(errno.ENOSPC if call == "fsync" else errno.EROFS, "No")

    def write():
        with manner(tmp_path / "page") as beside:
            (beside / "x.tif" if beside.is_dir() else beside).touch()

    if call == "mkdir" and manner is writing:
        pytest.skip("a file needs no folder made")
    with monkeypatch.context() as patch:
        patch.setattr(Path if call in ("mkdir", "replace") else os, call, refused)
        with pytest.raises(OutputError, match=r"no room left|read-only"):
            write()
    if call != "open":  # which is also what it takes to remove a folder
        assert names(tmp_path) == []


@pytest.mark.slow
@pytest.mark.parametrize("manner", ["writing", "writing_folder"])
def test_what_a_killed_process_left_is_taken_away_by_the_next(tmp_path, manner):
    target = tmp_path / "page"
    killed = subprocess.run([sys.executable, "-c", KILLED_WHILE_WRITING.format(manner=manner), str(target)])
    assert killed.returncode == -signal.SIGKILL
    assert names(tmp_path) == [".page.0.part"]
    with {"writing": writing, "writing_folder": writing_folder}[manner](target) as beside:
        assert not beside.is_dir() or not names(beside)
        (beside / "y.tif" if beside.is_dir() else beside).write_text("whole")
    assert names(tmp_path) == ["page"]


def test_what_another_process_is_writing_is_left_alone(tmp_path):
    target = tmp_path / "page.tif"
    other = AtomicFile(target)
    other.path.write_text("the other's")
    write_bytes(target, b"ours")
    assert other.path.read_text() == "the other's"
    other.take_place(target)
    assert target.read_text() == "the other's"
    other.drop()  # again, as at the end of the process
    assert names(tmp_path) == ["page.tif"]


def test_names_as_long_as_the_system_takes(tmp_path):
    for name in ("x" * 255, "頁" * 85):
        write_bytes(tmp_path / name, b"page")
    assert len(names(tmp_path)) == 2


def test_many_that_write_to_one_place_at_once_leave_one_whole_file(tmp_path):
    target, faults = tmp_path / "page.tif", []

    def write(letter):
        try:
            for _ in range(30):
                write_bytes(target, (letter * 1000 for _ in range(20)))
        except OutputError as problem:
            faults.append(problem)

    writers = [threading.Thread(target=write, args=[letter]) for letter in (b"a", b"b", b"c", b"d")]
    for writer in writers:
        writer.start()
    while any(writer.is_alive() for writer in writers):
        if target.exists():
            assert len(set(target.read_bytes())) == 1
            assert target.stat().st_size == 20_000
        time.sleep(0.002)
    assert faults == []
    assert names(tmp_path) == ["page.tif"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "how"),
    [(signal.SIGTERM, "ended by SIGTERM"), (signal.SIGINT, "interrupted")],
)
def test_signals_end_the_work_with_a_sentence(tmp_path, number, how):
    pipe, page = tmp_path / "scan.obj", tmp_path / "flat.obj"
    os.mkfifo(pipe)
    job = subprocess.Popen(
        [sys.executable, "-m", "planish", "flatten", str(pipe), "-o", str(page)],
        stderr=subprocess.PIPE,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # a job in the background ignores it
        text=True,
    )
    writer = None
    while writer is None and job.poll() is None:  # until planish reads, and waits for a mesh that does not come
        with suppress(OSError):
            writer = os.open(pipe, os.O_WRONLY | os.O_NONBLOCK)
        time.sleep(0.01)
    job.send_signal(number)
    _, said = job.communicate(timeout=60)
    os.close(writer)
    assert said == f"planish: {how}; no incomplete files were left\n"
    assert job.returncode == 128 + number
    assert names(tmp_path) == ["scan.obj"]


def test_a_signal_while_planish_is_still_being_loaded(tmp_path):
    code = (
        "import os, runpy, signal, sys\n"
        "class Watch:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name == 'planish.cli': os.kill(os.getpid(), signal.SIGINT)\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "sys.meta_path.insert(0, Watch()); sys.argv[1:] = ['--version']\n"
        "runpy.run_module('planish', run_name='__main__')\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (130, "")
    assert done.stderr == "planish: interrupted before anything was done\n"


@pytest.mark.slow
def test_a_signal_in_the_middle_of_decoding_is_not_silenced(tmp_path):
    code = (
        "import os, signal, sys, threading\n"
        "from planish.cli import main as run\n"
        "from planish.io.suppress_stderr import suppress_stderr\n"
        "def work(arguments):\n"
        "    with suppress_stderr():\n"
        "        os.kill(os.getpid(), signal.SIGTERM); threading.Event().wait(30)\n"
        "sys.modules['planish.cli.main'].run = work\n"
        "run([])\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 143
    assert done.stderr == "planish: ended by SIGTERM; no incomplete files were left\n"


@pytest.mark.parametrize("manner", ["writing", "writing_folder"])
def test_a_signal_while_a_file_is_half_written_leaves_none(tmp_path, manner):
    code = (
        "import os, signal, sys, threading\n"
        "from planish.cli import main as run\n"
        f"from planish.io.files import {manner}, all_or_nothing, write_bytes\n"
        "def work(arguments):\n"
        "    with all_or_nothing():\n"
        "        write_bytes(sys.argv[1] + '.json', b'whole')\n"
        f"        with {manner}(sys.argv[1]) as beside:\n"
        "            (beside / 'x.tif' if beside.is_dir() else beside).write_text('half')\n"
        "            os.kill(os.getpid(), signal.SIGTERM); threading.Event().wait(30)\n"
        "sys.modules['planish.cli.main'].run = work\n"
        "run([])\n"
    )
    done = subprocess.run([sys.executable, "-c", code, str(tmp_path / "flat")], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (143, "planish: ended by SIGTERM; no incomplete files were left\n")
    assert names(tmp_path) == []


def test_a_clock_that_jumps_changes_nothing(sheet, tmp_path, monkeypatch):
    assert run(["flatten", str(sheet), "-o", str(tmp_path / "a.ply")]) == 0
    hours = itertools.cycle([0.0, 4e9, -1e9, 1e6])
    monkeypatch.setattr(time, "time", lambda: next(hours))
    assert run(["flatten", str(sheet), "-o", str(tmp_path / "b.ply")]) == 0
    assert (tmp_path / "a.ply").read_bytes() == (tmp_path / "b.ply").read_bytes()


def shell(line, *words):
    """What a command of `planish` leaves behind where a shell redirects its streams."""
    script = f'"$0" -m planish "$@" {line}'
    return subprocess.run(["bash", "-c", script, sys.executable, *map(str, words)], capture_output=True, text=True)


def test_a_full_standard_output_is_an_error_in_one_line():
    done = shell(">/dev/full", "--help")
    assert (done.returncode, done.stderr) == (
        4,
        "planish: standard output cannot be written: No space left on device\n",
    )


def test_a_full_standard_error_changes_no_exit_code():
    assert shell("2>/dev/full", "flatten", "nothing.obj", "-o", "flat.obj").returncode == 3


def test_closed_streams_and_a_name_that_is_no_text_hinder_nothing(tmp_path):
    scan = tmp_path / os.fsdecode(b"b\xff.obj")
    scan.write_text("mtllib lost.mtl\nv 0 0 0\nv 90 0 0\nv 90 90 0\nv 0 90 0\nf 1 2 3\nf 1 3 4\n")
    report = tmp_path / "report.json"
    done = shell("<&- >&- 2>&-", "flatten", scan, "-o", tmp_path / "flat.obj", "--report", report, "--verbose")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert scan.name in json.loads(report.read_text())["warnings"][0]


@pytest.mark.parametrize("columns", ["0", "-5", "1", "none"])
def test_help_for_a_terminal_of_no_width_comes_to_its_end(columns):
    environment = {**os.environ, "COLUMNS": columns}
    command = [sys.executable, "-m", "planish", "warm-up", "--help"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (0, "")
    assert max(map(len, done.stdout.splitlines())) <= 80


@pytest.fixture
def pipe(tmp_path):
    os.mkfifo(tmp_path / "pipe.png")
    return tmp_path / "pipe.png"


class TestPipes:
    def test_a_reader_that_goes_away_is_an_error(self, pipe):
        def read_a_little():
            with pipe.open("rb") as file:
                file.read(10)

        reader = threading.Thread(target=read_a_little)
        reader.start()
        with pytest.raises(OutputError, match="the program that read it has ended"):
            write_bytes(pipe, [b"1" * 100_000] * 100)
        reader.join()

    def test_a_reader_that_never_comes_is_not_waited_for_without_end(self, pipe, monkeypatch):
        monkeypatch.setattr(pipes, "_READER_SECONDS", 0.1)
        with pytest.raises(OutputError, match=r"no program has read for 0.1 s; start its reader first"):
            write_bytes(pipe, b"1")

    def test_a_reader_may_come_later(self, pipe):
        got = []
        reader = threading.Timer(0.2, lambda: got.append(pipe.read_bytes()))
        reader.start()
        write_bytes(pipe, b"flat")
        reader.join()
        assert got == [b"flat"]

    def test_a_photo_from_a_pipe_is_read_once(self, pipe, tmp_path):
        scan = write_scan(tmp_path / "sheet.ply", sheet_scan(12, 9))[0]
        photo, camera = png_bytes(picture(200, 260)), tmp_path / "camera.json"
        camera.write_text(json.dumps(camera_as_json(camera_above(200, 260))))
        writer = threading.Thread(target=lambda: pipe.write_bytes(photo))
        writer.start()
        read = read_scan(scan, photo=pipe, camera=camera)
        writer.join()
        assert read.scan.photo.shape == (200, 260, 3)
        assert read.digests[pipe] == hashlib.sha256(photo).hexdigest()


def test_without_docstrings_asserts_and_compiled_kernels(sheet, tmp_path):
    """As `python -OO` has it: help is short then, but all works; and a small sheet is flattened by Python alone."""
    command = [sys.executable, "-OO", "-m", "planish", "flatten"]
    plain = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    for words in ([sheet, "-o", tmp_path / "flat.obj", "-q"], ["--help"]):
        done = subprocess.run([*command, *map(str, words)], capture_output=True, text=True, env=plain)
        assert (done.returncode, done.stderr) == (0, "")
    web = "from planish.web import app, service, openapi, fields; fields.known_fields(); openapi.request_body()"
    assert subprocess.run([sys.executable, "-OO", "-c", web], capture_output=True, text=True).stderr == ""
