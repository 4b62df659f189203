"""The first hour of two newcomers, by copy and paste: a scientist in Python, and an engineer who unwraps a segment.

Code and commands are read out of the documents and run in their order, so that a document that no longer works is a
failed test. The third newcomer, in a browser, is in test_serve_browser.py; the tutorial's in test_tutorial.py.
"""

import ast
import json
import re
import shlex
from pathlib import Path

import numpy as np
import pytest

import planish
from planish.cli.main import run
from planish.geometry.rigid_fit import fit_rigid
from planish.io.tifxyz import write_tifxyz
from planish.types import Page, Restoration

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parent.parent
MM_PER_VOXEL = 0.00791


def blocks(page, language):
    """The blocks of a language on a page, in order."""
    return re.findall(rf"^```{language}\n(.*?)^```$", (ROOT / page).read_text(), re.M | re.S)


def run_as_cell(code, names):
    """Run a block as a notebook does: the value of its last line is what it shows."""
    *before, last = ast.parse(code).body
    if not isinstance(last, ast.Expr):
        before, last = [*before, last], None
    exec(compile(ast.Module(before, []), "cell", "exec"), names)
    return None if last is None else eval(compile(ast.Expression(last.value), "cell", "eval"), names)


def run_as_shell(script):
    """Run the commands of a block; none may fail."""
    for command in script.replace("\\\n", " ").splitlines():
        name, *arguments = shlex.split(command, comments=True)
        assert name == "planish"
        assert run(arguments) == 0, command


def rms_off(page_xy, true_xy):
    """Rms distance of flattened points from the true ones after a rigid fit, which turns no page over."""
    turn, shift = fit_rigid(page_xy, true_xy)
    return float(np.sqrt(((page_xy @ turn.T + shift - true_xy) ** 2).sum(axis=1).mean()))


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="module")
def card():
    """The scan of a small page: at 300 dpi it takes a tenth of the time of a letter."""
    bent = planish.gallery.sheet("book", width_mm=74, height_mm=105)
    return planish.gallery.virtual_scan(bent, points=2000, photo_px=(600, 450)).scan


@pytest.mark.parametrize("page", ["README.md", "docs/api.md"])
def test_a_scientist_pastes_the_blocks_into_a_notebook(page, folder, card):
    planish.write_scan("scan.obj", card)
    mesh = card.mesh
    names = {"points": mesh.points, "faces": mesh.faces, "mesh": mesh}
    cells = blocks(page, "python")
    assert "read_scan" in cells[0]
    for code in cells:
        if 'units="m"' in code:
            names |= {"points": mesh.points / 1000, "start": (0, 0, 0), "end": (0, 0.1, 0)}
        run_as_cell(code, names)
    assert sorted(names["flat"].size_mm) == pytest.approx(
        [74, 105], rel=0.03
    )  # the rim is up to a point's spacing of 2 mm short
    done = names["done"]
    assert isinstance(done, Restoration)
    assert done.report.verdict.word == "good"
    assert "<img" in done._repr_html_()  # what the notebook shows
    if page == "docs/api.md":
        assert isinstance(done.page, Page)
        assert (folder / "page.tif").stat().st_size > 10_000


@pytest.fixture(scope="module")
def segment():
    """A rolled-up piece of sheet of 30 x 40 mm as a mesh in voxels, and the true places of its points [mm]."""
    bent = planish.gallery.sheet("wave", width_mm=30, height_mm=40)
    mesh, true_xy = planish.gallery.sheet_mesh(bent, points=3000, layout="grid")
    inside = mesh.points - mesh.points.min(axis=0) + 5.0
    return inside / MM_PER_VOXEL, mesh.faces, true_xy


def test_an_engineer_unwraps_a_segment(folder, segment):
    points, faces, true_xy = segment
    rows = np.unique(true_xy[:, 1].round(6)).size
    write_obj(folder / "segment.obj", points, faces)
    write_tifxyz(folder / "segment.tifxyz", points.reshape(rows, -1, 3), per_unit=0.01)
    for script in blocks("docs/unwrapping.md", "bash"):
        run_as_shell(script)
    texture_coordinates_are_the_page(folder, points, faces, true_xy)
    the_grid_is_regular(folder)
    names = {"points": points, "faces": faces, "planish": planish, "np": np}
    for code in blocks("docs/unwrapping.md", "python"):
        run_as_cell(code, names)
    assert rms_off(names["flat"].page_xy, true_xy) < 0.01
    assert names["uv"].min() >= 0
    assert names["uv"].max() == pytest.approx(1)
    assert names["measures"]["area"].shape == (len(faces),)
    np.testing.assert_allclose(names["measures"]["strain"], names["made"].strain, atol=1e-4)


def write_obj(path, points, faces):
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in points]
    path.write_text("\n".join([*lines, *(f"f {a} {b} {c}" for a, b, c in faces + 1), ""]))


def texture_coordinates_are_the_page(folder, points, faces, true_xy):
    made = planish.read_scan(folder / "flat.obj", units="mm").scan.mesh
    np.testing.assert_allclose(made.points, points, atol=1e-3)
    np.testing.assert_array_equal(made.faces, faces)
    lines = (folder / "flat.obj").read_text().splitlines()
    uv = np.array([line.split()[1:3] for line in lines if line.startswith("vt ")], float)
    assert len(uv) == len(points)
    assert (uv.min(), uv.max()) == pytest.approx((0, 1), abs=1e-6)
    figures = json.loads((folder / "distortion.json").read_text())
    assert rms_off(uv * [1, -1] * figures["uv_step_mm"], true_xy) < 0.01  # v runs up, the page's y down
    assert figures["faces"] == len(faces)
    for measure in ("area", "length", "strain"):
        assert 0 <= figures[measure]["mean"] <= figures[measure]["p99"] <= figures[measure]["worst"] < 0.01


def the_grid_is_regular(folder):
    import tifffile

    xyz = np.stack([tifffile.imread(folder / "page.tifxyz" / f"{axis}.tif") for axis in "xyz"], axis=-1)
    xyz = np.where(xyz[..., 2:] > 0, xyz, np.nan).astype(float)
    step = 1 / json.loads((folder / "page.tifxyz" / "meta.json").read_text())["scale"][0]
    for axis in (0, 1):
        assert np.nanmedian(np.linalg.norm(np.diff(xyz, axis=axis), axis=-1)) == pytest.approx(step, rel=0.01)
