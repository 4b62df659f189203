"""Gray code to scans: truth from the patterns themselves and from a virtual projector before a known book page."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from captures import DATA
from planish.acquire.structured_light.frames import check_frames
from planish.acquire.structured_light.gray_code import Codes, bits_for, decode, frame_count, patterns
from planish.acquire.structured_light.projector import check_fit, projector_of_code, triangulate_pairs
from planish.acquire.structured_light.scan import find_correspondence, from_gray_code
from planish.acquire.structured_light.subpixel import refine_subpixel
from planish.cli.main import run
from planish.errors import InputError, UsageError
from planish.gallery import sheet, typeset_sheet
from planish.gallery.devices import PROJECTOR_LENS, SMALL_RIG, projector_rig, structured_light
from planish.gallery.scene_view import aim_camera, render_view
from planish.geometry import project
from planish.geometry.triangulation import meet_plane, rays
from planish.io import image_files, read_captures
from planish.io.cameras import camera_as_json
from planish.types import Camera

PROJECTOR = SMALL_RIG[1]


@pytest.fixture(scope="module")
def rig():
    return projector_rig(sheet("book"), *SMALL_RIG)


@pytest.fixture(scope="module")
def capture(rig):
    book = sheet("book")
    return structured_light(book, *rig, patterns(PROJECTOR), typeset_sheet(book)[0])


@pytest.fixture(scope="module")
def truth(rig):
    """What each camera pixel sees: points, and where they lie on the projector."""
    seen = render_view(sheet("book"), rig[0])
    return seen, project(rig[1], seen.points.reshape(-1, 3)).reshape(*rig[0].shape_rc, 2)


@given(st.integers(2, 300), st.integers(2, 300))
def test_the_patterns_decode_to_their_own_pixels(rows, cols):
    frames = np.stack(list(patterns((rows, cols))))
    assert len(frames) == frame_count((rows, cols)) == 2 * (bits_for(rows) + bits_for(cols)) + 2
    codes = decode(frames, (rows, cols))
    assert (codes.column == np.arange(cols)).all()
    assert (codes.row == np.arange(rows)[:, None]).all()


def test_the_order_is_that_of_opencv():
    """Pattern before inverse, columns before rows, highest bit first: Gray code k ^ k // 2 read by hand."""
    frames = list(patterns((4, 8)))
    first = frames[0][0] > 0
    assert first.tolist() == [False] * 4 + [True] * 4
    assert (frames[2][0] > 0).tolist() == [False, False, True, True, True, True, False, False]
    assert (frames[4][0] > 0).tolist() == [False, True, True, False, False, True, True, False]
    assert (frames[6][:, 0] > 0).tolist() == [False, False, True, True]
    assert all((a == 255 - b).all() for a, b in zip(frames[::2], frames[1::2], strict=True))


@pytest.mark.slow
def test_codes_are_right_to_a_pixel_and_refined_to_a_thirtieth(capture, truth):
    seen, place = truth
    codes = decode(capture.frames, PROJECTOR)
    paper = (codes.column >= 0) & np.isfinite(seen.page_xy[..., 0]) & (codes.confidence > 0.3)
    whole = np.abs(codes.column - place[..., 0])[paper]
    fine = np.abs(refine_subpixel(capture.frames, codes, PROJECTOR) - place)[paper]
    assert np.quantile(whole, 0.99) < 1.0  # the step of the code
    assert np.nanmedian(fine) < 1 / 30
    assert np.nanquantile(fine, 0.95) < 0.2  # ink's edges, and the last pixels before the sheet's


@pytest.mark.slow
def test_the_book_page_is_true_to_a_twentieth_of_a_millimetre(rig, capture, truth):
    made = from_gray_code(capture.frames, *rig, capture.photo)
    column, row = made.scan.photo_xy.astype(int).T
    ray = truth[0].points[row, column]
    error = made.scan.mesh.points - ray
    error = (error * truth[0].normals[row, column]).sum(axis=1)
    on_sheet = np.isfinite(truth[0].page_xy[row, column, 0])
    assert on_sheet.mean() > 0.995
    # half the pixels of the rig that is held to 0.05 mm: twice the error, and 1 % of points at edges of ink left out
    assert np.sqrt(np.mean(np.sort(np.abs(error[on_sheet]))[: int(0.99 * on_sheet.sum())] ** 2)) < 0.05
    area = np.isfinite(truth[0].page_xy[..., 0]).sum()
    assert len(made.scan.mesh.points) > 0.97 * area  # ink does not tear holes


@pytest.mark.slow
@pytest.mark.parametrize(("most", "warned"), [(0.01, True), (0.25, False)])
def test_the_noise_of_the_surface_is_reported(rig, capture, monkeypatch, most, warned):
    """0.016 mm at half a millimetre between points; and what to do where that counts as too much."""
    monkeypatch.setattr("planish.acquire.scan_quality.NOISY", most)
    made = from_gray_code(capture.frames, *rig, capture.photo)
    assert 0.008 < made.noise_mm < 0.03
    assert 0.2 < made.noise_length_mm < 2.0
    hints = [warning.hint for warning in made.warnings if warning.code == "scan-noisy"]
    assert len(hints) == warned
    assert all("phase_steps" in hint for hint in hints)


@pytest.mark.slow
@pytest.mark.parametrize("unresolved", [1, 2])
def test_stripes_too_fine_for_the_camera_leave_no_holes(capture, truth, unresolved):
    """The finest rows are grey with some noise, as a camera sees them that does not resolve them."""
    blurred, end = capture.frames.copy(), len(capture.frames) - 2
    rng = np.random.default_rng(3)
    for k in range(end - 2 * unresolved, end, 2):
        grey = blurred[k : k + 2].astype(float).mean(axis=0)
        blurred[k : k + 2] = np.clip(np.rint(grey + rng.normal(0, 2, (2, *grey.shape))), 0, 255)
    on_page = np.isfinite(truth[0].page_xy[..., 0])
    result = find_correspondence(blurred, PROJECTOR)
    assert "stripes-unresolved" in {warning.code for warning in result.warnings}
    known = np.isfinite(result.projector_xy).all(axis=2)
    assert known[on_page].mean() > 0.97  # as with all bits; read as if resolved, a third of the pixels was lost
    error = np.abs(result.projector_xy - truth[1])[on_page & known]
    assert np.median(error[:, 1]) < 0.1  # crossings two or four times as far apart, of the same exactness each


@pytest.mark.slow
def test_without_refining_there_are_terraces(rig, capture, truth):
    """What the refinement is for: the plain codes' points lie off by far more."""
    codes = decode(capture.frames, PROJECTOR)
    known = (codes.column >= 0) & np.isfinite(truth[0].page_xy[..., 0])
    xy = np.argwhere(known)[:, ::-1].astype(float)
    plain, _ = triangulate_pairs(*rig, xy, np.c_[codes.column[known], codes.row[known]].astype(float))
    fine, _ = triangulate_pairs(*rig, xy, refine_subpixel(capture.frames, codes, PROJECTOR)[known])
    off = [np.nanmedian(np.linalg.norm(p - truth[0].points[known], axis=1)) for p in (plain, fine)]
    assert off[1] < off[0] / 10


@pytest.mark.slow
@pytest.mark.parametrize("factor", [2.0, 0.5, 1.5])
def test_a_projector_calibrated_at_another_scale_is_refused_with_the_factor(rig, capture, factor):
    camera, projector = rig
    wrong = projector_of_code(projector, 1 / factor)
    xy = np.random.default_rng(0).uniform(0, 500, (3000, 2))
    seen = render_view(sheet("book"), camera).points[xy[:, 1].astype(int), xy[:, 0].astype(int)]
    xy = np.trunc(xy)
    code = project(projector, seen)
    assert check_fit(camera, projector, xy, code) < 0.01
    with pytest.raises(InputError, match=f"give projector_scale={factor:g}"):
        check_fit(camera, wrong, xy, code)
    assert check_fit(camera, projector_of_code(wrong, factor), xy, code) < 0.01


@pytest.mark.slow
def test_patterns_that_were_stretched_one_way_are_refused(rig):
    """The projector stands above the camera, where rays miss each other little if its rows alone are scaled."""
    camera, _ = rig
    projector = aim_camera((10, 230, 590), (0, 0, 10), 375, PROJECTOR, PROJECTOR_LENS)
    row, col = np.mgrid[5:512:9, 5:640:9]
    seen = render_view(sheet("book"), camera).points[row, col].reshape(-1, 3)  # table and page
    xy, code = np.c_[col.ravel(), row.ravel()].astype(float), project(projector, seen)
    assert check_fit(camera, projector, xy, code) < 0.01
    for factor in (1.25, 0.8):
        stretched = code * [1, factor]  # rows of the calibration are finer
        with pytest.raises(InputError, match=rf"if its rows are taken to be {1 / factor:.3g} .* off a plane instead"):
            check_fit(camera, projector, xy, stretched)


@pytest.mark.slow
def test_errors_that_no_scale_explains_are_not_put_down_to_one(rig):
    """Rays that miss each other a little are noted, not refused, and a bent sheet is not made flat."""
    camera, projector = rig
    points = np.random.default_rng(0).uniform([-90, -120, 0], [90, 120, 30], (2000, 3))
    points[:, 2] = 30 * np.cos(points[:, 0] / 40)
    turn = cv2.Rodrigues(np.array([0.003, 0, 0.0]))[0]
    moved = replace(projector, rotation=turn @ projector.rotation, translation=turn @ projector.translation)
    assert 0.7 < check_fit(camera, moved, project(camera, points), project(projector, points)) < 2.5


@pytest.mark.slow
def test_a_projector_that_was_moved_is_refused(rig):
    camera, projector = rig
    points = np.random.default_rng(0).uniform([-90, -120, 0], [90, 120, 30], (2000, 3))
    turn = cv2.Rodrigues(np.array([0.02, 0, 0.02]))[0]
    moved = replace(projector, rotation=turn @ projector.rotation, translation=turn @ projector.translation)
    with pytest.raises(InputError, match="no other scale of the projector helps"):
        check_fit(camera, moved, project(camera, points), project(projector, points))


FRAMES = frame_count(PROJECTOR)
BAD = {
    "one is missing": (lambda f: np.delete(f, 12, 0), f"photo 13 or 14 of the {FRAMES} is missing"),
    "black is missing": (lambda f: f[:-1], "white or black at the end is missing"),
    "many are missing": (
        lambda f: f[:20],
        f"there are 20 photos; a code for 640 x 400 pixels of the projector has {FRAMES}",
    ),
    "few": (lambda f: f[:2], "there are 2 photos"),
    "one too many": (lambda f: np.insert(f, 6, f[5], 0), "photos 6 and 7 show the same pattern; take one of them away"),
    "one doubled, one lost": (
        lambda f: f[[*range(7), 6, *range(8, FRAMES)]],
        "photos 7 and 8 show the same pattern, so",
    ),
    "not pairs": (lambda f: f[[0, 2, 1, *range(3, FRAMES)]], "are not a pattern and its inverse"),
    "exchanged": (lambda f: f[[0, 1, 2, 3, 5, 4, *range(6, FRAMES)]], "photos 5 and 6 are exchanged"),
    "shuffled": (lambda f: f[[0, 1, 4, 5, 2, 3, *range(6, FRAMES)]], "some before them are out of order"),
    "rows first": (lambda f: np.concatenate([f[20:38], f[:20], f[38:]]), "do not follow in the column code"),
    "dark": (lambda f: f // 60, "lights 0.0 % of the view more than black"),
    "white and black": (lambda f: f[[*range(FRAMES - 2), -1, -2]], "white comes before black"),
    "overexposed": (lambda f: np.clip(f * 2.5, 0, 255).astype(np.uint8), "is overexposed under white"),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", BAD)
def test_photos_that_cannot_be_decoded_are_named(capture, case):
    spoil, sentence = BAD[case]
    check_frames(capture.frames, PROJECTOR)
    with pytest.raises(InputError) as said:
        check_frames(spoil(capture.frames), PROJECTOR)
    assert sentence in str(said.value)


@pytest.mark.slow
def test_photos_of_another_camera_and_impossible_scales_are_refused(rig, capture):
    with pytest.raises(InputError, match="the photos are 320 x 512 pixels, but the camera's"):
        from_gray_code(capture.frames[:, :, ::2], *rig)
    with pytest.raises(UsageError, match="must be above 0"):
        from_gray_code(capture.frames, *rig, projector_scale=0.0)


def test_codes_are_read_only():
    codes = Codes(np.zeros((2, 2), np.int32), np.zeros((2, 2), np.int32), np.zeros((2, 2)))
    with pytest.raises(ValueError, match="read-only"):
        codes.row[0, 0] = 1


@pytest.mark.slow
def test_the_commands_go_from_photos_to_a_scan(rig, capture, tmp_path, capsys):
    for k, frame in enumerate(capture.frames):
        cv2.imwrite(str(tmp_path / f"{k}.png"), frame)  # 0, 1, 2 ... 10: numbers in names count as numbers
    out = tmp_path / "out"
    out.mkdir()
    for name, camera in zip(("camera", "projector"), rig, strict=True):
        (out / f"{name}.json").write_text(json.dumps(camera_as_json(camera)))
    command = ["acquire", "gray-code", str(tmp_path), "--camera", f"{out}/camera.json", "-o", f"{out}/scan.ply"]
    assert run([*command, "--projector", f"{out}/projector.json", "--picture", f"{out}/look.png"]) == 0
    assert (out / "scan.jpg").exists()
    twice = camera_as_json(projector_of_code(rig[1], 0.5))
    (out / "twice.json").write_text(json.dumps(twice))
    capsys.readouterr()
    assert run([*command, "--projector", f"{out}/twice.json"]) == 3
    assert (
        "there are 40 photos; a code for 1280 x 800 pixels of the projector has 44" in capsys.readouterr().err
    )  # twice the pixels need one more bit each way
    assert run([*command, "--projector", f"{out}/twice.json", "--projector-scale", "2", "--overwrite"]) == 0


def test_patterns_are_written(tmp_path):
    assert run(["acquire", "patterns", "--size", "64", "40", "-o", str(tmp_path / "p")]) == 0
    names = sorted(p.name for p in (tmp_path / "p").iterdir())
    assert len(names) == frame_count((40, 64))
    frames = np.stack([cv2.imread(str(tmp_path / "p" / name), 0) for name in names])
    assert (decode(frames, (40, 64)).column == np.arange(64)).all()
    assert run(["acquire", "patterns", "--size", "1", "40", "-o", str(tmp_path / "p")]) == 2


REAL = DATA / "graycode"


@pytest.fixture(scope="module")
def real():
    told = cv2.FileStorage(str(REAL / "calibration_result.xml"), cv2.FILE_STORAGE_READ)
    names = ("cam_int", "cam_dist", "proj_int", "proj_dist", "roration", "translation")
    matrix, lens, lamp, lamp_lens, rotation, shift = (told.getNode(name).mat() for name in names)
    camera = Camera(matrix, np.eye(3), np.zeros(3), (1024, 1280), lens.ravel())
    projector = Camera(lamp, rotation, shift.ravel(), (768, 1024), lamp_lens.ravel())
    photos = [path for path in image_files([REAL]) if path.suffix == ".png"]
    return read_captures(photos).frames, camera, projector


@pytest.mark.shared("graycode")
class TestRealCapture:
    """A chessboard of 75 mm squares at 3.2 m, and a projector calibrated at twice the resolution of its code."""

    @pytest.mark.slow
    def test_the_factor_is_named(self, real):
        with pytest.raises(InputError, match=r"give projector_scale=2 if"):
            from_gray_code(*real, mask=None)

    @pytest.mark.slow
    def test_the_board_is_flat(self, real):
        frames, camera, projector = real
        calibrated = replace(projector, shape_rc=(1536, 2048))
        scan = from_gray_code(frames, camera, calibrated, projector_scale=2.0, mask=None).scan
        bright = np.clip(2.5 * frames[-2].astype(float), 0, 255).astype(np.uint8)
        found, corners = cv2.findChessboardCornersSB(bright, (7, 9), flags=cv2.CALIB_CB_EXHAUSTIVE)
        assert found
        outline = cv2.convexHull(corners.reshape(-1, 2).astype(np.float32)).reshape(-1, 2)
        board = np.zeros((1024, 1280), np.uint8)
        cv2.fillConvexPoly(board, np.rint(outline).astype(np.int32), 1)
        column, row = scan.photo_xy.astype(int).T
        points = scan.mesh.points[board[row, column] > 0]
        off = np.zeros(len(points))
        for _ in range(5):  # the plane of the points within 3 robust standard deviations of it
            near = points[np.abs(off) <= max(4.0 * np.median(np.abs(off)), 1e-9)]
            normal = np.linalg.svd((near - near.mean(axis=0))[::50], full_matrices=False)[2][2]
            off = (points - near.mean(axis=0)) @ normal
        assert 1.4826 * np.median(np.abs(off)) < 1.0  # asked for; plain decoding gave 1.4 mm
        directions, eye = rays(camera, corners.reshape(-1, 2).astype(float))
        on_board = meet_plane(eye, directions, np.append(normal, -normal @ near.mean(axis=0))).reshape(9, 7, 3)
        across = np.linalg.norm(np.diff(on_board, axis=1), axis=2).mean()
        assert abs(across / 75 - 1) < 0.005
