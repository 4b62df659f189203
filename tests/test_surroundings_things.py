"""What lies on a sheet or beside it: hands, second sheets, shadows, boxes; and what was left out is shown."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

import planish
from planish.document.cut_picture import cut_picture
from planish.document.surroundings import leave_out_surroundings
from planish.io import read_photo
from planish.job.stage_images import write_stages
from planish.pipeline import prepare
from planish.settings import BinarizeSettings, RenderSettings, RestoreSettings, ShadingSettings
from planish.view.html_document import view_page
from planish.view.page_layers import left_out_picture
from scenes import FINE, SKIN, as_colours, as_textures, box_on_table, in_shadow, seen, without_photo

QUICK = RestoreSettings(
    render=RenderSettings(dpi=72),
    shading=ShadingSettings(shading="none"),
    binarize=BinarizeSettings(binarize="none"),
    rotate="0",
)


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


@pytest.mark.slow
def test_where_a_mask_is_refused_none_is_asked_for():
    scan, _, _ = beside_another()
    hint = leave_out_surroundings(as_textures(scan))[1][0].hint
    assert hint == "cut the mesh to another of them in another program to get that"


@pytest.mark.slow
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


@pytest.mark.slow
def test_of_a_box_on_a_table_the_largest_face_is_taken_and_that_is_said_first():
    scan = box_on_table()
    alone, warnings = leave_out_surroundings(scan)
    assert [w.code for w in warnings] == ["box-face", "surroundings-left-out"]
    points = alone.mesh.points[np.unique(alone.mesh.faces)]
    across = (points - points.mean(axis=0)) @ np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2].T
    assert np.ptp(np.quantile(across, [0.005, 0.995], axis=0), axis=0) == pytest.approx([180, 140, 0], abs=8)


@pytest.mark.slow
def test_stages_and_view_show_what_was_left_out(tmp_path):
    scan, paper = seen("wave")
    done = planish.restore(scan, QUICK)
    write_stages(tmp_path, done)
    shown = read_photo(tmp_path / "0-sheet.png").pixels[..., 0]
    column, row = scan.photo_xy.astype(int).T
    assert np.median(shown[row, column][paper]) > 200
    assert np.median(shown[row, column][~paper]) < 30
    layer = left_out_picture(done)
    framed = cv2.imdecode(np.frombuffer(layer.data, np.uint8), cv2.IMREAD_GRAYSCALE)
    assert (framed > 200).mean() == pytest.approx((shown > 200).mean() * (framed != 154).mean(), abs=0.1)
    assert b'"left-out"' in view_page(done)
    assert left_out_picture(planish.restore(scan, replace(QUICK, sheet="all"))) is None


@pytest.mark.slow
@pytest.mark.parametrize("shown", [as_textures, as_colours, without_photo])
def test_what_was_left_out_is_shown_from_above_where_there_is_no_photo(shown):
    scan, _ = seen("crumpled", table=200.0 if shown is without_photo else 70.0, camera=FINE)
    picture = cut_picture(prepare(shown(scan), "auto"))[..., 0]
    bright = (picture > 150).sum() * (np.ptp(scan.mesh.points[:, :2], axis=0).max() / 800) ** 2  # mm2
    assert bright == pytest.approx(215.9 * 279.4, rel=0.25)  # crumpled, it covers less
    assert np.median(picture[:20]) < 70  # the table
