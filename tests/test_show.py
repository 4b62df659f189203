"""Pages and restorations among other libraries: arrays, images, xarrays, notebooks."""

import sys
from base64 import b64decode
from io import BytesIO, StringIO

import numpy as np
import pytest
from PIL import Image

from planish.errors import MissingExtraError
from planish.pipeline import restore
from planish.types import Page, Scan

KINDS = {
    "colours": (np.arange(12 * 9 * 3, dtype=np.uint8).reshape(12, 9, 3), "RGB"),
    "grey": (np.arange(12 * 9, dtype=np.uint8).reshape(12, 9), "L"),
    "16 bit": (np.arange(12 * 9 * 3, dtype=np.uint16).reshape(12, 9, 3) * 200, "RGB"),
    "black and white": (np.arange(12 * 9).reshape(12, 9) % 3 > 0, "1"),
}


@pytest.fixture(params=KINDS)
def kind(request):
    return KINDS[request.param]


@pytest.fixture(scope="module")
def scan(book_scan):
    return book_scan.scan


@pytest.fixture(scope="module")
def done(restored_book):
    return restored_book


def page_of(pixels, **more):
    known = np.ones(pixels.shape[:2], bool)
    known[0] = False
    return Page(pixels, known, 50.8, **more)  # two pixels a millimetre


class TestArrays:
    def test_a_page_is_an_array_without_a_copy(self, kind):
        page = page_of(kind[0])
        assert np.asarray(page).dtype == kind[0].dtype
        assert np.shares_memory(np.asarray(page), page.pixels)
        assert np.array_equal(np.asarray(page, np.float32), kind[0].astype(np.float32))

    def test_a_copy_may_be_written_and_the_page_stays(self):
        page = page_of(KINDS["grey"][0])
        mine = np.array(page)
        mine[:] = 7
        assert page.pixels[3, 3] != 7
        assert not np.asarray(page).flags.writeable


class TestPillow:
    def test_the_image_has_the_pixels_the_dpi_and_the_profile(self, kind):
        pixels, mode = kind
        image = page_of(pixels, icc=b"a profile").to_pil()
        assert (image.mode, image.size) == (mode, (9, 12))
        assert image.info == {"dpi": (50.8, 50.8), "icc_profile": b"a profile"}
        expected = np.round(pixels / 257) if pixels.dtype == np.uint16 else pixels
        assert np.array_equal(np.asarray(image), expected)

    def test_no_profile_where_the_page_has_none(self):
        assert "icc_profile" not in page_of(KINDS["grey"][0]).to_pil().info


class TestXarray:
    @pytest.mark.slow
    def test_places_are_pixel_centres_in_millimetres(self, kind):
        pixels, _ = kind
        made = page_of(pixels).to_xarray()
        assert made.dims == ("y", "x", "channel")[: pixels.ndim]
        assert made.x.values == pytest.approx(0.25 + np.arange(9) / 2)  # to rounding
        assert made.y.values == pytest.approx(0.25 + np.arange(12) / 2)
        assert made.x.attrs["units"] == made.y.attrs["units"] == "mm"
        # row 2 shows what lies 1 to 1.5 mm from the top
        assert np.array_equal(made.sel(y=1.1, method="nearest"), pixels[2])
        assert not made.known[0].any()
        assert made.known[1:].all()

    def test_without_xarray_one_sentence_says_what_to_install(self, monkeypatch):
        monkeypatch.setitem(sys.modules, "xarray", None)
        with pytest.raises(MissingExtraError, match=r"pip install 'xarray>="):
            page_of(KINDS["grey"][0]).to_xarray()


class TestNotebook:
    def test_a_page_shows_a_small_picture_of_itself(self, kind):
        large = np.repeat(np.repeat(kind[0], 100, axis=0), 100, axis=1)
        shown = Image.open(BytesIO(page_of(large)._repr_png_()))
        assert shown.size == (480, 640)  # of 900 x 1200
        # the mean grey stays, to the rounding of pixels and of luminance
        grey = large.mean() * {np.dtype(bool): 255.0, np.dtype(np.uint16): 1 / 257}.get(large.dtype, 1.0)
        assert np.asarray(shown.convert("L")).mean() == pytest.approx(grey, abs=1.5)

    @pytest.mark.slow
    def test_a_restoration_shows_its_page_and_its_figures(self, done):
        html = done._repr_html_()
        picture = Image.open(BytesIO(b64decode(html.split("base64,")[1].split('"')[0])))
        assert max(picture.size) == 640
        assert f"{done.report.page.width_mm:.1f} x {done.report.page.height_mm:.1f} mm" in html
        for sentence in (done.report.outcome, *map(str, done.report.warnings)):
            assert sentence in html
        assert len(html) < 200_000  # a notebook keeps it

    def test_without_a_photo_only_the_figures(self, scan):
        html = restore(Scan(scan.mesh))._repr_html_()
        assert "<img" not in html
        assert "expected error" in html

    def test_what_is_printed_is_short(self, done):
        width, height = done.flattening.size_mm
        assert repr(done).startswith(f"Restoration({width:.1f} x {height:.1f} mm, expected error 0.0")
        assert len(repr(done)) < 200
        assert repr(done.binary).startswith(f"Page({done.binary.pixels.shape[1]} x ")
        assert " px of bool, 300 dpi, " in repr(done.binary)


def test_the_progress_bar_names_the_stage_in_a_terminal_and_leaves_logs_alone():
    from rich.console import Console

    import planish

    drawn = {}
    for terminal in (True, False):
        file = StringIO()
        with planish.progress_bar(Console(file=file, force_terminal=terminal, width=100)) as progress:
            progress("flatten", 0.5)
            progress("turn", 1.0)
        drawn[terminal] = file.getvalue()
    assert "Orienting the page" in drawn[True]
    assert "100%" in drawn[True]
    assert drawn[False] == ""
