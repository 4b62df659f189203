"""PDFs: what a strict reader of the standard finds in them, and where their text lies."""

import re
import shutil
import subprocess
from xml.etree import ElementTree

import numpy as np
import pikepdf
import pytest
from PIL import ImageCms

from planish.errors import MissingExtraError, UsageError
from planish.gallery import typeset_page
from planish.gallery.prose import STORY
from planish.io import Origin, check_ocr, text_layer, way_up, write_pages
from planish.types import Page
from samples import picture

SRGB = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
ORIGIN = Origin("Flattened from a 3D scan.", (("a scan.obj", "0" * 64), ("phöto <1>.jpg", "f" * 64)))

with_tesseract = pytest.mark.skipif(
    shutil.which("tesseract") is None, reason="the program tesseract is not installed here"
)
with_poppler = pytest.mark.skipif(shutil.which("pdftotext") is None, reason="poppler's tools are not installed here")


def page_of(pixels, dpi=300.0, icc=None):
    return Page(pixels, np.ones(pixels.shape[:2], bool), dpi, icc)


PAGES = [
    page_of(picture(), icc=SRGB),
    page_of(picture()[..., 0].copy(), 287.4),
    page_of(picture()[..., 1] > 99, 600.0),
    page_of(picture(dtype=np.uint16)),
]


def written(tmp_path, pages=PAGES, **how):
    path = tmp_path / "page.pdf"
    write_pages(path, pages, ORIGIN, **how)
    return path


def faults(path):
    """What ISO 19005-2, level B, forbids or misses in a PDF of pictures and text.

    Apache PDFBox's Preflight, which knows part 1 only, finds one fault in these files relabelled as part 1: that the
    ICC profile is of version 4, which part 2 permits.
    """
    data = path.read_bytes()
    if not re.match(rb"%PDF-1\.[0-7]\r?\n%[\x80-\xff]{4}", data):
        yield "6.1.2: header of 1.0 to 1.7 and four bytes above 127 in a comment"
    with pikepdf.open(path) as pdf:
        if "/Encrypt" in pdf.trailer or "/ID" not in pdf.trailer:
            yield "6.1.3: a file identifier and no encryption"
        yield from _metadata_faults(pdf)
        intents = [i for i in pdf.Root.get("/OutputIntents", []) if i.S == "/GTS_PDFA1"]
        if len(intents) != 1:
            yield "6.2.3: one output intent of PDF/A"
            return
        profile = bytes(intents[0].DestOutputProfile.read_bytes())
        if (
            profile[36:40] != b"acsp"
            or profile[8] > 4
            or profile[16:20] != b"RGB "
            or intents[0].DestOutputProfile.N != 3
        ):
            yield "6.2.3: the output intent's profile is an ICC profile up to version 4 with N components"
        for thing in pdf.objects:
            yield from _object_faults(thing)


def _metadata_faults(pdf):
    metadata = pdf.Root.get("/Metadata")
    if metadata is None or ("/Filter" in metadata and metadata.Filter != "/FlateDecode"):
        yield "6.6.2: XMP"
        return
    tree = ElementTree.fromstring(metadata.read_bytes())
    said = {}
    for name in tree.iter():
        said[name.tag.split("}")[1]] = "".join(name.itertext())
        schema = name.tag.split("}")[0].strip("{")
        if not re.search(
            r"(rdf-syntax-ns#|/dc/elements/1.1/|/xap/1.0/|/pdf/1.3/|aiim.org/pdfa/ns/id/|adobe:ns:meta/)$", schema
        ):
            yield f"6.6.2.3: a property of the schema {schema}, which would have to be described"
    if (said.get("part"), said.get("conformance")) != ("2", "B"):
        yield "6.6.4: part 2, conformance B"
    pairs = {"/Creator": "CreatorTool", "/Producer": "Producer", "/Subject": "description"}
    for key, value in pdf.docinfo.items():
        if key in pairs and said.get(pairs[key]) != str(value):
            yield f"{key} of the information dictionary says another thing than the XMP"


def _object_faults(thing):
    if not isinstance(thing, pikepdf.Dictionary | pikepdf.Stream):
        return
    if thing.get("/Subtype") == "/Image":
        if thing.get("/Interpolate", False) or "/Alternates" in thing or "/OPI" in thing:
            yield "6.2.8: an image with interpolation or alternates"
        if str(thing.ColorSpace) not in ("/DeviceRGB", "/DeviceGray") and thing.ColorSpace[0] != "/ICCBased":
            yield "6.2.4: a colour space that is not defined"
    is_font = thing.get("/Type") == "/Font" and thing.get("/Subtype") == "/CIDFontType2"
    if is_font and ("/FontFile2" not in thing.FontDescriptor or "/CIDToGIDMap" not in thing):
        yield "6.2.11: a font that is not inside"
    if {"/JS", "/AA", "/TR", "/OpenAction", "/EmbeddedFiles"} & {*thing.keys()}:
        yield "6.1 to 6.5: scripts, actions, transfer functions or other files"


def test_a_pdf_for_archives_has_no_fault(tmp_path):
    assert list(faults(written(tmp_path, pdfa=True))) == []


def test_a_plain_pdf_does_not_pretend_to_be_for_archives(tmp_path):
    found = list(faults(written(tmp_path)))
    assert any("6.2.3" in fault for fault in found)
    assert any("6.6.4" in fault for fault in found)


@pytest.mark.parametrize("pdfa", [False, True])
def test_the_same_page_gives_the_same_bytes(tmp_path, pdfa):
    once = written(tmp_path, pdfa=pdfa).read_bytes()
    with pikepdf.open(tmp_path / "page.pdf") as pdf:
        first, second = map(bytes, pdf.trailer.ID)
    assert first == second  # both made from the content: no number that another library drew by the clock
    assert written(tmp_path, pdfa=pdfa).read_bytes() == once


def test_a_date_is_written_where_the_environment_tells_one(tmp_path, monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1132012800")
    path = written(tmp_path, pdfa=True)
    assert list(faults(path)) == []
    with pikepdf.open(path) as pdf:
        assert str(pdf.docinfo.CreationDate) == "D:20051115000000Z"
        assert b"2005-11-15T00:00:00+00:00" in pdf.Root.Metadata.read_bytes()
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "yesterday")
    with pytest.raises(UsageError, match="SOURCE_DATE_EPOCH is 'yesterday'"):
        written(tmp_path)


def test_sources_and_method_stand_in_the_metadata(tmp_path):
    with pikepdf.open(written(tmp_path)) as pdf, pdf.open_metadata() as meta:
        assert meta["dc:description"] == ORIGIN.method
        assert meta["dc:source"] == f"a scan.obj sha256:{'0' * 64}; phöto <1>.jpg sha256:{'f' * 64}"
        assert meta["xmp:CreatorTool"].startswith("planish ")


@pytest.mark.parametrize("how", [{"pdfa": True}, {"text": [b"%PDF"]}])
def test_other_formats_hold_no_text_and_are_no_pdf(tmp_path, how):
    with pytest.raises(UsageError, match="only a PDF"):
        write_pages(tmp_path / "page.tif", PAGES[:1], **how)
    assert list(tmp_path.iterdir()) == []


@with_poppler
def test_the_true_dpi_stands_in_the_eyes_of_poppler(tmp_path):
    listed = subprocess.run(
        ["pdfimages", "-list", written(tmp_path, pdfa=True)], capture_output=True, text=True, check=True
    ).stdout.splitlines()[2:]
    assert [row.split()[12:14] for row in listed] == [["300", "300"], ["287", "287"], ["600", "600"], ["300", "300"]]


# Text


@pytest.fixture(scope="module")
def page():
    return typeset_page(105, 148, dpi=200, point_size=10, table=False)[0]


@pytest.fixture(scope="module")
def layer(page):
    pytest.importorskip("pytesseract", reason="the extra planish[ocr] is not installed here")
    return text_layer(page, "eng")


@pytest.mark.slow
@with_tesseract
@with_poppler
def test_text_can_be_searched_and_lies_on_its_letters(tmp_path, page, layer):
    path = tmp_path / "page.pdf"
    write_pages(path, [page, page], ORIGIN, pdfa=True, text=[layer, layer])
    assert list(faults(path)) == []
    said = subprocess.run(["pdftotext", "-bbox", path, "-"], capture_output=True, text=True, check=True).stdout
    assert said.count("<page ") == 2
    boxes = [
        ([float(n) / 72 * 200 for n in numbers], word)
        for *numbers, word in re.findall(r'<word xMin="(.*?)" yMin="(.*?)" xMax="(.*?)" yMax="(.*?)">(.*?)<', said)
    ]
    assert "paper" in [word for _, word in boxes]
    ink = np.asarray(page.pixels).min(axis=2) < 128
    long = [box for box, word in boxes if len(word) > 4]
    covered = [ink[int(top) : int(bottom) + 1, int(left) : int(right) + 1].mean() for left, top, right, bottom in long]
    assert np.mean(np.array(covered) > 0.05) > 0.95  # a box a line or a word aside would lie on blank paper as often


@pytest.mark.slow
@with_tesseract
def test_the_text_is_not_seen(tmp_path, page, layer):
    path = tmp_path / "page.pdf"
    write_pages(path, [page], text=[layer])
    with pikepdf.open(path) as pdf:
        commands = b"".join(
            form.read_bytes()
            for form in pdf.objects
            if isinstance(form, pikepdf.Stream) and form.get("/Subtype") == "/Form"
        )
    assert b"3 Tr" in commands  # text of mode 3 is neither filled nor stroked
    assert not re.search(rb"(?<!3) Tr\b", commands)


@pytest.mark.slow
@with_tesseract
@pytest.mark.parametrize("quarters", [0, 1, 2, 3])
def test_tesseract_tells_the_way_up(page, quarters):
    pytest.importorskip("pytesseract", reason="the extra planish[ocr] is not installed here")
    turned = Page(np.rot90(page.pixels, quarters), np.rot90(page.known, quarters), page.dpi)
    assert way_up(turned) == 90 * quarters


@pytest.mark.slow
@with_tesseract
def test_blank_pages_and_capitals_have_no_way_up():
    assert way_up(page_of(np.full((300, 200, 3), 255, np.uint8))) is None
    story = tuple(paragraph.upper() for paragraph in STORY)
    assert way_up(typeset_page(148, 210, dpi=150, title=None, story=story, table=False)[0]) is None


@with_tesseract
def test_a_language_that_is_not_there_is_named(monkeypatch):
    pytest.importorskip("pytesseract", reason="the extra planish[ocr] is not installed here")
    check_ocr("eng")
    with pytest.raises(UsageError, match=r"no language xyz, only .*eng"):
        check_ocr("eng+xyz")


def test_without_the_extra_or_the_program_that_is_said(monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "pytesseract", None)
    with pytest.raises(MissingExtraError, match="pip install 'pytesseract"):
        check_ocr("eng")
    assert way_up(PAGES[0]) is None
    monkeypatch.undo()
    pytesseract = pytest.importorskip("pytesseract", reason="the extra planish[ocr] is not installed here")
    monkeypatch.setattr(pytesseract.pytesseract, "tesseract_cmd", "/none/tesseract")
    with pytest.raises(MissingExtraError, match="apt install tesseract-ocr"):
        text_layer(PAGES[0], "eng")
