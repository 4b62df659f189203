"""A scan as points that a browser can turn, and cut along an outline on what is seen of it."""

import json
from base64 import b64decode
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from planish.document.view_cut import cut_in_view
from planish.errors import InputError, UsageError
from planish.io import write_scan
from planish.pipeline import prepare
from planish.settings import BinarizeSettings, PhotoSettings, RenderSettings, RestoreSettings, ShadingSettings
from planish.web.outline import read_cut
from planish.web.restore_upload import restore_upload
from planish.web.scan_points import MOST, scan_points
from planish.web.upload_request import UploadRequest
from scenes import as_colours, as_textures, seen, without_photo

VIEW_PX = (1000, 800)
QUICK = RestoreSettings(
    render=RenderSettings(dpi=72),
    shading=ShadingSettings(shading="none"),
    binarize=BinarizeSettings(binarize="none"),
    rotate="0",
)


def decoded(shown):
    """(n, 3) points [mm] and (n, 3) colours of what a browser gets."""
    steps = np.frombuffer(b64decode(shown["points"]), "<i2").reshape(-1, 3)
    return steps * shown["step"] + shown["centre"], np.frombuffer(b64decode(shown["colours"]), np.uint8).reshape(-1, 3)


def field(shown, corners_xyz, right, down):
    """The form field of an outline through points in space, seen along two directions, as the browser makes it."""
    rows = 1.5 * np.array([right, down])  # pixels to a mm
    view = np.c_[rows, np.array(VIEW_PX) / 2 - rows @ shown["centre"]]
    corners = np.asarray(corners_xyz) @ view[:, :3].T + view[:, 3]
    parts = [",".join(f"{number:.6g}" for number in line) for line in [*view, *corners]]
    return f"{VIEW_PX[0]}x{VIEW_PX[1]} {' '.join(parts)}"


@pytest.mark.parametrize("form", [as_textures, as_colours, without_photo, lambda scan: scan])
def test_points_lie_on_the_scan_in_its_colours(form):
    scan = form(seen("book")[0])
    shown = json.loads(json.dumps(scan_points(scan)))
    points, colours = decoded(shown)
    assert MOST / 5 < len(points) <= MOST
    assert len(colours) == len(points)
    distance, nearest = cKDTree(scan.mesh.points).query(points)
    assert np.quantile(distance, 0.99) < 1.7  # points are 1.6 mm apart, but for the steep rim
    if scan.has_picture:
        original = seen("book")[0]
        col, row = np.rint(original.photo_xy[nearest]).astype(int).T
        wanted = original.photo[row, col].astype(int)
        assert np.median(np.abs(colours - wanted)) < 10  # noise of the photo
    assert np.dot(shown["right"], shown["down"]) == pytest.approx(0, abs=1e-9)


def test_the_outline_on_a_view_from_above_cuts_the_table_off():
    scan, paper = seen("letter")
    textured = as_textures(scan)
    shown = scan_points(textured)
    low, high = scan.mesh.points[paper].min(axis=0), scan.mesh.points[paper].max(axis=0)
    corners = [[x, y, 0] for x, y in ((low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1]))]
    mask, view = read_cut(field(shown, corners, shown["right"], shown["down"])).mask_and_view()
    prepared = prepare(replace(textured, sheet=mask, sheet_view=view))
    used = np.unique(prepared.scan.mesh.faces)
    inside = prepared.scan.mesh.points[used]
    assert (inside[:, :2] > low[:2] - 2).all()
    assert (inside[:, :2] < high[:2] + 2).all()
    assert np.ptp(inside[:, 0]) == pytest.approx(high[0] - low[0], abs=4)  # two points of 1.6 mm
    assert "surroundings-left-out" in [warning.code for warning in prepared.warnings]


def test_an_outline_on_a_view_from_the_side_cuts_off_what_lies_below():
    scan, _ = seen("crumpled")
    shown = scan_points(scan)
    into = np.cross(shown["right"], shown["down"])
    heights = scan.mesh.points @ -into
    table = np.median(heights)
    level = 5.0 + table
    far = 300.0 * np.array(shown["right"])
    corners = [-far - level * into, far - level * into, far - (level + 200) * into, -far - (level + 200) * into]
    mask, view = read_cut(field(shown, corners, shown["right"], into)).mask_and_view()
    kept, warnings = cut_in_view(scan, mask, view)
    assert heights[np.unique(kept.mesh.faces)].min() > level - 1  # a pixel is two thirds of a millimetre
    assert len(kept.mesh.faces) == pytest.approx((heights[scan.mesh.faces].min(axis=1) > level).sum(), rel=0.02)
    assert warnings[-1].code == "surroundings-left-out"


def test_an_outline_beside_the_scan_is_refused():
    scan, _ = seen("book")
    beside = np.array([[1.0, 0, 0, 5000], [0, -1, 0, 0]])
    with pytest.raises(InputError, match="within the outline that was drawn"):
        cut_in_view(scan, np.ones((100, 100), bool), beside)


@pytest.mark.parametrize(
    "text",
    [
        "9x9",
        "9x9 1,0,0,0 1,1 2,2 3,3",
        "9x9 1,0,0,0 2,0,0,0 1,1 2,2 3,3",
        "9x9 1,0,0,nan 0,1,0,0 1,1 2,2 3,3",
    ],
)
def test_what_is_no_view_is_refused(text):
    with pytest.raises(UsageError, match=r"cut must be|outline must"):
        read_cut(text)


@pytest.mark.slow
def test_an_upload_gives_points_and_with_the_cut_the_page(tmp_path, monkeypatch):
    scan, paper = seen("letter")
    folder = tmp_path / "in"
    folder.mkdir()
    write_scan(folder / "scan.obj", scan)

    def ask(name, **how):
        request = UploadRequest(
            scan="scan.obj",
            photo=(),
            camera=(),
            size=PhotoSettings(),
            settings=QUICK,
            units="mm",
            view=False,
            formats=("png",),
            **how,
        )
        monkeypatch.chdir(tmp_path)
        return restore_upload(folder, tmp_path / name, request, lambda stage, share: None)

    assert ask("points", points_only=True) == {"files": ["points.json"]}
    shown = json.loads((tmp_path / "points" / "points.json").read_text())
    low, high = scan.mesh.points[paper].min(axis=0), scan.mesh.points[paper].max(axis=0)
    corners = [[x, y, 0] for x, y in ((low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1]))]
    made = ask("page", cut=read_cut(field(shown, corners, shown["right"], shown["down"])))
    report = json.loads((tmp_path / "page" / "report.json").read_text())
    page = sorted((report["page"]["width_mm"], report["page"]["height_mm"]))
    assert page == pytest.approx([215.9, 279.4], rel=0.02)  # two points of 1.6 mm on each side
    assert any("were left out" in warning for warning in made["warnings"])
