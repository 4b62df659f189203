"""GLB and glTF, through nodes, accessors and images to a scan."""

import struct

from harness import SHELF, fuzz, instrumented

scans = instrumented("planish.io.scans")
instrumented("planish.io.gltf")

import numpy as np

from planish.io.encode import jpeg_bytes
from planish.io.gltf_write import glb_bytes
from samples import picture, sheet_scan

SPLIT = b"\n#bin\n"
"""Inputs with it are JSON and binary, to be packed into a GLB with right lengths; others are files as they are."""

RICH = b"""{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0,1]}],"nodes":[{"mesh":0,"rotation":[0,0,0,1],
"scale":[1,1,-1],"translation":[1,2,3],"children":[2]},{"mesh":1,"matrix":[1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1]},{}],
"meshes":[{"primitives":[{"attributes":{"POSITION":0,"TEXCOORD_0":1},"indices":2,"mode":5,"material":0}]},
{"primitives":[{"attributes":{"POSITION":0},"mode":6}]}],"materials":[{"pbrMetallicRoughness":{"baseColorTexture":
{"index":0,"texCoord":0,"extensions":{"KHR_texture_transform":{"offset":[0,0],"rotation":1,"scale":[1,1]}}}}}],
"textures":[{"source":0,"extensions":{"EXT_texture_webp":{"source":0}}}],"images":[{"bufferView":3,"mimeType":
"image/jpeg"},{"uri":"../a%20b.png"},{"uri":"data:image/png;base64,AAAA"}],"accessors":[{"bufferView":0,"count":4,
"type":"VEC3","componentType":5126,"sparse":{"count":1,"indices":{"bufferView":2,"componentType":5121},"values":
{"bufferView":0}}},{"bufferView":1,"count":4,"type":"VEC2","componentType":5123,"normalized":true},{"bufferView":2,
"byteOffset":0,"count":4,"type":"SCALAR","componentType":5121}],"bufferViews":[{"buffer":0,"byteOffset":0,
"byteLength":48},{"buffer":0,"byteOffset":48,"byteLength":16,"byteStride":4},{"buffer":0,"byteOffset":64,"byteLength":4},
{"buffer":0,"byteOffset":68,"byteLength":LENGTH}],"buffers":[{"byteLength":TOTAL}],"extensionsUsed":[],
"extensionsRequired":["KHR_mesh_quantization"]}"""

scan = sheet_scan(3, 3)
photo = jpeg_bytes(picture(12, 16))
binary = np.arange(12, dtype="<f4").tobytes() + np.arange(8, dtype="<u2").tobytes() + bytes([0, 1, 2, 3]) + photo
rich = RICH.replace(b"LENGTH", b"%d" % len(photo)).replace(b"TOTAL", b"%d" % len(binary)).replace(b"\n", b"")
plain = glb_bytes(scan.mesh.points, scan.mesh.faces, np.linspace(0, 1, 18).reshape(9, 2), photo)
length = struct.unpack_from("<I", plain, 12)[0]
seeds = [plain, plain[20 : 20 + length] + SPLIT + plain[28 + length :], rich + SPLIT + binary]
words = (
    b'"mode": "byteOffset": "byteStride": "count": "sparse": "bufferView": "uri": "indices": "matrix": "scale":'.split()
)
words += (
    b'"normalized":true "children": "source": "texCoord": null true [] {} "" -1 1e999 NaN 99999999999 5120 5121'.split()
)
words += [b"5122", b"5123", b"5125", b"5126", b'"VEC3"', b'"SCALAR"', b'"extensions":{}', SPLIT]


def read(data: bytes) -> None:
    text, split, chunk = data.partition(SPLIT)
    if split:
        text += b" " * (-len(text) % 4)
        chunk += b"\0" * (-len(chunk) % 4)
        head = struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(chunk))
        parts = (struct.pack("<I4s", len(text), b"JSON"), text, struct.pack("<I4s", len(chunk), b"BIN\0"), chunk)
        data = head + b"".join(parts)
    (SHELF / "sheet.glb").write_bytes(data)
    scans.read_scan(SHELF / "sheet.glb", inside=SHELF)


fuzz(read, seeds, words)
