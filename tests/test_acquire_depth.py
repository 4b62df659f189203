"""Depth maps to scans: truth from planes, and from the virtual depth camera before a known book page."""

import json

import cv2
import numpy as np
import pytest

from planish.acquire.grid_mesh import grid_mesh
from planish.acquire.range_image.depth import average_frames, back_project, from_depth, remove_flying_pixels
from planish.acquire.range_image.steps import depth_step
from planish.acquire.scan_preview import preview
from planish.cli.main import run
from planish.document.sheet_outline import find_sheet
from planish.errors import InputError
from planish.gallery import sheet
from planish.gallery.devices import depth_capture
from planish.gallery.sheets import normals
from planish.geometry import project
from planish.io import read_scan
from planish.io.cameras import camera_as_json
from planish.types import Camera

SHAPE = (60, 80)
CAMERA = Camera(np.array([[100.0, 0, 39.5], [0, 100, 29.5], [0, 0, 1]]), np.eye(3), np.zeros(3), SHAPE)
PHOTO = np.full((*SHAPE, 3), 200, np.uint8)


@pytest.fixture(scope="module")
def book():
    made = sheet("book")
    return made, depth_capture(made, frames=30, shape_rc=(240, 320), photo_px=(600, 450))


def from_surface(made, points):
    """Distance of points from a bent sheet [mm], along its normal; nearest of places 0.5 mm apart."""
    from scipy.spatial import cKDTree

    xy = np.stack(np.meshgrid(np.arange(0, made.width_mm, 0.5), np.arange(0, made.height_mm, 0.5)), -1).reshape(-1, 2)
    places = made.bend(xy)
    nearest = cKDTree(places).query(points)[1]
    return np.einsum("ij,ij->i", points - places[nearest], normals(made, xy[nearest]))


def test_depths_come_back_from_the_points_they_were_made_into():
    depth = 400 + 50 * np.random.default_rng(0).random(SHAPE)
    points = back_project(CAMERA, depth)
    np.testing.assert_allclose(points[..., 2], depth, atol=1e-9)
    rows, cols = np.mgrid[: SHAPE[0], : SHAPE[1]]
    np.testing.assert_allclose(project(CAMERA, points.reshape(-1, 3)), np.c_[cols.ravel(), rows.ravel()], atol=1e-9)


@pytest.mark.slow
def test_thirty_noisy_frames_of_the_book_page_are_true_to_half_a_millimetre(book):
    made, capture = book
    acquired = from_depth(capture.frames, capture.camera, capture.photo, capture.photo_camera)
    error = from_surface(made, acquired.scan.mesh.points)
    # 1 mm / sqrt(30) = 0.18 of noise; 0.29 / sqrt(30) of whole millimetres; the border's mixed pixels: 0.5 is asked for
    assert np.sqrt((error**2).mean()) < 0.25
    assert 0.15 < acquired.noise_mm < 0.25
    one = from_depth(capture.frames[:1], capture.camera, capture.photo, capture.photo_camera)
    assert np.sqrt((from_surface(made, one.scan.mesh.points) ** 2).mean()) > 0.8  # averaging is what did it


def test_outliers_and_frames_that_saw_nothing_do_not_pull_the_mean():
    rng = np.random.default_rng(1)
    stack = 500 + rng.standard_normal((30, *SHAPE))
    stack[:3] += 300
    stack[3:6] = 0
    depth, agree = average_frames(stack)
    np.testing.assert_allclose(depth, 500, atol=1.2)  # 5 standard deviations of the mean of 24
    np.testing.assert_allclose(agree, 0.8, atol=0.1)


def test_a_pixel_that_most_frames_do_not_see_is_left_out():
    stack = np.full((4, 1, 2), 500.0)
    stack[:3, 0, 1] = 0
    depth, _ = average_frames(stack)
    assert depth[0, 0] == 500
    assert np.isnan(depth[0, 1])


def test_nothing_is_joined_across_a_depth_jump_and_flying_pixels_go():
    depth = np.where(np.arange(SHAPE[1]) < 40, 500.0, 400.0) * np.ones(SHAPE)
    depth[:, 40] = 450  # the column that saw both
    flown = remove_flying_pixels(depth, CAMERA)
    assert np.isnan(flown[:, 40]).all()
    assert np.isfinite(np.delete(flown, 40, axis=1)).all()
    for map_ in (depth, flown):
        mesh, photo_xy = grid_mesh(back_project(CAMERA, map_), CAMERA)
        assert np.ptp(mesh.points[mesh.faces][..., 2], axis=1).max() < 1e-9
        assert 40 not in photo_xy[:, 0]


@pytest.mark.slow
def test_the_mesh_faces_the_camera(book):
    _, capture = book
    mesh = from_depth(capture.frames, capture.camera, capture.photo, capture.photo_camera).scan.mesh
    a, b, c = (mesh.points[mesh.faces[:, k]] for k in range(3))
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()  # the camera hangs above the table


@pytest.mark.slow
def test_the_photo_lies_where_the_photo_camera_saw_each_point(book):
    _, capture = book
    scan = from_depth(capture.frames, capture.camera, capture.photo, capture.photo_camera).scan
    np.testing.assert_allclose(scan.photo_xy, project(capture.photo_camera, scan.mesh.points))


def test_a_registered_photo_may_be_larger_than_the_depth_map():
    photo = np.full((120, 160, 3), 200, np.uint8)
    scan = from_depth([np.full(SHAPE, 300.0)], CAMERA, photo, mask=None).scan
    own = project(CAMERA, scan.mesh.points)
    np.testing.assert_allclose(scan.photo_xy, 2 * own + 0.5, atol=1e-9)  # centres of pixels cut in four


@pytest.mark.slow
def test_the_sheet_is_told_from_the_ground_and_its_print_kept(book):
    _, capture = book
    mask = find_sheet(capture.photo)
    spots = project(capture.photo_camera, sheet("book").bend(np.array([[108.0, 140], [5, 5], [210, 274], [60, 50]])))
    assert all(mask[round(y), round(x)] for x, y in spots)
    assert not mask[:8].any()
    assert find_sheet(np.full((50, 50, 3), 128, np.uint8)) is None


def test_a_mask_by_hand_cuts_the_sheet_out():
    mask = np.zeros(SHAPE, bool)
    mask[10:40, 20:60] = True
    scan = from_depth([np.full(SHAPE, 300.0)], CAMERA, PHOTO, mask=mask).scan
    assert np.ptp(scan.photo_xy, axis=0) == pytest.approx([40, 30], abs=0.2)  # to the pixels' outer edges
    said = from_depth([np.full(SHAPE, 300.0)], CAMERA, PHOTO).warnings
    assert "no sheet stands out" in said[0].sentence


@pytest.mark.slow
def test_a_mirrored_depth_map_under_its_photo_is_told(book):
    _, capture = book
    frames = capture.frames[:1]
    codes = [
        {w.code for w in from_depth(maps, capture.camera, capture.photo, capture.photo_camera).warnings}
        for maps in (frames, [frame[:, ::-1] for frame in frames])
    ]
    assert "depth-mirrored" not in codes[0]
    assert "depth-mirrored" in codes[1]


@pytest.mark.slow
def test_the_picture_shows_the_scan(book):
    _, capture = book
    made = from_depth(capture.frames, capture.camera, capture.photo, capture.photo_camera)
    drawn = preview(made)
    assert drawn.shape[0] == 900
    shaded, photographed, sure = np.array_split(drawn[300:600], 3, axis=1)
    assert photographed.mean() > 100
    assert np.ptp(shaded.mean(axis=2)) > 30
    assert not np.array_equal(shaded, sure)


BAD = {
    "sizes": ([np.ones(SHAPE), np.ones((9, 9))], {}, "depth map 2 is 9 x 9 pixels, the first 80 x 60"),
    "beyond all numbers": (
        [np.full(SHAPE, 1e300), np.full(SHAPE, np.inf)],
        {},
        "2 depth maps holds a depth: all are 0",
    ),
    "zeros": ([np.zeros(SHAPE)], {}, "no pixel of the 1 depth maps holds a depth"),
    "camera": ([np.ones((30, 40))], {}, "the depth maps are 40 x 30 pixels, but the depth camera's"),
    "lonely": ([np.where(np.arange(4800).reshape(SHAPE) == 3, 500.0, 0)], {"mask": None}, "1 of 4,800 pixels"),
    "photo": ([np.ones(SHAPE)], {"photo": np.zeros((60, 60, 3), np.uint8)}, "give the photo's own camera"),
    "mask": ([np.ones(SHAPE)], {"mask": np.ones((9, 9), bool)}, "the mask is 9 x 9 pixels, the photo 80 x 60"),
    "black mask": ([np.ones(SHAPE)], {"mask": np.zeros(SHAPE, bool)}, "the mask is black all over"),
    "photo_camera": (
        [np.ones(SHAPE)],
        {"photo_camera": CAMERA, "photo": np.zeros((9, 9, 3), np.uint8)},
        "the photo is 9 x 9 pixels, but its camera's numbers are for 80 x 60",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_what_cannot_be_used_is_said(case):
    frames, more, sentence = BAD[case]
    with pytest.raises(InputError, match=sentence):
        from_depth(frames, CAMERA, **{"photo": PHOTO, **more})


@pytest.mark.slow
def test_the_command_makes_a_scan_that_restore_takes_without_options(book, tmp_path):
    made, capture = book
    (tmp_path / "depth").mkdir()
    for k, frame in enumerate(capture.frames[:5]):
        cv2.imwrite(str(tmp_path / "depth" / f"{k}.png"), frame.astype(np.uint16))
    cv2.imwrite(str(tmp_path / "photo.png"), capture.photo[..., ::-1])
    for name, camera in (("depth", capture.camera), ("photo", capture.photo_camera)):
        (tmp_path / f"{name}.json").write_text(json.dumps(camera_as_json(camera)))
    at = {name: str(tmp_path / name) for name in ("depth", "photo.png", "depth.json", "photo.json", "scan.ply")}
    command = ["acquire", "depth", at["depth"], "--photo", at["photo.png"], "--camera", at["depth.json"]]
    command += ["--photo-camera", at["photo.json"], "-o", at["scan.ply"], "--picture", str(tmp_path / "look.png")]
    assert run(command) == 0
    assert cv2.imread(str(tmp_path / "look.png")).shape[0] == 900
    found = read_scan(at["scan.ply"])
    assert found.scan.photo.shape == capture.photo.shape
    report = tmp_path / "report.json"
    assert (
        run(["restore", at["scan.ply"], "-o", str(tmp_path / "page.png"), "--dpi", "80", "--report", str(report), "-q"])
        == 0
    )
    page = json.loads(report.read_text())["page"]
    # 1.35 mm a pixel here: the sheet ends between pixels, at the outline that the photo shows
    assert page["width_mm"] == pytest.approx(made.width_mm, abs=1.35)
    assert page["height_mm"] == pytest.approx(made.height_mm, abs=1.35)


@pytest.mark.parametrize(("step_mm", "told"), [(1.0, True), (0.1, False)])
def test_depths_in_coarse_steps_are_told_and_their_noise_is_not_zero(step_mm, told):
    """A sheet seen straight on, 0.2 mm of noise rounded to whole millimetres: most differences are exactly 0."""
    camera = Camera(np.array([[300.0, 0, 79.5], [0, 300, 59.5], [0, 0, 1]]), np.eye(3), np.zeros(3), (120, 160))
    rng = np.random.default_rng(5)
    depth = 500.3 + rng.normal(0, 0.2, (120, 160)) + 0.01 * np.arange(160)
    acquired = from_depth(
        [np.rint(depth / step_mm) * step_mm], camera, np.full((120, 160, 3), 200, np.uint8), mask=None
    )
    assert ("depth-in-steps" in {warning.code for warning in acquired.warnings}) == told
    # rounding adds step / sqrt(12) = 0.29 mm, and may take 0.2 mm of noise away altogether
    assert 0.15 < acquired.noise_mm < 0.45


def test_averaged_frames_have_no_steps():
    rng = np.random.default_rng(6)
    frames = [np.rint(500.3 + rng.normal(0, 1.0, (120, 160))) for _ in range(30)]
    assert depth_step(np.mean(frames, axis=0)) < 0.05  # a thirtieth of a millimetre


@pytest.mark.parametrize("levels", [(250.0, 300.0), (250.0, 300.0, 350.0), (300.0,)])
def test_flat_surfaces_one_behind_the_other_are_no_steps(levels):
    assert depth_step(np.repeat(levels, 2000)) == 0.0


def test_lone_missing_pixels_and_pairs_are_filled_and_larger_gaps_stay():
    camera = Camera(np.array([[300.0, 0, 79.5], [0, 300, 59.5], [0, 0, 1]]), np.eye(3), np.zeros(3), (120, 160))
    depth = 500.0 + 0.05 * np.arange(160) + np.zeros((120, 1))
    depth[20, 30] = depth[40, 50] = depth[40, 51] = 0
    depth[60:66, 60:66] = 0
    depth[:, 100:] += 100.0
    depth[80, 99] = 0  # at the jump its neighbours are on two surfaces
    acquired = from_depth([depth], camera, np.full((120, 160, 3), 200, np.uint8), mask=None)
    there = {tuple(xy) for xy in acquired.scan.photo_xy.astype(int)}
    assert {(30, 20), (50, 40), (51, 40)} <= there
    assert (62, 62) not in there
    assert (99, 80) not in there
    filled = acquired.scan.mesh.points[acquired.scan.photo_xy.astype(int).tolist().index([30, 20])]
    assert filled[2] == pytest.approx(500.0 + 0.05 * 30, abs=1e-6)


def codes(acquired):
    return {warning.code for warning in acquired.warnings}


@pytest.mark.slow
def test_the_noise_is_told_and_one_frame_has_too_much(book):
    """1 mm of noise along the rays and whole millimetres, 1.8 mm between points; thirty frames have 0.18 mm."""
    _, capture = book
    one, all_of_them = (
        from_depth(capture.frames[:count], capture.camera, capture.photo, capture.photo_camera) for count in (1, 30)
    )
    assert 0.7 < one.noise_mm < 1.4
    assert 0.3 < one.noise_length_mm < 2.0
    assert "scan-noisy" in codes(one)
    assert "several frames" in next(w.hint for w in one.warnings if w.code == "scan-noisy")
    assert all_of_them.noise_length_mm > 0.3
    assert "scan-noisy" not in codes(all_of_them)


@pytest.mark.slow
def test_the_command_says_the_height_and_the_length_of_the_noise(book, monkeypatch, capsys):
    from planish.cli.acquire.common import print_scan_summary

    _, capture = book
    one = from_depth(capture.frames[:1], capture.camera, capture.photo, capture.photo_camera)
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    print_scan_summary(one, [], [], quiet=False)
    out, err = capsys.readouterr()
    assert f"noise {one.noise_mm:.3f} mm, alike over {one.noise_length_mm:.2g} mm" in out
    assert "the scan is noisy" in err
    assert "bring the camera nearer" in err
