"""The sheet apart from the table around it: cut where that is plain, and never a point of a sheet alone."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest

import planish
from planish.cli.main import run
from planish.document.raised import raised_sheet
from planish.document.surroundings import leave_out_surroundings
from planish.errors import InputError
from planish.gallery import sheet, sheet_mesh
from planish.gallery.scene_view import aim_camera
from planish.io import read_scan, write_scan
from planish.job.from_report import inputs_from_report
from planish.job.html_page import make_html
from planish.pipeline import prepare
from planish.settings import BinarizeSettings, RenderSettings, RestoreSettings, ShadingSettings
from planish.types import Mesh, Scan
from scenes import FINE, as_colours, as_textures, seen, without_photo

QUICK = RestoreSettings(
    render=RenderSettings(dpi=72),
    shading=ShadingSettings(shading="none"),
    binarize=BinarizeSettings(binarize="none"),
    rotate="0",
)


@pytest.mark.parametrize("name", ["book", "letter", "wave"])
def test_a_table_around_the_sheet_is_left_out(name):
    scan, paper = seen(name)
    alone, (warning,) = leave_out_surroundings(scan)
    assert warning.code == "surroundings-left-out"
    used = np.unique(alone.mesh.faces)
    moved = (alone.mesh.points != scan.mesh.points).any(axis=1)
    assert (paper | moved)[used].mean() > 0.998  # nothing of the table
    assert paper[used].sum() > 0.98 * paper.sum()


@pytest.mark.slow
def test_the_page_has_its_size_instead_of_the_table_s():
    scan, _ = seen("book")
    done, whole = planish.restore(scan, QUICK), planish.restore(scan, planish.RestoreSettings(sheet="all"))
    assert done.flattening.size_mm == pytest.approx((215.9, 279.4), abs=2.5)  # a pixel of 1.6 mm, on the steep spine
    assert whole.flattening.size_mm[0] > 350
    assert done.report.warnings[0].code == "surroundings-left-out"
    assert len(done.flattening.page_xy) == len(scan.mesh.points)


@pytest.mark.parametrize("name", ["book", "letter", "wave", "curl", "miura", "crumpled"])
def test_a_sheet_alone_loses_no_point(name):
    scan, _ = seen(name, with_table=False)
    assert leave_out_surroundings(scan) == (scan, [])


def test_deep_shade_along_a_spine_is_no_table():
    scan, _ = seen("book", with_table=False)
    photo = scan.photo.astype(float)
    columns = scan.photo_xy[:, 0]
    left = np.quantile(columns, 0.3)
    photo[:, : int(left)] *= 0.2
    dark = Scan(scan.mesh, photo.astype(np.uint8), scan.photo_xy, scan.camera)
    assert leave_out_surroundings(dark) == (dark, [])


def test_a_flat_sheet_in_the_plane_of_a_dark_frame_is_kept_and_told():
    scan, _ = seen("flat")
    kept, (warning,) = leave_out_surroundings(scan)
    assert kept is scan
    assert warning.code == "surroundings-doubtful"


def test_light_wood_around_a_sheet_is_told():
    scan, _ = seen("spread", table=155.0)  # the paper is 1.39 times as bright
    kept, (warning,) = leave_out_surroundings(scan)
    assert kept is scan
    assert warning.code == "surroundings-doubtful"
    bare, _ = seen("spread", table=155.0, with_table=False)
    assert leave_out_surroundings(bare) == (bare, [])


def test_a_bright_table_is_not_cut_from_bright_paper():
    scan, _ = seen("book", table=190.0)
    kept, (warning,) = leave_out_surroundings(scan)
    assert kept is scan
    assert "may be a table" in warning.sentence


@pytest.mark.slow
@pytest.mark.parametrize("shown", [as_textures, as_colours])
@pytest.mark.parametrize("name", ["letter", "wave"])
def test_textures_and_colours_of_points_tell_the_table_as_well(name, shown):
    scan, paper = seen(name)
    alone, (warning,) = leave_out_surroundings(shown(scan))
    assert warning.code == "surroundings-left-out"
    used = np.unique(alone.mesh.faces)
    moved = (alone.mesh.points != scan.mesh.points).any(axis=1)
    assert (paper | moved)[used].mean() > 0.995
    assert paper[used].sum() > 0.97 * paper.sum()
    bare, _ = seen(name, with_table=False)
    assert leave_out_surroundings(shown(bare))[1] == []


@pytest.mark.slow
@pytest.mark.parametrize("name", ["letter", "crumpled"])
def test_the_page_is_right_to_half_a_per_cent(name):
    scan, _ = seen(name, camera=FINE)
    size = planish.restore(scan, QUICK, draw=False).flattening.size_mm
    assert sorted(size) == pytest.approx([215.9, 279.4], rel=0.005)


def test_a_mask_names_the_sheet_and_faces_end_at_its_outline():
    scan, _ = seen("flat", with_table=True)
    mask = np.zeros(scan.photo.shape[:2], bool)
    mask[60:180, 90:250] = True
    alone = prepare(replace(scan, sheet=mask)).scan
    assert np.ptp(alone.photo_xy, axis=0) == pytest.approx([160, 120], abs=0.6)  # of a pixel
    half = mask[::2, ::2]  # a mask of half the size
    assert np.ptp(prepare(replace(scan, sheet=half)).scan.photo_xy, axis=0) == pytest.approx([160, 120], abs=1.2)


def test_masks_that_do_not_fit_are_refused():
    scan, _ = seen("flat")
    with pytest.raises(InputError, match="black all over"):
        replace(scan, sheet=np.zeros((240, 320)))
    with pytest.raises(InputError, match="20 x 20 pixels, the photo 320 x 240"):
        prepare(replace(scan, sheet=np.ones((20, 20), bool)))
    corner = np.zeros((240, 320), bool)
    corner[0, 0] = True
    with pytest.raises(InputError, match=r"no part of the scan|belong together"):
        prepare(Scan(scan.mesh, scan.photo, scan.photo_xy + 20, sheet=corner))
    with pytest.raises(InputError, match="4 images"):
        prepare(replace(as_textures(scan), sheet=corner))


@pytest.mark.slow
def test_flatten_and_restore_take_a_mask_and_leave_out_the_table(tmp_path):
    scan, _ = seen("wave")
    write_scan(tmp_path / "s.ply", scan)
    mask = np.zeros((240, 320), np.uint8)
    mask[90:150, 120:200] = 1  # a label, not white
    cv2.imwrite(str(tmp_path / "mask.png"), mask)

    def size(*options):
        run(["flatten", f"{tmp_path}/s.ply", "-o", f"{tmp_path}/f.obj", "--report", f"{tmp_path}/r.json", *options])
        page = json.loads((tmp_path / "r.json").read_text())["page"]
        return sorted([page["width_mm"], page["height_mm"]])

    assert size() == pytest.approx([215.9, 279.4], abs=2)
    assert size("--sheet", "all")[0] > 350
    height, along_the_wave = size("--sheet", f"{tmp_path}/mask.png")
    assert height == pytest.approx(60 * 1.63, rel=0.03)  # mm a pixel on the table, less on the wave
    assert 80 * 1.63 < along_the_wave < 1.2 * 80 * 1.63
    assert len(read_scan(tmp_path / "f.obj").scan.mesh.points) == len(scan.mesh.points)
    wrong = ["restore", f"{tmp_path}/s.ply", "-o", f"{tmp_path}/p.png", "--sheet", f"{tmp_path}/nothing.png"]
    assert run(wrong) == 3


@pytest.mark.slow
@pytest.mark.parametrize("shown", [without_photo, lambda scan: scan])
def test_on_a_white_table_the_shape_tells_if_it_stands_out_all_around(shown):
    scan, paper = seen("crumpled", table=215.0, camera=FINE)
    alone, (warning,) = leave_out_surroundings(shown(scan))
    used = np.unique(alone.mesh.faces)
    moved = (alone.mesh.points != scan.mesh.points).any(axis=1)
    assert (paper | moved)[used].mean() > 0.995
    assert paper[used].sum() > 0.98 * paper.sum()
    assert warning.code == "surroundings-left-out"
    assert "its shape alone" in warning.sentence


@pytest.mark.slow
def test_a_sheet_that_may_stand_out_from_a_white_table_is_kept_and_told():
    aside = aim_camera((150, -160, 620), (0, 0, 0), 460, (480, 640))  # the table runs smoothly into a fifth of its rim
    scan = without_photo(seen("crumpled", table=215.0, camera=aside)[0])
    kept, (warning,) = leave_out_surroundings(scan)
    assert kept is scan
    assert warning.code == "surroundings-doubtful"


@pytest.mark.parametrize("name", ["letter", "book", "miura", "spread", "wave"])
def test_what_touches_a_white_table_is_kept_whole_with_it_and_told(name):
    scan, _ = seen(name, table=215.0)
    kept, (warning,) = leave_out_surroundings(scan)
    assert kept is scan
    assert warning.code == "surroundings-doubtful"
    assert "may be a table" in warning.sentence


@pytest.mark.parametrize("name", ["book", "letter", "wave", "curl", "miura", "crumpled", "spread", "flat"])
def test_a_bare_mesh_of_a_sheet_alone_loses_no_point(name):
    mesh, _ = sheet_mesh(sheet(name), points=20_000, layout="grid")
    scan = Scan(mesh)
    assert leave_out_surroundings(scan) == (scan, [])


def cut_grid(rows, cols, height_mm, cuts=()):
    """A sheet of so many 2 mm squares at a height over a plane (a function of x and y), without the faces of cuts."""
    y, x = np.mgrid[:rows, :cols] * 2.0
    points = np.stack([x, y, height_mm(x, y)], axis=-1).reshape(-1, 3)
    corner = np.arange(rows * cols).reshape(rows, cols)
    a, b, c, d = (part.ravel() for part in (corner[:-1, :-1], corner[:-1, 1:], corner[1:, :-1], corner[1:, 1:]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([b, d, c], axis=1)])
    centre = points[faces].mean(axis=1)
    gone = np.zeros(len(faces), bool)
    for (left, right), (low, high) in cuts:
        gone |= (centre[:, 0] > left) & (centre[:, 0] < right) & (centre[:, 1] > low) & (centre[:, 1] < high)
    return Scan(planish.Mesh(points, faces[~gone]))


LEFT, RIGHT, END = ((80, 88), (40, 290)), ((100, 108), (40, 290)), ((80, 108), (278, 290))
CUTS = {
    "a tooth of a comb": (12, [((left, left + 8), (40, 400)) for left in range(20, 200, 20)]),
    "a strip": (12, [LEFT, RIGHT]),
    "a strip between slits": (12, [((86, 88), (40, 290)), ((100, 102), (40, 290))]),
    "a tongue": (12, [LEFT, RIGHT, END]),
    "a wide tongue": (50, [LEFT, ((138, 146), (40, 290)), ((80, 146), (278, 290))]),
}


@pytest.mark.parametrize(("width_mm", "cuts"), CUTS.values(), ids=CUTS)
@pytest.mark.parametrize("height_mm", [6, 60])
def test_a_part_of_a_bare_sheet_that_stands_up_between_cuts_is_no_sheet_on_a_table(width_mm, cuts, height_mm):
    def arch(x, y):
        inside = (x >= 88) & (x <= 88 + width_mm)
        return np.where(inside, height_mm * np.sin(np.pi * np.clip((y - 60) / 220, 0, 1)), 0)

    scan = cut_grid(150, 111, arch, cuts)
    kept, warnings = leave_out_surroundings(scan)
    assert kept is scan
    assert [w.code for w in warnings] in ([], ["surroundings-doubtful"])


def test_a_sheet_that_the_border_of_the_scan_cuts_is_told():
    scan, paper = seen("wave")
    column = scan.photo_xy[:, 0]
    left = np.quantile(column[paper], 0.2)
    kept = (column[scan.mesh.faces] > left).all(axis=1)
    half = replace(scan, mesh=planish.Mesh(scan.mesh.points, scan.mesh.faces[kept]))
    alone, (warning,) = leave_out_surroundings(half)
    assert "border of the scan" in warning.sentence
    assert len(alone.mesh.faces) < 0.8 * kept.sum()


@pytest.mark.slow
def test_a_restoration_with_a_mask_can_be_looked_at_again(tmp_path):
    scan, _ = seen("flat")
    write_scan(tmp_path / "s.ply", scan)
    mask = np.zeros((240, 320), np.uint8)
    mask[60:180, 90:250] = 255
    cv2.imwrite(str(tmp_path / "mask.png"), mask)
    options = ["-o", f"{tmp_path}/p.png", "--dpi", "72", "--report", f"{tmp_path}/report.json"]
    assert run(["restore", f"{tmp_path}/s.ply", "--sheet", f"{tmp_path}/mask.png", *options]) == 0
    inputs = inputs_from_report(tmp_path)
    assert inputs.sheet == tmp_path / "mask.png"
    assert inputs.photo == (tmp_path / "s.jpg",)
    again = make_html(inputs, tmp_path / "view.html").report
    assert (again.page.width_mm, again.page.height_mm) == pytest.approx(inputs.size_mm, abs=0.01)


@pytest.mark.parametrize("points", [np.zeros((0, 3)), np.full((3, 3), np.nan)])
def test_nothing_to_see_is_refused_in_a_sentence(points):
    faces = np.arange(len(points), dtype=np.int32).reshape(-1, 3)
    assert raised_sheet(Scan(Mesh(points, faces))) is None
    with pytest.raises(InputError):
        planish.restore(Scan(Mesh(points, faces)))
