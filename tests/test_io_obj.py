from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planish.errors import InputError
from planish.io.obj import obj_parts, read_obj
from planish.io.polygons import Polygons, triangulate, uv_of_points
from samples import obj_text, sheet_scan

SQUARE = "v 0 0 0\nv 4 0 0\nv 4 3 0\nv 0 3 0\n"


def read(text, path=Path("sheet.obj")):
    return read_obj(path, text.encode() if isinstance(text, str) else text)


def faces_of(mesh):
    return mesh.polygons.corners.reshape(-1, 3).tolist()


@pytest.mark.parametrize(
    "text",
    [
        SQUARE + "f 1 2 3\nf 1 3 4\n",
        SQUARE + "f -4 -3 -2\nf -4 -2 -1\n",
        SQUARE.replace("4 0 0", "4e0 0.0E+00 -0") + "f 1 2 3\nf 1 3 4\n",
        (SQUARE + "f 1 2 3\nf 1 3 4\n").replace("\n", "\r\n"),
        (SQUARE + "f 1 2 3\nf 1 3 4\n").replace("\n", "\r"),
        "\ufeff# with a mark\n" + SQUARE + "f 1 2 3\nf 1 3 4",
        "o a\n" + SQUARE + "g left\ns off\nf 1 2 3\n\ng right\nf 1 \\\n3 4\n",
        SQUARE.replace("v 4 0 0", "  v\t4 0 0 1.0 # a corner") + "vn 0 0 1\nf 1//1 2//1 3//1\nf 1//1 3//1 4//1\n",
        SQUARE.replace("v 4 0 0", "v 4 0 0 0.5 0.5 0.5") + "f 1 2 3\nf 1 3 4\n",
        SQUARE + "f 1/ 2/ 3/\nf 1// 3// 4//\n",
    ],
)
def test_the_ways_to_write_the_same_square(text):
    mesh = read(text)
    np.testing.assert_array_equal(mesh.points, [[0, 0, 0], [4, 0, 0], [4, 3, 0], [0, 3, 0]])
    assert faces_of(mesh) == [[0, 1, 2], [0, 2, 3]]
    assert mesh.polygons.uv is None
    assert mesh.warnings == []


def test_indices_count_back_from_where_they_stand():
    mesh = read("v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 5 5 5\nv 6 5 5\nv 5 6 5\nf -3 -2 -1\n")
    assert faces_of(mesh) == [[0, 1, 2], [3, 4, 5]]


def test_polygons_stay_polygons_and_corners_keep_their_texture():
    mesh = read(SQUARE + "v 8 0 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0.5 0.5\nf 1/1 2/2 3/3 4/4\nf 2/1 5 3/2\n")
    assert mesh.polygons.sizes.tolist() == [4, 3]
    assert mesh.polygons.uv_corners.tolist() == [0, 1, 2, 3, 0, -1, 1]


def test_all_points_of_doubles_arrive_as_written():
    rng = np.random.default_rng(1)
    points = rng.normal(0, 300, (2000, 3))
    faces = rng.permutation(1998).reshape(-1, 3)
    text = "".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in points.tolist())
    text += "".join(f"f {a} {b} {c}\n" for a, b, c in (faces + 1).tolist())
    mesh = read(text)
    np.testing.assert_allclose(mesh.points, points, rtol=1e-15)  # the reader rounds the last bit its own way
    np.testing.assert_array_equal(faces_of(mesh), faces)


def test_points_that_are_no_numbers_are_not_finite():
    mesh = read("v nan 0 0\nv -1.#IND 0 0\nv inf 1 0\n" + SQUARE + "f 4 5 6\nf 1 5 6\nf 2 3 7\n")
    assert np.isfinite(mesh.points).all(1).tolist() == [False] * 3 + [True] * 4


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("# a letter\nDear Sir, the scan is\n", "is no OBJ: its line 2"),
        ("solid cube\n", "no points"),
        ("\x00\x01\x02", "is no OBJ"),
        ("# nothing\n", "no points"),
        (SQUARE, "4 points and no faces"),
        (SQUARE + "l 1 2 3\n", "no faces"),
        (SQUARE + "f 1 2 3\nf 1 3 5\n", "face 1 uses point 4, but the file has 4 points"),
        (SQUARE + "f 1 2 3\nf 1 3 900000000\n", "face 1 uses point"),
        (SQUARE + "f 1 2 -5\n", "was the file"),
        (SQUARE + "f 0 1 2\n", "was the file"),
        (SQUARE + "f 1 2\n", "line 5 reads “f 1 2”"),
        (SQUARE + "f 1 2 three\n", "line 5"),
        (SQUARE + "f 1 2 99999999999\n", "line 5"),
        ("v 0 0\n" + SQUARE + "f 1 2 3\n", "line 1 reads “v 0 0”"),
        ("v 0 0 1,5\n" + SQUARE + "f 1 2 3\n", "line 1"),
        ("v nan nan nan\nv inf 0 0\nv 0 nan 0\nf 1 2 3\n", "none of its 3 points"),
    ],
)
def test_what_is_no_mesh_is_refused_in_one_sentence(text, sentence):
    with pytest.raises(InputError, match=sentence) as caught:
        read(text)
    assert "sheet.obj" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_cut_in_half_is_noticed():
    text, _ = obj_text(sheet_scan(30, 20))
    for cut in (len(text) // 2, len(text) // 3, int(len(text) * 0.9)):
        with pytest.raises(InputError, match="cut short"):
            read(text[:cut])


def test_a_file_cut_at_a_line_end_is_suspected():
    text, _ = obj_text(sheet_scan(30, 20))
    lines = text.splitlines(keepends=True)
    mesh = read("".join(lines[: -3 * 2 * 29 * 19 // 4]))
    assert any("was the file cut short?" in warning.sentence for warning in mesh.warnings)


def test_every_face_keeps_its_own_image(tmp_path):
    (tmp_path / "sheet.mtl").write_text("newmtl a\nmap_Kd one.png\nnewmtl b\nmap_Kd two.png\nnewmtl c\n")
    for name in ("one.png", "two.png"):
        (tmp_path / name).write_bytes(b"1")
    faces = "usemtl a\nf 1/1 2/1 3/1\nusemtl b\nf 1/1 3/1 4/1\nf 1/1 2/1 4/1\nusemtl c\nf 2/1 3/1 4/1\n"
    mesh = read("mtllib sheet.mtl\n" + SQUARE + "vt 0 0\n" + faces, tmp_path / "sheet.obj")
    assert mesh.images.files == (tmp_path / "one.png", tmp_path / "two.png")
    assert mesh.images.of_face.tolist() == [0, 1, 1, -1]
    assert mesh.texture == tmp_path / "two.png"
    assert mesh.warnings == []


def test_missing_material_and_image_are_said_and_the_geometry_is_read(tmp_path):
    text = "mtllib sheet.mtl\nusemtl a\n" + SQUARE + "vt 0 0\nf 1/1 2/1 3/1\nf 1/1 3/1 4/1\n"
    mesh = read(text, tmp_path / "sheet.obj")
    assert "sheet.mtl, which does not exist" in mesh.warnings[0].sentence
    (tmp_path / "sheet.mtl").write_text("newmtl a\nmap_Kd photo.jpg\n")
    mesh = read(text, tmp_path / "sheet.obj")
    assert "photo.jpg, which does not exist" in mesh.warnings[0].sentence
    assert mesh.texture is None
    assert len(mesh.points) == 4


def test_an_image_named_by_another_computers_path_is_found_beside(tmp_path):
    (tmp_path / "sheet.mtl").write_text("newmtl a\nmap_Kd C:\\scans\\my photo.jpg\n")
    (tmp_path / "my photo.jpg").write_bytes(b"1")
    text = "mtllib sheet.mtl\nusemtl a\n" + SQUARE + "vt 0 0\nf 1/1 2/1 3/1\nf 1/1 3/1 4/1\n"
    assert read(text, tmp_path / "sheet.obj").texture == tmp_path / "my photo.jpg"


def test_the_unit_that_a_comment_names():
    assert read("# units: cm\n" + SQUARE + "f 1 2 3\n").unit == "cm"
    assert read(SQUARE + "f 1 2 3\n").unit is None


polygon_lists = st.lists(st.integers(3, 6), min_size=1, max_size=12)


@given(sizes=polygon_lists, seed=st.integers(0, 2**32 - 1), textured=st.booleans())
def test_what_is_written_is_read_again(sizes, seed, textured):
    rng = np.random.default_rng(seed)
    points = rng.normal(0, 100, (10, 3)).round(6)
    corners = np.concatenate([rng.permutation(10)[:size] for size in sizes]).astype(np.int32)
    polygons = Polygons(np.array(sizes, np.int32), corners)
    if textured:
        uv = rng.random((7, 2)).round(8)
        uv_corners = rng.integers(0, 7, len(corners)).astype(np.int32)
        bare = np.repeat(rng.random(len(sizes)) < 0.3, sizes)
        polygons = Polygons(polygons.sizes, corners, uv, np.where(bare, -1, uv_corners).astype(np.int32))
    mesh = read(b"".join(obj_parts(points, polygons)))
    np.testing.assert_allclose(mesh.points, points, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(mesh.polygons.sizes, polygons.sizes)
    np.testing.assert_array_equal(mesh.polygons.corners, polygons.corners)
    if textured and (polygons.uv_corners >= 0).any():
        np.testing.assert_array_equal(mesh.polygons.uv_corners, polygons.uv_corners)
        np.testing.assert_allclose(mesh.polygons.uv, polygons.uv, rtol=0, atol=1e-12)


def test_concave_polygons_are_cut_inside():
    arrow = np.array([[0, 0, 0], [4, 0, 0], [4, 4, 0], [3.9, 0.1, 0], [0, 0.2, 0]], float)
    cut = triangulate(arrow, Polygons(np.array([5], np.int32), np.arange(5, dtype=np.int32)))
    a, b, c = (arrow[cut[:, k]] for k in range(3))
    areas = np.cross(b - a, c - a)[:, 2] / 2
    x, y = arrow[:, 0], arrow[:, 1]
    assert (areas > 0).all()
    assert areas.sum() == pytest.approx((x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2)


def test_points_with_one_texture_place_are_told_from_seams():
    corners = np.array([0, 1, 2, 0, 2, 3], np.int32)
    sizes = np.array([3, 3], np.int32)
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0], [0.5, 0.5]], float)
    same = Polygons(sizes, corners, uv, np.array([0, 1, 2, 4, 2, 3], np.int32))  # row 4 is equal to row 0
    assert uv[uv_of_points(same, 4)].tolist() == [[0, 0], [1, 0], [1, 1], [0, 1]]
    seam = Polygons(sizes, corners, uv, np.array([0, 1, 2, 5, 2, 3], np.int32))
    assert uv_of_points(seam, 4) is None
    half = Polygons(sizes, corners, uv, np.array([0, 1, 2, -1, -1, -1], np.int32))
    assert uv_of_points(half, 4) is None
