"""Scans from strangers: what a mesh names is read only from within the folder that is given."""

import json

import pytest
from PIL import Image

from planish.errors import InputError
from planish.io import read_scan, write_scan
from planish.types import Scan
from samples import obj_text, sheet_scan


def outside_of(folder, kind):
    """A scan in `folder` that names a file above it, and the sentence that is said where it may not be read."""
    scan = sheet_scan()
    Image.fromarray(scan.photo).save(folder.parent / "photo.png")
    obj, mtl = obj_text(scan, "../photo.png")
    texture = b"comment TextureFile ../photo.png\n"
    if kind == "link":
        (folder / "photo.png").symlink_to(folder.parent / "photo.png")
        mtl = "newmtl page\nmap_Kd photo.png\n"
    if kind == "absolute":
        mtl = f"newmtl page\nmap_Kd {folder.parent / 'photo.png'}\n"
    if kind == "ply":
        path = write_scan(folder / "sheet.ply", Scan(scan.mesh, scan.photo, scan.photo_xy))[0]
        path.write_bytes(path.read_bytes().replace(b"comment TextureFile sheet.jpg\n", texture))
        return path
    (folder / "sheet.obj").write_text(obj)
    (folder / "sheet.mtl").write_text(mtl)
    if kind == "mtllib":
        (folder / "sheet.mtl").rename(folder.parent / "sheet.mtl")
        (folder / "sheet.obj").write_text(obj.replace("sheet.mtl", "../sheet.mtl"))
    return folder / "sheet.obj"


@pytest.mark.parametrize("kind", ["mtl", "absolute", "link", "mtllib", "ply"])
def test_files_outside_of_the_folder_are_read_only_where_that_is_allowed(tmp_path, kind):
    (tmp_path / "upload").mkdir()
    path = outside_of(tmp_path / "upload", kind)
    assert read_scan(path).scan.photo is not None
    assert read_scan(path, inside=tmp_path).scan.photo is not None
    found = read_scan(path, inside=tmp_path / "upload")
    assert found.scan.photo is None
    assert "does not exist" in found.warnings[0].sentence


def test_buffers_of_a_gltf_outside_of_the_folder(tmp_path):
    (tmp_path / "upload").mkdir()
    glb = write_scan(tmp_path / "sheet.glb", Scan(sheet_scan().mesh))[0].read_bytes()
    length = int.from_bytes(glb[12:16], "little")
    tree = json.loads(glb[20 : 20 + length])
    (tmp_path / "sheet.bin").write_bytes(glb[28 + length :])
    tree["buffers"][0]["uri"] = "../sheet.bin"
    path = tmp_path / "upload" / "sheet.gltf"
    path.write_text(json.dumps(tree))
    assert len(read_scan(path, inside=tmp_path).scan.mesh.points) == 35
    with pytest.raises(InputError, match=r"\.\./sheet\.bin, which does not exist"):
        read_scan(path, inside=tmp_path / "upload")


def test_layers_of_a_usd_outside_of_the_folder(tmp_path):
    (tmp_path / "upload").mkdir()
    points, faces = sheet_scan().mesh.points, sheet_scan().mesh.faces
    (tmp_path / "secret.usda").write_text(
        f"""#usda 1.0
def Mesh "sheet"
{{
    point3f[] points = {[tuple(p) for p in points.tolist()]}
    int[] faceVertexCounts = {[3] * len(faces)}
    int[] faceVertexIndices = {faces.ravel().tolist()}
}}
"""
    )
    path = tmp_path / "upload" / "sheet.usda"
    path.write_text(f"#usda 1.0\n(\n    subLayers = [@{tmp_path}/secret.usda@]\n)\n")
    assert len(read_scan(path, units="mm").scan.mesh.points) == len(points)
    assert len(read_scan(path, units="mm", inside=tmp_path).scan.mesh.points) == len(points)
    with pytest.raises(InputError, match=r"secret\.usda, which lies outside of the folder"):
        read_scan(path, units="mm", inside=tmp_path / "upload")
