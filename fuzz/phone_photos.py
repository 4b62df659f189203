"""HEIC and AVIF of phones, raw photos of cameras."""

import io

from harness import fuzz, instrumented

images = instrumented("planish.io.images")
instrumented("planish.io.photo_kinds")

import numpy as np
import pillow_heif
from PIL import Image

from samples import picture
from test_io_images import raw_tiff


def heic(mode: str, pixels: np.ndarray, **options: object) -> bytes:
    file = io.BytesIO()
    rows, cols = pixels.shape[:2]
    pillow_heif.from_bytes(mode=mode, size=(cols, rows), data=pixels.tobytes()).save(file, **options)
    return file.getvalue()


def avif() -> bytes:
    file = io.BytesIO()
    Image.fromarray(picture(32, 48)).save(file, "AVIF")
    return file.getvalue()


seeds = [
    heic("RGB", picture(32, 48), quality=50),
    heic("RGB;16", np.ascontiguousarray(picture(32, 48, dtype=np.uint16)), quality=50),
    avif(),
    raw_tiff(),
    raw_tiff(dng=False),
]
words = (
    b"ftyp heic mif1 avif msf1 meta iloc iprp ipco ispe irot imir clap hvcC av1C colr nclx prof idat grid iref".split()
)
words += [
    b"II*\0",
    b"MM\0*",
    b"\xfe\0\x04\0",
    b"\x23\x80",
    b"FUJIFILMCCD-RAW",
    b"IIRO",
    b"\0\0\0\x01",
    b"\xff\xff\xff\xff",
]


def read(data: bytes) -> None:
    images.decode_photo("photo", data, upright=len(data) % 2 == 1)


fuzz(read, seeds, words)
