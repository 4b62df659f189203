"""Names and paths of Windows, tried on any system: lists, names of folders, uploads, files that others hold open."""

from pathlib import Path, PureWindowsPath

import pytest

from planish.batch.items import safe_name
from planish.batch.list_file import default_name, read_list
from planish.errors import OutputError
from planish.io import atomic
from planish.io.files import write_bytes
from planish.web.form import plain_name
from planish.web.problems import HTTPProblem

DEVICES = ["con", "NUL.obj", "aux.left.ply", "Com1", "lpt9.txt", "COM².png"]


def test_separators_of_windows_part_folders():
    assert safe_name(PureWindowsPath("box 1\\scan:2\\a.obj")) == "box 1/scan%3A2/a.obj"


@pytest.mark.parametrize(
    ("scan", "name"),
    [
        (r"D:\lists\box 1\a.obj", "box 1/a"),
        (r"d:\LISTS\box 1\a.obj", "box 1/a"),  # Windows does not tell case apart
        (r"E:\scans\a.obj", "scans/a"),
        (r"\\server\share\scans\a.obj", "scans/a"),
        (r"D:\lists\..\a.obj", "a"),
    ],
)
def test_a_name_from_a_path_with_a_drive(scan, name):
    assert default_name(PureWindowsPath(r"D:\lists"), PureWindowsPath(scan)) == name


@pytest.mark.parametrize("name", DEVICES)
def test_names_of_devices_are_escaped_and_stay_apart(name):
    safe = safe_name(f"box/{name}")
    assert safe.startswith("box/%")
    assert safe_name(safe) != safe
    assert safe.endswith(name[1:])


@pytest.mark.parametrize("mark", '*?"<>|:')
def test_uploads_with_letters_that_windows_does_not_take_are_refused(mark):
    with pytest.raises(HTTPProblem, match="not a plain file name"):
        plain_name(f"scan{mark}.obj")


@pytest.mark.parametrize("name", [*DEVICES, "scan.obj."])
def test_uploads_with_names_that_windows_has_for_itself_are_refused(name):
    with pytest.raises(HTTPProblem, match="not a plain file name"):
        plain_name(name)
    assert plain_name(f"my {name}x") == f"my {name}x"


@pytest.mark.parametrize("start", ["", "\ufeff"])
def test_a_list_that_was_written_on_windows(tmp_path, start):
    for name in ("box 1/a.obj", "box 1/a.jpg", "b.ply"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    rows = ["scan,photo", "box 1\\a.obj,box 1\\a.jpg", "b.ply,", r"C:\scans\c.obj,"]
    (tmp_path / "scans.csv").write_bytes("\r\n".join([start + rows[0], *rows[1:], ""]).encode())
    items = {item.scan.name: item for item in read_list(tmp_path / "scans.csv").items}
    assert items["a.obj"].name == "box 1/a"
    assert items["a.obj"].photo == (tmp_path / "box 1" / "a.jpg",)
    assert items["b.ply"].photo == ()
    assert len(items) == 3  # a scan that is not there is told when it is its turn


class TestFilesThatOthersHoldOpen:
    """Windows refuses to replace them; a viewer or a virus scanner soon lets go."""

    @pytest.fixture
    def held(self, monkeypatch):
        monkeypatch.setattr(atomic, "OPEN_FILES_CAN_BE_LOCKED", False)
        replace_truly = Path.replace
        left = [3]

        def replace(path, target):
            left[0] -= 1
            if left[0] >= 0:
                raise PermissionError(13, "The process cannot access the file")
            return replace_truly(path, target)

        monkeypatch.setattr(Path, "replace", replace)
        return left

    def test_are_waited_for(self, held, tmp_path):
        write_bytes(tmp_path / "page.tif", b"new")
        assert [path.name for path in tmp_path.iterdir()] == ["page.tif"]

    def test_are_not_waited_for_without_end(self, held, tmp_path, monkeypatch):
        held[0] = 10**6
        monkeypatch.setattr(atomic, "_PATIENCE", 0.1)
        (tmp_path / "page.tif").write_bytes(b"old")
        with pytest.raises(OutputError, match=r"page\.tif cannot be written"):
            write_bytes(tmp_path / "page.tif", b"new")
        assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {"page.tif": b"old"}
