"""Depth maps: PNG, TIFF, EXR and .npy."""

import io

from harness import SHELF, fuzz, instrumented

depths = instrumented("planish.io.depths", "PIL")

import numpy as np
import OpenEXR
import tifffile

from planish.io.encode import png_bytes

whole = (np.arange(120).reshape(10, 12) * 7 + 400).astype(np.uint16)


def npy(numbers: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.save(file, numbers)
    return file.getvalue()


def tiff(numbers: np.ndarray, **options: object) -> bytes:
    file = io.BytesIO()
    tifffile.imwrite(file, numbers, **options)
    return file.getvalue()


def exr(numbers: np.ndarray) -> bytes:
    path = SHELF / "seed.exr"
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"Z": numbers}).write(str(path))
    return path.read_bytes()


seeds = [
    png_bytes(whole),
    tiff(whole),
    tiff(whole.astype(np.float32) / 1000, compression="zlib"),
    npy(whole),
    exr(whole / np.float32(1000)),
]
seeds += [npy(np.stack([whole, whole]) / 1000.0), npy(np.asfortranarray(whole.astype(">i4")))]
words = [
    b"'descr': '<f8'",
    b"'fortran_order': True",
    b"'shape': (3, 4)",
    b"|O",
    b"<c16",
    b"<m8[s]",
    b"99999999999",
    b"()",
]


def read(data: bytes) -> None:
    path = SHELF / ("depth.npy" if data.startswith(b"\x93NUMPY") else "depth.png")
    path.write_bytes(data)
    depths.read_depths([path])


fuzz(read, seeds, words)
