"""Cameras as other programs write them, brought into planish's own form.

JSON of Open3D, ROS (`camera_info`), RealSense, Polycam and other programs with fx, fy, cx, cy, width, height; YAML and
XML of OpenCV and ROS; COLMAP's text; Metashape's XML.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from planish.errors import InputError
from planish.geometry.guards import TINY
from planish.io.text import as_text

Json = dict[str, Any]

_METRE_MM = 1000.0
_MATRIX_NAMES = ("camera_matrix", "cameraMatrix", "Camera_Matrix", "intrinsics", "K", "k", "M1", "mtx")
_DISTORTION_NAMES = (
    *("distortion_coefficients", "Distortion_Coefficients", "dist_coeffs", "distCoeffs", "dist_coeff"),
    *("distortion", "D", "d", "coeffs", "dist"),
)
_WIDTH_NAMES = ("width", "image_width", "image_Width", "w")
_HEIGHT_NAMES = ("height", "image_height", "image_Height", "h")
_OTHER_LENSES = ("equidistant", "fisheye", "kannala", "ftheta", "f-theta", "omni")
_POLYCAM_POSE = [f"t_{row}{col}" for row in range(3) for col in range(4)]


def translate_json(path: Path, entries: Json) -> tuple[Json, set[str]] | None:
    """The camera of another program's JSON in planish's own form, and the keys that were used; None if it is none.

    Lengths are in mm where that program's are metres.
    """
    if isinstance(entries.get("intrinsic"), dict):  # Open3D's PinholeCameraParameters
        inner = translate_json(path, entries["intrinsic"])
        if inner is not None and "extrinsic" in entries:
            matrix = _numbers(path, "extrinsic", entries["extrinsic"], 16).reshape(4, 4).T
            inner[0].update(rotation=matrix[:3, :3].tolist(), translation=matrix[:3, 3].tolist())
        return None if inner is None else (inner[0], {"intrinsic", "extrinsic"})
    used: set[str] = set()
    intrinsics = _intrinsics(path, entries, used)
    if intrinsics is None:
        return None
    own = intrinsics
    model = next((str(entries[key]) for key in ("distortion_model", "model") if key in entries), "")
    used |= {"distortion_model", "model"} & entries.keys()
    if any(word in model.lower() for word in _OTHER_LENSES):
        raise InputError(f"{path} has the lens model {model[:40]}; a pinhole camera with OpenCV's distortion is wanted")
    if "distortion" not in own:
        name = next((name for name in _DISTORTION_NAMES if name in entries), None)
        if name is not None:
            used.add(name)
            own["distortion"] = _distortion(path, name, entries[name])
    width, height = _size(entries, used)
    if width is not None and height is not None:
        own["image_size"] = [width, height]
    if all(key in entries for key in _POLYCAM_POSE):
        used |= set(_POLYCAM_POSE)
        own |= _from_arkit_pose(path, [entries[key] for key in _POLYCAM_POSE])
    for key in ("rotation", "translation"):
        if key in entries and key not in own:
            used.add(key)
            own[key] = entries[key]
    return own, used


def _intrinsics(path: Path, entries: Json, used: set[str]) -> Json | None:
    if "intrinsic_matrix" in entries:  # Open3D: by columns
        used.add("intrinsic_matrix")
        numbers = _numbers(path, "intrinsic_matrix", entries["intrinsic_matrix"], 9).reshape(3, 3)
        return {"matrix": (numbers.T if numbers[0, 2] == 0 else numbers).tolist()}
    name = next((name for name in _MATRIX_NAMES if name in entries), None)
    if name is not None:
        used |= {name} | ({"R", "P", "r", "p", "binning_x", "binning_y", "roi", "header"} & entries.keys())
        return {"matrix": _numbers(path, name, _data(entries[name]), 9).reshape(3, 3).tolist()}
    for middle in (("ppx", "ppy"), ("cx", "cy")):
        keys = ("fx", "fy", *middle)
        if all(key in entries for key in keys):
            used |= set(keys)
            fx, fy, cx, cy = (float(_numbers(path, key, entries[key], 1)[0]) for key in keys)
            return {"matrix": [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]}
    return None


def _size(entries: Json, used: set[str]) -> tuple[Any, Any]:
    found = []
    for names in (_WIDTH_NAMES, _HEIGHT_NAMES):
        name = next((name for name in names if name in entries), None)
        found.append(None if name is None else entries[name])
        used |= {name} if name else set()
    if (
        "image_size" in entries
        and None in found
        and isinstance(entries["image_size"], list)
        and len(entries["image_size"]) == 2
    ):
        used.add("image_size")
        found = entries["image_size"]
    return found[0], found[1]


def _data(value: Any) -> Any:
    """The numbers of a matrix that stands with its rows and columns."""
    return value["data"] if isinstance(value, dict) and "data" in value else value


def _distortion(path: Path, name: str, value: Any) -> list[float]:
    numbers = _numbers(path, name, _data(value))
    while len(numbers) and numbers[-1] == 0:
        numbers = numbers[:-1]
    wanted = next((count for count in (0, 4, 5, 8, 12, 14) if count >= len(numbers)), None)
    if wanted is None:
        raise InputError(f"{path}: “{name}” has {len(numbers)} numbers; OpenCV's distortion has at most 14")
    return [*numbers.tolist(), *[0.0] * (wanted - len(numbers))]


def _from_arkit_pose(path: Path, values: list[Any]) -> Json:
    """World to camera of a pose that maps the camera (looking along -z, y up) to the world, in metres."""
    pose = _numbers(path, "t_00 ... t_23", values, 12).reshape(3, 4)
    rotation = (pose[:, :3] @ np.diag([1.0, -1.0, -1.0])).T
    return {"rotation": rotation.tolist(), "translation_mm": (-_METRE_MM * rotation @ pose[:, 3]).tolist()}


def _numbers(path: Path, name: str, value: Any, count: int | None = None) -> np.ndarray:
    try:
        numbers = np.array(value, np.float64).reshape(-1)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{path}: “{name}” is no array of numbers") from None
    if count is not None and len(numbers) != count:
        raise InputError(f"{path}: “{name}” has {len(numbers)} numbers; {count} are wanted")
    if not np.isfinite(numbers).all():
        raise InputError(f"{path}: “{name}” holds a number that is not finite")
    return numbers


# Text that is no JSON


def read_other_text(path: Path, data: bytes, photo_name: str | None) -> Json | None:
    """A camera from YAML, XML or COLMAP's text as a JSON of planish or of another program; None if it is none."""
    text = as_text(data)
    start = text.lstrip()[:4096]
    if start.startswith("<"):
        return _from_xml(path, text, photo_name)
    if start.startswith("%YAML") or re.search(r"(?m)^(?:image_width|camera_matrix|cameraMatrix|K)\s*:", text[:65536]):
        return _from_yaml(text)
    if re.search(r"(?m)^\d+\s+(?:SIMPLE_|FULL_)?(?:PINHOLE|RADIAL|OPENCV)\w*\s+\d+\s+\d+\s", text[:65536]) or re.search(
        r"(?m)^# +IMAGE_ID, QW", text[:4096]
    ):
        return _from_colmap(path, photo_name)
    return None


def _from_yaml(text: str) -> Json:
    """The keys at the left margin and their numbers: all that camera files of OpenCV and ROS hold."""
    entries: Json = {}
    for block in re.split(r"(?m)^(?=[A-Za-z_])", text):
        key, _, rest = block.partition(":")
        data = re.search(r"data\s*:\s*\[([^\]]*)\]", rest) or re.match(r"\s*\[([^\]]*)\]", rest)
        if data:
            entries[key.strip()] = _words_as_numbers(re.split(r"[\s,]+", data[1]))
        elif re.match(r"[ \t]*\S+[ \t]*(?:\n|\Z)", rest):
            entries[key.strip()] = _as_number(rest.strip())
        elif rest.strip().startswith("-"):  # a list line by line
            entries[key.strip()] = _words_as_numbers(re.findall(r"(?m)^\s*-\s*([-+.\deE]+)\s*$", rest))
    return entries


def _words_as_numbers(words: Iterable[str]) -> list[float | str]:
    return [_as_number(word) for word in words if word]


def _as_number(word: str) -> float | str:
    try:
        return float(word)
    except ValueError:
        return word.strip("\"'")


def _from_xml(path: Path, text: str, photo_name: str | None) -> Json | None:
    try:
        root = ElementTree.fromstring(re.sub(r"\A\s*<\?xml[^>]*\?>", "", text))
    except (ElementTree.ParseError, ValueError) as problem:
        raise InputError(f"{path} is broken XML: {problem}") from None
    if root.find(".//sensors/sensor") is not None:
        return _from_metashape(path, root, photo_name)
    if root.tag == "calibration":
        return _metashape_sensor(path, root)
    entries: Json = {}
    for child in root:
        data = child.find("data")
        content = (child.text if data is None else data.text) or ""
        numbers = _words_as_numbers(content.split())
        if numbers:
            entries[child.tag] = numbers if data is not None or len(numbers) > 1 else numbers[0]
    return entries


def _from_metashape(path: Path, root: ElementTree.Element, photo_name: str | None) -> Json:
    """Cameras by their labels, in the frame of the chunk as it was placed in the world."""
    sensors = {}
    for sensor in root.iter("sensor"):
        calibrations = [one for one in sensor.findall("calibration") if one.get("class", "adjusted") == "adjusted"]
        if calibrations:
            sensors[sensor.get("id")] = _metashape_sensor(path, calibrations[0])
    placed = np.eye(4)
    place = root.find(".//chunk/transform") if root.find(".//chunk/transform") is not None else root.find("./transform")
    if place is not None:
        scale = _texts(path, place, "scale", 1, [1.0])[0]
        placed[:3, :3] = scale * np.reshape(_texts(path, place, "rotation", 9, list(np.eye(3).ravel())), (3, 3))
        placed[:3, 3] = _texts(path, place, "translation", 3, [0.0] * 3)
    found: Json = {}
    for camera in root.iter("camera"):
        own, transform = sensors.get(camera.get("sensor_id")), camera.find("transform")
        if own is None or transform is None:
            continue
        pose = placed @ _numbers(path, "transform", (transform.text or "").split(), 16).reshape(4, 4)
        turn = pose[:3, :3] / max(np.cbrt(abs(np.linalg.det(pose[:3, :3]))), TINY)
        label = camera.get("label", "")
        found[_photo_of_label(label, photo_name)] = {
            **own,
            "rotation": turn.T.tolist(),
            "translation": (-turn.T @ pose[:3, 3]).tolist(),
        }
    if not found:
        raise InputError(f"{path} holds no aligned camera; align the photos in Metashape, then export the cameras")
    return {"cameras": found}


def _photo_of_label(label: str, photo_name: str | None) -> str:
    """Metashape's labels are file names without their suffix, unless somebody changed them."""
    return photo_name if photo_name and Path(photo_name).stem == Path(label).stem else label


def _metashape_sensor(path: Path, calibration: ElementTree.Element) -> Json:
    resolution = calibration.find("resolution")
    if resolution is not None:
        width, height = (float(resolution.get(key, "0")) for key in ("width", "height"))
    else:
        width, height = (_texts(path, calibration, key, 1)[0] for key in ("width", "height"))
    f, cx, cy, b1, b2 = (_texts(path, calibration, key, 1, [0.0])[0] for key in ("f", "cx", "cy", "b1", "b2"))
    k1, k2, k3, p1, p2 = (_texts(path, calibration, key, 1, [0.0])[0] for key in ("k1", "k2", "k3", "p1", "p2"))
    middle_x, middle_y = (width - 1) / 2 + cx, (height - 1) / 2 + cy
    if b2:
        raise InputError(f"{path}: the camera has skew (b2 is {b2:g}), which planish does not know; fix it at 0")
    # its first tangential number stands where OpenCV has the second (Metashape's manual, "Camera models")
    return {
        "matrix": [[f + b1, 0, middle_x], [0, f, middle_y], [0, 0, 1]],
        "image_size": [width, height],
        "distortion": [k1, k2, p2, p1, k3],
    }


def _texts(
    path: Path, owner: ElementTree.Element, key: str, count: int, default: list[float] | None = None
) -> list[float]:
    child = owner.find(key)
    if child is None:
        if default is None:
            raise InputError(f"{path} does not say “{key}” of its camera")
        return default
    return [float(x) for x in _numbers(path, key, (child.text or "").split(), count)]


_COLMAP_MODELS: dict[str, Callable[[list[float]], tuple[list[float], list[float]]]] = {
    "SIMPLE_PINHOLE": lambda p: ([p[0], p[0], p[1], p[2]], []),
    "PINHOLE": lambda p: (p[:4], []),
    "SIMPLE_RADIAL": lambda p: ([p[0], p[0], p[1], p[2]], [p[3], 0, 0, 0]),
    "RADIAL": lambda p: ([p[0], p[0], p[1], p[2]], [p[3], p[4], 0, 0]),
    "OPENCV": lambda p: (p[:4], p[4:8]),
    "FULL_OPENCV": lambda p: (p[:4], p[4:12]),
}
_COLMAP_COUNTS = {"SIMPLE_PINHOLE": 3, "PINHOLE": 4, "SIMPLE_RADIAL": 4, "RADIAL": 5, "OPENCV": 8, "FULL_OPENCV": 12}


def _from_colmap(path: Path, photo_name: str | None) -> Json:
    """cameras.txt and images.txt, which lie in one folder; without the second, the only camera without its place."""
    cameras = {}
    for words in _rows(path.with_name("cameras.txt")):
        if len(words) < 5:
            raise InputError(f"{path.with_name('cameras.txt')}: a line holds {len(words)} words; is it COLMAP's?")
        model, numbers = words[1], _numbers(path, "a camera", words[2:]).tolist()
        if model not in _COLMAP_MODELS or len(numbers) != 2 + _COLMAP_COUNTS[model]:
            raise InputError(f"{path} has a camera of the model {model[:30]}; known are {', '.join(_COLMAP_MODELS)}")
        (fx, fy, cx, cy), distortion = _COLMAP_MODELS[model](numbers[2:])
        matrix = [[fx, 0, cx - 0.5], [0, fy, cy - 0.5], [0, 0, 1]]  # COLMAP's first pixel has its centre at 0.5
        cameras[words[0]] = {"matrix": matrix, "distortion": distortion, "image_size": numbers[:2]}
    found: Json = {}
    images = path.with_name("images.txt")
    for words in _rows(images)[::2] if images.is_file() else []:  # every second line lists points
        if len(words) < 10 or words[8] not in cameras:
            raise InputError(f"{images}: an image has {len(words)} words or no camera; is it COLMAP's?")
        w, x, y, z, *place = _numbers(path, "an image", words[1:8])
        found[" ".join(words[9:])] = {
            **cameras[words[8]],
            "rotation": _from_quaternion(path, np.array([w, x, y, z])),
            "translation": place,
        }
    if found:
        return {"cameras": found}
    if len(cameras) != 1:
        raise InputError(f"{path} has {len(cameras)} cameras and no images.txt beside it, which tells their places")
    return next(iter(cameras.values()))


def _rows(path: Path) -> list[list[str]]:
    """The lines without comments, as words; empty lines stand for images without points."""
    if not path.is_file():
        raise InputError(f"{path}: there is no such file; COLMAP writes cameras.txt and images.txt into one folder")
    lines = as_text(path.read_bytes()).splitlines()
    rows = [line.split() for line in lines if not line.lstrip().startswith("#")]
    return [row for row in rows if row] if path.name == "cameras.txt" else rows


def _from_quaternion(path: Path, quaternion: np.ndarray) -> list[list[float]]:
    from scipy.spatial.transform import Rotation

    if not np.linalg.norm(quaternion) > 0:
        raise InputError(f"{path}: an image's rotation is the quaternion 0 0 0 0")
    turn: list[list[float]] = Rotation.from_quat(np.roll(quaternion, -1)).as_matrix().tolist()
    return turn
