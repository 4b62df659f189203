"""What devices write and cameras see that an earlier version did not take: faint lasers, poor photos, plain boards."""

import cv2
import numpy as np
import pytest

from planish.acquire.calibration.boards import Board, board_pixels, find_corners
from planish.acquire.laser.board import calibrate_laser_planes
from planish.acquire.laser.faint import faint_line
from planish.errors import InputError
from planish.gallery import sheet
from planish.gallery.laser import overhead_camera


def board_with_line(strength, rows=270, cols=360, noise=2.0):
    """A bright chessboard of 30 px squares with a green line that is greener by so many levels, and its place."""
    row, col = np.mgrid[:rows, :cols]
    grey = np.where((row // 30 + col // 30) % 2, 220.0, 60.0)
    at = 150 + 0.1 * np.arange(rows)
    line = strength * np.exp(-(((col - at[:, None]) / 1.5) ** 2) / 2)
    photo = np.stack([grey, np.minimum(grey + line, 255), grey], axis=2)
    noisy = photo + np.random.default_rng(0).normal(0, noise, photo.shape)
    return np.clip(noisy, 0, 255).astype(np.uint8), at


def test_a_faint_line_over_a_board_is_found_in_nearly_all_rows():
    photo, true = board_with_line(20.0)
    at, channel = faint_line(photo, np.ones(photo.shape[:2], bool), "rows")
    assert channel == 1
    assert np.isfinite(at).mean() > 0.9
    assert np.nanmedian(np.abs(at - true)) < 0.5  # px, of a line 3.5 px wide


def test_without_a_line_hardly_a_row_has_one():
    photo, _ = board_with_line(0.0)
    at, _ = faint_line(photo, np.ones(photo.shape[:2], bool), "rows")
    assert np.isfinite(at).mean() < 0.1


def posed(board, distance, tilt, camera):
    """A photo of the board held before a camera, with a plane of green light on it (x = 20 mm in the camera)."""
    pixels = board_pixels(board, 40).astype(np.float64)
    size = np.array([pixels.shape[1], pixels.shape[0]]) / 40 * board.square_mm
    turn = cv2.Rodrigues(np.radians([[tilt], [0.6 * tilt], [0.0]]))[0]
    row, col = np.mgrid[: camera.shape_rc[0], : camera.shape_rc[1]]
    rays = np.stack([col, row, np.ones(row.shape)], axis=-1) @ np.linalg.inv(camera.matrix).T
    normal, middle = turn[:, 2], np.array([0.0, 0, distance])
    points = rays * ((normal @ middle) / (rays @ normal))[..., None]
    local = (points - middle) @ turn + [*(size / 2), 0]
    places = (local[..., :2] / board.square_mm * 40 - 0.5).astype(np.float32)
    grey = cv2.remap(pixels, places[..., 0], places[..., 1], cv2.INTER_LINEAR, borderValue=235)
    grey = cv2.GaussianBlur(0.75 * grey + 20, (5, 5), 0.8)
    line = 40 * np.exp(-(((points[..., 0] - 20) / 0.6) ** 2) / 2)
    photo = np.stack([grey, np.minimum(grey + line, 255), grey], axis=2)
    return np.clip(photo + np.random.default_rng(1).normal(0, 1, photo.shape), 0, 255).astype(np.uint8)


def test_a_poor_photo_is_left_out_of_a_laser_s_calibration():
    camera = overhead_camera(sheet("flat", width_mm=200.0, height_mm=270.0), (1000, 800))
    camera = type(camera)(camera.matrix, np.eye(3), np.zeros(3), camera.shape_rc)
    board = Board(8, 11, 18.0, "chessboard")
    photos = [posed(board, d, t, camera) for d, t in ((480.0, 5.0), (560.0, -14.0), (520.0, 12.0))]
    blank = np.full_like(photos[0], 120)
    found = calibrate_laser_planes([*photos, blank], ["a", "b", "c", "blank.jpg"], camera, board)
    assert len(found.left_out) == 1
    assert "blank.jpg" in found.left_out[0]
    plane = found.planes[0] / np.linalg.norm(found.planes[0][:3])
    assert abs(plane[0]) > 0.999
    assert abs(abs(plane[3]) - 20) < 0.5  # mm
    with pytest.raises(InputError, match=r"blank\.jpg"):
        calibrate_laser_planes([photos[0], blank], ["a", "blank.jpg"], camera, board)


@pytest.mark.parametrize("blind", ["findChessboardCorners", "findChessboardCornersSB"])
def test_a_chessboard_that_one_detector_misses_is_seen_by_the_other(monkeypatch, blind):
    board = Board(8, 6, 10.0, "chessboard")
    photo = np.full((420, 520), 200, np.uint8)
    drawn = board_pixels(board, 50)
    photo[60 : 60 + drawn.shape[0], 60 : 60 + drawn.shape[1]] = 0.6 * drawn + 40
    photo = cv2.GaussianBlur(photo, (5, 5), 1.0)
    monkeypatch.setattr(cv2, blind, lambda *args, **kwargs: (False, None))
    rows_of, xy = find_corners(board, photo)
    assert len(rows_of) == 35
    true = 60 + 50 * (1 + np.stack([rows_of % 7, rows_of // 7], axis=1)) - 0.5
    assert min(np.abs(xy - true).max(), np.abs(xy[::-1] - true).max()) < 0.5  # px
