"""Boards and calibration: truth from the virtual camera and projector that took the photos."""

import json
import re
import shlex
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pikepdf
import pytest

from planish.acquire.calibration.boards import Board, board_page, board_pixels, corner_points, find_corners
from planish.acquire.calibration.camera import _calibrate, calibrate_camera, calibrate_projector
from planish.acquire.calibration.poses import draw_poses
from planish.acquire.structured_light.gray_code import patterns
from planish.cli.main import run
from planish.errors import InputError, UsageError
from planish.gallery import sheet, typeset_sheet
from planish.gallery.devices import SMALL_RIG, board_poses, posed_board, projector_rig, structured_light
from planish.geometry import project
from planish.io import read_camera
from planish.io.cameras import camera_as_json

pytestmark = pytest.mark.usefixtures("corners_found_once")

SESSION = Path(__file__).parent.parent / "docs" / "acquire.md"
BOARD = Board(9, 7, 18.0)
CAMERA, PROJECTOR = projector_rig(sheet("book"), *SMALL_RIG)
WHITE = [np.full(SMALL_RIG[1], 255, np.uint8)]


def photos_of(board, poses, shown=WHITE):
    """What the virtual camera sees of the board in each pose, under each pattern."""
    for turn, middle in poses:
        stiff, page = posed_board(board_pixels(board, 90), 90, board.square_mm, turn, middle)
        yield structured_light(stiff, CAMERA, PROJECTOR, shown, page).frames


@pytest.fixture(scope="module")
def photos():
    return [frames[0] for frames in photos_of(BOARD, board_poses(6))]


@pytest.fixture(scope="module")
def captures():
    return list(photos_of(BOARD, board_poses(4, rng=1), list(patterns(SMALL_RIG[1]))))


@pytest.fixture(scope="module")
def calibrated(photos):
    return calibrate_camera(photos, BOARD)


def exact_corners(count, board=BOARD, camera=CAMERA, alike=False):
    """Corners where the camera sees them, without any photo."""
    places, corners = [], []
    for turn, middle in board_poses(count):
        stiff, _ = posed_board(np.zeros((7, 9), np.uint8), 1, board.square_mm, turn * (0.05 if alike else 1), middle)
        places.append(corner_points(board))
        corners.append(project(camera, stiff.bend(corner_points(board)[:, :2])))
    return places, corners


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["charuco", "chessboard"])
def test_corners_are_found_where_they_are(kind):
    board = replace(BOARD, kind=kind)
    turn, middle = next(board_poses(1))
    frames = next(photos_of(board, [(turn, middle)]))
    rows_of, xy = find_corners(board, frames[0])
    stiff, _ = posed_board(board_pixels(board, 90), 90, 18.0, turn, middle)
    true = project(CAMERA, stiff.bend(corner_points(board)[:, :2]))
    if kind == "chessboard" and np.linalg.norm(xy[0] - true[0]) > 50:
        true = true[::-1]  # a chessboard looks the same from either end
    assert len(rows_of) == 48
    assert np.linalg.norm(xy - true[rows_of], axis=1).max() < 0.35  # px, at squares of 33 px and noise of 1 level


@pytest.mark.slow
def test_a_camera_is_found_again(calibrated):
    camera = calibrated.camera
    assert calibrated.rms_px < 0.15
    np.testing.assert_allclose(np.diag(camera.matrix)[:2], np.diag(CAMERA.matrix)[:2], rtol=0.005)
    np.testing.assert_allclose(camera.matrix[:2, 2], CAMERA.matrix[:2, 2], atol=6)
    # what counts: rays in the middle half of the view, to a third of a pixel at most where the board was seen
    assert calibrated.focal_sd < 0.005
    assert camera.shape_rc == CAMERA.shape_rc


def test_exact_corners_give_the_exact_camera():
    found, kept = _calibrate(*exact_corners(8), CAMERA.shape_rc, [])
    assert kept == list(range(8))
    assert found.rms_px < 1e-3  # OpenCV keeps corners as float32
    np.testing.assert_allclose(found.camera.matrix, CAMERA.matrix, rtol=1e-3, atol=0.05)
    np.testing.assert_allclose(found.camera.distortion, CAMERA.distortion, atol=0.02)


def test_a_photo_that_does_not_fit_is_left_out_and_said():
    places, corners = exact_corners(8)
    corners[3] = corners[3] + np.random.default_rng(0).normal(0, 6, corners[3].shape)
    found, kept = _calibrate(places, corners, CAMERA.shape_rc, [])
    assert kept == [0, 1, 2, 4, 5, 6, 7]
    assert "1 photos do not fit" in found.warnings[0].sentence


def test_poses_that_are_too_alike_are_refused():
    with pytest.raises(InputError, match="poses are too alike"):
        _calibrate(*exact_corners(8, alike=True), CAMERA.shape_rc, [])


@pytest.mark.slow
def test_a_projector_is_found_again(captures):
    found = calibrate_projector(captures, BOARD, CAMERA, SMALL_RIG[1])
    assert found.rms_px < 0.15
    spots = sheet("book").bend(np.random.default_rng(0).uniform([20, 60], [200, 220], (200, 2)))
    off = np.linalg.norm(project(found.camera, spots) - project(PROJECTOR, spots), axis=1)
    # four poses only; 0.4 px of the projector are 0.14 mm on the page
    assert off.max() < 0.5


@pytest.mark.slow
def test_bad_photos_are_said(photos, captures):
    with pytest.raises(InputError, match="was found in 0 of 4 photos"):
        calibrate_camera([np.full((100, 120), 200, np.uint8)] * 4, BOARD)
    with pytest.raises(InputError, match="photo 2 is 320 x 512 pixels, photo 1 640 x 512"):
        calibrate_camera([photos[0], photos[1][:, ::2]], BOARD)
    with pytest.raises(InputError, match=r"pose 1: there are 39 photos"):
        calibrate_projector([captures[0][1:]], BOARD, CAMERA, SMALL_RIG[1])
    with pytest.raises(InputError, match="pose 1: the photos are 320 x 512 pixels"):
        calibrate_projector([captures[0][:, :, ::2]], BOARD, CAMERA, SMALL_RIG[1])
    with pytest.raises(InputError, match="lit by the projector, in 1 of 1 poses; at least 4"):
        calibrate_projector(captures[:1], BOARD, CAMERA, SMALL_RIG[1])


@pytest.mark.parametrize(
    ("board", "sentence"),
    [
        ({"columns": 2}, "a board of 2 x 10 squares"),
        ({"square_mm": 0.0}, "squares of 0 mm"),
        ({"kind": "dots"}, "there is no board 'dots'"),
    ],
)
def test_impossible_boards_are_refused(board, sentence):
    with pytest.raises(UsageError, match=sentence):
        Board(**board)


@pytest.mark.parametrize("paper", ["a4", "letter"])
def test_the_printed_board_has_its_true_size(paper, tmp_path):
    page = board_page(Board(), paper)
    dark = ~page.pixels[: -20 * 20]  # without the scale at the foot
    across = np.flatnonzero(dark.any(axis=0))
    assert (across[-1] - across[0] + 1) / page.dpi * 25.4 == pytest.approx(7 * 25.0, abs=0.05)  # a pixel
    assert run(["calibrate", "board", "-o", str(tmp_path / "board.pdf"), "--paper", paper]) == 0
    with pikepdf.open(tmp_path / "board.pdf") as pdf:
        width = float(pdf.pages[0].mediabox[2]) / 72 * 25.4
    assert width == pytest.approx(210.0 if paper == "a4" else 215.9, abs=0.03)
    with pytest.raises(UsageError, match="does not fit on"):
        board_page(Board(square_mm=40.0), paper)


@pytest.mark.slow
def test_the_picture_of_the_poses(calibrated):
    drawn = draw_poses(calibrated, BOARD)
    assert drawn.shape == (640, 3 * 640 + 2 * 20, 3)
    assert all((panel < 200).any() for panel in np.array_split(drawn, 3, axis=1))


@pytest.mark.slow
def test_from_photos_to_a_page_by_the_commands(photos, captures, tmp_path, monkeypatch, capsys):
    """The session of docs/acquire.md by copy and paste, on fewer photos than `planish acquire virtual` makes."""
    monkeypatch.chdir(tmp_path)
    session = re.search(r"```console\n(planish acquire virtual boards .+?)```", SESSION.read_text(), re.S)[1]
    commands = [shlex.split(line)[1:] for line in session.splitlines()]
    book = sheet("book")
    made = structured_light(book, CAMERA, PROJECTOR, patterns(SMALL_RIG[1]), typeset_sheet(book)[0])
    folders = {"camera": photos, "book/photos": made.frames} | {f"pose_{k}": c for k, c in enumerate(captures)}
    for name, images in folders.items():
        folder = tmp_path / "try" / name
        folder.mkdir(parents=True)
        for k, image in enumerate(images):
            cv2.imwrite(str(folder / f"{k}.png"), image)
    cv2.imwrite("try/book/photo.png", made.photo[..., ::-1])
    assert [words[:2] for words in commands[:2]] == [["acquire", "virtual"]] * 2
    for words in commands[2:]:
        there = [path for word in words for path in (sorted(map(str, Path().glob(word))) if "*" in word else [word])]
        more = ["--dpi", "100", "--report", "report.json", "-q"] if words[0] == "restore" else []
        assert run([*there, *more]) == 0, capsys.readouterr().err
    assert read_camera("try/proj.json").shape_rc == SMALL_RIG[1]
    page = json.loads(Path("report.json").read_text())["page"]
    # of 215.9 x 279.4: up to two camera pixels of 0.55 mm are lost at each side, and the scale is good to 0.3 %
    assert page["width_mm"] == pytest.approx(214.5, abs=2.2)
    assert page["height_mm"] == pytest.approx(278.5, abs=2.2)
    Path("other.json").write_text(json.dumps({**camera_as_json(CAMERA), "image_size": [1280, 1024]}))
    capsys.readouterr()
    wrong = ["--camera", "other.json", "--projector", "try/proj.json", "-o", "x.ply"]
    assert run(["acquire", "gray-code", "try/book/photos", *wrong]) == 3
    assert "but the camera's numbers are for 1280 x 1024" in capsys.readouterr().err
