"""The sheet apart from the table around it: cut where that is plain, and never a point of a sheet alone."""

import numpy as np
import pytest

import planish
from planish.acquire.grid_mesh import grid_mesh
from planish.document.surroundings import leave_out_surroundings
from planish.gallery import sheet
from planish.gallery.scene_view import aim_camera, render_view
from planish.settings import BinarizeSettings, RenderSettings, RestoreSettings, ShadingSettings
from planish.types import Scan

CAMERA = aim_camera((0, -60, 620), (0, 0, 0), 520, (240, 320))
QUICK = RestoreSettings(
    render=RenderSettings(dpi=72),
    shading=ShadingSettings(shading="none"),
    binarize=BinarizeSettings(binarize="none"),
    rotate="0",
)


def seen(name, table=70.0, with_table=True):
    """A range image of a sheet of blank paper on its table, and a photo by the same camera."""
    shown = render_view(sheet(name), CAMERA)
    paper = np.isfinite(shown.page_xy[..., 0])
    levels = np.where(paper, 215.0, table) + np.random.default_rng(1).normal(0, 4, paper.shape)
    photo = np.repeat(np.clip(levels, 0, 255).astype(np.uint8)[..., None], 3, axis=2)
    mesh, photo_xy = grid_mesh(np.where(with_table | paper[..., None], shown.points, np.nan), CAMERA)
    return Scan(mesh, photo, photo_xy, CAMERA), paper[tuple(photo_xy.astype(int).T[::-1])]


@pytest.mark.parametrize("name", ["book", "letter", "wave"])
def test_a_table_around_the_sheet_is_left_out(name):
    scan, paper = seen(name)
    alone, (warning,) = leave_out_surroundings(scan)
    assert warning.code == "surroundings-left-out"
    used = np.unique(alone.mesh.faces)
    assert paper[used].mean() > 0.998  # nothing of the table
    assert paper[used].sum() > 0.95 * paper.sum()  # but a pixel or two of the rim, 1.6 mm each


@pytest.mark.slow
def test_the_page_has_its_size_instead_of_the_table_s():
    scan, _ = seen("book")
    done, whole = planish.restore(scan, QUICK), planish.restore(scan, planish.RestoreSettings(sheet="all"))
    assert done.flattening.size_mm == pytest.approx((215.9, 279.4), abs=2.5)  # a pixel of 1.6 mm, seen aslant
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


def test_a_bright_table_is_not_cut_from_bright_paper():
    scan, _ = seen("book", table=190.0)
    assert leave_out_surroundings(scan) == (scan, [])
