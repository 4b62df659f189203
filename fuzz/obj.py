"""OBJ with its MTL and image, through units and texture coordinates to a scan."""

from harness import SHELF, fuzz, instrumented

scans = instrumented("planish.io.scans")
instrumented("planish.io.obj")

from planish.io.encode import png_bytes
from samples import obj_text, picture, sheet_scan

SPLIT = b"\n#mtl\n"
"""What follows goes into the MTL."""

(SHELF / "photo.png").write_bytes(png_bytes(picture()))
obj, mtl = obj_text(sheet_scan(3, 3))
seeds = [
    (obj + SPLIT.decode() + mtl).encode(),
    b"# units: inch\nv 0 0 0\nv 8 0 0 1 1 1\nv 8 11 .5e0\nv nan 11 0\ng a b\ns 1\nf 1//1 2/2 3 -1\nl 1 2\n",
    b"mtllib sheet.mtl b.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0 \\\n 1\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\r\nusemtl b\rf 3 2 1\n"
    + SPLIT
    + b"newmtl a\nmap_Kd -clamp on -o 1 1 1 ../photo.png\nnewmtl b\nmap_Kd C:\\x\\photo.png\nd 0.5\nillum 2\n",
]
words = b"v vt vn f g o s l p usemtl mtllib newmtl map_Kd map_Ka map_Bump -o -s -bm Kd nan inf -1 / //".split()
words += [b"# units=m", b"1e999", b" 99999999999", b"\\\n", b"\r", b"\xef\xbb\xbf", SPLIT]


def read(data: bytes) -> None:
    text, _, materials = data.partition(SPLIT)
    (SHELF / "sheet.obj").write_bytes(text)
    (SHELF / "sheet.mtl").write_bytes(materials)
    scans.read_scan(SHELF / "sheet.obj", inside=SHELF)


fuzz(read, seeds, words)
