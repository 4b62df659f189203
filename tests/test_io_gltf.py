import base64
import json
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from planish.errors import InputError
from planish.io.gltf import read_gltf
from planish.io.gltf_write import glb_bytes, one_uv_per_point
from planish.io.pages import png_bytes
from samples import picture, sheet_scan

TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0]], "<f4")


def document(arrays, primitive=None, **more):
    """A glTF of arrays (name, numbers, kind) in one data URI, with one primitive of the first as positions."""
    blob, views, accessors = b"", [], []
    for _, numbers, kind in arrays:
        component = {"<f4": 5126, "<u4": 5125, "<u2": 5123, "|u1": 5121, "<i2": 5122, "|i1": 5120}[numbers.dtype.str]
        views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": numbers.nbytes})
        accessors.append(
            {"bufferView": len(views) - 1, "componentType": component, "count": len(numbers), "type": kind}
        )
        blob += numbers.tobytes() + bytes(-numbers.nbytes % 4)
    tree = {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": len(blob), "uri": "data:;base64," + base64.b64encode(blob).decode()}],
        "bufferViews": views,
        "accessors": accessors,
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, **(primitive or {})}]}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
    }
    return tree | more


def read(tree, path=Path("sheet.gltf")):
    return read_gltf(path, tree if isinstance(tree, bytes) else json.dumps(tree).encode())


def test_a_triangle_in_metres():
    mesh = read(document([("position", TRIANGLE, "VEC3")]))
    np.testing.assert_array_equal(mesh.points, TRIANGLE)
    assert mesh.polygons.corners.tolist() == [0, 1, 2]
    assert mesh.unit == "m"


def test_nodes_put_their_meshes_in_place():
    turn = [0, 0, np.sqrt(0.5), np.sqrt(0.5)]  # a quarter turn about z
    nodes = [
        {"children": [1, 2], "translation": [10, 0, 0]},
        {"mesh": 0, "rotation": turn, "scale": [2, 2, 2]},
        {"mesh": 0, "matrix": [-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 5, 1]},
    ]
    mesh = read(document([("position", TRIANGLE, "VEC3")], nodes=nodes))
    expected = [[10, 0, 0], [10, 2, 0], [6, 0, 0], [10, 0, 5], [9, 0, 5], [10, 2, 5]]
    np.testing.assert_allclose(mesh.points, expected, atol=1e-12)
    assert mesh.polygons.corners.tolist() == [0, 1, 2, 5, 4, 3]  # a mirrored mesh keeps its printed side


@pytest.mark.parametrize("scale", [1.0, 0.5])
def test_files_of_another_program(scale):
    scan = sheet_scan()
    uv = np.random.default_rng(0).random((len(scan.mesh.points), 2))
    material = trimesh.visual.material.PBRMaterial(baseColorTexture=Image.fromarray(scan.photo))
    visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
    other = trimesh.Trimesh(scan.mesh.points / 1000, scan.mesh.faces, visual=visual, process=False)
    scene = trimesh.Scene()
    scene.add_geometry(other, transform=np.diag([scale, scale, scale, 1.0]))
    mesh = read(scene.export(file_type="glb"))
    np.testing.assert_allclose(mesh.points, scan.mesh.points / 1000 * scale, atol=2e-8)  # float32 of 0.28
    np.testing.assert_array_equal(mesh.polygons.corners.reshape(-1, 3), scan.mesh.faces)
    np.testing.assert_allclose(mesh.polygons.uv, uv, atol=1e-7)
    assert mesh.texture.startswith(b"\x89PNG")


def test_another_program_reads_ours():
    scan = sheet_scan()
    uv = np.random.default_rng(0).random((len(scan.mesh.points), 2))
    data = glb_bytes(scan.mesh.points, scan.mesh.faces, uv, png_bytes(scan.photo))
    other = trimesh.load_scene(trimesh.util.wrap_as_stream(data), file_type="glb", process=False).to_geometry()
    np.testing.assert_allclose(other.vertices, scan.mesh.points / 1000, atol=2e-8)
    np.testing.assert_array_equal(other.faces, scan.mesh.faces)
    np.testing.assert_allclose(other.visual.uv, uv, atol=1e-7)
    assert other.visual.material.baseColorTexture.size == (60, 40)


def test_files_beside_the_document(tmp_path):
    tree = document([("position", TRIANGLE, "VEC3"), ("uv", TRIANGLE[:, :2].copy(), "VEC2")])
    blob = base64.b64decode(tree["buffers"][0]["uri"].partition(",")[2])
    tree["buffers"][0]["uri"] = "the%20sheet.bin"
    tree["meshes"][0]["primitives"][0] = {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": 0}
    tree |= {"materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]}
    tree |= {"textures": [{"source": 0}], "images": [{"uri": "photo%201.png"}]}
    with pytest.raises(InputError, match=r"the sheet\.bin, which does not exist"):
        read(tree, tmp_path / "sheet.gltf")
    (tmp_path / "the sheet.bin").write_bytes(blob)
    assert "photo 1.png, which does not exist" in read(tree, tmp_path / "sheet.gltf").warnings[0].sentence
    (tmp_path / "photo 1.png").write_bytes(b"1")
    mesh = read(tree, tmp_path / "sheet.gltf")
    assert mesh.texture == tmp_path / "photo 1.png"
    np.testing.assert_array_equal(mesh.polygons.uv, [[0, 1], [1, 1], [0, -1]])  # v runs down in the file


def test_packed_numbers():
    whole = np.array([[0, 0, 0], [32767, 0, 0], [0, -32768, 16384]], "<i2")
    tree = document([("position", whole, "VEC3"), ("uv", np.array([[0, 0], [255, 0], [0, 51]], "u1"), "VEC2")])
    tree["accessors"][0]["normalized"] = tree["accessors"][1]["normalized"] = True
    transform = {"offset": [0.5, 0.25], "scale": [0.5, 1]}
    told = {"index": 0, "extensions": {"KHR_texture_transform": transform}}
    tree["meshes"][0]["primitives"][0] = {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": 0}
    tree |= {"materials": [{"pbrMetallicRoughness": {"baseColorTexture": told}}], "textures": [{"source": 0}]}
    tree |= {"images": [{"uri": "data:image/png;base64," + base64.b64encode(png_bytes(picture())).decode()}]}
    tree |= {"extensionsRequired": ["KHR_mesh_quantization", "KHR_texture_transform"]}
    mesh = read(tree)
    np.testing.assert_allclose(mesh.points, [[0, 0, 0], [1, 0, 0], [0, -1, 16384 / 32767]])
    np.testing.assert_allclose(mesh.polygons.uv, [[0.5, 0.75], [1, 0.75], [0.5, 0.55]])
    assert mesh.texture == png_bytes(picture())


def test_strides_and_sparse_points():
    rows = np.zeros(3, [("p", "<f4", 3), ("rest", "<f4", 3)])
    rows["p"] = TRIANGLE
    tree = document([("position", rows["p"].copy(), "VEC3"), ("which", np.array([1], "<u2"), "SCALAR")])
    raw = rows.tobytes() + np.array([1], "<u2").tobytes() + bytes(2) + np.array([9, 9, 9], "<f4").tobytes()
    tree["buffers"] = [{"byteLength": len(raw), "uri": "data:;base64," + base64.b64encode(raw).decode()}]
    tree["bufferViews"] = [
        {"buffer": 0, "byteLength": 72, "byteStride": 24},
        {"buffer": 0, "byteOffset": 72, "byteLength": 2},
        {"buffer": 0, "byteOffset": 76, "byteLength": 12},
    ]
    np.testing.assert_array_equal(read(tree).points, TRIANGLE)
    tree["accessors"][0]["sparse"] = {
        "count": 1,
        "indices": {"bufferView": 1, "componentType": 5123},
        "values": {"bufferView": 2},
    }
    np.testing.assert_array_equal(read(tree).points, [TRIANGLE[0], [9, 9, 9], TRIANGLE[2]])


def test_strips_and_fans_and_other_kinds():
    points = np.c_[np.array([[0, 0], [1, 0], [0, 1], [1, 1], [0, 2]], "<f4"), np.zeros(5, "<f4")].astype("<f4")
    strip = read(document([("position", points, "VEC3")], {"mode": 5}))
    assert strip.polygons.corners.reshape(-1, 3).tolist() == [[0, 1, 2], [2, 1, 3], [2, 3, 4]]
    fan = read(document([("position", points, "VEC3")], {"mode": 6}))
    assert fan.polygons.corners.reshape(-1, 3).tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 4]]
    with pytest.raises(InputError, match="no triangles"):
        read(document([("position", points, "VEC3")], {"mode": 0}))


def test_every_face_keeps_its_own_image():
    uv = np.zeros((3, 2), "<f4")
    tree = document([("position", TRIANGLE, "VEC3"), ("uv", uv, "VEC2")])
    plain = {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}}
    tree["meshes"] = [{"primitives": [{**plain, "material": k} for k in (0, 1, 1)]}]
    tree["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": k}}} for k in (0, 1)]
    tree["textures"] = [{"source": 1}, {"source": 0}]
    image = "data:image/png;base64," + base64.b64encode(png_bytes(picture())).decode()
    tree["images"] = [{"uri": image}, {"uri": "other.png"}]
    mesh = read(tree)
    assert mesh.texture == png_bytes(picture())
    assert mesh.images.of_face.tolist() == [1, 0, 0]
    assert "other.png, which does not exist" in mesh.warnings[0].sentence


def changed(*path_and_value):
    tree = document([("position", TRIANGLE, "VEC3"), ("index", np.array([0, 1, 2], "<u4"), "SCALAR")], {"indices": 1})
    *path, last, value = path_and_value
    place = tree
    for key in path:
        place = place[key]
    place[last] = value
    return tree


@pytest.mark.parametrize(
    ("tree", "sentence"),
    [
        ({}, "no glTF 2.0"),
        ({"asset": {"version": "1.0"}}, "version “1.0”"),
        (b"{nonsense", "no glTF that can be read"),
        (b"[1]", "its JSON is no object"),
        (b"glTF\x02\x00\x00\x00", "cut short"),
        ({"asset": {"version": "2.0"}}, "no triangles"),
        (changed("extensionsRequired", ["EXT_mesh_folding"]), "needs the extension EXT_mesh_folding"),
        (changed("meshes", 0, "primitives", 0, "extensions", {"KHR_draco_mesh_compression": {}}), "bufferViews"),
        (changed("accessors", 0, "count", 4), "does not hold so many"),
        (changed("accessors", 0, "count", 2), "face 0 uses point"),
        (changed("accessors", 0, "count", -1), "its count is -1, and no number from 0"),
        (changed("accessors", 0, "byteOffset", -12), "its byteOffset is -12"),
        (changed("accessors", 0, "componentType", 1), "its componentType is 1"),
        (changed("bufferViews", 0, "byteLength", 10**9), "ends beyond its buffer"),
        (changed("buffers", 0, {"byteLength": 36}), "has no data"),
        (changed("accessors", 0, {"count": 10**12, "type": "VEC3", "componentType": 5126}), "has no data"),
        (changed("nodes", [{"children": [0]}]), "hangs in two places"),
        (changed("nodes", 0, "rotation", [0, 1]), "its rotation is"),
        (changed("scene", 7), "uses 7 of its scenes, of which there are 1"),
        (changed("nodes", 0, "mesh", "first"), "uses “first” of its meshes"),
        (changed("nodes", ["sheet"]), "its nodes are no list of objects"),
        (changed("scene", "main"), "its scene is “main”, and no number"),
        (changed("accessors", 0, "count", 2), "face 0 uses point 2, but its mesh has 2 points"),
    ],
)
def test_what_is_no_mesh_is_refused_in_one_sentence(tree, sentence):
    with pytest.raises(InputError, match=sentence) as caught:
        read(tree)
    assert "sheet.gltf" in str(caught.value)


def test_a_cut_file_is_noticed_wherever_it_is_cut():
    data = glb_bytes(TRIANGLE.astype(float), np.array([[0, 1, 2]], np.int32))
    assert len(read(data).points) == 3
    for cut in range(4, len(data)):
        with pytest.raises(InputError):
            read(data[:cut])


def test_a_chunk_of_an_unknown_kind_is_passed_over():
    data = glb_bytes(TRIANGLE.astype(float), np.array([[0, 1, 2]], np.int32))
    more = data + struct.pack("<II", 4, 0x12345678) + b"abcd"
    assert len(read(more[:8] + struct.pack("<I", len(more)) + more[12:]).points) == 3


def test_points_are_repeated_only_where_a_seam_runs():
    faces = np.array([[0, 1, 2], [0, 2, 4]], np.int32)
    uv = np.array([[0, 0], [1, 0], [1, 1], [0.5, 0.5]])
    repeated, source, point_uv = one_uv_per_point(5, faces, uv, np.array([[0, 1, 2], [3, 2, -1]]))
    assert source.tolist() == [0, 1, 2, 3, 4, 0]
    assert source[repeated].tolist() == faces.tolist()
    assert point_uv[repeated].tolist() == [[[0, 0], [1, 0], [1, 1]], [[0.5, 0.5], [1, 1], [-1, -1]]]
