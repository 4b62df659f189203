"""Markers in photos, and the size they give, against the truth of the gallery's photos."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from planish.acquire.photos.marker_scale import scale_from_markers
from planish.acquire.photos.markers import (
    Markers,
    corners_of,
    edge_offsets,
    find_markers,
    with_distortion,
    without_distortion,
)
from planish.errors import InputError
from planish.gallery import MarkerCard, photo_shoot, sheet, typeset_sheet
from planish.geometry import project
from planish.types import Camera

LENS = np.array([0.03, -0.02, 0.001, -0.0005])


@pytest.fixture(scope="module")
def shoot():
    bent = sheet("wave")
    return photo_shoot(bent, typeset_sheet(bent, 150)[0], 5, rng=3, photo_px=(1528, 1146), cards=2)


@pytest.fixture(scope="module")
def found(shoot):
    return [find_markers(photo) for photo in shoot.photos]


def seen(cards, cameras):
    """Markers with exact sides, as if they had been found."""
    photos = []
    for camera in cameras:
        sides, corners = [], []
        for card in cards:
            square = card.corners
            t = np.linspace(0.1, 0.9, 30)[:, None]
            sides.append(tuple(project(camera, square[k] + t * (square[(k + 1) % 4] - square[k])) for k in range(4)))
            corners.append(project(camera, square))
        photos.append(Markers(np.array([card.number for card in cards]), np.array(corners), tuple(sides)))
    return photos


def around(count=4, lens=LENS, tilt=155.0):
    """Cameras half a metre from the origin, 25 degrees off the vertical."""
    cameras = []
    for k in range(count):
        turn = Rotation.from_euler("ZYX", [90.0 * k, 0, tilt], degrees=True).as_matrix()
        rotation = turn.T
        eye = turn @ [0, 0, -500.0]
        matrix = np.array([[1800.0, 0, 760], [0, 1800, 570], [0, 0, 1]])
        cameras.append(Camera(matrix, rotation, -rotation @ eye, (1146, 1528), lens))
    return cameras


@pytest.mark.slow
def test_corners_are_right_to_a_tenth_of_a_pixel(shoot, found):
    off = []
    for markers, camera in zip(found, shoot.cameras, strict=True):
        assert sorted(markers.ids) == sorted(card.number for card in shoot.cards)
        ideal = replace(camera, distortion=np.zeros(0))
        for number, corners in zip(markers.ids, corners_of(markers, camera), strict=True):
            card = next(card for card in shoot.cards if card.number == number)
            off.append(corners - project(ideal, card.corners))
    off = np.array(off)
    assert np.sqrt(np.mean(off**2)) < 0.05  # px; 0.02 to 0.05 where sides have 140 px and noise 1.5 levels
    assert np.abs(off).max() < 0.3


@pytest.mark.slow
def test_size_from_two_cards(shoot, found):
    """The world of the cameras is in units of 7.3 mm here, as structure from motion leaves it."""
    cameras = [replace(camera, translation=camera.translation / 7.3) for camera in shoot.cameras]
    estimate = scale_from_markers(found, cameras, 40.0)
    assert estimate.factor == pytest.approx(7.3, rel=1e-3)  # a tenth of a pixel over 140 px and ten corners
    assert abs(estimate.factor / 7.3 - 1) < 4 * estimate.relative_error
    assert estimate.relative_error < 1e-3
    assert sorted(estimate.markers) == sorted(card.number for card in shoot.cards)
    assert estimate.photos == (0, 1, 2, 3, 4)
    assert estimate.refused == ()


def sharpened(photo):
    """As phones do it: overshoot on both sides of an edge, cut off at black and white."""
    return cv2.addWeighted(photo, 1.8, cv2.GaussianBlur(photo, (0, 0), 1.0), -0.8, 0)


def contrasted(photo):
    code = np.arange(256) / 255
    return np.rint(255 * (0.5 - 0.5 * np.cos(np.pi * code))).astype(np.uint8)[photo]


@pytest.mark.slow
@pytest.mark.parametrize("processed", [sharpened, contrasted])
def test_a_phone_that_sharpens_or_bends_tones_changes_no_size(shoot, found, processed):
    """Sharpening alone made the factor 0.5 % larger here, sides of 140 px being 0.35 px short at both ends."""
    plain = scale_from_markers(found, shoot.cameras, 40.0)
    other = scale_from_markers([find_markers(processed(photo)) for photo in shoot.photos], shoot.cameras, 40.0)
    assert other.factor == pytest.approx(plain.factor, rel=3e-4)


@pytest.mark.parametrize("number", [0, 17, 49])
def test_ink_that_spreads_moves_no_corner(number):
    drawn = cv2.aruco.generateImageMarker(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50), number, 480)
    spread = cv2.erode(np.pad(drawn, 240, constant_values=255), np.ones((9, 9)))  # black grows by 4
    photo = cv2.resize(spread, None, fx=0.25, fy=0.25, interpolation=cv2.INTER_AREA)
    corners = find_markers(photo).corners_xy[0]
    true = np.array([[0, 0], [120, 0], [120, 120], [0, 120]]) + 59.5
    assert np.abs(corners - true).max() < 0.06  # by the sides alone 1.0 px off


@pytest.mark.slow
def test_size_with_cameras_as_structure_from_motion_finds_them(shoot, found):
    """Cameras 0.1 mm off their places, as measured for ten photos, leave the size within 0.2 %."""
    rng = np.random.default_rng(0)
    errors = []
    for _ in range(5):
        cameras = []
        for camera in shoot.cameras:
            turn = Rotation.from_rotvec(rng.normal(0, 0.1 / 500, 3)).as_matrix()
            cameras.append(replace(camera, rotation=turn @ camera.rotation, translation=turn @ camera.translation))
        estimate = scale_from_markers(found, cameras, 40.0)
        errors.append(estimate.factor - 1)
        assert abs(errors[-1]) < 5 * estimate.relative_error
    assert np.sqrt(np.mean(np.square(errors))) < 2e-3


def test_a_moved_card_gives_two_squares_of_one_size():
    cameras = around(5)
    before, after = MarkerCard(4, (30.0, 5.0)), MarkerCard(4, (-40.0, 25.0), 30.0)
    photos = seen([before], cameras[:3]) + seen([after], cameras[3:])
    estimate = scale_from_markers(photos, cameras, 40.0)
    assert estimate.factor == pytest.approx(1, abs=1e-6)  # exact sides; the lens's curve is removed
    assert estimate.markers == (4, 4)


def test_two_cards_of_one_number_are_told_apart():
    cameras = around()
    cards = [MarkerCard(9, (50.0, 0.0)), MarkerCard(9, (-50.0, 20.0), 70.0)]
    photos = seen(cards, cameras)
    photos[1] = Markers(photos[1].ids, photos[1].corners_xy[::-1], photos[1].sides_xy[::-1])
    estimate = scale_from_markers(photos, cameras, 20.0)
    assert estimate.factor == pytest.approx(0.5, abs=1e-6)
    assert estimate.markers == (9, 9)


def test_a_wrong_corner_and_a_wrong_photo_are_refused():
    cameras = around(6)
    photos = seen([MarkerCard(1, (20.0, 10.0))], cameras)
    shifted = tuple(side + [2.5, 0] if k == 0 else side for k, side in enumerate(photos[2].sides_xy[0]))
    photos[2] = Markers(photos[2].ids, photos[2].corners_xy, (shifted,))
    photos[4] = Markers(photos[4].ids, photos[4].corners_xy, (tuple(side + 25 for side in photos[4].sides_xy[0]),))
    estimate = scale_from_markers(photos, cameras, 40.0)
    assert 4 not in estimate.photos
    assert estimate.factor == pytest.approx(1, abs=1e-4)  # by least squares with all corners 2e-3


def test_markers_of_another_size_are_left_out_or_refused():
    cameras = around(5)
    true, other = MarkerCard(1, (30.0, 0.0)), MarkerCard(2, (-40.0, 0.0), side_mm=24.0)
    few = seen([true, other], cameras[:2]) + seen([true], cameras[2:])
    estimate = scale_from_markers(few, cameras, 40.0)
    assert (estimate.markers, estimate.refused) == ((1,), (2,))
    assert estimate.factor == pytest.approx(1, abs=1e-6)
    with pytest.raises(InputError, match="different sizes"):
        scale_from_markers(seen([true, other], cameras), cameras, 40.0)


def test_no_size_from_one_photo_or_from_none():
    cameras = around(3)
    photos = seen([MarkerCard(1, (30.0, 0.0))], cameras)
    assert scale_from_markers(photos, [cameras[0], None, None], 40.0) is None
    assert scale_from_markers([seen([], cameras)[0]] * 3, cameras, 40.0) is None


def test_photos_from_one_place_tell_no_size():
    """The phone was turned, not moved: nothing has a depth."""
    cameras = around(4, tilt=180.0)
    assert scale_from_markers(seen([MarkerCard(1, (20.0, 10.0))], cameras), cameras, 40.0) is None


def test_error_is_larger_with_fewer_photos():
    """Two photos leave no photo out to learn from: one per cent is claimed."""
    cameras = around(2)
    assert scale_from_markers(seen([MarkerCard(1, (0.0, 0.0))], cameras), cameras, 40.0).relative_error >= 0.01


@pytest.mark.parametrize(
    "image",
    [np.zeros((80, 120), np.uint8), np.full((300, 400, 3), 255, np.uint8), np.zeros((90, 90, 3), np.uint16)],
)
def test_nothing_is_found_on_bare_images(image):
    markers = find_markers(image)
    assert len(markers.ids) == 0
    assert markers.corners_xy.shape == (0, 4, 2)


def test_a_marker_at_the_edge_of_the_photo_has_no_side_that_is_not_there():
    drawn = cv2.aruco.generateImageMarker(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50), 3, 150)
    image = np.full((300, 300), 255, np.uint8)
    image[100:250, 150:300] = drawn
    assert len(find_markers(image).ids) == 0


@pytest.mark.parametrize("sigma", [0.6, 1.5])
@pytest.mark.parametrize("place", [-0.8, 0.0, 0.37])
def test_blur_does_not_move_edges(sigma, place):
    from scipy.special import ndtr

    x = np.arange(-6, 6.1, 0.25)
    profile = 0.04 + 0.9 * ndtr((x - place) / sigma)
    offset, clear = edge_offsets(profile[None], 0.25)
    assert clear[0]
    assert offset[0] == pytest.approx(place, abs=0.01)  # the blur's tail at the window's end


def test_lens_there_and_back():
    camera = around(1)[0]
    xy = np.random.default_rng(0).uniform([0, 0], [1528, 1146], (50, 2))
    assert np.abs(with_distortion(camera, without_distortion(camera, xy)) - xy).max() < 1e-6
