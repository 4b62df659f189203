"""Geometry packed with Draco or meshopt inside a GLB: the packed bytes, and the numbers that say how to unpack them."""

import json

from harness import SHELF, fuzz, instrumented

scans = instrumented("planish.io.scans")
instrumented("planish.io.gltf")
instrumented("planish.io.gltf_packed")

from test_io_packed_gltf import draco, glb, meshopt

SPLIT = b"\n#bin\n"
"""Before it the JSON of the file, after it the binary; lengths of the whole are made right."""

seeds = [
    json.dumps(tree).encode() + SPLIT + blob for tree, blob in (draco(), meshopt(), meshopt("KHR_meshopt_compression"))
]
words = (
    b'"mode": "filter": "count": "byteStride": "byteLength": "attributes": "TRIANGLES" "INDICES" "OCTAHEDRAL"'.split()
)
words += b'"QUATERNION" "EXPONENTIAL" "POSITION": DRACO -1 0 1e999 4294967295 2147483648 16 null [] {}'.split()
words += [SPLIT, b"\xa0", b"\xa1", b"\xe1", b"\xd1"]


def read(data: bytes) -> None:
    text, _, blob = data.partition(SPLIT)
    try:
        tree = json.loads(text)
    except (ValueError, RecursionError):
        return
    if isinstance(tree, dict):
        (SHELF / "sheet.glb").write_bytes(glb(tree, blob))
        scans.read_scan(SHELF / "sheet.glb", inside=SHELF)


fuzz(read, seeds, words)
