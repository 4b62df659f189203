"""Images of meshes as programs write them: several of them, material files, names, repeats, colours of points."""

import base64
import json
import unicodedata
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from planish.errors import InputError, OutputError
from planish.io import read_scan, write_scan
from planish.io import scan_photos as photos_module
from planish.io.encode import png_bytes
from planish.pipeline.prepare import prepare
from planish.render import draw
from planish.settings import RenderSettings
from planish.types import Mesh, Scan, Texture
from samples import obj_text, picture, sheet_scan
from shapes import grid

ROWS, COLS = 7, 5
PHOTO = picture(200, 260)


def flat_places():
    """The corners of the sheet on its page of 200 x 280 mm, y down."""
    uv, _ = grid(ROWS, COLS)
    return np.c_[uv[:, 0], 280 - uv[:, 1]]


def page(scan):
    """The page at 50 dpi, the sheet laid out as `arch` bends it."""
    places = np.tile(flat_places(), (len(scan.mesh.points) // (ROWS * COLS), 1))  # glTF repeats the points
    return draw(scan, places, (200.0, 280.0), RenderSettings(dpi=50)).page


def one_photo(folder, photo=PHOTO):
    """The sheet with one photo, as OBJ text without materials: v, vt, and faces as lists of corners."""
    Image.fromarray(photo).save(folder / "photo.png")
    scan = sheet_scan(ROWS, COLS)
    uv = np.c_[flat_places()[:, 0] / 200, 1 - flat_places()[:, 1] / 280]
    return scan.mesh, uv


def lines(mesh, uv, faces, shift=(0, 0)):
    told = ["# units: mm"]
    told += [f"v {x:.9f} {y:.9f} {z:.9f}" for x, y, z in mesh.points]
    told += [f"vt {u + shift[0]:.9f} {v + shift[1]:.9f}" for u, v in uv]
    return "\n".join([*told, *faces]) + "\n"


def all_faces(mesh):
    return ["f " + " ".join(f"{i}/{i}" for i in face) for face in mesh.faces + 1]


def single(folder, mtl, *, extra=(), shift=(0, 0), uv=None, name="page"):
    mesh, places = one_photo(folder)
    head = ["mtllib sheet.mtl", f"usemtl {name}"] if not extra else list(extra)
    (folder / "sheet.mtl").write_text(mtl)
    text = lines(mesh, places if uv is None else uv(places), [*head, *all_faces(mesh)], shift)
    (folder / "sheet.obj").write_text(text)
    return read_scan(folder / "sheet.obj")


@pytest.fixture
def expected(tmp_path_factory):
    """The page drawn from one photo by a plain material file."""
    folder = tmp_path_factory.mktemp("plain")
    return page(single(folder, "newmtl page\nmap_Kd photo.png\n").scan)


def halves(tmp_path):
    """The photo cut into a left and a right image of different sizes; faces are on either side of the cut."""
    mesh, uv = one_photo(tmp_path)
    left = uv[mesh.faces].mean(axis=1)[:, 0] < 0.5
    cut = PHOTO.shape[1] // 2
    (tmp_path / "l.png").write_bytes(png_bytes(np.ascontiguousarray(PHOTO[:, :cut])))
    larger = np.repeat(np.repeat(PHOTO[:, cut:], 2, axis=0), 2, axis=1)
    (tmp_path / "r.png").write_bytes(png_bytes(larger))
    on_left, on_right = np.c_[uv[:, 0] * 2, uv[:, 1]], np.c_[uv[:, 0] * 2 - 1, uv[:, 1]]
    return mesh, left, on_left, on_right


def two_images_obj(tmp_path):
    mesh, left, on_left, on_right = halves(tmp_path)
    (tmp_path / "two.mtl").write_text("newmtl page left\nmap_Kd l.png\nnewmtl page right\nmap_Kd r.png\n")
    n = len(mesh.points)
    faces = ["mtllib two.mtl"]
    for name, mine, first in (("page left", left, 0), ("page right", ~left, n)):
        faces += [f"usemtl {name}"]
        faces += ["f " + " ".join(f"{i}/{i + first}" for i in face) for face in mesh.faces[mine] + 1]
    (tmp_path / "two.obj").write_text(lines(mesh, np.r_[on_left, on_right], faces))
    return tmp_path / "two.obj"


def two_images_ply(tmp_path):
    mesh, left, on_left, on_right = halves(tmp_path)
    head = ["ply", "format ascii 1.0", "comment TextureFile l.png", "comment TextureFile r.png", "comment units: mm"]
    head += [f"element vertex {len(mesh.points)}", *(f"property double {axis}" for axis in "xyz")]
    head += [f"element face {len(mesh.faces)}", "property list uchar int vertex_indices"]
    head += ["property list uchar float texcoord", "property int texnumber", "end_header"]
    body = [" ".join(f"{x:.9f}" for x in point) for point in mesh.points]
    for face, mine in zip(mesh.faces, left, strict=True):
        places = (on_left if mine else on_right)[face].ravel()
        body.append(f"3 {' '.join(map(str, face))} 6 {' '.join(f'{x:.9f}' for x in places)} {0 if mine else 1}")
    (tmp_path / "two.ply").write_text("\n".join([*head, *body]) + "\n")
    return tmp_path / "two.ply"


def gltf(folder, mesh, groups, materials, images, *, colours=None, name="sheet.gltf", **more):
    """A glTF: groups are (faces, uv, material), images file names or bytes."""
    blobs, views, accessors, primitives = [], [], [], []

    def accessor(array, kind, code):
        data = np.ascontiguousarray(array).tobytes()
        views.append({"buffer": 0, "byteOffset": sum(map(len, blobs)), "byteLength": len(data)})
        blobs.append(data + b"\0" * (-len(data) % 4))
        accessors.append({"bufferView": len(views) - 1, "count": len(array), "type": kind, "componentType": code})
        return len(accessors) - 1

    position = accessor((mesh.points / 1000).astype("<f4"), "VEC3", 5126)
    for faces, uv, material in groups:
        attributes = {"POSITION": position}
        if uv is not None:
            attributes["TEXCOORD_0"] = accessor(np.c_[uv[:, 0], 1 - uv[:, 1]].astype("<f4"), "VEC2", 5126)
        if colours is not None:
            attributes["COLOR_0"] = accessor(colours.astype("<f4"), "VEC3", 5126)
        indices = accessor(faces.astype("<u4").reshape(-1, 1), "SCALAR", 5125)
        primitives.append({"attributes": attributes, "indices": indices, "material": material})
    uri = "data:application/octet-stream;base64," + base64.b64encode(b"".join(blobs)).decode()
    tree = {
        "asset": {"version": "2.0"},
        "meshes": [{"primitives": primitives}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"uri": uri, "byteLength": sum(map(len, blobs))}],
        "materials": materials,
        "textures": [{"source": k} for k in range(len(images))],
        "images": [{"uri": image} for image in images],
        **more,
    }
    (folder / name).write_text(json.dumps(tree))
    return folder / name


def base(k):
    return {"pbrMetallicRoughness": {"baseColorTexture": {"index": k}}}


def two_images_gltf(tmp_path):
    mesh, left, on_left, on_right = halves(tmp_path)
    groups = [(mesh.faces[left], on_left, 0), (mesh.faces[~left], on_right, 1)]
    return gltf(tmp_path, mesh, groups, [base(0), base(1)], ["l.png", "r.png"])


MAKERS = [two_images_obj, two_images_ply, two_images_gltf]


@pytest.mark.parametrize("made", MAKERS)
@pytest.mark.parametrize("kept", [1e9, 0])
def test_every_face_is_drawn_from_its_own_image(tmp_path, monkeypatch, expected, made, kept):
    monkeypatch.setattr(photos_module, "KEPT_BYTES", kept)
    found = read_scan(made(tmp_path))
    assert len(found.scan.textures) == 2
    assert found.warnings == []
    drawn = page(found.scan)
    np.testing.assert_array_equal(drawn.known, expected.known)
    off = np.abs(drawn.pixels.astype(int) - expected.pixels)
    # images end at the cut, where the filter takes the rim for what lies beyond; the right one is twice as fine
    assert np.median(off) == 0
    assert np.quantile(off, 0.99) <= 2
    assert off.max() <= 12
    assert {path.name for path in found.sources} >= {"l.png", "r.png"}


def test_an_image_that_is_missing_leaves_its_faces_blank_and_is_told(tmp_path, expected):
    path = two_images_obj(tmp_path)
    (tmp_path / "r.png").unlink()
    found = read_scan(path)
    drawn = page(found.scan)
    assert drawn.known[:, : drawn.known.shape[1] // 2 - 2].all()
    assert not drawn.known[:, drawn.known.shape[1] // 2 + 2 :].any()
    assert any("r.png, which does not exist" in str(warning) for warning in found.warnings)
    assert any("stay blank" in str(warning) for warning in found.warnings)


def test_an_image_that_changes_between_reading_and_drawing_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(photos_module, "KEPT_BYTES", 0)
    found = read_scan(two_images_obj(tmp_path))
    (tmp_path / "r.png").write_bytes(png_bytes(PHOTO))
    with pytest.raises(InputError, match=r"r\.png was changed"):
        page(found.scan)


def test_a_photo_given_beside_several_images_stands_for_one(tmp_path):
    found = read_scan(two_images_obj(tmp_path), photo=tmp_path / "r.png")
    assert not found.scan.textures
    assert any("stands for r.png, and" in str(warning) for warning in found.warnings)


MATERIALS = {
    "plain": "newmtl page\nmap_Kd photo.png\n",
    "small letters": "newmtl page\nmap_kd photo.png\n",
    "capitals": "NEWMTL page\nMAP_KD photo.png\n",
    "tabs and line ends": "newmtl\tpage\r\n\tmap_Kd\tphoto.png\r\n",
    "ambient": "newmtl page\nmap_Ka photo.png\n",
    "emissive": "newmtl page\nmap_Ke photo.png\nmap_bump other.png\n",
    "diffuse before ambient": "newmtl page\nmap_Ka gone.png\nmap_Kd photo.png\n",
    "options": "newmtl page\nmap_Kd -blendu on -clamp off -mm 0 1 -bm 1.0 -imfchan l photo.png\n",
    "quotes": 'newmtl page\nmap_Kd "photo.png"\n',
}


@pytest.mark.parametrize("mtl", MATERIALS.values(), ids=MATERIALS)
def test_the_grammar_of_material_files(tmp_path, expected, mtl):
    found = single(tmp_path, mtl)
    np.testing.assert_array_equal(page(found.scan).pixels, expected.pixels)


@pytest.mark.parametrize("options", ["-o 0.1 0.05 0 -s 0.8 0.9 1", "-s 0.8 0.9 -o 0.1 0.05 -clamp on"])
def test_scale_and_offset_of_a_map(tmp_path, expected, options):
    found = single(
        tmp_path,
        f"newmtl page\nmap_Kd {options} photo.png\n",
        uv=lambda uv: (uv - [0.1, 0.05]) / [0.8, 0.9],
    )
    assert found.warnings == []
    off = np.abs(page(found.scan).pixels.astype(int) - expected.pixels)
    assert off.max() <= 1  # places differ by the digits of the file


@pytest.mark.parametrize(
    "head",
    [
        ["mtllib sheet.mtl", "usemtl Page 1 (left)"],
        ["mtllib gone away.mtl sheet.mtl", "usemtl Page 1 (left)"],
        ["mtllib gone.mtl", "mtllib sheet.mtl", "usemtl Page 1 (left)"],
    ],
)
def test_names_with_blanks_and_several_libraries(tmp_path, expected, head):
    mtl = "newmtl Page 1\nmap_Kd gone.png\nnewmtl Page 1 (left)\nmap_Kd photo.png\n"
    found = single(tmp_path, mtl, extra=head)
    np.testing.assert_array_equal(page(found.scan).pixels, expected.pixels)
    assert all("gone" in str(warning) for warning in found.warnings)


def test_a_library_whose_name_holds_blanks(tmp_path, expected):
    mesh, uv = one_photo(tmp_path)
    (tmp_path / "my scan.mtl").write_text("newmtl page\nmap_Kd photo.png\n")
    (tmp_path / "sheet.obj").write_text(lines(mesh, uv, ["mtllib my scan.mtl", "usemtl page", *all_faces(mesh)]))
    np.testing.assert_array_equal(page(read_scan(tmp_path / "sheet.obj").scan).pixels, expected.pixels)


@pytest.mark.parametrize(
    ("named", "stored"),
    [
        ("Photo.PNG", "photo.png"),
        (unicodedata.normalize("NFC", "Über.png"), unicodedata.normalize("NFD", "Über.png")),
        ("Textures\\Über.PNG", unicodedata.normalize("NFD", "über.png")),
    ],
)
def test_names_that_differ_in_case_or_unicode_form_alone(tmp_path, expected, named, stored):
    mesh, uv = one_photo(tmp_path)
    (tmp_path / "photo.png").rename(tmp_path / stored)
    (tmp_path / "SHEET.mtl").write_text(f"newmtl page\nmap_Kd {named}\n")
    (tmp_path / "sheet.obj").write_text(lines(mesh, uv, ["mtllib Sheet.MTL", "usemtl page", *all_faces(mesh)]))
    found = read_scan(tmp_path / "sheet.obj")
    np.testing.assert_array_equal(page(found.scan).pixels, expected.pixels)


def test_of_two_names_that_differ_in_case_none_is_guessed(tmp_path):
    mesh, uv = one_photo(tmp_path)
    (tmp_path / "PHOTO.png").write_bytes(png_bytes(PHOTO))
    (tmp_path / "sheet.mtl").write_text("newmtl page\nmap_Kd Photo.png\n")
    (tmp_path / "sheet.obj").write_text(lines(mesh, uv, ["mtllib sheet.mtl", "usemtl page", *all_faces(mesh)]))
    found = read_scan(tmp_path / "sheet.obj")
    assert found.scan.photo is None
    assert "there is PHOTO.png, photo.png" in str(found.warnings[0])


def test_what_is_missing_is_named_where_there_is_no_photo(tmp_path):
    mesh, uv = one_photo(tmp_path)
    (tmp_path / "sheet.obj").write_text(lines(mesh, uv, ["mtllib gone.mtl", "usemtl page", *all_faces(mesh)]))
    assert "gone.mtl, which does not exist" in str(read_scan(tmp_path / "sheet.obj").warnings[0])


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be", "utf-32-le", "utf-8-sig"])
def test_text_with_a_byte_order_mark(tmp_path, encoding):
    scan = sheet_scan()
    text, mtl = obj_text(scan)
    (tmp_path / "photo.png").write_bytes(png_bytes(scan.photo))
    (tmp_path / "sheet.obj").write_bytes(("\ufeff" * (encoding != "utf-8-sig") + text).encode(encoding))
    (tmp_path / "sheet.mtl").write_bytes(("\ufeff" * (encoding != "utf-8-sig") + mtl).encode(encoding))
    found = read_scan(tmp_path / "sheet.obj")
    np.testing.assert_array_equal(found.scan.photo, scan.photo)
    np.testing.assert_allclose(found.scan.photo_xy, scan.photo_xy, atol=1e-5)


@pytest.mark.parametrize("shift", [(0, -1), (1, 0), (-3, 7)])
def test_a_chart_a_whole_number_beside_the_image_is_the_same(tmp_path, expected, shift):
    found = single(tmp_path, MATERIALS["plain"], shift=shift)
    assert found.warnings == []
    assert np.abs(page(found.scan).pixels.astype(int) - expected.pixels).max() <= 1  # digits of the file


def test_a_clamped_image_is_not_repeated(tmp_path):
    found = single(tmp_path, "newmtl page\nmap_Kd -clamp on photo.png\n", shift=(0, -1))
    assert any("outside 0 to 1" in str(warning) for warning in found.warnings)
    with pytest.raises(InputError, match="no part of the sheet falls on"):
        page(found.scan)


@pytest.mark.parametrize(("wrap", "repeats"), [(10497, True), (33071, False)])
def test_the_sampler_of_a_gltf_says_whether_images_repeat(tmp_path, wrap, repeats):
    mesh, uv = one_photo(tmp_path)
    path = gltf(
        tmp_path,
        mesh,
        [(mesh.faces, uv + [2, 0], 0)],
        [base(0)],
        ["photo.png"],
        samplers=[{"wrapS": wrap, "wrapT": wrap}],
        textures=[{"source": 0, "sampler": 0}],
    )
    assert (read_scan(path).warnings == []) == repeats


NORMAL = {"normalTexture": {"index": 1}}
MATERIALS_OF_GLTF = {
    "base colour": {**base(0), **NORMAL, "emissiveTexture": {"index": 1}},
    "diffuse": {
        **NORMAL,
        "extensions": {"KHR_materials_pbrSpecularGlossiness": {"diffuseTexture": {"index": 0}}},
        "occlusionTexture": {"index": 1},
    },
    "emissive": {
        **NORMAL,
        "emissiveTexture": {"index": 0},
        "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1], "metallicRoughnessTexture": {"index": 1}},
    },
}


@pytest.mark.parametrize("material", MATERIALS_OF_GLTF.values(), ids=MATERIALS_OF_GLTF)
def test_the_photo_of_a_gltf_is_told_by_its_role(tmp_path, expected, material):
    mesh, uv = one_photo(tmp_path)
    (tmp_path / "normal.png").write_bytes(png_bytes(np.full((40, 60, 3), (128, 128, 255), np.uint8)))
    path = gltf(tmp_path, mesh, [(mesh.faces, uv, 0)], [material], ["photo.png", "normal.png"])
    found = read_scan(path)
    assert np.abs(page(found.scan).pixels.astype(int) - expected.pixels).max() <= 1  # places of float32


def test_a_normal_map_alone_is_no_photo(tmp_path):
    mesh, uv = one_photo(tmp_path)
    path = gltf(tmp_path, mesh, [(mesh.faces, uv, 0)], [{"normalTexture": {"index": 0}}], ["photo.png"])
    found = read_scan(path)
    assert not found.scan.has_picture
    assert "no photos (normal map)" in str(found.warnings[0])


KTX2 = b"\xabKTX 20\xbb\r\n\x1a\n" + bytes(80)


@pytest.mark.parametrize("required", [True, False])
def test_an_image_as_ktx2_hinders_neither_geometry_nor_another_photo(tmp_path, required):
    mesh, uv = one_photo(tmp_path)
    (tmp_path / "photo.ktx2").write_bytes(KTX2)
    more = {"extensionsRequired": ["KHR_texture_basisu"]} if required else {}
    textures = [{"extensions": {"KHR_texture_basisu": {"source": 0}}}]
    path = gltf(tmp_path, mesh, [(mesh.faces, uv, 0)], [base(0)], ["photo.ktx2"], textures=textures, **more)
    found = read_scan(path)
    assert not found.scan.has_picture
    assert "KTX2" in str(found.warnings[0])
    assert read_scan(path, photo=tmp_path / "photo.png").scan.photo_xy is not None


def colours_of(mesh):
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    return (mesh.points - low) / (high - low)


def test_colours_of_points_are_drawn_where_there_is_no_image(tmp_path):
    uv, _ = grid(61, 46)
    places = np.c_[uv[:, 0], 280 - uv[:, 1]]
    scan = sheet_scan(61, 46)
    rgb = np.rint(255 * colours_of(scan.mesh)).astype(int)
    numbers = np.c_[scan.mesh.points, rgb / 255]
    text = "\n".join("v " + " ".join(f"{x:.6f}" for x in row) for row in numbers)
    faces = "\n".join("f " + " ".join(map(str, face)) for face in scan.mesh.faces + 1)
    (tmp_path / "sheet.obj").write_text(f"# units: mm\n{text}\n{faces}\n")
    found = read_scan(tmp_path / "sheet.obj")
    np.testing.assert_array_equal(found.scan.colours, rgb)
    assert any("colours of its points" in str(warning) for warning in found.warnings)
    drawn = draw(found.scan, places, (200.0, 280.0), RenderSettings(dpi=50)).page
    assert drawn.known.all()
    at = np.clip(np.rint(places * 50 / 25.4 - 0.5).astype(int), 0, np.array(drawn.known.shape[::-1]) - 1)
    off = np.abs(drawn.pixels[at[:, 1], at[:, 0]].astype(int) - rgb)
    # the nearest pixel is up to 0.36 mm off; colours run over 255 levels in 200 mm, faster where the sheet is steep
    assert off.max() <= 6


def test_colours_of_a_gltf_are_linear_light(tmp_path):
    scan = sheet_scan(ROWS, COLS)
    half = np.full((len(scan.mesh.points), 3), 0.2140411)  # of the light of white is code value 0.5 in sRGB
    path = gltf(tmp_path, scan.mesh, [(scan.mesh.faces, None, 0)], [{}], [], colours=half)
    colours = read_scan(path).scan.colours
    assert abs(float(np.median(colours)) / 65535 - 0.5) < 1e-3  # the table of codes has 16 bits


def test_a_list_of_texture_coordinates_by_another_name(tmp_path, expected):
    mesh, uv = one_photo(tmp_path)
    head = ["ply", "format ascii 1.0", "comment TextureFile photo.png", "comment units: mm"]
    head += [f"element vertex {len(mesh.points)}", *(f"property double {axis}" for axis in "xyz")]
    head += [f"element face {len(mesh.faces)}", "property list uchar int vertex_indices"]
    head += ["property list uchar float t", "end_header"]
    body = [" ".join(f"{x:.9f}" for x in point) for point in mesh.points]
    body += [f"3 {' '.join(map(str, face))} 6 {' '.join(f'{x:.9f}' for x in uv[face].ravel())}" for face in mesh.faces]
    (tmp_path / "sheet.ply").write_text("\n".join([*head, *body]) + "\n")
    found = read_scan(tmp_path / "sheet.ply")
    assert any("the list “t”" in str(warning) for warning in found.warnings)
    assert np.abs(page(found.scan).pixels.astype(int) - expected.pixels).max() <= 1


@pytest.mark.parametrize("suffix", ["obj", "ply"])
def test_several_textures_are_written_and_read_again(tmp_path, suffix):
    rng = np.random.default_rng(0)
    images = [rng.integers(0, 256, (rows, 16, 3)).astype(np.uint8) for rows in (12, 20)]
    mesh = Mesh([[0, 0, 0], [200, 0, 0], [200, 280, 0], [0, 280, 0], [100, 300, 0]], [[0, 1, 2], [0, 2, 3], [2, 4, 3]])
    places = np.array([[[0, 11], [15, 11], [15, 0]], [[0, 19], [15, 0], [0, 0]], [[3, 4], [5, 6], [7, 8]]], float)
    textures = tuple(Texture(image.shape[:2], 8, lambda image=image: image) for image in images)
    scan = Scan(mesh, photo_xy=places, textures=textures, texture_of_face=np.array([0, 1, 0], np.int32))
    written = write_scan(tmp_path / f"scan.{suffix}", scan)
    assert [file.name for file in written[1:3]] == ["scan-1.jpg", "scan-2.jpg"]
    again = read_scan(tmp_path / f"scan.{suffix}").scan
    np.testing.assert_array_equal(again.mesh.faces, mesh.faces)
    np.testing.assert_array_equal(again.texture_of_face, [0, 1, 0])
    assert [texture.shape_rc for texture in again.textures] == [(12, 16), (20, 16)]
    np.testing.assert_allclose(again.photo_xy, places, atol=1e-3)
    with pytest.raises(OutputError, match="2 textures"):
        write_scan(tmp_path / "scan.glb", scan)


@pytest.mark.parametrize("place", [(1e300, 0), (-1e300, 1e300), (np.nan, np.inf), (0.5, 1e155)])
def test_texture_coordinates_beyond_all_photos_are_unknown(tmp_path, place):
    mesh, uv = one_photo(tmp_path)
    uv[ROWS * COLS // 2] = place
    (tmp_path / "page.mtl").write_text("newmtl page\nmap_Kd photo.png\n")
    text = "\n".join(f"v {x} {y} {z}" for x, y, z in mesh.points)
    text += "\n" + "\n".join(f"vt {u!r} {v!r}" for u, v in uv.tolist())
    head = "# units: mm\nmtllib page.mtl\nusemtl page\n"
    (tmp_path / "scan.obj").write_text(head + text + "\n" + "\n".join(all_faces(mesh)))
    scan = read_scan(tmp_path / "scan.obj").scan
    assert np.isnan(scan.photo_xy).any(axis=1).sum() == 1
    assert np.isnan(replace(scan, photo_xy=np.where(np.isnan(scan.photo_xy), 1e300, scan.photo_xy)).photo_xy).sum() == 2
    assert prepare(scan, "auto").scan.photo is not None  # that no camera is sought for such places
