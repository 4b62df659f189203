"""`planish photo` from start to end, and what the EXIF of a photo says."""

import io
import json

import cv2
import numpy as np
import pytest
from PIL import Image

from planish.cli.main import run
from planish.gallery import sheet, virtual_scan
from planish.io import focal_length_px, write_unscaled_page
from planish.types import Page

pytestmark = pytest.mark.slow

EXIF, FOCAL_35, FOCAL, RESOLUTION, UNIT, ORIENTATION = 0x8769, 0xA405, 0x920A, 0xA20E, 0xA210, 0x0112


@pytest.fixture(scope="module")
def book(tmp_path_factory):
    made = virtual_scan(sheet("book"), points=2000, photo_px=(1600, 1200))
    path = tmp_path_factory.mktemp("photo") / "book.jpg"
    Image.fromarray(made.scan.photo).save(path, quality=92)
    return path


def test_a_photo_becomes_a_page_with_an_account(book, tmp_path):
    page, binary, report = tmp_path / "page.png", tmp_path / "binary.png", tmp_path / "report.json"
    arguments = ["photo", str(book), "-o", str(page), "--binary", str(binary), "--report", str(report), "-q"]
    assert run(arguments) == 0
    said = json.loads(report.read_text())
    assert said["photo"]["shape"] == "text-lines and borders"
    assert said["photo"]["scale"] == "unknown"
    assert 0 < said["photo"]["straightness"] < 0.15
    assert said["seconds"]["shape"] > 0
    assert any("how large the sheet is" in warning for warning in said["warnings"])
    for path in (page, binary):
        with Image.open(path) as image:
            assert "dpi" not in image.info
            assert image.height / image.width == pytest.approx(279.4 / 215.9, rel=0.08)  # the focal length is a guess


def test_with_the_paper_known_the_dpi_is_true(book, tmp_path):
    page = tmp_path / "page.tif"
    assert run(["photo", str(book), "-o", str(page), "--paper", "letter", "--dpi", "100", "-q"]) == 0
    with Image.open(page) as image:
        assert image.info["dpi"] == (100, 100)
        assert image.size == pytest.approx((850, 1100), abs=6)


def test_a_photo_taken_lying_is_shown_upright(book, tmp_path):
    lying, page = tmp_path / "lying.jpg", tmp_path / "page.png"
    exif = Image.Exif()
    exif[ORIENTATION] = 6
    with Image.open(book) as image:
        image.transpose(Image.Transpose.ROTATE_90).save(lying, exif=exif)
    assert run(["photo", str(lying), "-o", str(page), "-q"]) == 0
    with Image.open(page) as image:
        assert image.height > image.width


def test_what_shows_no_page_is_one_sentence(tmp_path, capsys):
    wall, page = tmp_path / "wall.png", tmp_path / "page.png"
    Image.new("RGB", (800, 600), (200, 200, 190)).save(wall)
    assert run(["photo", str(wall), "-o", str(page), "-q"]) == 3
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "neither lines of text nor the outline" in said
    assert not page.exists()


@pytest.mark.parametrize(
    ("flags", "code"),
    [(["--width-mm", "0"], 2), (["--width-mm", "100", "--paper", "a4"], 2), (["--paper", "a0"], 2)],
)
def test_bad_flags_are_refused(book, tmp_path, flags, code):
    assert run(["photo", str(book), "-o", str(tmp_path / "page.png"), *flags]) == code


def test_binary_needs_a_method(book, tmp_path):
    arguments = ["-o", str(tmp_path / "a.png"), "--binary", str(tmp_path / "b.png"), "--binarize", "none"]
    assert run(["photo", str(book), *arguments]) == 2


def test_handwriting_gives_a_page_or_a_sentence(tmp_path, capsys):
    rng = np.random.default_rng(3)
    paper = np.full((1200, 900, 3), 225, np.uint8)
    for row in range(120, 1100, 70):
        x = np.arange(80, 820, 3)
        wave = 14 * np.sin(x / 7.0 + rng.uniform(0, 6)) * rng.uniform(0.3, 1, len(x)) + 8 * np.sin(x / 90)
        stroke = np.stack([x + 4 * np.cos(x / 5.0), row + wave], axis=1).astype(np.int32)
        cv2.polylines(paper, [stroke.reshape(-1, 1, 2)], False, (30, 30, 90), 2, cv2.LINE_AA)
    Image.fromarray(paper).save(tmp_path / "letter.jpg")
    code = run(["photo", str(tmp_path / "letter.jpg"), "-o", str(tmp_path / "page.png"), "-q"])
    assert code in (0, 3)
    assert "Traceback" not in capsys.readouterr().err


def jpeg(size, **tags):
    exif = Image.Exif()
    exif.get_ifd(EXIF).update({int(name[1:]): value for name, value in tags.items()})
    file = io.BytesIO()
    Image.new("L", size).save(file, "JPEG", exif=exif)
    return file


def test_focal_length_by_the_diagonal_of_35_mm_film():
    assert focal_length_px(jpeg((4000, 3000), **{f"_{FOCAL_35}": 43})) == pytest.approx(5000 * 43 / 43.267, rel=1e-4)


def test_focal_length_by_the_sensor():
    tags = {f"_{FOCAL}": 4.0, f"_{RESOLUTION}": 1000.0, f"_{UNIT}": 4}  # 1000 pixels a millimetre
    assert focal_length_px(jpeg((4000, 3000), **tags)) == pytest.approx(4000)


@pytest.mark.parametrize("size", [(1882, 2416), (2000, 2000), (1809, 2412)])
def test_cropped_photos_have_no_known_focal_length(size):
    assert focal_length_px(jpeg(size, **{f"_{FOCAL_35}": 26})) is None


def test_without_exif_or_image_there_is_no_focal_length():
    assert focal_length_px(jpeg((400, 300))) is None
    assert focal_length_px(jpeg((400, 300), **{f"_{FOCAL_35}": 0})) is None
    assert focal_length_px(io.BytesIO(b"not an image")) is None


@pytest.mark.parametrize("suffix", [".tif", ".png", ".jpg", ".pdf"])
@pytest.mark.parametrize("kind", [np.uint8, bool])
def test_pages_of_unknown_size_say_no_dpi(tmp_path, suffix, kind):
    page = Page(np.ones((40, 30), kind), np.ones((40, 30), bool), 300.0)
    write_unscaled_page(tmp_path / f"page{suffix}", page)
    if suffix == ".pdf":
        assert (tmp_path / "page.pdf").read_bytes().startswith(b"%PDF")
        return
    with Image.open(tmp_path / f"page{suffix}") as image:
        assert image.size == (30, 40)
        assert image.info.get("dpi", (1, 1)) == (1, 1)  # TIFF must say something: one pixel a pixel
