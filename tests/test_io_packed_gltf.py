"""glTF packed with Draco and meshopt."""

import json
import struct

import numpy as np
import pytest

from planish.errors import InputError
from planish.io import read_scan
from samples import sheet_scan

MESH = sheet_scan(7, 5).mesh
POINTS = (MESH.points / 1000).astype("<f4")


def glb(tree, blob):
    text = json.dumps({"asset": {"version": "2.0"}, **tree}).encode()
    text += b" " * (-len(text) % 4)
    blob += b"\0" * (-len(blob) % 4)
    head = struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(blob))
    return head + struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(blob), b"BIN\0") + blob


def draco():
    import DracoPy

    blob = DracoPy.encode(POINTS.astype(float), MESH.faces.astype(np.uint32), quantization_bits=16)
    number = next(one["unique_id"] for one in DracoPy.decode(blob).attributes if one["attribute_type"] == 0)
    packed = {"bufferView": 0, "attributes": {"POSITION": number}}
    primitive = {"attributes": {"POSITION": 0}, "indices": 1, "extensions": {"KHR_draco_mesh_compression": packed}}
    tree = {
        "extensionsRequired": ["KHR_draco_mesh_compression"],
        "meshes": [{"primitives": [primitive]}],
        "accessors": [
            {"count": len(POINTS), "type": "VEC3", "componentType": 5126},
            {"count": MESH.faces.size, "type": "SCALAR", "componentType": 5125},
        ],
        "bufferViews": [{"buffer": 0, "byteLength": len(blob)}],
        "buffers": [{"byteLength": len(blob)}],
    }
    return tree, blob


def meshopt(name="EXT_meshopt_compression"):
    import meshoptimizer

    points = meshoptimizer.encode_vertex_buffer(POINTS, len(POINTS), 12)
    index = meshoptimizer.encode_index_buffer(MESH.faces.ravel().astype(np.uint32), MESH.faces.size, len(POINTS))
    gap = b"\0" * (-len(points) % 4)
    blob = points + gap + index
    views = []
    for start, length, mode, stride, count in (
        (0, len(points), "ATTRIBUTES", 12, len(POINTS)),
        (len(points + gap), len(index), "TRIANGLES", 4, MESH.faces.size),
    ):
        packed = {"buffer": 0, "byteOffset": start, "byteLength": length, "byteStride": stride, "mode": mode}
        views.append({"buffer": 1, "byteLength": stride * count, "extensions": {name: {**packed, "count": count}}})
    tree = {
        "extensionsRequired": [name],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "count": len(POINTS), "type": "VEC3", "componentType": 5126},
            {"bufferView": 1, "count": MESH.faces.size, "type": "SCALAR", "componentType": 5125},
        ],
        "bufferViews": views,
        "buffers": [{"byteLength": len(blob)}, {"byteLength": 10**6}],
    }
    return tree, blob


@pytest.mark.parametrize("made", [draco, meshopt])
def test_packed_geometry(tmp_path, made):
    pytest.importorskip("DracoPy" if made is draco else "meshoptimizer")
    (tmp_path / "sheet.glb").write_bytes(glb(*made()))
    found = read_scan(tmp_path / "sheet.glb").scan.mesh
    # Draco renumbers points, and 16 bits of 280 mm are steps of 4 um
    middles = (mesh.points[mesh.faces].mean(axis=1) for mesh in (found, MESH))
    got, wanted = (middle[np.lexsort(np.round(middle, 1).T)] for middle in middles)
    np.testing.assert_allclose(got, wanted, atol=0.01)


@pytest.mark.parametrize("made", [draco, meshopt])
def test_damaged_packed_geometry_is_refused(tmp_path, made):
    pytest.importorskip("DracoPy" if made is draco else "meshoptimizer")
    tree, blob = made()
    (tmp_path / "sheet.glb").write_bytes(glb(tree, blob[:1] + bytes(len(blob) - 1)))
    with pytest.raises(InputError, match=r"sheet\.glb"):
        read_scan(tmp_path / "sheet.glb")


@pytest.mark.parametrize(
    ("which", "changed"),
    [
        (1, {"count": MESH.faces.size - 1}),  # no whole number of triangles: the library would write beyond its memory
        (1, {"filter": "EXPONENTIAL"}),
        (0, {"filter": "OCTAHEDRAL"}),  # of rows of 12 bytes
        (0, {"filter": "QUATERNION"}),
        (0, {"byteStride": 6, "count": 2 * len(POINTS)}),
    ],
)
def test_numbers_that_meshopt_does_not_allow_are_refused_before_it_is_called(tmp_path, which, changed):
    pytest.importorskip("meshoptimizer")
    tree, blob = meshopt()
    tree["bufferViews"][which]["extensions"]["EXT_meshopt_compression"].update(changed)
    (tmp_path / "sheet.glb").write_bytes(glb(tree, blob))
    with pytest.raises(InputError, match="cannot be unpacked"):
        read_scan(tmp_path / "sheet.glb")
