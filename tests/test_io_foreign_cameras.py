"""Cameras of other programs: the same camera in every form."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from planish.errors import InputError
from planish.io import read_camera, scaled_camera

FX, FY, CX, CY, WIDTH, HEIGHT = 760.0, 761.0, 321.5, 238.5, 640, 480
MATRIX = np.array([[FX, 0, CX], [0, FY, CY], [0, 0, 1]])
DISTORTION = [0.1, -0.05, 0.001, -0.002, 0.01]
TURN = Rotation.from_euler("xyz", [10, -20, 30], degrees=True).as_matrix()
SHIFT = np.array([1.0, -2, 400])
SIZE = {"width": WIDTH, "height": HEIGHT}
POSE = np.c_[(TURN.T) @ np.diag([1, -1, -1]), -TURN.T @ SHIFT / 1000]
"""Camera to world as ARKit has it, in metres."""

FORMS = {
    "open3d": {"intrinsic_matrix": MATRIX.T.ravel().tolist(), **SIZE, "color_mode": "MJPG"},
    "open3d with place": {
        "class_name": "PinholeCameraParameters",
        "intrinsic": {"intrinsic_matrix": MATRIX.T.ravel().tolist(), **SIZE},
        "extrinsic": np.r_[np.c_[TURN, SHIFT], [[0, 0, 0, 1]]].T.ravel().tolist(),
    },
    "ros": {
        **SIZE,
        "distortion_model": "plumb_bob",
        "D": DISTORTION,
        "K": MATRIX.ravel().tolist(),
        "R": np.eye(3).ravel().tolist(),
        "P": np.c_[MATRIX, [0, 0, 0]].ravel().tolist(),
    },
    "ros 2": {**SIZE, "distortion_model": "plumb_bob", "d": DISTORTION, "k": MATRIX.ravel().tolist()},
    "realsense": {**SIZE, "ppx": CX, "ppy": CY, "fx": FX, "fy": FY, "model": "brown_conrady", "coeffs": DISTORTION},
    "polycam": {
        **{"fx": FX, "fy": FY, "cx": CX, "cy": CY, "blur_score": 120.5, **SIZE},
        **{f"t_{row}{col}": POSE[row, col] for row in range(3) for col in range(4)},
    },
    "a list": {
        "camera_matrix": MATRIX.tolist(),
        "dist_coeffs": [DISTORTION],
        "image_width": WIDTH,
        "image_height": HEIGHT,
    },
}
PLACED = {"open3d with place", "polycam"}
DISTORTED = {"ros", "ros 2", "realsense", "a list"}


def check(camera, name=""):
    np.testing.assert_allclose(camera.matrix, MATRIX, rtol=1e-12)
    assert camera.shape_rc == (HEIGHT, WIDTH)
    np.testing.assert_allclose(camera.distortion, DISTORTION if name in DISTORTED else np.zeros_like(camera.distortion))
    np.testing.assert_allclose(camera.rotation, TURN if name in PLACED else np.eye(3), atol=1e-9)
    np.testing.assert_allclose(camera.translation, SHIFT if name in PLACED else np.zeros(3), atol=1e-9)


@pytest.mark.parametrize("name", FORMS)
def test_json_of_other_programs(tmp_path, name):
    (tmp_path / "camera.json").write_text(json.dumps(FORMS[name]))
    warnings = []
    check(read_camera(tmp_path / "camera.json", warnings=warnings), name)
    assert [warning.code for warning in warnings] == [
        "camera-keys-unknown" for _ in range(1) if name in ("open3d", "open3d with place", "polycam")
    ]


def test_a_size_that_is_not_told_is_the_photos(tmp_path):
    form = {key: value for key, value in FORMS["realsense"].items() if key not in ("width", "height")}
    (tmp_path / "camera.json").write_text(json.dumps(form))
    check(read_camera(tmp_path / "camera.json", photo_shape=(HEIGHT, WIDTH)), "realsense")
    with pytest.raises(InputError, match="does not say “image_size”"):
        read_camera(tmp_path / "camera.json")


def test_a_fisheye_is_refused(tmp_path):
    (tmp_path / "camera.json").write_text(json.dumps({**FORMS["ros"], "distortion_model": "equidistant"}))
    with pytest.raises(InputError, match="lens model equidistant"):
        read_camera(tmp_path / "camera.json")


ROS_YAML = f"""image_width: {WIDTH}
image_height: {HEIGHT}
camera_name: narrow_stereo
camera_matrix:
  rows: 3
  cols: 3
  data: [{", ".join(map(str, MATRIX.ravel()))}]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [{", ".join(map(str, DISTORTION))}]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
"""


def test_yaml_of_ros(tmp_path):
    (tmp_path / "camera.yaml").write_text(ROS_YAML)
    check(read_camera(tmp_path / "camera.yaml"), "ros")


@pytest.mark.parametrize("suffix", [".yml", ".xml"])
def test_files_that_opencv_writes(tmp_path, suffix):
    import cv2

    storage = cv2.FileStorage(str(tmp_path / f"camera{suffix}"), cv2.FILE_STORAGE_WRITE)
    storage.write("image_width", WIDTH)
    storage.write("image_height", HEIGHT)
    storage.write("camera_matrix", MATRIX)
    storage.write("distortion_coefficients", np.array([DISTORTION]))
    storage.release()
    check(read_camera(tmp_path / f"camera{suffix}"), "ros")


def test_text_of_colmap(tmp_path):
    k1, k2, p1, p2, _ = DISTORTION
    (tmp_path / "cameras.txt").write_text(
        "# Camera list with one line of data per camera:\n"
        f"1 OPENCV {WIDTH} {HEIGHT} {FX} {FY} {CX + 0.5} {CY + 0.5} {k1} {k2} {p1} {p2}\n"
        f"2 SIMPLE_RADIAL {WIDTH} {HEIGHT} {FX} {CX + 0.5} {CY + 0.5} {k1}\n"
    )
    x, y, z, w = Rotation.from_matrix(TURN).as_quat()
    place = " ".join(map(str, [w, x, y, z, *SHIFT]))
    (tmp_path / "images.txt").write_text(
        f"# IMAGE_ID, QW, QX\n1 {place} 1 left photo.jpg\n10 20 -1 30 40 7\n2 {place} 2 right.jpg\n\n"
    )
    for name in ("cameras.txt", "images.txt"):
        found = read_camera(tmp_path / name, "left photo.jpg")
        np.testing.assert_allclose(found.matrix, MATRIX)
        np.testing.assert_allclose(found.distortion, [k1, k2, p1, p2])
        np.testing.assert_allclose(found.rotation, TURN, atol=1e-9)
        np.testing.assert_allclose(found.translation, SHIFT)
    np.testing.assert_allclose(read_camera(tmp_path / "images.txt", "right.jpg").distortion, [k1, 0, 0, 0])
    with pytest.raises(InputError, match=r"no camera for gone\.jpg"):
        read_camera(tmp_path / "images.txt", "gone.jpg")


def test_xml_of_metashape(tmp_path):
    k1, k2, p1, p2, k3 = DISTORTION
    scale = 0.5
    chunk = np.eye(4)
    chunk[:3, :3] = scale * TURN
    pose = np.r_[np.c_[TURN.T, -TURN.T @ SHIFT], [[0, 0, 0, 1]]]  # camera to world
    inside = np.linalg.inv(chunk) @ pose @ np.diag([scale, scale, scale, 1])
    numbers = " ".join(map(str, inside.ravel()))
    turn = " ".join(map(str, TURN.ravel()))
    (tmp_path / "cameras.xml").write_text(
        f"""<?xml version="1.0" encoding="UTF-8"?>
<document version="1.5.0"><chunk label="Chunk 1"><sensors><sensor id="0" label="x" type="frame">
<resolution width="{WIDTH}" height="{HEIGHT}"/><calibration type="frame" class="adjusted">
<resolution width="{WIDTH}" height="{HEIGHT}"/><f>{FY}</f>
<cx>{CX - (WIDTH - 1) / 2}</cx><cy>{CY - (HEIGHT - 1) / 2}</cy>
<b1>{FX - FY}</b1><k1>{k1}</k1><k2>{k2}</k2><k3>{k3}</k3><p1>{p2}</p1><p2>{p1}</p2></calibration></sensor></sensors>
<cameras><camera id="0" sensor_id="0" label="IMG_1"><transform>{numbers}</transform></camera>
<camera id="1" sensor_id="0" label="IMG_2"/></cameras>
<transform><rotation>{turn}</rotation><translation>0 0 0</translation><scale>{scale}</scale></transform>
</chunk></document>"""
    )
    found = read_camera(tmp_path / "cameras.xml", "IMG_1.JPG")
    np.testing.assert_allclose(found.matrix, MATRIX)
    np.testing.assert_allclose(found.distortion, DISTORTION)
    np.testing.assert_allclose(found.rotation, TURN, atol=1e-9)
    np.testing.assert_allclose(found.translation, SHIFT, atol=1e-6)  # inverted twice


@pytest.mark.parametrize("factor", [0.5, 2.0, 3.0])
def test_a_scaled_camera_sees_the_same_places_of_the_photo(tmp_path, factor):
    (tmp_path / "camera.json").write_text(json.dumps(FORMS["realsense"]))
    camera = read_camera(tmp_path / "camera.json")
    scaled = scaled_camera(camera, (round(HEIGHT * factor), round(WIDTH * factor)))
    point = np.array([10.0, -20, 300])
    seen, again = (one.matrix @ point / point[2] for one in (camera, scaled))
    np.testing.assert_allclose((again[:2] + 0.5) / factor, seen[:2] + 0.5)
    assert scaled_camera(camera, (480, 480)) is None


def test_a_broken_file_is_refused_in_one_sentence(tmp_path):
    for text in (
        "<opencv_storage><camera_matrix>",
        "1 PINHOLE 640 480 1 2\n",
        "K: [1, 2]\n",
        '{"fx": 1, "fy": 1, "cx": "a", "cy": 1}',
    ):
        (tmp_path / "cameras.txt").write_text(text)
        with pytest.raises(InputError, match=r"cameras\.txt"):
            read_camera(tmp_path / "cameras.txt")
