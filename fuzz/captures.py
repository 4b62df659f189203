"""A folder of photos in which names and one photo are not what they should be."""

import shutil

from harness import SHELF, fuzz, instrumented

captures = instrumented("planish.io.captures")
instrumented("planish.io.images", "PIL")

from planish.io.encode import png_bytes
from samples import picture

good = png_bytes(picture(10, 12))
seeds = [b"2.png\n" + good, "x²٣10.tif\n".encode() + png_bytes(picture(10, 12, 1)[..., 0])]
words = [b"\n", b"..", b"/", b".jpg", b"\xff", b"\xc2\xb2", b"99999999999999999999"]


def read(data: bytes) -> None:
    name, _, content = data.partition(b"\n")
    folder = SHELF / "tried"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    (folder / "1.png").write_bytes(good)
    safe = bytes(byte for byte in name if byte not in b"/\0")[:100].decode("utf-8", "surrogateescape").lstrip(".")
    (folder / (safe + ".png")).write_bytes(content)
    captures.read_captures([folder])


fuzz(read, seeds, words)
