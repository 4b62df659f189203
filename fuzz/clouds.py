"""Point clouds of every kind: PLY, PCD, E57, LAS, LAZ, PTX and plain text."""

import io

from harness import SHELF, fuzz, instrumented

clouds = instrumented("planish.io.clouds")
for name in ("cloud_text", "cloud_pcd", "cloud_ply", "cloud_las", "cloud_e57", "ply"):
    instrumented(f"planish.io.{name}", "laspy", "pypcd4")

import laspy
import numpy as np
import pye57

xyz = np.array([[0.0, 0, 4], [1, 0, 4], [0, 1, 4], [1, 1, 5]])

PCD = (
    b"# .PCD v0.7\nVERSION 0.7\nFIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F U\nCOUNT 1 1 1 1\nWIDTH 2\nHEIGHT 2\n"
    b"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 4\nDATA "
)
RANGE_GRID = (
    b"ply\nformat ascii 1.0\nobj_info num_cols 2\nobj_info num_rows 2\nelement vertex 3\nproperty float x\n"
    b"property float y\nproperty float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
    b"element range_grid 4\nproperty list uchar int vertex_indices\nend_header\n"
    b"0 0 4 9 9 9\n1 0 4 9 9 9\n0 1 4 9 9 9\n1 0\n1 1\n0\n1 2\n"
)


def las(compressed: bool) -> bytes:
    cloud = laspy.create(point_format=2, file_version="1.2")
    cloud.header.scales = [0.001] * 3
    cloud.x, cloud.y, cloud.z = xyz.T
    cloud.red = cloud.green = cloud.blue = np.arange(4, dtype=np.uint16) * 1000
    file = io.BytesIO()
    cloud.write(file, do_compress=compressed)
    return file.getvalue()


def e57() -> bytes:
    path = SHELF / "seed.e57"
    with pye57.E57(str(path), mode="w") as file:
        columns = dict(zip(("cartesianX", "cartesianY", "cartesianZ"), xyz.T, strict=True))
        file.write_scan_raw({**columns, "intensity": np.linspace(0, 1, 4)})
    return path.read_bytes()


rows = np.zeros(4, [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("rgb", "<u4")])
rows["z"] = 4
seeds = [
    b"# units: m\n0;0;400\n1;0;400\n",
    b"0 0 400 1 2 3\n1 0 400 4 5 6\n0 1 400 7 8 9\n",
    b"2\n2\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n" + b"0 0 4 0.5\n" * 4,
    PCD + b"ascii\n" + b"0 0 4 255\n" * 4,
    PCD + b"binary\n" + rows.tobytes(),
    RANGE_GRID,
    las(False),
    las(True),
    e57(),
]
words = (
    b"VERSION FIELDS SIZE TYPE COUNT WIDTH HEIGHT VIEWPOINT POINTS DATA ascii binary binary_compressed nan inf".split()
)
words += (
    b"range_grid num_cols num_rows element camera viewportx viewporty LASF ASTM-E57 99999999999 -1 1e999 , ; \t".split()
)


def read(data: bytes) -> None:
    path = SHELF / "cloud"
    path.write_bytes(data)
    clouds.read_cloud(path)


fuzz(read, seeds, words)
