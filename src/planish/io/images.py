"""Photos from their files: every kind of pixel becomes 8 or 16 bit colour, and what was lost on the way is said."""

from __future__ import annotations

import io
import logging
import struct
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageCms

from planish.display.one_line import one_line
from planish.errors import InputError
from planish.io.files import read_bytes
from planish.io.photo_kinds import decode_other, other_kind
from planish.io.pipes import is_stream
from planish.io.suppress_stderr import suppress_stderr
from planish.memory import check_memory
from planish.types import Diagnostic, Floats, Pixels

FORMATS = {
    "JPEG": "JPEG",
    "PNG": "PNG",
    "TIFF": "TIFF",
    "WEBP": "WebP",
    "BMP": "BMP",
    "JPEG2000": "JPEG 2000",
    "PPM": "PPM",
    "AVIF": "AVIF",
}
"""What Pillow calls them, and what people do."""

_WANTED = "one of " + ", ".join(FORMATS.values())

MOST_MEGAPIXELS = 400.0
"""A larger photo is refused before it fills the memory: 400 megapixels of 16 bit colour are 2.4 GB."""

PLAUSIBLE_MEGAPIXELS, PLAUSIBLE_PACKING = 16.0, 2000.0
"""A larger image, packed more tightly, was damaged or made to fill the memory: photos are packed into a tenth or a
hundredth of their bytes, and Deflate at its best packs white paper into a thousandth."""

_IMPLAUSIBLE = (
    "{} says that it has {} x {} pixels, but no photo fits so many into {} bytes; is the file damaged or cut short?"
)
_BYTES_PER_PIXEL = {8: 10.0, 16: 16.0}
"""That decoding takes, by the bits of the file's colours: the decoder's pixels and one or two copies of ours."""

FEWEST_PIXELS = 8
"""A photo with fewer pixels across shows no page."""

_ORIENTATION = 0x0112
_PLANAR_CONFIGURATION, _PHOTOMETRIC, _BITS_PER_SAMPLE = 284, 262, 258
_IN_PLANES = 2
_TIFF_MARKS = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_TIFFFILE_ALONE = ("raw", "tiff_adobe_deflate", "tiff_deflate", "packbits")
"""Compressions that tifffile knows without further packages."""

for _decoder in ("PIL", "tifffile"):  # what they log of damaged files is said in one sentence here
    logging.getLogger(_decoder).addHandler(logging.NullHandler())


class Photo(NamedTuple):
    """A photo: pixels (rows, cols, 3) uint8 or uint16, its colour profile (None: sRGB), and what was changed.

    `orientation` is the EXIF orientation in which the pixels are to be shown, 1 where that is as they are.
    """

    pixels: Pixels
    icc: bytes | None
    warnings: list[Diagnostic]
    orientation: int = 1

    def __repr__(self) -> str:
        return one_line(self)


def read_photo(path: str | Path, *, upright: bool = False) -> Photo:
    """Read a photo.

    Grey becomes three equal channels, 16 bit stays 16 bit (except CMYK), a palette is looked up, transparency is
    dropped, CMYK becomes sRGB by its profile. Of a TIFF with several pages the first is read.

    Parameters
    ----------
    path : str or Path
        JPEG, PNG, TIFF, WebP, BMP, JPEG 2000, PPM or AVIF, told by its content; with `planish[photos]` also HEIC, and
        a camera's raw photo (DNG, NEF, CR2, ARW ...), which is developed with the camera's white balance to 16 bit.
    upright : bool
        Turn the photo as its EXIF orientation asks. By default its pixels stay as they are stored, because texture
        coordinates and calibrated cameras count those; a warning says so where that makes a difference.

    Returns
    -------
    Photo
        pixels (rows, cols, 3) uint8 or uint16; icc, the bytes of an RGB colour profile or None; warnings, Diagnostics.

    Raises
    ------
    InputError
        If there is no such file, it is no such image, damaged, cut short, below 8 pixels or above 400 megapixels.
    MissingExtraError
        If it is HEIC or raw, and the library for it is not installed.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     Image.new("L", (40, 30), 128).save(f"{folder}/grey.png")
    ...     read_photo(f"{folder}/grey.png").pixels.shape
    (30, 40, 3)
    """
    path = Path(path)
    return decode_photo(str(path), read_bytes(path), upright=upright)


def decode_photo(name: str, data: bytes, *, upright: bool = False) -> Photo:
    """Read a photo from the bytes of its file; `name` is for messages. As `read_photo`."""
    warnings: list[Diagnostic] = []
    kind = other_kind(name, data)
    if kind is not None:
        with suppress_stderr():
            pixels, icc = decode_other(name, data, kind)
        _check_pixels(name, pixels.shape[1], pixels.shape[0])
        pixels, icc = _three_channels(name, pixels, icc, warnings)
        return Photo(np.ascontiguousarray(pixels), icc, warnings)
    with _decoding(name):
        image = _open_photo(name, data)
        _check_size(name, image, data)
        orientation = _orientation(image)
        image.load()  # finds every damage that Pillow can find
        pixels, icc = _stored_pixels(name, data, image, orientation, warnings)
        pixels, icc = _three_channels(name, pixels, icc, warnings)
        pages = getattr(image, "n_frames", 1) if image.format == "TIFF" else 1
    if pages > 1:
        warnings.append(Diagnostic("several-pages", f"{name} holds {pages} pages; the first was read"))
    if upright:
        pixels, orientation = _turned(pixels, orientation), 1
    elif orientation != 1:
        warnings.append(
            Diagnostic(
                "exif-orientation-ignored",
                f"{name} asks to be shown turned (EXIF orientation {orientation}); its pixels were taken as stored, as "
                "texture coordinates and cameras count them",
            )
        )
    return Photo(np.ascontiguousarray(pixels), icc, warnings, orientation)


def stored_shape(source: Path | bytes) -> tuple[int, int] | None:
    """Rows and columns of an image by its header alone; None where that does not tell."""
    if isinstance(source, Path) and is_stream(source):
        source = read_bytes(source)
    try:
        with suppress_stderr(), Image.open(io.BytesIO(source) if isinstance(source, bytes) else source) as image:
            return image.height, image.width
    except Exception:  # decoders raise nearly every class there is; who reads the image itself says what is wrong
        return None


def decode_grid(name: str, data: bytes, kind: Literal["TIFF", "PNG"] = "TIFF") -> NDArray:
    """Read the numbers of a TIFF or PNG as they are: (rows, cols) or (rows, cols, channels), any type.

    Raises
    ------
    InputError
        If it is none, damaged, cut short, or above 400 megapixels.
    """
    with _decoding(name, f"a {kind}"):
        try:
            image = _open(data, [kind])
        except Image.UnidentifiedImageError:
            if kind != "TIFF" or not data.startswith(_TIFF_MARKS):
                raise
            grid = _grid_by_tifffile(name, data)
        else:
            _check_size(name, image, data, fewest=1)
            image.load()
            grid = np.array(image)
        if grid.ndim not in (2, 3):
            raise InputError(f"{name} holds numbers in the shape {grid.shape}; one number a pixel is wanted")
        return grid


@contextmanager
def _decoding(name: str, wanted: str = _WANTED) -> Iterator[None]:
    """Keep decoders quiet, and make one sentence of whatever a bad file raises."""
    try:
        with suppress_stderr():
            yield
    except InputError:
        raise
    except Image.UnidentifiedImageError:
        raise InputError(f"{name} is no image that can be read; {wanted} is wanted") from None
    except Image.DecompressionBombError:  # WebP's decoder asks for the process's limit itself
        raise InputError(f"{name} says that it has more pixels than are read of a WebP; give it as JPEG") from None
    except MemoryError:
        raise InputError(f"{name} does not fit into the memory; give a smaller photo") from None
    except Exception as problem:  # decoders raise nearly every class there is on damaged files
        reason = " ".join(str(problem).split()) or type(problem).__name__
        raise InputError(f"{name} is damaged or was cut short: {reason}; copy it again") from problem


def _open(data: bytes, kinds: Iterable[str]) -> Image.Image:
    """Open an image as `Image.open` does, without its limit of pixels: that is one for all threads of the process.

    Raises
    ------
    PIL.UnidentifiedImageError
        If it is of none of these kinds.
    """
    Image.preinit()
    Image.init()
    for kind in kinds:
        if kind not in Image.OPEN:  # a Pillow without AVIF or WebP
            continue
        factory, accepts = Image.OPEN[kind]
        if accepts is not None and accepts(data[:16]) is not True:
            continue
        try:
            return factory(io.BytesIO(data), "")
        except (SyntaxError, IndexError, TypeError, struct.error):  # as Pillow says that this is another kind
            continue
    raise Image.UnidentifiedImageError


def _open_photo(name: str, data: bytes) -> Image.Image:
    """Open a photo of any kind; of a TIFF that Pillow does not know, say what its pixels are."""
    try:
        return _open(data, FORMATS)
    except Image.UnidentifiedImageError:
        if not data.startswith(_TIFF_MARKS):
            raise
    import tifffile

    with tifffile.TiffFile(io.BytesIO(data)) as file:
        page = file.pages.first
        found = f"{page.samplesperpixel} x {page.dtype}"
    raise InputError(f"{name} is a TIFF with pixels of {found}; 8 or 16 bit grey or colour is wanted")


def _grid_by_tifffile(name: str, data: bytes) -> NDArray:
    """A TIFF of numbers that Pillow does not know, such as floats of 64 bits."""
    import tifffile

    with tifffile.TiffFile(io.BytesIO(data)) as file:
        page = file.pages.first
        rows, cols = page.imagelength, page.imagewidth
        _check_pixels(name, cols, rows, fewest=1)
        if page.shape not in ((rows, cols), (rows, cols, page.samplesperpixel)):
            raise InputError(f"{name} holds numbers in the shape {page.shape}; one number a pixel is wanted")
        per_pixel = page.samplesperpixel * page.bitspersample / 8
        if rows * cols * per_pixel > PLAUSIBLE_PACKING * len(data):
            raise InputError(_IMPLAUSIBLE.format(name, cols, rows, len(data)))
        check_memory(2 * rows * cols * per_pixel, name, "give a smaller file")
        return np.asarray(page.asarray())


def _check_size(name: str, image: Image.Image, data: bytes, fewest: int = FEWEST_PIXELS) -> None:
    width, height = image.size
    _check_pixels(name, width, height, fewest)
    megapixels = width * height / 1e6
    unpacked = width * height * (1 / 8 if image.mode == "1" else len(image.getbands()))
    if megapixels > PLAUSIBLE_MEGAPIXELS and unpacked > PLAUSIBLE_PACKING * len(data):
        raise InputError(_IMPLAUSIBLE.format(name, width, height, len(data)))
    per_pixel = _BYTES_PER_PIXEL[16 if _has_sixteen_bits(data, image) else 8]
    check_memory(width * height * per_pixel, f"{name} with its {megapixels:.0f} megapixels", "give a smaller photo")


def _check_pixels(name: str, width: int, height: int, fewest: int = FEWEST_PIXELS) -> None:
    megapixels = width * height / 1e6
    if megapixels > MOST_MEGAPIXELS:
        raise InputError(
            f"{name} has {width} x {height} = {megapixels:.0f} megapixels; at most {MOST_MEGAPIXELS:.0f} are read. Give"
            " a smaller photo"
        )
    if min(width, height) < fewest:
        raise InputError(f"{name} is {width} x {height} pixels; a photo of the sheet is wanted")


def _orientation(image: Image.Image) -> int:
    """How the photo asks to be shown, 1 to 8; 1 (as it is stored) also where its EXIF is damaged."""
    try:
        orientation: Any = image.getexif().get(_ORIENTATION)
    except Exception:  # the reader of EXIF raises nearly every class there is; the pixels are what counts
        return 1
    return orientation if orientation in range(2, 9) else 1


def _stored_pixels(
    name: str, data: bytes, image: Image.Image, orientation: int, warnings: list[Diagnostic]
) -> tuple[NDArray, bytes | None]:
    """The pixels (rows, cols[, channels]) as the file has them, not turned, and their colour profile."""
    icc = image.info.get("icc_profile") or None
    pixels: NDArray
    turned_by_decoder = image.format == "TIFF"  # Pillow and OpenCV turn these themselves
    if image.mode.startswith("I;16"):
        pixels = _sixteen_bit_grey(image)
    elif _has_sixteen_bits(data, image):
        known = image.format == "TIFF" and image.info.get("compression") in _TIFFFILE_ALONE
        pixels = _by_tifffile(data, image) if known else _by_opencv(data)
        turned_by_decoder &= not known
    else:
        eight_bit, icc = _to_rgb(name, image, icc, warnings)
        pixels = np.asarray(eight_bit)
    if turned_by_decoder:
        pixels = _turned(pixels, {6: 8, 8: 6}.get(orientation, orientation))
    return pixels, icc


def _sixteen_bit_grey(image: Image.Image) -> NDArray[np.uint16]:
    grey = np.asarray(image).astype(np.uint16)
    white_is_zero = image.format == "TIFF" and _tag(image, _PHOTOMETRIC) == 0
    return np.uint16(65535) - grey if white_is_zero else grey


def _has_sixteen_bits(data: bytes, image: Image.Image) -> bool:
    """Whether the file's colours have 16 bits; Pillow decodes only the upper half."""
    if image.mode not in ("RGB", "RGBA", "LA"):
        return False
    if image.format == "TIFF":
        return set(_tag(image, _BITS_PER_SAMPLE) or ()) == {16}
    return image.format == "PNG" and data[24] == 16  # bit depth in the header


def _tag(image: Image.Image, number: int) -> Any:
    return image.tag_v2.get(number)  # type: ignore[attr-defined]


def _by_opencv(data: bytes) -> NDArray[np.uint16]:
    """16 bit pixels, red first."""
    import cv2

    _check_chunks(data)
    pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if pixels is None or pixels.dtype != np.uint16:
        raise ValueError("its 16 bit pixels cannot be decoded")
    if pixels.ndim == 3 and pixels.shape[2] >= 3:
        pixels = pixels[..., [2, 1, 0, 3][: pixels.shape[2]]]
    return np.asarray(pixels)


def _check_chunks(data: bytes) -> None:
    """Check that no chunk of a PNG claims more bytes than the file has: OpenCV takes the memory before it looks."""
    place = 8  # after the signature
    while place + 8 <= len(data) and data.startswith(b"\x89PNG"):
        length = int.from_bytes(data[place : place + 4], "big")
        if length > len(data):
            raise ValueError(f"one of its chunks claims {length:,} bytes")
        place += length + 12  # with its length, kind and check sum


def _by_tifffile(data: bytes, image: Image.Image) -> NDArray[np.uint16]:
    import tifffile

    pixels = tifffile.imread(io.BytesIO(data), key=0)
    return np.moveaxis(pixels, 0, -1) if _tag(image, _PLANAR_CONFIGURATION) == _IN_PLANES else pixels


def _to_rgb(
    name: str, image: Image.Image, icc: bytes | None, warnings: list[Diagnostic]
) -> tuple[Image.Image, bytes | None]:
    """An 8 bit image as L, LA, RGB or RGBA."""
    if image.mode in ("L", "LA", "RGB", "RGBA"):
        return image, icc
    if image.mode in ("1", "P", "PA", "RGBX", "RGBa", "La"):
        clear = "transparency" in image.info or image.mode in ("PA", "RGBa", "La")
        return image.convert("RGBA" if clear else "RGB"), icc
    if image.mode in ("CMYK", "YCbCr", "LAB"):
        if image.mode == "CMYK":
            how = "by its colour profile" if icc else "without a colour profile, so its colours are rough"
            warnings.append(Diagnostic("cmyk-converted", f"{name} is in CMYK; it was converted to sRGB {how}"))
        return _to_srgb(image, icc), None
    raise InputError(
        f"{name} holds pixels of kind {image.mode} (numbers of 32 bits); 8 or 16 bit grey or colour is wanted"
    )


def _to_srgb(image: Image.Image, icc: bytes | None) -> Image.Image:
    if image.mode == "LAB":
        source = ImageCms.ImageCmsProfile(ImageCms.createProfile("LAB"))
    elif icc and image.mode == "CMYK":
        source = ImageCms.ImageCmsProfile(io.BytesIO(icc))
    else:
        return image.convert("RGB")
    try:
        converted = ImageCms.profileToProfile(image, source, ImageCms.createProfile("sRGB"), outputMode="RGB")
    except ImageCms.PyCMSError:  # a broken profile
        return image.convert("RGB")
    assert converted is not None
    return converted


def _three_channels(
    name: str, pixels: NDArray, icc: bytes | None, warnings: list[Diagnostic]
) -> tuple[NDArray, bytes | None]:
    """Grey repeated, transparency dropped."""
    if pixels.ndim == 2:
        pixels = pixels[..., None]
    colours = 3 if pixels.shape[2] >= 3 else 1
    if pixels.shape[2] > colours:
        clear = int((pixels[..., colours] < np.iinfo(pixels.dtype).max).sum())
        if clear:
            sentence = f"{name} has {clear} transparent pixels; their colours were taken as they are"
            warnings.append(Diagnostic("transparency-dropped", sentence))
    if icc and icc[16:20] != b"RGB ":  # the colour space that the profile is for
        kind = icc[16:20].decode("ascii", "replace").strip()
        sentence = f"{name} has a colour profile for {kind}, which is left out; its colours were taken as sRGB"
        warnings.append(Diagnostic("colour-profile-dropped", sentence))
        icc = None
    if colours == 3:
        return pixels[..., :3], icc
    return np.repeat(pixels[..., :1], 3, axis=2), None


_STEPS = {2: (1, -1), 3: (-1, -1), 4: (-1, 1), 6: (1, -1), 7: (-1, -1), 8: (-1, 1)}
"""Down and across in which an EXIF orientation is read, after rows and columns are swapped from 5 on."""


def _turned(pixels: NDArray, orientation: int) -> NDArray:
    """The pixels as EXIF orientation 1 to 8 asks to show them."""
    if orientation >= 5:
        pixels = pixels.swapaxes(0, 1)
    down, left = _STEPS.get(orientation, (1, 1))
    return pixels[::down, ::left]


def as_stored(shown_xy: Floats, photo: Photo) -> Floats:
    """Columns and rows of a photo's stored pixels, from those (n, 2) of the picture as a viewer shows it.

    Examples
    --------
    >>> upright = Photo(np.zeros((30, 40, 3), np.uint8), None, [], 6)
    >>> as_stored(np.array([[0.0, 0], [29, 5]]), upright).tolist()
    [[0.0, 29.0], [5.0, 0.0]]
    """
    rows, cols = photo.pixels.shape[:2]
    size = np.array([rows, cols] if photo.orientation >= 5 else [cols, rows])
    back = np.array(_STEPS.get(photo.orientation, (1, 1))[::-1]) < 0
    xy = np.where(back, size - 1 - shown_xy, shown_xy)
    return np.asarray(xy[:, ::-1] if photo.orientation >= 5 else xy)
