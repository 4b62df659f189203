"""The sheet apart from the table around it: cut where that is plain, and never a point of a sheet alone."""

import json
from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest

import planish
from planish.acquire.grid_mesh import grid_mesh
from planish.cli.main import run
from planish.document.surroundings import leave_out_surroundings
from planish.errors import InputError
from planish.gallery import sheet, sheet_mesh
from planish.gallery.scene_view import aim_camera, render_view
from planish.io import read_photo, read_scan, write_scan
from planish.job.from_report import inputs_from_report
from planish.job.html_page import make_html
from planish.pipeline import prepare
from planish.settings import BinarizeSettings, RenderSettings, RestoreSettings, ShadingSettings
from planish.types import Scan, Texture

CAMERA = aim_camera((0, -60, 620), (0, 0, 0), 520, (240, 320))
FINE = aim_camera((0, -60, 620), (0, 0, 0), 460, (480, 640))
"""A pixel is 0.8 mm."""

QUICK = RestoreSettings(
    render=RenderSettings(dpi=72),
    shading=ShadingSettings(shading="none"),
    binarize=BinarizeSettings(binarize="none"),
    rotate="0",
)


SKIN = (200, 150, 130)


@cache
def viewed(name, camera):
    return render_view(sheet(name), camera)


def seen(name, table=70.0, with_table=True, camera=CAMERA, finger=None):
    """A range image of a sheet of blank paper on its table, and a photo by the same camera; a finger of some colour."""
    shown = viewed(name, camera)
    points, paper = shown.points.copy(), np.isfinite(shown.page_xy[..., 0])
    levels = np.where(paper[..., None], 215.0, table) * np.ones(3)
    if finger is not None:
        held = raise_finger(points, paper)
        levels[held], paper = finger, paper & ~held
    levels += np.random.default_rng(1).normal(0, 4, paper.shape)[..., None]
    mesh, photo_xy = grid_mesh(np.where(with_table | paper[..., None], points, np.nan), camera)
    photo = np.clip(levels, 0, 255).astype(np.uint8)
    return Scan(mesh, photo, photo_xy, camera), paper[tuple(photo_xy.astype(int).T[::-1])]


def raise_finger(points, paper):
    """Raise points to a finger 24 mm wide that comes from the left and reaches 20 mm over the sheet; its pixels."""
    x, y = points[..., 0], points[..., 1]
    rows, cols = np.nonzero(paper)
    left = x[int(np.median(rows)), cols.min() + 3] + 20
    across = np.abs(y - np.median(y[paper])) / 12
    held = (across < 1) & (x < left)
    top = points[paper, 2].max() if np.ptp(points[paper, 2]) < 5 else np.median(points[held & paper, 2])
    height = top + 14 * np.sqrt(np.clip(1 - across**2, 0, 1)) - points[..., 2]
    eye = np.array([0, -60, 620.0])
    towards = eye - points[held]
    points[held] += towards / towards[:, 2:] * height[held][:, None]
    return held


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


@pytest.mark.parametrize("name", ["flat", "letter", "spread", "book"])
def test_a_finger_that_holds_the_sheet_is_left_out(name):
    scan, paper = seen(name, finger=SKIN)
    if name == "flat":  # a flat sheet in the plane of its table is kept whole, so it is held 5 mm above it
        lifted = scan.mesh.points + np.where(paper, 5, 0)[:, None] * [0, 0, 1]
        scan = replace(scan, mesh=planish.Mesh(lifted, scan.mesh.faces))
    alone, warnings = leave_out_surroundings(scan)
    assert [w.code for w in warnings] == ["surroundings-left-out", "hand-left-out"]
    used = np.unique(alone.mesh.faces)
    moved = (alone.mesh.points != scan.mesh.points).any(axis=1)
    assert (paper | moved)[used].mean() > 0.998
    assert paper[used].sum() > 0.97 * paper.sum()


@pytest.mark.parametrize("name", ["letter", "spread", "book"])
def test_a_coloured_picture_at_the_rim_is_no_hand(name):
    scan, paper = seen(name)
    photo, (column, row) = scan.photo.copy(), scan.photo_xy[paper].astype(int).T
    printed = (column < np.quantile(column, 0.2)) & (np.abs(row - np.median(row)) < 12)
    photo[row[printed], column[printed]] = SKIN
    alone, warnings = leave_out_surroundings(replace(scan, photo=photo))
    assert [w.code for w in warnings] == ["surroundings-left-out"]
    assert paper[np.unique(alone.mesh.faces)].sum() > 0.98 * paper.sum()


def test_a_hand_as_white_as_the_paper_is_told_before_anything_else():
    scan, _ = seen("spread", finger=(205, 205, 205))
    codes = [w.code for w in leave_out_surroundings(scan)[1]]
    assert codes == ["surroundings-doubtful", "surroundings-left-out"]


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


def as_textures(scan):
    """The same scan with its photo as four textures, a quarter of the view each."""
    places = scan.photo_xy[scan.mesh.faces]
    rows, cols = scan.photo.shape[:2]
    middle = places.mean(axis=1)
    number = (middle[:, 0] > cols / 2) + 2 * (middle[:, 1] > rows / 2)
    images = tuple(Texture((rows, cols), 8, lambda: scan.photo) for _ in range(4))
    return Scan(scan.mesh, photo_xy=places, textures=images, texture_of_face=number.astype(np.int32))


def as_colours(scan):
    column, row = scan.photo_xy.astype(int).T
    return Scan(scan.mesh, colours=scan.photo[row, column])


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


def beside_another(name="wave"):
    """A sheet, and 10 mm to its right a bent strip of another; which points are its own."""
    scan, paper = seen(name)
    photo = scan.photo.copy()
    right = scan.photo_xy[paper, 0].max()
    first, last = int(right) + 6, int(right) + 40
    photo[60:160, first:last] = 215
    column, row = scan.photo_xy.T
    other = (column >= first) & (column < last) & (row >= 60) & (row < 160)
    lifted = scan.mesh.points + np.where(other, 3 * np.sin((column - first) / 11) ** 2, 0)[:, None] * [0, 0, 1]
    return replace(scan, photo=photo, mesh=planish.Mesh(lifted, scan.mesh.faces)), paper, other


def test_of_two_sheets_the_larger_is_taken_and_that_is_said_first():
    scan, paper, other = beside_another()
    alone, warnings = leave_out_surroundings(scan)
    used = np.unique(alone.mesh.faces)
    assert not other[used].any()
    assert paper[used].sum() > 0.98 * paper.sum()
    assert [w.code for w in warnings] == ["sheets-several", "surroundings-left-out"]
    assert warnings[0].sentence == "the scan shows 2 sheets; the page is the largest of them"
    assert warnings[0].hint == "give {sheet} as an image that is white on another of them to get that"


def test_a_mask_takes_the_other_of_two_sheets():
    scan, _, other = beside_another()
    column, row = scan.photo_xy[other].astype(int).T
    mask = np.zeros(scan.photo.shape[:2], bool)
    mask[row, column] = True
    used = prepare(replace(scan, sheet=mask)).scan.photo_xy
    assert used.min(axis=0) == pytest.approx(scan.photo_xy[other].min(axis=0), abs=1)
    assert used.max(axis=0) == pytest.approx(scan.photo_xy[other].max(axis=0), abs=1)


def test_where_a_mask_is_refused_none_is_asked_for():
    scan, _, _ = beside_another()
    hint = leave_out_surroundings(as_textures(scan))[1][0].hint
    assert hint == "cut the mesh to another of them in another program to get that"


def without_photo(scan):
    return replace(scan, photo=None, photo_xy=None, camera=None)


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


def in_shadow(scan):
    rows, cols = np.mgrid[:240, :320]
    shadow = np.where(rows + 0.5 * cols > 150, 1.0, 0.3)[..., None]
    return replace(scan, photo=(scan.photo * shadow).astype(np.uint8))


@pytest.mark.parametrize("name", ["book", "letter", "spread"])
def test_under_a_shadow_white_paper_is_told_from_a_wooden_table(name):
    scan, paper = seen(name, table=(110.0, 80.0, 60.0))
    alone, (warning,) = leave_out_surroundings(in_shadow(scan))
    assert warning.code == "surroundings-left-out"
    used = np.unique(alone.mesh.faces)
    moved = (alone.mesh.points != scan.mesh.points).any(axis=1)
    assert (paper | moved)[used].mean() > 0.998
    assert paper[used].sum() > 0.97 * paper.sum()


def test_paper_and_lit_table_apart_from_a_shadow_are_not_taken_for_the_sheet():
    shaded = in_shadow(seen("spread")[0])  # a grey table
    kept, warnings = leave_out_surroundings(shaded)
    assert kept is shaded
    assert [w.code for w in warnings] == ["surroundings-doubtful"]


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
def test_the_stages_show_what_was_left_out(tmp_path):
    scan, paper = seen("wave")
    write_scan(tmp_path / "s.ply", scan)
    assert (
        run(["restore", f"{tmp_path}/s.ply", "-o", f"{tmp_path}/p.png", "--dpi", "72", "--stages", f"{tmp_path}"]) == 0
    )
    shown = read_photo(tmp_path / "0-sheet.png").pixels[..., 0]
    column, row = scan.photo_xy.astype(int).T
    assert np.median(shown[row, column][paper]) > 200
    assert np.median(shown[row, column][~paper]) < 30


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


def box_on_table(width=140.0, deep=60.0, high=180.0, noise_mm=1.0):
    """A range image of a box on a table, turned by 20 degrees, that shows three of its faces."""
    camera = aim_camera((0, -300, 600), (0, 0, 60), 380, (240, 320))
    col, row = np.meshgrid(np.arange(320.0), np.arange(240.0))
    rays = np.stack([col, row, np.ones_like(col)], axis=-1) @ np.linalg.inv(camera.matrix).T @ camera.rotation
    eye = -camera.rotation.T @ camera.translation
    turn = np.radians(20)
    axes = np.array([[np.cos(turn), np.sin(turn), 0], [-np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    with np.errstate(divide="ignore"):
        low, high_ = (((side - [0, 0, high / 2]) - axes @ eye) / (rays @ axes.T) for side in _sides(width, deep, high))
    first, last = np.minimum(low, high_).max(axis=-1), np.maximum(low, high_).min(axis=-1)
    table = -eye[2] / rays[..., 2]
    reach = np.where((first < last) & (first > 0), np.minimum(first, table), table)
    reach = reach + np.random.default_rng(2).normal(0, noise_mm, reach.shape) / np.linalg.norm(rays, axis=-1)
    return Scan(grid_mesh(eye + rays * reach[..., None], camera, noise_mm=noise_mm)[0])


def _sides(width, deep, high):
    half = np.array([width, deep, high]) / 2
    return -half + [0, 0, high], half + [0, 0, high]


def test_of_a_box_on_a_table_the_largest_face_is_taken_and_that_is_said_first():
    scan = box_on_table()
    alone, warnings = leave_out_surroundings(scan)
    assert [w.code for w in warnings] == ["box-face", "surroundings-left-out"]
    points = alone.mesh.points[np.unique(alone.mesh.faces)]
    across = (points - points.mean(axis=0)) @ np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2].T
    assert np.ptp(np.quantile(across, [0.005, 0.995], axis=0), axis=0) == pytest.approx([180, 140, 0], abs=8)
