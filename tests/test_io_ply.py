from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from planish.errors import InputError
from planish.io.ply import read_ply
from planish.io.ply_write import ply_parts
from planish.io.polygons import Polygons
from samples import sheet_scan

POINTS = np.array([[0, 0, 0], [4, 0, 0], [4, 3, 0], [0, 3, 0], [2, 5, 1]], float)
FORMATS = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}


def ply(kind, elements, comments=()):
    """A PLY of elements {name: (properties, rows)}; a list property is (name, count kind, kind), its cell a list."""
    order = FORMATS[kind]
    names = {"u1": "uchar", "i4": "int", "f4": "float", "f8": "double", "u2": "ushort"}
    head = ["ply", f"format {kind} 1.0", *(f"comment {c}" for c in comments)]
    body = b""
    for element, (properties, rows) in elements.items():
        head.append(f"element {element} {len(rows)}")
        for name, *kinds in properties:
            head.append(f"property {'list ' * (len(kinds) == 2)}{' '.join(names[k] for k in kinds)} {name}")
        for row in rows:
            cells = []
            for (_, *kinds), cell in zip(properties, row, strict=True):
                if len(kinds) == 2:
                    cells += [(kinds[0], len(cell)), *((kinds[1], c) for c in cell)]
                else:
                    cells.append((kinds[0], cell))
            if kind == "ascii":
                body += (" ".join(str(value) for _, value in cells) + "\n").encode()
            else:
                body += b"".join(np.array(value, order + k).tobytes() for k, value in cells)
    return "\n".join(head).encode() + b"\nend_header\n" + body


XYZ = [("x", "f4"), ("y", "f4"), ("z", "f4")]
LIST = [("vertex_indices", "u1", "i4")]


def read(data, path=Path("sheet.ply")):
    return read_ply(path, data)


@pytest.mark.parametrize("kind", FORMATS)
def test_points_and_faces_of_mixed_sizes(kind):
    mesh = read(ply(kind, {"vertex": (XYZ, POINTS), "face": (LIST, [[[0, 1, 2, 3]], [[3, 2, 4]]])}))
    np.testing.assert_array_equal(mesh.points, POINTS)
    assert mesh.polygons.sizes.tolist() == [4, 3]
    assert mesh.polygons.corners.tolist() == [0, 1, 2, 3, 3, 2, 4]
    assert mesh.warnings == []


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize("names", [("s", "t"), ("u", "v"), ("texture_u", "texture_v")])
def test_texture_of_points_among_other_columns(tmp_path, kind, names):
    columns = [("nx", "f4"), *XYZ, ("red", "u1"), *((name, "f4") for name in names)]
    rows = [[0, *p, 255, 0.25 * k, 1 - 0.125 * k] for k, p in enumerate(POINTS)]
    faces = [("flags", "u1"), *LIST, ("quality", "f4")]
    (tmp_path / "my photo.png").write_bytes(b"1")
    data = ply(
        kind,
        {"camera": ([("fov", "f8")], [[1.5]]), "vertex": (columns, rows), "face": (faces, [[7, [0, 1, 2], 0.5]])},
        comments=["TextureFile my photo.png", "units: mm"],
    )
    mesh = read(data, tmp_path / "sheet.ply")
    np.testing.assert_array_equal(mesh.polygons.uv[mesh.polygons.uv_corners], [[0, 1], [0.25, 0.875], [0.5, 0.75]])
    assert mesh.texture == tmp_path / "my photo.png"
    assert mesh.unit == "mm"


@pytest.mark.parametrize("kind", FORMATS)
def test_texture_of_face_corners_and_two_images(tmp_path, kind):
    for name in ("a.png", "b.png"):
        (tmp_path / name).write_bytes(b"1")
    properties = [*LIST, ("texcoord", "u1", "f4"), ("texnumber", "i4")]
    rows = [
        [[0, 1, 2], [0, 0, 1, 0, 1, 1], 1],
        [[0, 2, 3], [0, 0, 1, 1, 0, 1], 1],
        [[2, 4, 3], [0.5] * 6, 0],
        [[0, 1, 4], [], 1],
    ]
    data = ply(kind, {"vertex": (XYZ, POINTS), "face": (properties, rows)}, ["TextureFile a.png", "TextureFile b.png"])
    mesh = read(data, tmp_path / "sheet.ply")
    assert mesh.images.files == (tmp_path / "a.png", tmp_path / "b.png")
    assert mesh.images.of_face.tolist() == [1, 1, 0, 1]
    uv = np.vstack([mesh.polygons.uv, [np.nan, np.nan]])[mesh.polygons.uv_corners].reshape(4, 6)
    np.testing.assert_array_equal(uv, [[0, 0, 1, 0, 1, 1], [0, 0, 1, 1, 0, 1], [0.5] * 6, [np.nan] * 6])


def test_a_missing_image_is_said():
    elements = {
        "vertex": ([*XYZ, ("s", "f4"), ("t", "f4")], np.c_[POINTS, POINTS[:, :2]]),
        "face": (LIST, [[[0, 1, 2]]]),
    }
    mesh = read(ply("ascii", elements, ["TextureFile gone.png"]))
    assert "gone.png, which does not exist" in mesh.warnings[0].sentence


@pytest.mark.parametrize("encoding", ["ascii", "binary"])
def test_files_of_another_program(encoding):
    scan = sheet_scan()
    other = trimesh.Trimesh(scan.mesh.points, scan.mesh.faces, process=False)
    mesh = read(other.export(file_type="ply", encoding=encoding))
    np.testing.assert_allclose(mesh.points, scan.mesh.points, atol=2e-5)  # float32, and 8 digits, of up to 280
    np.testing.assert_array_equal(mesh.polygons.corners.reshape(-1, 3), scan.mesh.faces)


def test_another_program_reads_ours():
    scan = sheet_scan()
    polygons = Polygons(np.full(len(scan.mesh.faces), 3, np.int32), scan.mesh.faces.reshape(-1))
    data = b"".join(ply_parts(scan.mesh.points, polygons, face_columns={"strain": np.arange(len(scan.mesh.faces))}))
    other = trimesh.load_mesh(trimesh.util.wrap_as_stream(data), file_type="ply", process=False)
    np.testing.assert_array_equal(other.vertices, scan.mesh.points)
    np.testing.assert_array_equal(other.faces, scan.mesh.faces)


@pytest.mark.parametrize("kind", FORMATS)
def test_a_cut_file_is_noticed_wherever_it_is_cut(kind):
    data = ply(kind, {"vertex": (XYZ, POINTS), "face": (LIST, [[[0, 1, 2, 3]], [[3, 2, 4]]])})
    last = len(data) - (2 if kind == "ascii" else 0)  # an ascii file is whole without its last digit's line end
    for cut in range(4, last):
        with pytest.raises(InputError, match=r"sheet\.ply"):
            read(data[:cut])


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        (b"ply\nformat ascii 1.0\nelement vertex 3\n", "header has no end"),
        (b"ply\nend_header\n", "does not say “format”"),
        (b"ply\nformat ascii 2.0\nend_header\n", "“format ascii 2.0”"),
        (b"ply\nformat ascii 1.0\nelement vertex many\nend_header\n", "“element vertex many”"),
        (b"ply\nformat ascii 1.0\nproperty float x\nend_header\n", "“property float x”"),
        (b"ply\nformat ascii 1.0\nelement vertex 1\nproperty quad x\nend_header\n1\n", "“property quad x”"),
        (b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n", "have no y"),
        (b"ply\nformat ascii 1.0\nend_header\n", "no points"),
        (ply("ascii", {"vertex": (XYZ, POINTS)}), "5 points and no faces"),
        (ply("ascii", {"vertex": (XYZ, POINTS), "face": (LIST, [[[0, 1]]])}), "no faces"),
        (ply("ascii", {"vertex": (XYZ, POINTS), "face": (LIST, [[[0, 1, 5]]])}), "face 0 uses point 5"),
        (ply("ascii", {"vertex": (XYZ, POINTS), "face": (LIST, [[[0, 1, -1]]])}), "face 0 uses point -1"),
        (ply("ascii", {"vertex": (XYZ, POINTS), "face": (LIST, [[[0, 1, 1.5]]])}), "face 0 uses point -1"),
        (ply("ascii", {"vertex": (XYZ, [["0", "one", "2"]])}), "line 1 after the header holds “one”"),
        (ply("ascii", {"vertex": (XYZ, np.full((3, 3), np.nan)), "face": (LIST, [[[0, 1, 2]]])}), "none of its 3"),
    ],
)
def test_what_is_no_mesh_is_refused_in_one_sentence(data, sentence):
    with pytest.raises(InputError, match=sentence):
        read(data)


def test_a_header_that_promises_too_much_is_refused_at_once():
    head = b"ply\nformat binary_little_endian 1.0\nelement vertex 3000000000000\nproperty float x\nproperty float y\n"
    with pytest.raises(InputError, match="cut short"):
        read(head + b"property float z\nend_header\n" + bytes(120))


def test_points_that_are_no_numbers_are_kept():
    points = [["nan", "1", "2"], ["inf", "-inf", "0"], *POINTS.astype(str).tolist()]
    mesh = read(ply("ascii", {"vertex": (XYZ, points), "face": (LIST, [[[2, 3, 4]]])}))
    assert np.isfinite(mesh.points).all(1).tolist() == [False] * 2 + [True] * 5


@given(
    sizes=st.lists(st.integers(3, 6), min_size=1, max_size=12),
    seed=st.integers(0, 2**32 - 1),
    texture=st.sampled_from(["none", "points", "corners"]),
)
def test_what_is_written_is_read_again(sizes, seed, texture):
    rng = np.random.default_rng(seed)
    points = rng.normal(0, 100, (10, 3))
    corners = np.concatenate([rng.permutation(10)[:size] for size in sizes]).astype(np.int32)
    polygons = Polygons(np.array(sizes, np.int32), corners)
    uv = rng.random((10, 2)).astype(np.float32).astype(np.float64)
    if texture == "corners":
        bare = np.repeat(rng.random(len(sizes)) < 0.3, sizes)
        uv_corners = np.where(bare, -1, rng.integers(0, 10, len(corners))).astype(np.int32)
        polygons = Polygons(polygons.sizes, corners, uv, uv_corners)
    data = b"".join(
        ply_parts(
            points,
            polygons,
            point_uv=uv if texture == "points" else None,
            point_columns={"noise": rng.random(10)},
            face_columns={"strain": rng.random(len(sizes)), "red": np.arange(len(sizes), dtype=np.uint8)},
        )
    )
    mesh = read(data)
    np.testing.assert_array_equal(mesh.points, points)
    np.testing.assert_array_equal(mesh.polygons.sizes, polygons.sizes)
    np.testing.assert_array_equal(mesh.polygons.corners, corners)
    if texture != "none" and (texture == "points" or (polygons.uv_corners >= 0).any()):
        expected = uv[corners] if texture == "points" else np.vstack([uv, [np.nan] * 2])[polygons.uv_corners]
        np.testing.assert_array_equal(np.vstack([mesh.polygons.uv, [np.nan] * 2])[mesh.polygons.uv_corners], expected)


def test_faces_of_very_many_corners():
    angle = np.linspace(0, 2 * np.pi, 300, endpoint=False)
    points = np.c_[np.cos(angle), np.sin(angle), 0 * angle]
    polygons = Polygons(np.array([300], np.int32), np.arange(300, dtype=np.int32))
    assert read(b"".join(ply_parts(points, polygons))).polygons.sizes.tolist() == [300]
