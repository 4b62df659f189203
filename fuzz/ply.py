"""PLY, ascii and binary, through units and texture coordinates to a scan."""

from harness import SHELF, fuzz, instrumented

scans = instrumented("planish.io.scans")
instrumented("planish.io.ply")

import numpy as np

from planish.io.encode import png_bytes
from planish.io.ply_write import ply_parts
from planish.io.polygons import of_triangles
from samples import picture, sheet_scan

(SHELF / "photo.png").write_bytes(png_bytes(picture()))
mesh = sheet_scan(3, 3).mesh
uv = np.linspace(0, 1, 18).reshape(9, 2)
ASCII = (
    b"ply\nformat ascii 1.0\ncomment TextureFile photo.png\ncomment units: m\nelement vertex 4\nproperty float x\n"
    b"property double y\nproperty short z\nelement face 2\nproperty list uchar int vertex_indices\n"
    b"property list uchar float texcoord\nproperty int texnumber\nend_header\n"
    b"0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2 6 0 0 1 0 1 1 0\n4 0 1 2 3 0 0\n"
)
LITTLE = b"".join(ply_parts(mesh.points, of_triangles(mesh.faces), point_uv=uv, texture="photo.png"))
BIG = (
    b"ply\rformat binary_big_endian 1.0\rcomment TextureFile photo.png\relement vertex 3\rproperty float x\r"
    b"property float y\rproperty float z\rproperty uchar s\rproperty uchar t\relement edge 1\rproperty int a\r"
    b"element face 1\rproperty list uint int64 vertex_index\rend_header\r"
    + np.eye(3, dtype=">f4")[0].tobytes() * 1
    + b"\0\1"
    + np.eye(3, dtype=">f4")[1].tobytes()
    + b"\1\0"
    + np.eye(3, dtype=">f4")[2].tobytes()
    + b"\1\1\0\0\0\7\0\0\0\3"
    + np.arange(3, dtype=">i8").tobytes()
)
words = b"ply format ascii binary_little_endian binary_big_endian 1.0 comment obj_info element vertex face".split()
words += b"property list char uchar short ushort int uint float double int64 uint64 vertex_index texcoord".split()
words += [b"texnumber", b"end_header\n", b"TextureFile photo.png", b"99999999999", b"nan", b"-1", b"\xff\xff\xff\xff"]


def read(data: bytes) -> None:
    (SHELF / "sheet.ply").write_bytes(data)
    scans.read_scan(SHELF / "sheet.ply", inside=SHELF)


fuzz(read, [ASCII, LITTLE, BIG], words)
