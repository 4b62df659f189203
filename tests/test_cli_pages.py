"""The files of the page at the command line: split, masked, searchable, for archives; all of them or none."""

import json
import shutil
import subprocess

import numpy as np
import pikepdf
import pytest
from PIL import Image

from planish.cli.main import run
from planish.errors import OutputError, install_command
from planish.gallery import sheet, virtual_scan
from planish.io import write_scan

pytestmark = pytest.mark.slow


def scanned(tmp_path_factory, name, **how):
    made = virtual_scan(sheet(name), **how)
    path = tmp_path_factory.mktemp(name) / f"{name}.obj"
    write_scan(path, made.scan)
    return path


@pytest.fixture(scope="module")
def spread(tmp_path_factory):
    return scanned(tmp_path_factory, "spread", points=12_000, photo_px=(2000, 1500))


@pytest.fixture(scope="module")
def book(tmp_path_factory):
    return scanned(tmp_path_factory, "book", points=4000, photo_px=(1000, 750))


def restored(scan, output, *more, dpi="100"):
    return run(["restore", str(scan), "-o", str(output), "--dpi", dpi, *(str(m) for m in more)])


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_a_spread_becomes_a_file_of_two_pages(spread, tmp_path):
    report = tmp_path / "r.json"
    binary = tmp_path / "bw.tif"
    assert restored(spread, tmp_path / "book.tif", "--pages", "auto", "--report", report, "--binary", binary) == 0
    assert names(tmp_path) == ["book.tif", "bw.tif", "r.json"]
    said = json.loads(report.read_text())
    for path in (tmp_path / "book.tif", binary):
        with Image.open(path) as image:
            assert image.n_frames == 2
            widths = []
            for k in range(2):
                image.seek(k)
                widths.append(image.size[0])
                assert image.info["dpi"] == (100, 100)
        assert sum(widths) == round(said["page"]["width_mm"] / 25.4 * 100)
        assert widths[0] == pytest.approx(148 / 25.4 * 100, abs=6)  # a mesh of 2 mm places the spine to 1.5 mm
    assert [part["side"] for part in said["pages"]] == ["left", "right"]
    assert said["spine"]["found_by"] == "surface"
    assert set(said["sources"]) == {"spread.obj", "spread.jpg"}


def test_a_spread_becomes_two_files_where_one_holds_a_single_page(spread, tmp_path):
    assert restored(spread, tmp_path / "book.png", "--pages", "2", "--mask", tmp_path / "mask.png") == 0
    assert names(tmp_path) == ["book-1.png", "book-2.png", "mask-1.png", "mask-2.png"]
    for k in "12":
        with Image.open(tmp_path / f"book-{k}.png") as page, Image.open(tmp_path / f"mask-{k}.png") as mask:
            assert page.size == mask.size
            assert set(np.unique(np.asarray(mask))) <= {0, 128, 255}


def test_a_single_page_stays_whole_and_the_mask_agrees_with_the_report(book, tmp_path, capsys):
    report, mask = tmp_path / "r.json", tmp_path / "mask.png"
    assert restored(book, tmp_path / "page.png", "--pages", "auto", "--report", report, "--mask", mask) == 0
    assert names(tmp_path) == ["mask.png", "page.png", "r.json"]
    assert "stays one page" in capsys.readouterr().err
    said = json.loads(report.read_text())
    assert [part["side"] for part in said["pages"]] == ["whole"]
    with Image.open(mask) as image:
        assert (np.asarray(image) > 0).mean() == pytest.approx(said["page"]["known_fraction"])
    assert said["page"]["missing_regions"] >= 0
    assert said["page"]["missing_mm2"] >= 0


def test_a_page_for_archives(book, tmp_path):
    assert restored(book, tmp_path / "page.pdf", "--pdfa") == 0
    with pikepdf.open(tmp_path / "page.pdf") as pdf:
        assert pdf.open_metadata().pdfa_status == "2B"
        assert "scan" in str(pdf.docinfo.Subject)


@pytest.mark.skipif(shutil.which("tesseract") is None, reason="the program tesseract is not installed here")
@pytest.mark.skipif(shutil.which("pdftotext") is None, reason="poppler's tools are not installed here")
def test_a_pdf_whose_text_can_be_searched(spread, tmp_path):
    pytest.importorskip("pytesseract", reason="the extra planish[ocr] is not installed here")
    report = tmp_path / "r.json"
    more = ("--pages", "2", "--ocr", "eng", "--pdfa", "--report", report)
    assert restored(spread, tmp_path / "book.pdf", *more, dpi="200") == 0
    for page in "12":
        read = ["pdftotext", "-f", page, "-l", page, tmp_path / "book.pdf", "-"]
        said = subprocess.run(read, capture_output=True, text=True, check=True).stdout
        assert len([word for word in ("paper", "page", "the", "and") if word in said.split()]) >= 3
    assert json.loads(report.read_text())["seconds"]["text"] > 0


@pytest.mark.parametrize(
    ("code", "sentence", "more"),
    [
        (2, "PDF/A requires a PDF", ["--pdfa"]),
        (2, "an OCR text layer requires a PDF", ["--ocr", "eng"]),
        (2, "name a method with --binarize", ["--binary", "bw.png", "--binarize", "none"]),
        (4, "a mask needs a lossless format", ["--mask", "mask.jpg"]),
        (2, "--pages", ["--pages", "3"]),
    ],
)
def test_what_cannot_be_is_refused_before_work(book, tmp_path, capsys, code, sentence, more):
    assert restored(book, tmp_path / "page.tif", *more) == code
    assert sentence in capsys.readouterr().err
    assert names(tmp_path) == []


def test_without_the_extra_the_command_ends_with_6(book, tmp_path, capsys, monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "pytesseract", None)
    assert restored(book, tmp_path / "page.pdf", "--ocr", "eng") == 6
    assert install_command("ocr") in capsys.readouterr().err
    assert names(tmp_path) == []


def test_a_page_in_place_is_kept_even_if_only_the_split_would_replace_it(book, tmp_path, capsys):
    (tmp_path / "page-2.png").write_text("mine")
    assert restored(book, tmp_path / "page.png", "--pages", "auto", "--no-overwrite") == 4
    assert "page-2.png exists" in capsys.readouterr().err
    assert names(tmp_path) == ["page-2.png"]


def test_if_the_last_of_several_files_cannot_be_written_none_is(book, tmp_path, capsys, monkeypatch):
    def full(path, report):
        raise OutputError(f"{path} cannot be written: there is no room left on the disk")

    monkeypatch.setattr("planish.job.runner.write_json", full)
    (tmp_path / "page.tif").write_text("before")
    more = ("--binary", tmp_path / "bw.png", "--flat", tmp_path / "flat.obj", "--report", tmp_path / "r.json")
    assert restored(book, tmp_path / "page.tif", *more) == 4
    assert "no room left" in capsys.readouterr().err
    assert (tmp_path / "page.tif").read_text() == "before"
    assert names(tmp_path) == ["page.tif"]
