"""Pages to their files: true dpi, colour profile, as many bits as the format holds."""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from planish.errors import OutputError
from planish.io.files import write_bytes
from planish.types import Page

JPEG_QUALITY = 95
"""Of 100, with colours at full resolution: no block can be seen at page size."""

_MM_PER_INCH = 25.4
_XRESOLUTION, _YRESOLUTION, _RESOLUTION_UNIT, _SOFTWARE = 0x011A, 0x011B, 0x0128, 0x0131
_INCH = 2
_LONGEST_JPEG = 65_500
_POINTS_PER_INCH = 72.0
_PDF_POINTS = (3.0, 14_400.0)
"""Sides of a PDF page that viewers show."""


def write_page(path: str | Path, page: Page) -> None:
    """Write a page as TIFF, PNG, JPEG or PDF, by the suffix, with its true dpi and colour profile.

    | kind of pixels | TIFF | PNG | JPEG | PDF |
    |---|---|---|---|---|
    | bool | CCITT G4, 1 bit | 1 bit | grey | CCITT G4 |
    | 8 bit | Deflate | 8 bit | quality 95 | JPEG, quality 95 |
    | 16 bit | Deflate | 16 bit | rounded to 8 bit | JPEG, rounded to 8 bit |

    Parameters
    ----------
    path : str or Path
        .tif, .tiff, .png, .jpg, .jpeg or .pdf.
    page : Page

    Raises
    ------
    OutputError
        If the suffix is another, the format cannot hold so many pixels, or the file cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> page = Page(np.full((30, 20), 255, np.uint8), np.ones((30, 20), bool), dpi=300.0)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_page(f"{folder}/page.tif", page)
    ...     with Image.open(f"{folder}/page.tif") as image:
    ...         image.info["dpi"]
    (300.0, 300.0)
    """
    write_pages(path, [page])


def write_pages(path: str | Path, pages: Sequence[Page]) -> None:
    """Write several pages into one TIFF or PDF (one page: also PNG or JPEG). As `write_page`."""
    path = Path(path)
    encode = _encoder(path)
    if not pages:
        raise OutputError(f"{path} was not written: there is no page to write")
    if len(pages) > 1 and encode not in (_tiff, _pdf):
        raise OutputError(f"{path} cannot hold {len(pages)} pages; .tif and .pdf can")
    write_bytes(path, encode(path, pages))


def check_page_name(path: str | Path) -> None:
    """Refuse a name whose suffix is no kind of page, before long work.

    Raises
    ------
    OutputError
        If it is not .tif, .tiff, .png, .jpg, .jpeg or .pdf.
    """
    _encoder(Path(path))


def _encoder(path: Path) -> Callable[[Path, Sequence[Page]], bytes]:
    suffix = path.suffix.lower()
    if suffix not in _ENCODERS:
        raise OutputError(
            f"{path}: a page is written as {', '.join(_ENCODERS)}; {suffix or 'no suffix'} is none of them"
        )
    return _ENCODERS[suffix]


# TIFF


def _tiff(path: Path, pages: Sequence[Page]) -> bytes:
    if all(page.pixels.dtype == bool for page in pages):
        return _bilevel_tiff(pages)
    import tifffile

    file = io.BytesIO()
    with tifffile.TiffWriter(file) as writer:
        for page in pages:
            writer.write(
                _grey(page.pixels),
                photometric="rgb" if page.pixels.ndim == 3 else "minisblack",
                compression="zlib",
                compressionargs={"level": 1},  # level 6 takes 4 times as long for 5 % less
                predictor=True,
                rowsperstrip=max(1, 2**20 // max(1, page.pixels[:1].nbytes)),  # a strip a thread, of about 1 MB
                resolution=(page.dpi, page.dpi),
                resolutionunit="INCH",
                iccprofile=page.icc,
                software=_software(),
                metadata=None,
            )
    return file.getvalue()


def _bilevel_tiff(pages: Sequence[Page]) -> bytes:
    images = [Image.fromarray(page.pixels) for page in pages]
    for image, page in zip(images, pages, strict=True):
        image.encoderinfo = {"dpi": (page.dpi, page.dpi), "software": _software()}
    file = io.BytesIO()
    images[0].save(file, "TIFF", compression="group4", save_all=True, append_images=images[1:], **images[0].encoderinfo)
    return file.getvalue()


# PNG


def _png(path: Path, pages: Sequence[Page]) -> bytes:
    (page,) = pages
    return png_bytes(page.pixels, page.dpi, page.icc)


def png_bytes(pixels: NDArray, dpi: float | None = None, icc: bytes | None = None) -> bytes:
    """Encode pixels of 1, 8 or 16 bits as PNG."""
    if pixels.dtype == np.uint16:
        return _sixteen_bit_png(pixels, dpi, icc)
    file = io.BytesIO()
    level = 6 if pixels.dtype == bool else 1  # for colour, level 6 takes 5 times as long for 10 % less
    Image.fromarray(pixels).save(file, "PNG", compress_level=level, **_info(dpi, icc))
    return file.getvalue()


def _info(dpi: float | None, icc: bytes | None) -> dict[str, Any]:
    """What Pillow is told; it takes None for a profile of its own."""
    return ({"dpi": (dpi, dpi)} if dpi else {}) | ({"icc_profile": icc} if icc else {})


def _sixteen_bit_png(pixels: NDArray, dpi: float | None, icc: bytes | None) -> bytes:
    """OpenCV's PNG with resolution and profile put behind its header: Pillow writes no 16 bit colour."""
    import cv2

    _, encoded = cv2.imencode(
        ".png", pixels if pixels.ndim == 2 else pixels[..., ::-1], [cv2.IMWRITE_PNG_COMPRESSION, 1]
    )
    data = encoded.tobytes()
    chunks = b""
    if icc:
        chunks += _png_chunk(b"iCCP", b"ICC Profile\0\0" + zlib.compress(icc))
    if dpi:
        per_metre = round(dpi * 1000 / _MM_PER_INCH)
        chunks += _png_chunk(b"pHYs", struct.pack(">IIB", per_metre, per_metre, 1))
    header = 8 + 4 + 4 + 13 + 4  # signature; length, name, content and checksum of IHDR
    return data[:header] + chunks + data[header:]


def _png_chunk(name: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))


# JPEG and PDF


def _jpeg(path: Path, pages: Sequence[Page]) -> bytes:
    (page,) = pages
    rows, cols = page.pixels.shape[:2]
    if max(rows, cols) > _LONGEST_JPEG:
        raise OutputError(
            f"{path}: the page has {cols} x {rows} pixels, and a JPEG at most {_LONGEST_JPEG} a side; write .tif"
        )
    return jpeg_bytes(page.pixels, page.dpi, page.icc)


def jpeg_bytes(pixels: NDArray, dpi: float | None = None, icc: bytes | None = None) -> bytes:
    """Encode pixels as JPEG, those of 1 and 16 bits as 8."""
    options = _info(round(dpi) if dpi else None, icc)
    if dpi:  # JFIF holds whole dpi only
        exif = Image.Exif()
        exif[_XRESOLUTION] = exif[_YRESOLUTION] = dpi
        exif[_RESOLUTION_UNIT], exif[_SOFTWARE] = _INCH, _software()
        options["exif"] = exif
    file = io.BytesIO()
    image = Image.fromarray(_eight_bit(_grey(pixels)))
    image.save(file, "JPEG", quality=JPEG_QUALITY, subsampling=0, **options)
    return file.getvalue()


def _pdf(path: Path, pages: Sequence[Page]) -> bytes:
    import img2pdf

    for page in pages:
        _check_pdf_size(path, page)
    parts = [(_tiff if page.pixels.dtype == bool else _jpeg)(path, [page]) for page in pages]
    sizes = iter(pages)

    def layout(width_px: int, height_px: int, dpi: object) -> tuple[float, float, float, float]:
        points = _POINTS_PER_INCH / next(sizes).dpi  # the file's own dpi may be rounded
        return (width_px * points, height_px * points) * 2

    return bytes(img2pdf.convert(parts, layout_fun=layout, creator=_software(), nodate=True))


def _check_pdf_size(path: Path, page: Page) -> None:
    rows, cols = page.pixels.shape[:2]
    width, height = (n / page.dpi * _MM_PER_INCH for n in (cols, rows))
    smallest, largest = (points / _POINTS_PER_INCH * _MM_PER_INCH for points in _PDF_POINTS)
    if not smallest <= min(width, height) <= max(width, height) <= largest:
        raise OutputError(
            f"{path}: the page is {width:.3g} x {height:.3g} mm, a PDF page {smallest:.1f} to {largest:.0f} mm a side;"
            " write .tif"
        )


_ENCODERS: dict[str, Callable[[Path, Sequence[Page]], bytes]] = {
    ".tif": _tiff,
    ".tiff": _tiff,
    ".png": _png,
    ".jpg": _jpeg,
    ".jpeg": _jpeg,
    ".pdf": _pdf,
}


def _grey(pixels: NDArray) -> NDArray:
    """True and False as white and black."""
    return pixels.astype(np.uint8) * np.uint8(255) if pixels.dtype == bool else pixels


def _eight_bit(pixels: NDArray) -> NDArray[np.uint8]:
    if pixels.dtype == np.uint8:
        return pixels
    return ((pixels.astype(np.uint32) + 128) // 257).astype(np.uint8)


def _software() -> str:
    from planish import __version__

    return f"planish {__version__}"
