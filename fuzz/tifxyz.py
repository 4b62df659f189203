"""A tifxyz folder in which one file is not what it should be."""

from harness import SHELF, fuzz, instrumented

scans = instrumented("planish.io.scans", "PIL")
instrumented("planish.io.tifxyz", "PIL")

import numpy as np

from planish.io.encode import tiff_bytes
from planish.io.tifxyz import write_tifxyz
from planish.types import Page

NAMES = ("x.tif", "y.tif", "z.tif", "mask.tif", "meta.json")
"""The first byte of an input chooses the file that the others go into."""

grid = np.stack([*np.meshgrid(np.arange(4.0), np.arange(5.0)), np.ones((5, 4))], axis=-1)
grid[0, 0] = np.nan
write_tifxyz(SHELF / "good", grid * 100 + 1, 1.0)
seeds = [bytes([k]) + (SHELF / "good" / name).read_bytes() for k, name in enumerate(NAMES) if name != "mask.tif"]
seeds += [b"\3" + tiff_bytes([Page(np.full((10, 8), 255, np.uint8), np.ones((10, 8), bool), 300.0)])]
words = [b'"format":"tifxyz"', b'"scale":[1,1]', b"II*\0", b"MM\0*", b"NaN", b"null", b"[", b"{"]


def read(data: bytes) -> None:
    path = SHELF / "good" / NAMES[data[0] % len(NAMES) if data else 0]
    kept = path.read_bytes() if path.exists() else None
    path.write_bytes(data[1:])
    try:
        scans.read_scan(path.parent, inside=SHELF)
    finally:
        path.unlink() if kept is None else path.write_bytes(kept)


fuzz(read, seeds, words)
