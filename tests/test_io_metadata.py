import hashlib
import os
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image

import planish
from planish.errors import InputError
from planish.gallery import sheet as known_sheet
from planish.gallery import sheet_mesh
from planish.io import Origin, fingerprints, origin_of, read_scan, write_page, write_scan
from planish.io.metadata import xmp_packet
from planish.io.suppress_stderr import suppress_stderr
from planish.settings import FlattenSettings, RestoreSettings
from planish.types import Mesh, Page, Scan
from samples import picture, sheet_scan

ORIGIN = Origin("Flattened from a 3D scan by multigrid.", (("scan.obj", "ab" * 32),))
TAGS = {"software": 305, "method": 270, "date": 306, "xmp": 700}


def pages():
    colour = picture()
    for pixels in (colour, colour[..., 0].copy(), picture(dtype=np.uint16), colour[..., 1] > 99):
        yield Page(pixels, np.ones(pixels.shape[:2], bool), 287.4)


def what_it_says(path):
    """Software, method, date and XMP of a file, wherever its format keeps them."""
    with Image.open(path) as image:
        if path.suffix == ".png":
            said = {**image.info, **{"software": image.info["Software"], "method": image.info["Description"]}}
        else:
            exif = image.getexif()
            said = {name: exif.get(tag) for name, tag in TAGS.items()}
        xmp = said["xmp"] or image.info["xmp"]
    return said | {"xmp": (xmp if isinstance(xmp, bytes) else xmp.encode()).strip(b"\0")}


def properties(packet):
    tree = ElementTree.fromstring(packet)
    return {item.tag.split("}")[1]: "".join(item.itertext()) for item in tree.iter()}


@pytest.mark.parametrize("suffix", ["tif", "png", "jpg"])
def test_every_page_says_what_made_it_how_and_from_what(tmp_path, suffix):
    for page in pages():
        path = tmp_path / f"page.{suffix}"
        write_page(path, page, ORIGIN)
        said = what_it_says(path)
        assert said["software"] == f"planish {planish.__version__}"
        assert said["method"] == ORIGIN.method
        known = properties(said["xmp"])
        assert known["XResolution"] == known["YResolution"] == "287400/1000"
        assert known["source"] == f"scan.obj sha256:{'ab' * 32}"
        assert known["CreatorTool"] == f"planish {planish.__version__}"
        assert "CreateDate" not in known


@pytest.mark.parametrize("suffix", ["tif", "png", "jpg", "pdf"])
def test_what_a_file_says_is_small_and_the_same_on_every_day(tmp_path, suffix, monkeypatch):
    monkeypatch.delenv("SOURCE_DATE_EPOCH", raising=False)
    page = next(pages())
    for name in ("once", "again"):
        write_page(tmp_path / f"{name}.{suffix}", page, ORIGIN)
    once, again = ((tmp_path / f"{name}.{suffix}").read_bytes() for name in ("once", "again"))
    assert once == again
    assert len(xmp_packet(300.0, ORIGIN)) < 1500


def test_a_date_comes_from_the_environment_alone(tmp_path, monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1132012800")
    for suffix in ("tif", "jpg"):
        write_page(tmp_path / f"page.{suffix}", next(pages()), ORIGIN)
        said = what_it_says(tmp_path / f"page.{suffix}")
        assert said["date"] == "2005:11:15 00:00:00"
        assert properties(said["xmp"])["CreateDate"] == "2005-11-15T00:00:00+00:00"


def test_names_that_xml_cannot_hold_do_not_break_it():
    packet = xmp_packet(300.0, Origin("a <b> & c", (("\udcff\x01&<sç>.obj", "00"),)))
    known = properties(packet)
    assert known["description"] == "a <b> & c"
    assert known["source"] == "??&<sç>.obj sha256:00"


def test_fingerprints_are_those_of_sha256sum(tmp_path):
    (tmp_path / "a.obj").write_bytes(b"v 0 0 0\n")
    (tmp_path / "page.tifxyz").mkdir()
    for name in ("meta.json", "x.tif", "y.tif", "z.tif"):
        (tmp_path / "page.tifxyz" / name).write_bytes(name.encode())
    found = fingerprints([tmp_path / "a.obj", tmp_path / "page.tifxyz", tmp_path / "a.obj"])
    assert found == {
        "a.obj": hashlib.sha256(b"v 0 0 0\n").hexdigest(),
        "page.tifxyz": hashlib.sha256(b"meta.jsonx.tify.tifz.tif").hexdigest(),
    }
    with pytest.raises(InputError, match=r"none\.obj cannot be read"):
        fingerprints([tmp_path / "none.obj"])


def test_files_of_one_name_in_two_folders_are_both_named(tmp_path):
    for folder in ("left", "right"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "1.jpg").write_text(folder)
    assert len(fingerprints(tmp_path / folder / "1.jpg" for folder in ("left", "right"))) == 2


def test_a_scan_knows_the_files_it_came_from(tmp_path):
    write_scan(tmp_path / "sheet.obj", sheet_scan())
    assert {path.name for path in read_scan(tmp_path / "sheet.obj").sources} == {"sheet.obj", "sheet.jpg"}
    other = tmp_path / "other.png"
    Image.fromarray(picture()).save(other)
    assert [path.name for path in read_scan(tmp_path / "sheet.obj", photo=other).sources] == ["sheet.obj", "other.png"]
    write_scan(tmp_path / "sheet.glb", sheet_scan())
    assert [path.name for path in read_scan(tmp_path / "sheet.glb").sources] == ["sheet.glb"]


@pytest.mark.slow
def test_the_method_is_said_in_a_sentence():
    mesh, _ = sheet_mesh(known_sheet("book"), points=3000)
    done = planish.restore(Scan(mesh), RestoreSettings(flatten=FlattenSettings(lengths="unfolded")))
    assert origin_of(done.report, {"a": "1"}, "nick") == Origin(
        "Flattened from a 3D scan by multigrid with unfolded lengths; shading kept; binarized by nick.", (("a", "1"),)
    )


def test_the_digest_is_of_the_bytes_that_were_read(tmp_path):
    """A file that changes while its scan is worked on: the report names what the page was made from."""
    (path,) = write_scan(tmp_path / "sheet.ply", Scan(Mesh([[0.0, 0, 0], [100, 0, 0], [0, 100, 0]], [[0, 1, 2]])))
    read, before = read_scan(path), hashlib.sha256(path.read_bytes()).hexdigest()
    path.write_bytes(b"something else")
    assert fingerprints(read.sources, read.digests) == {"sheet.ply": before}


def test_a_library_leaves_stderr_to_the_program_around_it(capfd):
    with suppress_stderr():
        os.write(2, b"from another thread")
    assert capfd.readouterr().err == "from another thread"
