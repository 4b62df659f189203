"""`planish flatten` for teams that unwrap: texture coordinates, distortion of faces, same order."""

import json

import numpy as np
import pytest

import planish
from planish.cli.main import run
from planish.errors import UsageError
from planish.gallery import sheet, sheet_mesh
from planish.io import read_scan, write_scan
from planish.io.meshes import read_mesh
from planish.types import Scan


@pytest.fixture(scope="module")
def book(tmp_path_factory):
    mesh, _ = sheet_mesh(sheet("book"), points=600)
    path = tmp_path_factory.mktemp("book") / "book.obj"
    write_scan(path, Scan(mesh))
    return path


def vt(path):
    return np.array([line.split()[1:] for line in path.read_text().splitlines() if line.startswith("vt ")], float)


def lines_of(path, key):
    return [line.split() for line in path.read_text().splitlines() if line.startswith(key + " ")]


def test_texture_coordinates_are_millimetres_or_a_unit_and_points_and_faces_keep_their_order(book, tmp_path):
    mm, unit, figures = tmp_path / "mm.obj", tmp_path / "unit.obj", tmp_path / "unit.json"
    common = ["--as", "uv", "--units", "mm", "-q"]
    assert run(["flatten", str(book), "-o", str(mm), *common]) == 0
    assert run(["flatten", str(book), "-o", str(unit), *common, "--uv", "unit", "--distortion", str(figures)]) == 0
    step = json.loads(figures.read_text())["uv_step_mm"]
    assert step == pytest.approx(np.ptp(vt(mm), axis=0).max(), abs=1e-4)  # six digits are written
    np.testing.assert_allclose(vt(unit) * step, vt(mm), atol=step * 1e-6)
    assert vt(unit).max() == pytest.approx(1, abs=1e-6)
    assert vt(unit).min() >= 0
    for path in (mm, unit):
        np.testing.assert_allclose(np.array(lines_of(path, "v"))[:, 1:].astype(float), read_mesh(book).points)
        corners = [[corner.split("/")[0] for corner in line[1:]] for line in lines_of(path, "f")]
        assert corners == [[corner.split("/")[0] for corner in line[1:]] for line in lines_of(book, "f")]


def test_the_figures_are_those_of_the_arrays_and_of_python(book, tmp_path):
    path, ply = tmp_path / "a.json", tmp_path / "flat.ply"
    assert run(["flatten", str(book), "-o", str(ply), "--units", "mm", "-q", "--distortion", str(path)]) == 0
    figures, arrays = json.loads(path.read_text()), np.load(tmp_path / "a.npz")
    scan = read_scan(book, units="mm").scan
    made = planish.distortion(scan.mesh, planish.flatten(scan.mesh))
    assert set(figures) == {*made.summary(), "uv_step_mm"}
    assert (figures["faces"], figures["faces_left_out"], figures["uv_step_mm"]) == (len(scan.mesh.faces), 0, 1.0)
    assert arrays["polygon"].tolist() == list(range(len(scan.mesh.faces)))
    for name, values in made.arrays().items():
        np.testing.assert_allclose(arrays[name], values, atol=1e-6)
        sizes, weights = np.abs(arrays[name]), made.area_mm2
        assert figures[name]["worst"] == sizes.max() == sizes[figures[name]["worst_face"]]
        assert figures[name]["mean"] == pytest.approx(np.average(sizes, weights=weights))
        below = weights[sizes <= figures[name]["p99"]].sum() / weights.sum()
        assert 0.99 <= below <= 0.99 + weights.max() / weights.sum()
    header = ply.read_bytes().split(b"end_header")[0].decode()
    of_faces = header[header.index("element face") :]
    for name in ("area_distortion", "angle_distortion_deg", "length_distortion", "face_strain"):
        assert f"property float {name}" in of_faces


def test_left_out_faces_are_counted_and_have_no_numbers():
    mesh, _ = sheet_mesh(sheet("book"), points=300)
    with_needle = planish.Mesh(mesh.points, np.vstack([[0, 0, 1], mesh.faces]))
    made = planish.distortion(with_needle, planish.flatten(with_needle))
    assert made.summary()["faces_left_out"] == 1
    assert np.isnan(made.area[0])
    assert np.isfinite(made.area[1:]).all()
    with pytest.raises(UsageError, match="give the mesh that was flattened"):
        planish.distortion(mesh, planish.flatten(with_needle))


@pytest.mark.parametrize("kind", ["points", "uv"])
def test_quads_of_a_grid_stay_or_are_cut_into_the_triangles_that_were_measured(book, tmp_path, kind):
    grid, figures = tmp_path / "grid", tmp_path / "figures.json"
    assert run(["flatten", str(book), "-o", str(grid), "--as", "uv", "--units", "mm", "-q"]) == 0
    common = ["flatten", str(grid), "--as", kind, "--units", "mm", "-q", "-o"]
    quads, cut, ply = tmp_path / "quads.obj", tmp_path / "cut.obj", tmp_path / "cut.ply"
    assert run([*common, str(quads), "--distortion", str(figures)]) == 0
    assert run([*common, str(cut), "--triangles"]) == 0
    assert run([*common, str(ply), "--triangles"]) == 0
    assert {len(line) - 1 for line in lines_of(quads, "f")} == {4}
    assert {len(line) - 1 for line in lines_of(cut, "f")} == {3}
    assert len(lines_of(cut, "f")) == 2 * len(lines_of(quads, "f")) == json.loads(figures.read_text())["faces"]
    assert lines_of(cut, "v") == lines_of(quads, "v")
    assert lines_of(cut, "vt") == lines_of(quads, "vt")
    owner = np.load(figures.with_suffix(".npz"))["polygon"]
    faces = lines_of(quads, "f")
    for triangle, line in zip(owner, lines_of(cut, "f"), strict=True):
        assert set(line[1:]) <= set(faces[triangle][1:])
    assert f"element face {len(owner)}" in ply.read_bytes().split(b"end_header")[0].decode()


@pytest.mark.parametrize(
    ("flags", "code", "sentence"),
    [
        (["--uv", "unit"], 2, "cannot be 0 to 1; set --as=uv|cannot be 0 to 1; set --as uv"),
        (["--distortion", "figures.csv"], 4, "distortion is written as .json"),
    ],
)
def test_what_cannot_be_written_is_refused_before_the_work(book, tmp_path, capsys, flags, code, sentence):
    assert run(["flatten", str(book), "-o", str(tmp_path / "flat.obj"), *flags]) == code
    said = capsys.readouterr().err
    assert any(part in said for part in sentence.split("|"))
    assert not (tmp_path / "flat.obj").exists()
