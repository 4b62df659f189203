import io
import struct
import zlib

import cv2
import numpy as np
import pytest
import tifffile
from PIL import Image, ImageCms

from planish.errors import InputError
from planish.io import read_photo
from planish.io.images import decode_photo
from samples import picture

SRGB = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
COLOUR = picture()
COLOUR_16 = picture(dtype=np.uint16)
GREY = picture(channels=1)[..., 0] if picture(channels=1).ndim == 3 else picture(channels=1)


def encoded(pixels, kind, **kw):
    file = io.BytesIO()
    image = pixels if isinstance(pixels, Image.Image) else Image.fromarray(pixels)
    image.save(file, kind, **kw)
    return file.getvalue()


def tiff(pixels, **kw):
    file = io.BytesIO()
    tifffile.imwrite(file, pixels, **kw)
    return file.getvalue()


def png_16(pixels):
    order = [2, 1, 0, 3][: pixels.shape[2]] if pixels.ndim == 3 else slice(None)
    return cv2.imencode(".png", pixels[..., order] if pixels.ndim == 3 else pixels)[1].tobytes()


GREY_16 = COLOUR_16[..., 0].copy()
WITH_ALPHA = np.dstack([COLOUR_16, np.full(COLOUR_16.shape[:2], 65535, np.uint16)])
LOSSLESS = {
    "png": (encoded(COLOUR, "PNG"), COLOUR),
    "tiff": (encoded(COLOUR, "TIFF"), COLOUR),
    "tiff lzw": (encoded(COLOUR, "TIFF", compression="tiff_lzw"), COLOUR),
    "webp": (encoded(COLOUR, "WEBP", lossless=True), COLOUR),
    "bmp": (encoded(COLOUR, "BMP"), COLOUR),
    "ppm": (encoded(COLOUR, "PPM"), COLOUR),
    "jpeg 2000": (encoded(COLOUR, "JPEG2000"), COLOUR),
    "grey png": (encoded(GREY, "PNG"), GREY),
    "grey tiff, 0 is white": (tiff(255 - GREY, photometric="miniswhite"), GREY),
    "two colours": (encoded(Image.fromarray(GREY > 99), "PNG"), (GREY > 99) * np.uint8(255)),
    "palette": (encoded(Image.fromarray(GREY).convert("P"), "PNG"), GREY),
    "16 bit png": (png_16(COLOUR_16), COLOUR_16),
    "16 bit grey png": (png_16(GREY_16), GREY_16),
    "16 bit png with alpha": (png_16(WITH_ALPHA), COLOUR_16),
    "16 bit tiff": (tiff(COLOUR_16, photometric="rgb"), COLOUR_16),
    "16 bit tiff, packed": (tiff(COLOUR_16, photometric="rgb", compression="zlib", predictor=True), COLOUR_16),
    "16 bit tiff, tiles": (tiff(COLOUR_16, photometric="rgb", tile=(16, 16)), COLOUR_16),
    "16 bit tiff, big end first": (tiff(COLOUR_16, photometric="rgb", byteorder=">"), COLOUR_16),
    "16 bit tiff, planes": (
        tiff(np.moveaxis(COLOUR_16, 2, 0).copy(), photometric="rgb", planarconfig="separate"),
        COLOUR_16,
    ),
    "16 bit tiff with alpha": (tiff(WITH_ALPHA, photometric="rgb", extrasamples=["unassalpha"]), COLOUR_16),
    "16 bit grey tiff": (tiff(GREY_16), GREY_16),
    "16 bit grey tiff, big end first": (tiff(GREY_16, byteorder=">"), GREY_16),
    "16 bit grey tiff, 0 is white": (tiff(65535 - GREY_16, photometric="miniswhite"), GREY_16),
    "16 bit lzw tiff": (cv2.imencode(".tif", COLOUR_16[..., ::-1])[1].tobytes(), COLOUR_16),
}


@pytest.mark.parametrize("name", LOSSLESS)
def test_pixels_arrive_as_they_are(name):
    data, pixels = LOSSLESS[name]
    photo = decode_photo(name, data)
    assert photo.pixels.dtype == pixels.dtype
    assert photo.pixels.flags.c_contiguous
    np.testing.assert_array_equal(photo.pixels, np.broadcast_to(pixels.reshape(40, 60, -1), (40, 60, 3)))
    assert photo.icc is None
    assert photo.warnings == []


def test_jpeg_and_profile(tmp_path):
    (tmp_path / "photo.jpg").write_bytes(encoded(COLOUR, "JPEG", quality=95, icc_profile=SRGB))
    photo = read_photo(tmp_path / "photo.jpg")
    assert photo.icc == SRGB
    assert np.abs(photo.pixels.astype(int) - COLOUR).max() <= 8  # JPEG of a smooth picture


def test_transparency_is_dropped_and_said():
    see_through = np.dstack([COLOUR, np.full(COLOUR.shape[:2], 255, np.uint8)])
    see_through[0, :3, 3] = 0
    photo = decode_photo("photo.png", encoded(see_through, "PNG"))
    np.testing.assert_array_equal(photo.pixels, COLOUR)
    assert "3 transparent pixels" in photo.warnings[0].sentence


def test_printing_colours_become_screen_colours():
    cmyk = Image.fromarray(COLOUR).convert("CMYK")
    for kind in ("JPEG", "TIFF"):
        photo = decode_photo("photo", encoded(cmyk, kind, **({"quality": 98} if kind == "JPEG" else {})))
        assert "CMYK" in photo.warnings[0].sentence
        assert np.abs(photo.pixels.astype(int) - COLOUR).mean() < 4  # plain conversion and back, and JPEG


def test_a_grey_profile_does_not_fit_colours():
    grey = bytearray(SRGB)
    grey[16:20] = b"GRAY"
    photo = decode_photo("photo.png", encoded(GREY, "PNG", icc_profile=bytes(grey)))
    assert photo.icc is None
    assert "colour profile for GRAY" in photo.warnings[0].sentence


def as_stored(orientation):
    """COLOUR as it must be stored to be shown right under an EXIF orientation."""
    undo = {2: "FLIP_LEFT_RIGHT", 3: "ROTATE_180", 4: "FLIP_TOP_BOTTOM", 5: "TRANSPOSE"}
    undo |= {6: "ROTATE_90", 7: "TRANSVERSE", 8: "ROTATE_270"}
    image = Image.fromarray(COLOUR)
    return image.transpose(getattr(Image.Transpose, undo[orientation])) if orientation in undo else image


def with_orientation(data, orientation):
    """A TIFF of OpenCV whose planar configuration, which is the usual one, is made an orientation."""
    planar = struct.pack("<HHIHH", 0x011C, 3, 1, 1, 0)
    assert data.count(planar) == 1
    return data.replace(planar, struct.pack("<HHIHH", 0x0112, 3, 1, orientation, 0))


@pytest.mark.parametrize("kind", ["PNG", "TIFF", "16 bit TIFF", "16 bit LZW TIFF"])
@pytest.mark.parametrize("orientation", range(1, 9))
def test_photos_are_turned_only_when_asked(kind, orientation):
    stored = np.array(as_stored(orientation))
    if kind == "16 bit LZW TIFF":
        data = with_orientation(
            cv2.imencode(".tif", stored[..., ::-1].astype(np.uint16) * 257)[1].tobytes(), orientation
        )
    elif kind == "16 bit TIFF":
        tag = (274, "H", 1, orientation, True)
        data = tiff(stored.astype(np.uint16) * 257, photometric="rgb", extratags=[tag])
        grey = tiff(stored[..., 0].astype(np.uint16) * 257, extratags=[tag])
        np.testing.assert_array_equal(decode_photo("grey", grey).pixels[..., 0], stored[..., 0].astype(int) * 257)
    else:
        exif = Image.Exif()
        exif[0x0112] = orientation
        data = encoded(stored, kind, exif=exif)
    scale = 257 if "16 bit" in kind else 1
    photo = decode_photo("photo", data)
    np.testing.assert_array_equal(photo.pixels, stored.astype(int) * scale)
    assert bool(photo.warnings) == (orientation != 1)
    upright = decode_photo("photo", data, upright=True)
    np.testing.assert_array_equal(upright.pixels, COLOUR.astype(int) * scale)
    assert upright.warnings == []


def test_of_several_pages_the_first_is_read():
    photo = decode_photo("photo.tif", encoded(COLOUR, "TIFF", save_all=True, append_images=[Image.fromarray(GREY)]))
    np.testing.assert_array_equal(photo.pixels, COLOUR)
    assert "holds 2 pages" in photo.warnings[0].sentence


def png_that_claims(width, height):
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    data = b"\x89PNG\r\n\x1a\n"
    for name, content in ((b"IHDR", header), (b"IDAT", zlib.compress(b"\0")), (b"IEND", b"")):
        data += struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))
    return data


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        (b"no image at all", "no image that can be read"),
        (b"%PDF-1.7\n", "is a PDF; save it as JPEG"),
        (encoded(COLOUR[:1, :1], "PNG"), "is 1 x 1 pixels"),
        (encoded(COLOUR[:1], "PNG"), "is 60 x 1 pixels"),
        (png_that_claims(30_000, 30_000), "900 megapixels"),
        (tiff(COLOUR[..., 0].astype(np.float32)), "kind F"),
        (tiff(COLOUR[..., 0].astype(np.float64)), "is a TIFF with pixels of 1 x float64; 8 or 16 bit"),
        (tiff(COLOUR.astype(np.float64), photometric="rgb"), "is a TIFF with pixels of 3 x float64; 8 or 16 bit"),
        (encoded(COLOUR, "JPEG")[:400], "damaged or was cut short"),
        (tiff(COLOUR_16, photometric="rgb")[:9000], "damaged or was cut short"),
        (png_16(COLOUR_16)[:-200], "damaged or was cut short"),
    ],
)
def test_what_is_no_photo_is_refused_in_one_sentence(data, sentence):
    with pytest.raises(InputError, match=sentence) as caught:
        decode_photo("photo.jpg", data)
    assert str(caught.value).startswith("photo.jpg")
    assert "\n" not in str(caught.value)


def test_a_photo_that_is_not_there(tmp_path):
    with pytest.raises(InputError, match="there is no such file"):
        read_photo(tmp_path / "photo.jpg")


MAY_BE_CUT = ("ppm", "bmp", "jpeg 2000", "two colours")
"""The decoder shows what there is of them, or their last part holds no pixels."""


@pytest.mark.parametrize("name", [name for name in LOSSLESS if name not in MAY_BE_CUT])
def test_a_cut_photo_is_noticed(name):
    data, _ = LOSSLESS[name]
    for share in (0.1, 0.5, 0.8):
        with pytest.raises(InputError):
            decode_photo("photo", data[: int(len(data) * share)])


@pytest.mark.slow
def test_large_photos_are_read_without_a_word():
    large = Image.new("1", (12_000, 9_000))  # 108 megapixels: Pillow warns from 89 on
    assert decode_photo("photo.png", encoded(large, "PNG")).pixels.shape == (9_000, 12_000, 3)


def test_reading_changes_no_limit_of_the_process(monkeypatch):
    """Other threads may rely on Pillow's limit while a photo above it is read."""
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 100)
    seen = []
    init = Image.init

    def watched():
        seen.append(Image.MAX_IMAGE_PIXELS)
        return init()

    monkeypatch.setattr(Image, "init", watched)
    file = io.BytesIO()
    Image.fromarray(picture(40, 60)).save(file, "PNG")
    assert decode_photo("photo.png", file.getvalue()).pixels.shape == (40, 60, 3)
    assert seen
    assert set(seen) == {100}


@pytest.mark.parametrize("depth", [8, 10])
def test_a_photo_of_a_phone(depth):
    pillow_heif = pytest.importorskip("pillow_heif")
    top = 2**depth - 1
    smooth = picture(64, 96, dtype=np.uint16) / 65535
    values = np.rint(smooth * top).astype(np.uint16)
    shown = (values << (16 - depth)) if depth > 8 else values.astype(np.uint8)
    mode = "RGB;16" if depth > 8 else "RGB"
    file = io.BytesIO()
    made = pillow_heif.from_bytes(mode=mode, size=(96, 64), data=np.ascontiguousarray(shown).tobytes())
    made.save(file, quality=-1, chroma=444)
    found = decode_photo("IMG_1.HEIC", file.getvalue())
    assert found.pixels.dtype == (np.uint16 if depth > 8 else np.uint8)
    level = found.pixels / np.iinfo(found.pixels.dtype).max
    assert np.abs(level - smooth).max() < 0.02  # the codec's own conversion of colours
    with pytest.raises(InputError, match="a HEIC photo, but damaged"):
        decode_photo("IMG_1.HEIC", file.getvalue()[:300])


def raw_tiff(dng=True):
    """A TIFF as cameras write it: a thumbnail in the first directory, raw pixels in the one below it."""
    import tifffile

    file = io.BytesIO()
    with tifffile.TiffWriter(file) as tiff:
        extra = [(50706, "B", 4, (1, 4, 0, 0), True)] if dng else []
        tiff.write(picture(30, 40), photometric="rgb", subfiletype=1, subifds=1, extratags=extra, metadata=None)
        tiff.write(np.zeros((120, 160), np.uint16), photometric=32803, metadata=None)
    return file.getvalue()


@pytest.mark.parametrize("dng", [True, False])
def test_the_thumbnail_of_a_raw_photo_is_never_taken_for_it(dng):
    pytest.importorskip("rawpy")
    assert min(decode_photo("photo.dng", raw_tiff(dng)).pixels.shape[:2]) > 100  # 160 x 120, perhaps without a rim
    with pytest.raises(InputError, match="a camera's raw photo that cannot be developed"):
        decode_photo("photo.dng", raw_tiff(dng)[:-30_000])
