"""Photos of every codec, and the focal length that their EXIF tells."""

import io
import struct
import zlib

from harness import fuzz, instrumented

images = instrumented("planish.io.images", "PIL", "tifffile")
exif = instrumented("planish.io.exif", "PIL")

import numpy as np
import tifffile
from PIL import Image, ImageCms

from planish.io.encode import jpeg_bytes, png_bytes
from samples import picture

SIGNATURE = b"\x89PNG\r\n\x1a\n"
ICC = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()


def saved(kind: str, image: Image.Image, **options: object) -> bytes:
    file = io.BytesIO()
    image.save(file, kind, **options)
    return file.getvalue()


def tiff(pixels: np.ndarray, **options: object) -> bytes:
    file = io.BytesIO()
    tifffile.imwrite(file, pixels, **options)
    return file.getvalue()


def with_right_checksums(data: bytes) -> bytes:
    """A PNG whose chunks have the lengths and checksums of what they hold, so that the decoder looks further."""
    parts, at = [SIGNATURE], len(SIGNATURE)
    while at + 8 <= len(data):
        length = min(struct.unpack_from(">I", data, at)[0], len(data) - at - 8)
        chunk = data[at + 4 : at + 8 + length]
        parts.append(struct.pack(">I", length) + chunk + struct.pack(">I", zlib.crc32(chunk)))
        at += 12 + length
    return b"".join(parts)


def told(tag: int, value: object) -> Image.Exif:
    known = Image.Exif()
    known[0x0112] = 6
    known.get_ifd(0x8769)[tag] = value
    return known


colour, deep = picture(12, 16), picture(12, 16, dtype=np.uint16)
image = Image.fromarray(colour)
palette, grey, clear = image.quantize(8), image.convert("L"), image.convert("RGBA")
seeds = [
    jpeg_bytes(colour, 300, ICC[:200]),
    saved("JPEG", image, progressive=True, exif=told(0xA405, 28)),
    saved("JPEG", image.convert("CMYK"), exif=told(0x920A, 4.2)),
    png_bytes(colour, 300, ICC),
    png_bytes(deep),
    saved("PNG", palette, transparency=1),
    saved("PNG", clear),
    saved("PNG", image.convert("1")),
    *(saved("TIFF", image, compression=name) for name in ("raw", "tiff_lzw", "jpeg", "packbits", "tiff_adobe_deflate")),
    saved("TIFF", image.convert("1"), compression="group4"),
    saved("TIFF", image.convert("LAB")),
    saved("TIFF", palette),
    tiff(deep, photometric="rgb"),
    tiff(deep[..., 0], photometric="miniswhite"),
    tiff(np.moveaxis(deep, 2, 0).copy(), photometric="rgb", planarconfig=2, compression="zlib", predictor=True),
    tiff(np.zeros((32, 32, 3), np.uint16), photometric="rgb", tile=(16, 16), bigtiff=True),
    saved("WEBP", image, exif=told(0xA405, 28)),
    saved("WEBP", clear, lossless=True),
    saved("BMP", image),
    saved("BMP", palette),
    saved("JPEG2000", image),
    saved("PPM", image),
    saved("PPM", grey),
    b"P3 8 8 255 " + b"1 2 3 " * 64,
]
words = b"IHDR PLTE tRNS iCCP eXIf zTXt acTL fdAT II*\0 MM\0* VP8L VP8X ALPH P6 P4".split()
words += b"\xff\xda \xff\xc4 \xff\xe1\0\x20Exif\0\0 \xff\x4f\xff\x51 \xff\xff\xff\xff".split()


def read(data: bytes) -> None:
    for file in [data, with_right_checksums(data)] if data.startswith(SIGNATURE) else [data]:
        images.decode_photo("photo", file, upright=len(data) % 2 == 1)
        exif.focal_length_px(io.BytesIO(file))


fuzz(read, seeds, words)
