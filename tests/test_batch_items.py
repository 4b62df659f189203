"""Items of a batch: search, names, list files, and input files."""

import os
from pathlib import Path

import pytest

from planish.batch import find_items, read_list
from planish.batch.inputs import find_inputs
from planish.batch.items import Item, safe_name
from planish.errors import InputError


def files(folder, *names):
    for name in names:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(name.encode())
    return folder


def named(folder):
    return {item.name: item.scan.relative_to(folder).as_posix() for item in find_items(folder).items}


def test_every_scan_is_an_item_and_nothing_else(tmp_path):
    files(tmp_path, "box/1.obj", "box/1.mtl", "box/1.jpg", "box/2.PLY", "box/2.json", "one/scan.glb", "one/photo.png")
    files(tmp_path, ".hidden/x.obj", "box/.x.obj", "sheet/meta.json", "sheet/x.tif", "sheet/y.tif", "sheet/z.tif")
    assert named(tmp_path) == {"box/1": "box/1.obj", "box/2": "box/2.PLY", "one": "one/scan.glb", "sheet": "sheet"}


def test_conflicting_names_become_full_paths(tmp_path):
    files(tmp_path, "a.obj", "a.ply", "b.obj", "b/1.obj", "b/2.obj", "c/scan.obj", "c.obj")
    assert set(named(tmp_path)) == {"a.obj", "a.ply", "b.obj", "b/1.obj", "b/2.obj", "c/scan.obj", "c.obj"}


def test_names_are_safe_and_unique():
    paths = ["a:b", "a%3Ab", "line\nbreak", "end.", " start", "x" * 250, "x" * 251, os.fsdecode(b"\xff"), "Ünï/文"]
    safe = [safe_name(path) for path in paths]
    assert len(set(safe)) == len(paths)
    for name in safe:
        assert name.isprintable()
        assert all(len(part.encode()) <= 200 and part == part.strip() for part in name.split("/"))
    assert safe[-1] == "Ünï/文"


def test_a_recursive_link_is_skipped_with_a_note(tmp_path):
    files(tmp_path, "in/a/scan.obj", "other/b.obj")
    (tmp_path / "in" / "a" / "loop").symlink_to(tmp_path / "in")
    (tmp_path / "in" / "more").symlink_to(tmp_path / "other")
    found = find_items(tmp_path / "in")
    assert [item.name for item in found.items] == ["a", "more"]
    assert len(found.notes) == 1
    assert "a link to one of its parent folders" in found.notes[0]


def test_an_unreadable_folder_is_skipped_with_a_note(tmp_path, monkeypatch):
    files(tmp_path, "good/scan.obj", "closed/scan.obj")
    scandir = os.scandir

    def guarded(folder):
        if Path(folder).name == "closed":
            raise PermissionError(13, "Permission denied")
        return scandir(folder)

    monkeypatch.setattr("os.scandir", guarded)
    found = find_items(tmp_path)
    assert [item.name for item in found.items] == ["good"]
    assert found.notes == [f"{tmp_path / 'closed'} was skipped because it cannot be read: Permission denied"]


def test_a_folder_without_scans_is_refused(tmp_path):
    files(tmp_path, "notes.txt", "photo.jpg")
    with pytest.raises(InputError, match="contains no scan"):
        find_items(tmp_path)
    with pytest.raises(InputError, match="no such folder"):
        find_items(tmp_path / "none")


def test_a_single_scan_is_refused(tmp_path):
    files(tmp_path, "sheet/meta.json", "sheet/x.tif", "sheet/y.tif", "sheet/z.tif", "a.obj")
    with pytest.raises(InputError, match="is a single scan"):
        find_items(tmp_path / "sheet")
    with pytest.raises(InputError, match="is a single scan"):
        read_list(tmp_path / "a.obj")


def test_a_broken_link_to_a_scan_is_an_item(tmp_path):
    (tmp_path / "a.obj").symlink_to("gone.obj")
    assert named(tmp_path) == {"a": "a.obj"}


# Lists


def listed(tmp_path, text, name="scans.csv"):
    (tmp_path / name).write_text(text)
    return read_list(tmp_path / name).items


def test_a_list_as_csv(tmp_path):
    text = "scan, photo, camera, name, units\nb/2.ply, p.jpg; q.jpg, c.json, second, cm\na/1.obj,,,,\n"
    first, second = listed(tmp_path, text)
    assert first == Item(name="a/1", scan=tmp_path / "a/1.obj")
    assert second.name == "second"
    assert second.photo == (tmp_path / "p.jpg", tmp_path / "q.jpg")
    assert second.camera == (tmp_path / "c.json",)
    assert second.units == "cm"
    assert listed(tmp_path, "scan,units\na.obj,7.91um\n")[0].units == "7.91um"


def test_a_list_as_json_lines(tmp_path):
    text = '{"scan": "/else/1.obj", "photo": ["p.jpg", "q.jpg"]}\n\n{"scan": "../2.obj"}\n'
    first, second = listed(tmp_path, text, "scans.jsonl")
    assert (first.name, second.name) == ("2", "else/1")
    assert second.scan == Path("/else/1.obj")
    assert second.photo == (tmp_path / "p.jpg", tmp_path / "q.jpg")


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("name\na\n", "expected a header with the column scan"),
        ("scan,size\na.obj,3\n", "expected a header with the column scan"),
        ("scan,name\na.obj,x\nb.obj,x\n", r"the name x \(line 2, 3\) occurs twice"),
        ("scan,name\na.obj,x\nb.obj,x/y\n", "is a parent folder of another name"),
        ("scan,name\na.obj,../x\n", "is not a valid folder name"),
        ("scan,name\na.obj,/x\n", "is not a valid folder name"),
        ("scan,name\na.obj,.planish\n", "is not a valid folder name"),
        ("scan,name\na.obj,summary.html\n", "is not a valid folder name"),
        ("scan,units\na.obj,ell\n", "units is 'ell'"),
        ("scan,units\na.obj,mm,x\n", "more fields than the 2 columns"),
        ("scan\n", "lists no scan"),
        ("scan,photo\n,a.jpg\n", "names 0 scans"),
    ],
)
def test_invalid_lists(tmp_path, text, sentence):
    with pytest.raises(InputError, match=sentence):
        listed(tmp_path, text)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ('{"scan": "a.obj"\n', "line 1 is not valid JSON"),
        ('["a.obj"]\n', "expected an object"),
        ('{"scan": "a.obj", "size": 3}\n', "expected an object"),
        ('{"scan": 3}\n', "expected a path or a list of paths"),
        ('{"scan": "a.obj", "name": 3}\n', "is not a valid folder name"),
    ],
)
def test_invalid_json_lines(tmp_path, text, sentence):
    with pytest.raises(InputError, match=sentence):
        listed(tmp_path, text, "scans.jsonl")


# Input files

OBJ = "mtllib s.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
GLTF = '{"buffers": [{"uri": "s%20.bin"}], "images": [{"uri": "data:image/png;base64,"}, {"uri": "t.png"}]}'
PLY = "ply\nformat ascii 1.0\ncomment TextureFile t.png\nend_header\n"


@pytest.mark.parametrize(
    ("name", "text", "others"),
    [
        ("s.obj", OBJ, {"s.mtl": "newmtl s\nmap_Kd -s 1 1 1 t.png\n", "t.png": "T"}),
        ("s.gltf", GLTF, {"s .bin": "B", "t.png": "T"}),
        ("s.ply", PLY, {"t.png": "T"}),
    ],
)
def test_a_change_of_any_referenced_file_is_detected(tmp_path, name, text, others):
    for file, content in {name: text, **others}.items():
        (tmp_path / file).write_text(content)
    item = Item(name="s", scan=tmp_path / name)
    before = find_inputs(item)
    assert {Path(stamp.path).name for stamp in before.file_stamps} == {name, *others}
    for file in (name, *others):
        old = (tmp_path / file).read_text()
        (tmp_path / file).write_text(old + " ")
        assert find_inputs(item).fingerprint() != before.fingerprint(), file
        (tmp_path / file).unlink()
        assert find_inputs(item).fingerprint() != before.fingerprint(), file
        (tmp_path / file).write_text(old)
    assert find_inputs(item).fingerprint() == before.fingerprint()


def test_the_fingerprint_depends_on_content_not_on_folder_or_time(tmp_path):
    for place in ("here", "there"):
        files(tmp_path / place, "s.obj")
    os.utime(tmp_path / "there" / "s.obj", (0, 0))
    here, there = (find_inputs(Item(name="s", scan=tmp_path / place / "s.obj")) for place in ("here", "there"))
    assert here.fingerprint() == there.fingerprint()
    assert here.file_stamps != there.file_stamps


def test_the_photo_beside_a_scan_is_used_if_the_scan_references_none(tmp_path):
    files(tmp_path, "a/s.obj", "a/photo.jpg", "a/s_camera.json", "b/s.obj", "b/s.mtl", "b/t.png", "b/s.jpg")
    (tmp_path / "b/s.obj").write_text(OBJ)
    (tmp_path / "b/s.mtl").write_text("map_Kd t.png\n")
    a, b = (find_inputs(item) for item in find_items(tmp_path).items)
    assert (a.photo, a.camera) == ((tmp_path / "a/photo.jpg",), (tmp_path / "a/s_camera.json",))
    assert b.photo == ()
