"""Work that needs more memory than there is is refused before it begins."""

import errno
import os
import subprocess
import sys

import cv2
import numpy as np
import pytest

from planish import memory
from planish.cli.main import run
from planish.errors import InputError
from planish.io import read_scan, write_scan
from planish.io.encode import png_bytes
from planish.io.files import read_bytes
from planish.io.images import decode_photo
from planish.pipeline import flatten
from planish.render import draw
from planish.settings import RenderSettings
from planish.types import Scan
from samples import picture, sheet_scan


@pytest.fixture
def only(monkeypatch):
    """Play a machine that has so many bytes free."""

    def play(free):
        monkeypatch.setattr(memory, "free_bytes", lambda: free)

    return play


def test_what_is_free_is_no_more_than_the_machine_has():
    assert 0 < memory.free_bytes() <= os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")


def groups(folder, listed, files):
    (folder / "cgroup").write_text(listed)
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return memory.of_control_groups(folder, folder / "mount")


def test_a_control_group_of_version_2_and_the_one_above_it(tmp_path):
    files = {
        "mount/a/memory.max": "1000\n",
        "mount/a/memory.current": "700\n",
        "mount/a/memory.stat": "anon 600\ninactive_file 60\n",  # may be dropped
        "mount/a/b/memory.max": "max\n",
        "mount/a/b/memory.current": "300\n",
    }
    assert groups(tmp_path, "0::/a/b\n", files) == 360


def test_a_control_group_of_version_1_seen_from_within_a_container(tmp_path):
    files = {"mount/memory/memory.limit_in_bytes": "5000", "mount/memory/memory.usage_in_bytes": "1000"}
    assert groups(tmp_path, "7:cpu,memory:/docker/0123\n1:name=systemd:/x\n", files) == 4000


def test_without_control_groups_nothing_is_limited(tmp_path):
    assert memory.of_control_groups(tmp_path, tmp_path) == float("inf")
    assert groups(tmp_path, "0::/\n", {}) == float("inf")


def test_a_limit_of_the_process_counts():
    code = (
        "import resource; from planish.memory import free_bytes\n"
        "resource.setrlimit(resource.RLIMIT_AS, (2 * 10**9, 2 * 10**9)); print(free_bytes() < 2e9)"
    )
    assert subprocess.check_output([sys.executable, "-c", code], text=True).strip() == "True"


SCAN = sheet_scan(40, 30)


def refused_and_taken(only, free, work, sentence):
    """Refuse with somewhat less than is needed, and take with somewhat more."""
    only(0.9 * free)
    with pytest.raises(InputError, match=sentence) as caught:
        work()
    assert "MB of memory" in str(caught.value)
    assert "\n" not in str(caught.value)
    only(1.1 * free)
    work()


@pytest.mark.slow
def test_a_mesh_that_does_not_fit(only, tmp_path):
    path = write_scan(tmp_path / "sheet.ply", Scan(SCAN.mesh))[0]
    size = path.stat().st_size
    refused_and_taken(only, size, lambda: read_bytes(path), "give a smaller file")
    refused_and_taken(only, 3 * size, lambda: read_scan(path), "let the scanner's software reduce it")
    refused_and_taken(only, 400 * 1200, lambda: flatten(SCAN.mesh), "let the scanner's software reduce the mesh")


@pytest.mark.parametrize(("dtype", "per_pixel"), [(np.uint8, 10), (np.uint16, 16)])
def test_a_photo_that_does_not_fit(only, dtype, per_pixel):
    data = png_bytes(picture(150, 200, dtype=dtype))
    refused_and_taken(only, per_pixel * 150 * 200, lambda: decode_photo("photo", data), "give a smaller photo")


@pytest.mark.slow
@pytest.mark.parametrize(("dtype", "per_pixel"), [(np.uint8, 16), (np.uint16, 22)])
def test_a_page_that_does_not_fit(only, dtype, per_pixel):
    scan = sheet_scan(photo=picture(dtype=dtype))
    size = (100.0, 200.0)
    page_xy = scan.mesh.points[:, :2] * [1, -1] + [0, 280]
    need = per_pixel * 787 * 394  # at 100 dpi
    refused_and_taken(only, need, lambda: draw(scan, page_xy, size, RenderSettings(dpi=100.0)), "lower dpi")


@pytest.mark.parametrize(
    ("problem", "free", "expected"),
    [
        (MemoryError(), 1e12, True),
        (OSError(errno.ENOMEM, "Cannot allocate memory"), 1e12, True),
        (OSError(errno.ENOSPC, "No space left"), 1e6, False),
        (RuntimeError("can't start new thread"), 1e6, True),
        (RuntimeError("can't start new thread"), 1e12, False),
        (ImportError("libx.so: failed to map segment from shared object"), 1e6, True),
        (ImportError("no such name"), 1e6, False),
        (KeyError("own fault"), 1e6, False),
    ],
)
def test_only_what_asked_for_memory_failed_for_want_of_it(problem, free, expected, monkeypatch):
    monkeypatch.setattr(memory, "free_bytes", lambda: free)
    assert memory.is_out_of_memory(problem) == expected


def test_opencv_says_so_in_a_class_of_its_own():
    problem = cv2.error("Insufficient memory")
    problem.code = cv2.Error.StsNoMem
    assert memory.is_out_of_memory(problem)
    with pytest.raises(cv2.error) as caught:
        cv2.resize(np.zeros((0, 0), np.uint8), (4, 4))
    assert not memory.is_out_of_memory(caught.value)


def test_the_command_line_shows_own_faults_while_memory_is_scarce(monkeypatch):
    monkeypatch.setattr(memory, "free_bytes", lambda: 1e6)
    monkeypatch.setattr(sys.modules["planish.cli.main"], "app", lambda *_, **__: {}["own fault"])
    with pytest.raises(KeyError):
        run([])


def test_the_command_line_tells_in_one_line_that_memory_ran_out(monkeypatch, capsys):
    def app(*_, **__):
        raise MemoryError

    monkeypatch.setattr(sys.modules["planish.cli.main"], "app", app)
    assert run([]) == 3
    assert capsys.readouterr().err.startswith("planish: not enough memory")


@pytest.mark.parametrize(("kind", "kilobytes"), [("d", 300_000), ("v", 300_000), ("v", 600_000)])
def test_a_limit_too_low_for_the_libraries_is_a_sentence(tmp_path, kind, kilobytes):
    scan = write_scan(tmp_path / "scan.obj", sheet_scan())[0]
    script = f'ulimit -{kind} {kilobytes}; exec "$0" -m planish flatten "$1" -o "$2"'
    words = [sys.executable, str(scan), str(tmp_path / "flat.obj")]
    done = subprocess.run(["bash", "-c", script, *words], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr.count("\n")) == (3, 1)
    assert "memory" in done.stderr
