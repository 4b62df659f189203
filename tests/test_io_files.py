import errno
import json
import os
import threading
import time

import numpy as np
import pytest

from planish import memory
from planish.errors import InputError, OutputError
from planish.io import check_writable, make_folder, write_json
from planish.io.files import all_or_nothing, files_in, is_folder, read_bytes, write_bytes, writing, writing_folder
from planish.types import ScanReport


def names(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda p: None, "no such file"),
        (lambda p: p.mkdir(), "is a folder"),
        (lambda p: p.write_bytes(b""), "is empty"),
    ],
)
def test_a_file_that_cannot_be_read_is_named(tmp_path, make, sentence):
    path = tmp_path / "scan.obj"
    make(path)
    with pytest.raises(InputError, match=sentence) as caught:
        read_bytes(path)
    assert str(path) in str(caught.value)


def test_a_name_that_no_system_takes_is_an_input_error():
    with pytest.raises(InputError):
        read_bytes("scan\0.obj")
    with pytest.raises(InputError):
        read_bytes("x" * 5000)


def test_names_too_long_for_the_system_and_folders_that_may_not_be_read(tmp_path, monkeypatch):
    with pytest.raises(InputError, match="too long"):
        is_folder(tmp_path / ("x" * 300))
    with pytest.raises(OutputError, match="too long"):
        check_writable(tmp_path / ("x" * 300))
    with pytest.raises(OutputError, match="too long"):
        check_writable(tmp_path / ("x" * 300) / "page.tif")

    def forbidden(folder):
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(type(tmp_path), "iterdir", forbidden)  # root may read everywhere
    with pytest.raises(InputError, match="Permission denied"):
        files_in(tmp_path, {".png"})


def test_a_pipe_is_read_to_its_end_however_slow(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    parts = [b"a" * 100_000, b"b" * 100_000]

    def write_slowly():
        with pipe.open("wb") as file:
            for part in parts:
                file.write(part)
                file.flush()
                time.sleep(0.05)

    writer = threading.Thread(target=write_slowly)
    writer.start()
    assert read_bytes(pipe) == b"".join(parts)
    writer.join()


def test_a_device_without_end_is_refused(monkeypatch):
    monkeypatch.setattr(memory, "free_bytes", lambda: 1e8)
    with pytest.raises(InputError, match="is it the right file"):
        read_bytes("/dev/zero")


def test_read_bytes_accepts_a_file(tmp_path):
    (tmp_path / "a").write_bytes(b"123")
    assert read_bytes(tmp_path / "a") == b"123"


def test_check_writable_refuses_before_long_work(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("1")
    for path, sentence in [
        (tmp_path / "none" / "page.tif", "there is no folder"),
        (tmp_path / "file" / "page.tif", "is a file, not a folder"),
        (tmp_path, "is a folder"),
        ("/", "is a folder"),
    ]:
        with pytest.raises(OutputError, match=sentence):
            check_writable(path)
    with pytest.raises(OutputError, match="allow overwriting with overwrite"):
        check_writable(tmp_path / "file", overwrite=False)
    monkeypatch.setattr(os, "access", lambda path, mode: False)  # root may write everywhere
    with pytest.raises(OutputError, match="not permitted"):
        check_writable(tmp_path / "page.tif")


def test_check_writable_accepts_new_and_old_files(tmp_path):
    (tmp_path / "old").write_text("1")
    check_writable(tmp_path / "new", overwrite=False)
    check_writable(tmp_path / "old")
    assert names(tmp_path) == ["old"]


@pytest.mark.parametrize("failure", [ValueError, KeyboardInterrupt])
def test_a_failed_write_leaves_what_stood_there_and_nothing_else(tmp_path, failure):
    path = tmp_path / "page.tif"
    path.write_bytes(b"before")

    def parts():
        yield b"half"
        raise failure

    with pytest.raises(failure):
        write_bytes(path, parts())
    assert path.read_bytes() == b"before"
    assert names(tmp_path) == ["page.tif"]


def test_a_file_is_replaced_only_when_finished(tmp_path):
    path = tmp_path / "page.tif"
    path.write_bytes(b"before")
    path.chmod(0o640)
    with writing(path) as beside:
        beside.write_bytes(b"after")
        assert path.read_bytes() == b"before"
    assert path.read_bytes() == b"after"
    assert path.stat().st_mode & 0o777 == 0o640
    assert names(tmp_path) == ["page.tif"]


def test_a_symbolic_link_stays_one(tmp_path):
    (tmp_path / "real").mkdir()
    (tmp_path / "link.json").symlink_to(tmp_path / "real" / "file.json")
    write_json(tmp_path / "link.json", {"a": 1})
    assert (tmp_path / "link.json").is_symlink()
    assert json.loads((tmp_path / "real" / "file.json").read_text()) == {"a": 1}


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="this system has no /dev/full")  # noqa: PTH110
def test_a_full_disk_is_said_in_one_sentence():
    with pytest.raises(OutputError, match="no room left on the disk"):
        write_bytes("/dev/full", b"1" * 100_000)


def test_a_full_disk_leaves_nothing(tmp_path):
    def parts():
        yield b"half"
        raise OSError(28, "No space left on device")

    with pytest.raises(OutputError, match="no room left"):
        write_bytes(tmp_path / "a", parts())
    assert names(tmp_path) == []


def test_json_holds_plain_values(tmp_path):
    path = tmp_path / "report.json"
    write_json(path, ScanReport(points=np.int64(3), faces=1, pieces=1, holes=0, noise_mm=float("inf")))
    told = json.loads(path.read_text())
    assert told["points"] == 3
    assert told["noise_mm"] is None
    write_json(path, {"x": np.arange(3), "y": (1, 2), "z": {1: True}})
    assert json.loads(path.read_text()) == {"x": [0, 1, 2], "y": [1, 2], "z": {"1": True}}


def test_folders_are_made_or_refused(tmp_path):
    make_folder(tmp_path / "a" / "b")
    make_folder(tmp_path / "a" / "b")
    assert (tmp_path / "a" / "b").is_dir()
    (tmp_path / "file").write_text("1")
    for path in (tmp_path / "file", tmp_path / "file" / "b"):
        with pytest.raises(OutputError, match="a file stands there"):
            make_folder(path)


def fill(folder, text):
    for name in ("meta.json", "x.tif", "y.tif", "z.tif"):
        (folder / name).write_text(text)


def test_a_folder_is_replaced_only_when_finished(tmp_path):
    path = tmp_path / "segment"
    with writing_folder(path) as folder:
        fill(folder, "before")

    def interrupted():
        with writing_folder(path) as folder:
            fill(folder, "half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert (path / "x.tif").read_text() == "before"
    with writing_folder(path) as folder:
        fill(folder, "after")
    assert (path / "x.tif").read_text() == "after"
    assert names(tmp_path) == ["segment"]


def test_a_folder_of_another_kind_is_not_replaced(tmp_path):
    (tmp_path / "holiday").mkdir()
    (tmp_path / "file").write_text("1")
    for name in ("holiday", "file"):
        with pytest.raises(OutputError), writing_folder(tmp_path / name):
            pass
    assert names(tmp_path) == ["file", "holiday"]


def test_files_written_together_appear_together(tmp_path):
    (tmp_path / "old").write_bytes(b"before")
    with all_or_nothing():
        write_bytes(tmp_path / "old", b"after")
        write_bytes(tmp_path / "new", b"new")
        assert (tmp_path / "old").read_bytes() == b"before"
        assert not (tmp_path / "new").exists()
    assert (tmp_path / "old").read_bytes() == b"after"
    assert names(tmp_path) == ["new", "old"]


@pytest.mark.parametrize("problem", [OutputError("the third cannot be encoded"), KeyboardInterrupt()])
def test_one_that_fails_leaves_all_as_they_were(tmp_path, problem):
    (tmp_path / "old").write_bytes(b"before")

    @all_or_nothing()
    def written():
        write_bytes(tmp_path / "old", b"after")
        write_bytes(tmp_path / "new", b"new")
        raise problem

    with pytest.raises(type(problem)):
        written()
    assert (tmp_path / "old").read_bytes() == b"before"
    assert names(tmp_path) == ["old"]
    write_bytes(tmp_path / "new", b"later")  # and afterwards files are written at once again
    assert names(tmp_path) == ["new", "old"]


def test_files_of_a_block_within_a_block_wait_for_the_outer_one(tmp_path):
    with all_or_nothing():
        with all_or_nothing():
            write_bytes(tmp_path / "a", b"1")
        assert not (tmp_path / "a").exists()

        def fails():
            with all_or_nothing():
                write_bytes(tmp_path / "b", b"1")
                raise OutputError("it cannot be encoded")

        with pytest.raises(OutputError, match="encoded"):
            fails()
        write_bytes(tmp_path / "c", b"1")
    assert names(tmp_path) == ["a", "c"]
