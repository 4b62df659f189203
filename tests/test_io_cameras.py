import json

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planish.errors import InputError
from planish.geometry import project
from planish.io import read_camera
from planish.io.cameras import camera_as_json

MATRIX = [[900.0, 0, 320], [0, 880.0, 240], [0, 0, 1]]
TURN = [0.3, -0.5, 0.2]
OWN = {"matrix": MATRIX, "rotation": TURN, "translation": [10, -20, 500], "image_size": [640, 480]}
POINTS = np.random.default_rng(0).normal(0, 50, (20, 3))


def camera(folder, told, *args, **kw):
    path = folder / "camera.json"
    path.write_text(told if isinstance(told, str) else json.dumps(told))
    return read_camera(path, *args, **kw)


def test_the_own_form(tmp_path):
    found = camera(tmp_path, OWN | {"distortion": [0.1, -0.05, 0.001, 0.002]})
    expected, _ = cv2.projectPoints(
        POINTS, np.array(TURN), np.array([10.0, -20, 500]), np.array(MATRIX), np.array([0.1, -0.05, 0.001, 0.002])
    )
    np.testing.assert_allclose(project(found, POINTS), expected.reshape(-1, 2), atol=1e-9)
    assert found.shape_rc == (480, 640)
    named = {"fx": 900, "fy": 880, "cx": 320, "cy": 240, "rotation": found.rotation.tolist()}
    again = camera(tmp_path, named | {"translation": [10, -20, 500], "image_size": [640, 480], "note": "mine"})
    np.testing.assert_allclose(again.matrix, found.matrix)
    np.testing.assert_allclose(again.rotation, found.rotation, atol=1e-15)


def test_a_camera_that_says_nothing_stands_in_the_origin_and_looks_along_z(tmp_path):
    found = camera(tmp_path, {"matrix": MATRIX, "image_size": [640, 480]})
    np.testing.assert_allclose(project(found, np.array([[0.0, 0, 100], [10, 5, 100]])), [[320, 240], [410, 284]])


def test_lengths_follow_the_unit_of_the_mesh(tmp_path):
    metres = camera(tmp_path, OWN | {"translation": [0.01, -0.02, 0.5]}, mm_per_unit=1000.0)
    np.testing.assert_allclose(metres.translation, [10, -20, 500])


def test_cameras_by_name(tmp_path):
    moved = OWN | {"translation": [0, 0, 400]}
    told = {"cameras": {"a.jpg": OWN, "b.jpg": moved}, "note": "both"}
    np.testing.assert_allclose(camera(tmp_path, told, "a.jpg").translation, [10, -20, 500])
    np.testing.assert_allclose(camera(tmp_path, told, "b.jpg", mm_per_unit=10.0).translation, [0, 0, 4000])
    assert camera(tmp_path, {"cameras": {"a.jpg": OWN}}, "other.jpg").shape_rc == (480, 640)  # there is but one


@given(seed=st.integers(0, 2**32 - 1), scale=st.sampled_from([1.0, -1.0, 1e-3, -250.0]))
def test_a_matrix_is_taken_apart(seed, scale, tmp_path_factory):
    rng = np.random.default_rng(seed)
    matrix = np.array([[rng.uniform(500, 3000), 0, rng.uniform(0, 2000)], [0, rng.uniform(500, 3000), 900], [0, 0, 1]])
    rotation = cv2.Rodrigues(rng.normal(0, 1, 3))[0]
    translation = rng.normal(0, 100, 3) + [0, 0, 600]
    projection = scale * matrix @ np.c_[rotation, translation]
    found = camera(tmp_path_factory.mktemp("p"), {"P": projection.tolist(), "image_size": [640, 480]})
    np.testing.assert_allclose(found.matrix, matrix, rtol=1e-9, atol=1e-9 * 3000)
    np.testing.assert_allclose(found.rotation, rotation, atol=1e-9)
    np.testing.assert_allclose(found.translation, translation, atol=1e-6)


def test_one_of_several_matrices_is_chosen_by_the_photo(tmp_path):
    one, two = (np.array(MATRIX) @ np.c_[np.eye(3), [0, 0, z]] for z in (100.0, 200.0))
    told = {"P": {"a.jpg": one.tolist(), "b.jpg": two.tolist()}, "image_size": [640, 480]}
    assert camera(tmp_path, told, "b.jpg").translation[2] == pytest.approx(200)
    for name in ("c.jpg", None):
        with pytest.raises(InputError, match=r"for a\.jpg, b\.jpg; give one of these with photo"):
            camera(tmp_path, told, name)
    del told["P"]["a.jpg"]
    assert camera(tmp_path, told, "c.jpg").translation[2] == pytest.approx(200)  # there is only one


def test_straight_down(tmp_path):
    found = camera(tmp_path, {"focal_px": 1000, "width": 641, "height": 481, "cam": [10, -20, 500]})
    seen = project(found, np.array([[10.0, 20, 0], [60, 20, 0], [10, 70, 0], [10, 70, 250]]))
    np.testing.assert_allclose(
        seen, [[320, 240], [420, 240], [320, 140], [320, 40]]
    )  # y up in space, down in the photo


def test_what_is_written_is_read_again(tmp_path):
    found = camera(tmp_path, OWN | {"distortion": [0.1, -0.05, 0.001, 0.002, 0.3]})
    again = camera(tmp_path, camera_as_json(found, mm_per_unit=10.0), mm_per_unit=10.0)
    for name in ("matrix", "rotation", "translation", "distortion"):
        np.testing.assert_allclose(getattr(again, name), getattr(found, name), atol=1e-12)
    assert again.shape_rc == found.shape_rc


def without(key):
    return {name: value for name, value in OWN.items() if name != key}


@pytest.mark.parametrize(
    ("told", "sentence"),
    [
        ("{", "no JSON"),
        ('"text"', "a JSON object"),
        ("[" * 100_000, "no JSON"),
        ("{}", "holds no camera"),
        (without("image_size"), "holds no camera"),
        (without("matrix"), "does not say “fx”"),
        (OWN | {"image_size": [640]}, "“image_size” has 1 numbers; 2 are wanted"),
        (OWN | {"image_size": [640, 0]}, "640 x 0 pixels"),
        (OWN | {"image_size": [640, 480.5]}, "whole numbers"),
        (OWN | {"image_size": "large"}, "no array of numbers"),
        (OWN | {"matrix": [[1, 2], [3]]}, "no array of numbers"),
        (OWN | {"matrix": np.eye(4).tolist()}, "4 x 4 numbers; 3 x 3 are wanted"),
        (OWN | {"matrix": np.array(MATRIX).T.tolist()}, "must be"),
        (OWN | {"matrix": [[-900, 0, 320], [0, 880, 240], [0, 0, 1]]}, "above 0 is wanted"),
        (OWN | {"rotation": (2 * np.eye(3)).tolist()}, "no rotation matrix"),
        (OWN | {"rotation": np.diag([1, 1, -1]).tolist()}, "its determinant is -1"),
        (OWN | {"translation": [1, 2, None]}, "not finite"),
        (OWN | {"translation": [1, 2, -1e300]}, "which no camera has; is the file damaged"),
        ({"focal_px": 1e300, "width": 640, "height": 480, "cam": [0, 0, 1]}, "which no camera has"),
        (OWN | {"distortion": [1, 2, 3]}, "“distortion” has 3 numbers"),
        ({"P": np.zeros((3, 4)).tolist(), "image_size": [640, 480]}, "belongs to no camera"),
        ({"P": np.eye(3, 4).tolist()}, "does not say “image_size”"),
        ({"P": {}, "image_size": [640, 480]}, "has no camera for"),
        ({"cameras": {"a.jpg": OWN, "b.jpg": OWN}}, "has no camera for a scan without a photo, but for a.jpg, b.jpg"),
        ({"cameras": [OWN]}, "must name a camera for each photo's file name"),
        ({"cameras": {"a.jpg": 3}}, "each of “cameras” must be a camera"),
        ({"focal_px": 1000, "width": 640, "height": 480}, "does not say “cam”"),
        ({"focal_px": -1, "width": 640, "height": 480, "cam": [0, 0, 1]}, "above 0 is wanted"),
    ],
)
def test_what_is_no_camera_is_refused_in_one_sentence(tmp_path, told, sentence):
    with pytest.raises(InputError, match=sentence) as caught:
        camera(tmp_path, told)
    assert "camera.json" in str(caught.value)


def test_a_rotation_of_few_digits_is_made_a_true_one(tmp_path):
    rounded = cv2.Rodrigues(np.array(TURN))[0].round(4)
    found = camera(tmp_path, OWN | {"rotation": rounded.tolist()})
    np.testing.assert_allclose(found.rotation @ found.rotation.T, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(found.rotation, rounded, atol=1e-4)
