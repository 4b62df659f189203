import io

import numpy as np
import pikepdf
import pytest
from PIL import Image, ImageCms

from planish.errors import OutputError
from planish.io import check_page_name, page_names, read_photo, write_page, write_pages
from planish.types import Page
from samples import picture

SRGB = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
PIXELS = {
    "colour": picture(),
    "grey": picture()[..., 0].copy(),
    "16 bit colour": picture(dtype=np.uint16),
    "16 bit grey": picture(dtype=np.uint16)[..., 0].copy(),
    "bilevel": picture()[..., 1] > 99,
}


def page_of(pixels, dpi=287.4, icc=SRGB):
    return Page(pixels, np.ones(pixels.shape[:2], bool), dpi, icc if pixels.ndim == 3 else None)


def as_read(pixels):
    """What `read_photo` must give."""
    pixels = pixels * np.uint8(255) if pixels.dtype == bool else pixels
    return np.broadcast_to(pixels.reshape(*pixels.shape[:2], -1), (*pixels.shape[:2], 3))


@pytest.mark.parametrize("kind", PIXELS)
@pytest.mark.parametrize("suffix", [".tif", ".tiff", ".png", ".TIF"])
def test_lossless_pages_keep_every_pixel_and_the_true_dpi(tmp_path, kind, suffix):
    path = tmp_path / f"page{suffix}"
    write_page(path, page_of(PIXELS[kind]))
    photo = read_photo(path)
    np.testing.assert_array_equal(photo.pixels, as_read(PIXELS[kind]))
    assert photo.pixels.dtype == (np.uint16 if "16" in kind else np.uint8)
    assert photo.icc == (SRGB if "colour" in kind else None)
    with Image.open(path) as image:
        assert image.info["dpi"] == pytest.approx((287.4, 287.4), abs=0.02)  # PNG counts whole pixels a metre
        if kind == "bilevel":
            assert image.mode == "1"
            assert suffix == ".png" or image.info["compression"] == "group4"


@pytest.mark.parametrize("kind", PIXELS)
def test_jpeg_pages_hold_eight_bits(tmp_path, kind):
    write_page(tmp_path / "page.jpg", page_of(PIXELS[kind]))
    photo = read_photo(tmp_path / "page.jpg")
    scale = 257 if "16" in kind else 1
    assert np.abs(photo.pixels.astype(float) - as_read(PIXELS[kind]) / scale).mean() < 2.5
    assert photo.icc == (SRGB if "colour" in kind else None)
    with Image.open(tmp_path / "page.jpg") as image:
        assert image.info["dpi"] == (287, 287)
        assert float(image.getexif()[0x011A]) == pytest.approx(287.4, abs=1e-6)


@pytest.mark.parametrize("kind", PIXELS)
def test_pdf_pages_have_the_true_size(tmp_path, kind):
    write_page(tmp_path / "page.pdf", page_of(PIXELS[kind]))
    with pikepdf.open(tmp_path / "page.pdf") as pdf:
        (page,) = pdf.pages
        box = [float(n) for n in page.MediaBox]
        assert box[2:] == pytest.approx([60 / 287.4 * 72, 40 / 287.4 * 72], abs=1e-3)
        images = page.get_images() if hasattr(page, "get_images") else page.images  # pikepdf 9
        (image,) = images.values()
        assert (int(image.Width), int(image.Height)) == (60, 40)
        assert str(image.Filter if not isinstance(image.Filter, pikepdf.Array) else image.Filter[0]) == (
            "/CCITTFaxDecode" if kind == "bilevel" else "/DCTDecode"
        )
        drawn = pikepdf.PdfImage(image).as_pil_image().convert("RGB")
    scale = 257 if "16" in kind else 1
    assert np.abs(np.asarray(drawn, float) - as_read(PIXELS[kind]) / scale).mean() < 2.5


def test_several_pages_in_one_file(tmp_path):
    pages = [page_of(PIXELS["colour"], 100.0), page_of(PIXELS["bilevel"], 200.0), page_of(PIXELS["16 bit grey"], 300.0)]
    write_pages(tmp_path / "book.tif", pages)
    with Image.open(tmp_path / "book.tif") as image:
        assert image.n_frames == 3
        for k, dpi in enumerate((100, 200, 300)):
            image.seek(k)
            assert image.info["dpi"] == (dpi, dpi)
    write_pages(tmp_path / "book.pdf", pages)
    with pikepdf.open(tmp_path / "book.pdf") as pdf:
        widths = [float(page.MediaBox[2]) for page in pdf.pages]
    assert widths == pytest.approx([60 * 72 / dpi for dpi in (100, 200, 300)], abs=1e-3)


def test_several_bilevel_pages_stay_one_bit(tmp_path):
    write_pages(tmp_path / "book.tif", [page_of(PIXELS["bilevel"], dpi) for dpi in (100.0, 200.0)])
    with Image.open(tmp_path / "book.tif") as image:
        for k, dpi in enumerate((100, 200)):
            image.seek(k)
            assert image.mode == "1"
            assert image.info["dpi"] == (dpi, dpi)
            assert image.info["compression"] == "group4"


@pytest.mark.parametrize("name", ["page", "page.gif", "page.tif.bak"])
def test_other_suffixes_are_refused_before_anything_is_written(tmp_path, name):
    with pytest.raises(OutputError, match="a page is written as"):
        check_page_name(tmp_path / name)
    with pytest.raises(OutputError, match="a page is written as"):
        write_page(tmp_path / name, page_of(PIXELS["grey"]))
    assert list(tmp_path.iterdir()) == []


def test_known_suffixes_are_accepted():
    for name in ("a.tif", "a.TIFF", "a.png", "a.jpg", "a.jpeg", "a.pdf"):
        check_page_name(name)


def test_formats_of_one_page_refuse_more(tmp_path):
    for name in ("book.png", "book.jpg"):
        with pytest.raises(OutputError, match="cannot hold 2 pages"):
            write_pages(tmp_path / name, [page_of(PIXELS["grey"])] * 2)
    with pytest.raises(OutputError, match="no page to write"):
        write_pages(tmp_path / "book.tif", [])


def test_names_of_the_files_of_several_pages():
    for name, names in [
        ("a.png", ["a-1.png", "a-2.png"]),
        ("b.c.JPG", ["b.c-1.JPG", "b.c-2.JPG"]),
        ("a.pdf", ["a.pdf"]),
    ]:
        assert [path.name for path in page_names(name, 2)] == names
        assert [path.name for path in page_names(name, 1)] == [name]


def test_a_tiff_of_many_strips_keeps_every_pixel(tmp_path):
    """8 MB: each core has several strips, and the last is shorter."""
    pixels = np.random.default_rng(0).integers(0, 65536, (1003, 701, 3), np.uint16)
    pixels[100:900] //= 256
    write_page(tmp_path / "page.tif", page_of(pixels))
    np.testing.assert_array_equal(read_photo(tmp_path / "page.tif").pixels, pixels)
    write_page(tmp_path / "page.tif", page_of((pixels // 257).astype(np.uint8)))
    with Image.open(tmp_path / "page.tif") as image:  # by libtiff
        np.testing.assert_array_equal(np.asarray(image), pixels // 257)


def test_a_page_longer_than_a_jpeg_can_be(tmp_path):
    with pytest.raises(OutputError, match="at most 65500 a side"):
        write_page(tmp_path / "page.jpg", page_of(np.zeros((8, 70_000), np.uint8)))


def test_no_folder_no_page(tmp_path):
    with pytest.raises(OutputError, match="there is no folder"):
        write_page(tmp_path / "none" / "page.tif", page_of(PIXELS["grey"]))


def test_a_page_of_one_pixel(tmp_path):
    for suffix in (".tif", ".png", ".jpg"):
        for pixels in (np.zeros((1, 1), bool), np.zeros((1, 1, 3), np.uint8), np.zeros((1, 1), np.uint16)):
            write_page(tmp_path / f"dot{suffix}", page_of(pixels))
            assert Image.open(io.BytesIO((tmp_path / f"dot{suffix}").read_bytes())).size == (1, 1)


def test_a_page_that_no_viewer_would_show(tmp_path):
    for size in ((5, 200), (200, 70_000)):
        with pytest.raises(OutputError, match=r"1\.1 to 5080 mm"):
            write_page(tmp_path / "dot.pdf", page_of(np.zeros(size, bool)))
