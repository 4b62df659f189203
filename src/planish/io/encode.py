"""Pixels to the bytes of TIFF, PNG and JPEG: true dpi, colour profile, metadata, as many bits as the format holds."""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from numpy.typing import NDArray
from PIL import Image

from planish.color import to_uint8
from planish.dpi import MM_PER_INCH
from planish.io.metadata import SOFTWARE, Origin, creation_date, xmp_packet
from planish.system import usable_cores
from planish.types import Page

JPEG_QUALITY = 95
"""Of 100, with colours at full resolution: no block can be seen at page size."""
STRIP_BYTES = 1 << 20
"""Of a TIFF, before compression: a core's work for some milliseconds."""

_XRESOLUTION, _YRESOLUTION, _RESOLUTION_UNIT, _SOFTWARE = 0x011A, 0x011B, 0x0128, 0x0131
_DESCRIPTION, _DATE_TIME, _XMP = 0x010E, 0x0132, 0x02BC
_INCH = 2
_BYTE = 1


# TIFF


def tiff_bytes(pages: Sequence[Page], origin: Origin | None = None) -> bytes:
    """Encode pages as TIFF: Deflate, or CCITT G4 where all are of 1 bit."""
    if all(page.pixels.dtype == bool for page in pages):
        return _bilevel_tiff(pages, origin)
    import tifffile

    date = creation_date()
    file = io.BytesIO()
    with tifffile.TiffWriter(file) as writer:
        for page in pages:
            pixels = to_uint8(page.pixels) if page.pixels.dtype == bool else page.pixels
            rows = max(1, STRIP_BYTES // max(1, pixels[:1].nbytes))
            packet = xmp_packet(page.dpi, origin)
            writer.write(
                _deflated_strips(pixels, rows),
                shape=pixels.shape,
                dtype=pixels.dtype,
                photometric="rgb" if pixels.ndim == 3 else "minisblack",
                compression="adobe_deflate",
                predictor=True,
                rowsperstrip=rows,
                resolution=(page.dpi, page.dpi),
                resolutionunit="INCH",
                iccprofile=page.icc,
                software=SOFTWARE,
                description=origin.method if origin else None,
                datetime=date.strftime("%Y:%m:%d %H:%M:%S") if date else None,
                extratags=[(_XMP, _BYTE, len(packet), packet, True)],
                metadata=None,
            )
    return file.getvalue()


def _deflated_strips(pixels: NDArray, rows: int) -> Iterator[bytes]:
    """Strips of so many rows, as differences between neighbours, compressed by all cores.

    Of differences run lengths alone make files as small as zlib's search for repetitions, in half the time.
    """

    def deflated(top: int) -> bytes:
        strip = pixels[top : top + rows].copy()
        strip[:, 1:] -= pixels[top : top + rows, :-1]
        packer = zlib.compressobj(1, strategy=zlib.Z_RLE)
        return packer.compress(strip.tobytes()) + packer.flush()

    with ThreadPoolExecutor(usable_cores()) as pool:
        yield from pool.map(deflated, range(0, len(pixels), rows))


def _bilevel_tiff(pages: Sequence[Page], origin: Origin | None) -> bytes:
    images = [Image.fromarray(page.pixels) for page in pages]
    for image, page in zip(images, pages, strict=True):
        tags: dict[int, Any] = {_SOFTWARE: SOFTWARE, _XMP: xmp_packet(page.dpi, origin)}
        tags |= {_DESCRIPTION: origin.method} if origin else {}
        date = creation_date()
        tags |= {_DATE_TIME: date.strftime("%Y:%m:%d %H:%M:%S")} if date else {}
        image.encoderinfo = {"dpi": (page.dpi, page.dpi), "tiffinfo": tags}
    file = io.BytesIO()
    images[0].save(file, "TIFF", compression="group4", save_all=True, append_images=images[1:], **images[0].encoderinfo)
    return file.getvalue()


# PNG


def png_bytes(
    pixels: NDArray, dpi: float | None = None, icc: bytes | None = None, origin: Origin | None = None
) -> bytes:
    """Encode pixels of 1, 8 or 16 bits as PNG."""
    data = _bilevel_png(pixels) if pixels.dtype == bool else _plain_png(pixels)
    chunks = b""
    if icc:
        chunks += _png_chunk(b"iCCP", b"ICC Profile\0\0" + zlib.compress(icc))
    if dpi:
        per_metre = round(dpi * 1000 / MM_PER_INCH)
        chunks += _png_chunk(b"pHYs", struct.pack(">IIB", per_metre, per_metre, 1))
        chunks += _png_chunk(b"tEXt", b"Software\0" + SOFTWARE.encode("latin-1"))
        chunks += _png_chunk(b"iTXt", b"XML:com.adobe.xmp\0\0\0\0\0" + xmp_packet(dpi, origin))
    if origin:
        chunks += _png_chunk(b"tEXt", b"Description\0" + origin.method.encode("latin-1", "replace"))
    header = 8 + 4 + 4 + 13 + 4  # signature; length, name, content and checksum of IHDR
    return data[:header] + chunks + data[header:]


def _plain_png(pixels: NDArray) -> bytes:
    """By OpenCV, in less than half of Pillow's time, and in 16 bit colours, which Pillow does not write."""
    import cv2

    _, encoded = cv2.imencode(".png", pixels if pixels.ndim == 2 else pixels[..., ::-1])
    return encoded.tobytes()


def _bilevel_png(pixels: NDArray) -> bytes:
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "PNG", compress_level=6)
    return file.getvalue()


def _png_chunk(name: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))


# JPEG


def jpeg_bytes(
    pixels: NDArray, dpi: float | None = None, icc: bytes | None = None, origin: Origin | None = None
) -> bytes:
    """Encode pixels as JPEG, those of 1 and 16 bits as 8."""
    options: dict[str, Any] = {"icc_profile": icc} if icc else {}
    if dpi:  # JFIF holds whole dpi only
        options |= {"dpi": (round(dpi), round(dpi)), "exif": _exif(dpi, origin), "xmp": xmp_packet(dpi, origin)}
    file = io.BytesIO()
    image = Image.fromarray(to_uint8(pixels))
    image.save(file, "JPEG", quality=JPEG_QUALITY, subsampling=0, **options)
    return file.getvalue()


def _exif(dpi: float, origin: Origin | None) -> Image.Exif:
    exif = Image.Exif()
    exif[_XRESOLUTION] = exif[_YRESOLUTION] = dpi
    exif[_RESOLUTION_UNIT], exif[_SOFTWARE] = _INCH, SOFTWARE
    if origin:
        exif[_DESCRIPTION] = origin.method
    if date := creation_date():
        exif[_DATE_TIME] = date.strftime("%Y:%m:%d %H:%M:%S")
    return exif
