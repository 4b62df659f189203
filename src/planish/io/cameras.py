"""Cameras from files and to JSON: planish's own form, 3 x 4 matrices, a camera that looks straight down, and others."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import scipy.linalg
from scipy.spatial.transform import Rotation

from planish.errors import InputError
from planish.geometry.guards import SINGULAR
from planish.geometry.rigid_fit import nearest_rotation
from planish.io.files import read_bytes
from planish.io.foreign_cameras import read_other_text, translate_json
from planish.types import Camera, Diagnostic, Floats

_KEYS = {
    "cameras": {"cameras", "note"},
    "P": {"P", "image_size", "note"},
    "focal_px": {"focal_px", "width", "height", "cam", "note"},
    "image_size": {
        *("matrix", "fx", "fy", "cx", "cy", "rotation", "translation", "distortion", "image_size", "note"),
    },
}
"""The key that tells each form, and all the keys that it may have."""

_DISTORTION_LENGTHS = (0, 4, 5, 8, 12, 14)
"""That OpenCV knows."""

_NOT_ORTHOGONAL = 1e-3
"""Largest entry by which rotation @ rotation.T may differ from 1: numbers written with few digits."""

_LARGEST_SIDE = 2**20

_LARGEST = 1e15
"""Of the numbers of a camera: pixels times the micrometres of a globe; far larger ones overflow when multiplied."""


def read_camera(
    path: str | Path,
    photo_name: str | None = None,
    *,
    mm_per_unit: float = 1.0,
    photo_shape: tuple[int, int] | None = None,
    warnings: list[Diagnostic] | None = None,
) -> Camera:
    """Read a camera.

    Parameters
    ----------
    path : str or Path
        JSON in one of four forms, each of which may have a ``"note"``:

        - ``{"fx", "fy", "cx", "cy", "image_size": [w, h]}`` or ``"matrix"`` for the first four, and, where they are
          not 1 and 0, ``"rotation"`` (3 x 3, or OpenCV's 3 numbers) and ``"translation"`` from world to camera, and
          OpenCV's ``"distortion"``;
        - ``{"P": 3 x 4, "image_size": [w, h]}``, or P a mapping of photo file names to such matrices;
        - ``{"focal_px", "width", "height", "cam": [x, y, z]}``: it looks along -z from (x, -y, z), so that cam has y
          down as the photo; the principal point is the middle of the photo;
        - ``{"cameras": {photo file name: camera}}``, each in one of the forms above.

        Also what other programs write: JSON of Open3D, ROS, RealSense and Polycam, YAML and XML of OpenCV and ROS,
        COLMAP's cameras.txt and images.txt, Metashape's XML (docs/formats.md).
    photo_name : str, optional
        File name of the photo, to choose among several by.
    mm_per_unit : float
        Of the lengths in the file, which are in the unit of the mesh.
    photo_shape : (int, int), optional
        Rows and columns of the photo, for files that do not tell them.
    warnings : list of Diagnostic, optional
        Gets a warning on keys that are not known.

    Raises
    ------
    InputError
        If the file is none of these, holds no possible camera, or none for that photo.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     text = '{"fx": 900, "fy": 900, "cx": 319.5, "cy": 239.5, "image_size": [640, 480]}'
    ...     _ = Path(f"{folder}/kinect.json").write_text(text)
    ...     read_camera(f"{folder}/kinect.json").shape_rc
    (480, 640)
    """
    path = Path(path)
    entries = _read(path, photo_name)
    return _camera(path, entries, photo_name, mm_per_unit, photo_shape, [] if warnings is None else warnings)


def scaled_camera(camera: Camera, shape_rc: tuple[int, int]) -> Camera | None:
    """The camera for a photo that is larger or smaller by the same factor both ways; None where it is not.

    Examples
    --------
    >>> camera = Camera(np.array([[800.0, 0, 319.5], [0, 800, 239.5], [0, 0, 1]]), np.eye(3), np.zeros(3), (480, 640))
    >>> scaled_camera(camera, (960, 1280)).matrix.tolist()
    [[1600.0, 0.0, 639.5], [0.0, 1600.0, 479.5], [0.0, 0.0, 1.0]]
    >>> scaled_camera(camera, (960, 1000)) is None
    True
    """
    (rows, cols), (height, width) = camera.shape_rc, shape_rc
    if abs(cols * height - rows * width) > max(rows, cols):  # a pixel of rounding either way
        return None
    across, down = width / cols, height / rows
    matrix = camera.matrix.copy()
    matrix[0] *= across
    matrix[1] *= down
    matrix[:2, 2] += (np.array([across, down]) - 1) / 2  # pixel centres lie at integers
    return Camera(matrix, camera.rotation, camera.translation, shape_rc, camera.distortion)


def camera_from_json(path: str | Path, entries: object) -> Camera:
    """A camera that is part of another file, in mm; `path` is for messages."""
    if not isinstance(entries, dict):
        raise InputError(f"{path} holds no camera: a JSON object with its numbers is wanted")
    return _camera(Path(path), entries, None, 1.0, None, [])


def holds_many(path: str | Path) -> bool:
    """Whether a camera file has a camera for each of several photos, by their names."""
    entries = _read(Path(path), None)
    return "cameras" in entries or isinstance(entries.get("P"), dict)


def _camera(
    path: Path,
    entries: dict[str, Any],
    photo_name: str | None,
    mm_per_unit: float,
    photo_shape: tuple[int, int] | None,
    warnings: list[Diagnostic],
) -> Camera:
    form = next((key for key in _KEYS if key in entries), None)
    foreign = form is None or (form == "P" and not entries.keys() <= _KEYS["P"])
    translated = translate_json(path, entries) if foreign or form == "image_size" else None
    if translated is not None:
        _note_unknown(path, entries.keys() - translated[1] - _KEYS["image_size"], warnings)
        return _own_form(path, translated[0], mm_per_unit, photo_shape)
    if form is None:
        raise InputError(f"{path} holds no camera: it has none of {', '.join(_KEYS)} (docs/formats.md shows the forms)")
    _note_unknown(path, entries.keys() - _KEYS[form], warnings)
    if form == "cameras":
        one = _named(path, "cameras", entries["cameras"], photo_name)
        if not isinstance(one, dict) or "cameras" in one:
            raise InputError(f"{path}: each of “cameras” must be a camera (docs/formats.md shows the forms)")
        return _camera(path, one, photo_name, mm_per_unit, photo_shape, warnings)
    if form == "P":
        return _from_projection(path, _projection(path, entries["P"], photo_name), _size(path, entries), mm_per_unit)
    if form == "focal_px":
        return _straight_down(path, entries, mm_per_unit)
    return _own_form(path, entries, mm_per_unit, photo_shape)


def _note_unknown(path: Path, unknown: set[str], warnings: list[Diagnostic]) -> None:
    if unknown:
        named = ", ".join(f"“{key[:30]}”" for key in sorted(unknown)[:5]) + (" and more" if len(unknown) > 5 else "")
        warnings.append(Diagnostic("camera-keys-unknown", f"{path} has {named}, which planish does not know"))


def camera_as_json(camera: Camera, *, mm_per_unit: float = 1.0) -> dict[str, Any]:
    """The camera in planish's own form, lengths in a unit of so many mm."""
    rows, cols = camera.shape_rc
    return {
        "image_size": [cols, rows],
        "matrix": camera.matrix.tolist(),
        "rotation": camera.rotation.tolist(),
        "translation": (np.ravel(camera.translation) / mm_per_unit).tolist(),
        "distortion": camera.distortion.tolist(),
    }


def _read(path: Path, photo_name: str | None) -> dict[str, Any]:
    """The JSON of a camera file, or what another format holds as such."""
    data = read_bytes(path)
    other = None if data.lstrip()[:1] in (b"{", b"[") else read_other_text(path, data, photo_name)
    if other is not None:
        return other
    try:
        entries = json.loads(data)
    except (ValueError, RecursionError) as problem:  # ValueError: no JSON, or no text at all
        raise InputError(f"{path} is no JSON file: {problem}") from None
    if not isinstance(entries, dict):
        raise InputError(f"{path} holds no camera: a JSON object with its numbers is wanted")
    return entries


def _numbers(path: Path, name: str, value: object, *shapes: tuple[int, ...]) -> Floats:
    """A value as finite numbers of one of these shapes."""
    wanted = " or ".join(" x ".join(map(str, shape)) or "one" for shape in shapes)
    try:
        array = np.array(value, np.float64)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{path}: “{name}” is no array of numbers; {wanted} numbers are wanted") from None
    if array.shape not in shapes:
        found = " x ".join(map(str, array.shape)) or "one"
        raise InputError(f"{path}: “{name}” has {found} numbers; {wanted} are wanted")
    if not np.isfinite(array).all():
        raise InputError(f"{path}: “{name}” holds a number that is not finite")
    if (np.abs(array) > _LARGEST).any():
        raise InputError(f"{path}: “{name}” holds {np.abs(array).max():g}, which no camera has; is the file damaged?")
    return array


def _size(path: Path, entries: dict[str, Any], photo_shape: tuple[int, int] | None = None) -> tuple[int, int]:
    """Rows and columns of the photo."""
    if "image_size" not in entries and photo_shape is not None:
        return photo_shape
    if "image_size" not in entries:
        raise InputError(f"{path} does not say “image_size”: [width, height] of the photo in pixels")
    width, height = _numbers(path, "image_size", entries["image_size"], (2,))
    return _rows_and_columns(path, width, height)


def _rows_and_columns(path: Path, width: float, height: float) -> tuple[int, int]:
    if not (
        width == int(width) and height == int(height) and 0 < min(width, height) <= max(width, height) < _LARGEST_SIDE
    ):
        raise InputError(
            f"{path} says that the photo is {width:g} x {height:g} pixels; whole numbers above 0 are wanted"
        )
    return int(height), int(width)


def _own_form(path: Path, entries: dict[str, Any], mm_per_unit: float, photo_shape: tuple[int, int] | None) -> Camera:
    if "matrix" in entries:
        matrix = _numbers(path, "matrix", entries["matrix"], (3, 3))
        if not (matrix[2] == [0, 0, 1]).all() or matrix[1, 0] != 0:
            raise InputError(f"{path}: “matrix” must be [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]")
    else:
        lost = [key for key in ("fx", "fy", "cx", "cy") if key not in entries]
        if lost:
            raise InputError(f"{path} does not say “{lost[0]}”; “matrix” or fx, fy, cx, cy are wanted [px]")
        fx, fy, cx, cy = (float(_numbers(path, key, entries[key], ())) for key in ("fx", "fy", "cx", "cy"))
        matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    if not (matrix[0, 0] > 0 and matrix[1, 1] > 0):
        raise InputError(
            f"{path}: the focal lengths are {matrix[0, 0]:g} and {matrix[1, 1]:g} pixels; above 0 is wanted"
        )
    distortion = _numbers(path, "distortion", entries.get("distortion", []), *((n,) for n in _DISTORTION_LENGTHS))
    translation = _numbers(path, "translation", entries.get("translation", [0, 0, 0]), (3,)) * mm_per_unit
    if "translation_mm" in entries:
        translation = _numbers(path, "translation", entries["translation_mm"], (3,))
    return Camera(matrix, _rotation(path, entries), translation, _size(path, entries, photo_shape), distortion)


def _rotation(path: Path, entries: dict[str, Any]) -> Floats:
    rotation = _numbers(path, "rotation", entries.get("rotation", np.eye(3)), (3, 3), (3,))
    if rotation.shape == (3,):
        rotation = Rotation.from_rotvec(rotation).as_matrix()
    with np.errstate(over="ignore", invalid="ignore"):  # then it is no rotation
        off = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
    if not off <= _NOT_ORTHOGONAL or np.linalg.det(rotation) < 0:
        raise InputError(
            f"{path}: “rotation” is no rotation matrix (its rows are off by {off:.2g}, its determinant is"
            f" {np.linalg.det(rotation):.3g}; 0 and 1 are wanted)"
        )
    return nearest_rotation(rotation)


def _projection(path: Path, matrices: object, photo_name: str | None) -> Floats:
    if not isinstance(matrices, dict):
        return _numbers(path, "P", matrices, (3, 4))
    return _numbers(path, f"P of {photo_name}", _named(path, "P", matrices, photo_name), (3, 4))


def _named(path: Path, key: str, several: object, photo_name: str | None) -> object:
    """What stands under a photo's name; the only one there is fits any."""
    if not isinstance(several, dict):
        raise InputError(f"{path}: “{key}” must name a camera for each photo's file name")
    if photo_name not in several and len(several) != 1:
        raise InputError(
            f"{path} has no camera for {photo_name or 'a scan without a photo'}, but for"
            f" {', '.join(sorted(several)[:8]) or 'none'}",
            "give one of these with {photo}",
        )
    return several[photo_name] if photo_name in several else next(iter(several.values()))


def _from_projection(path: Path, projection: Floats, shape_rc: tuple[int, int], mm_per_unit: float) -> Camera:
    """Take P = s K [R | t] apart: K upper triangular, its diagonal positive (Hartley and Zisserman 2004, 6.2.4)."""
    determinant = np.linalg.det(projection[:, :3])
    scale = np.linalg.norm(projection[:, :3])
    if not abs(determinant) > SINGULAR * scale**3:
        raise InputError(f"{path}: the matrix P belongs to no camera (its left 3 x 3 part has no inverse)")
    projection = projection * np.sign(determinant)  # the scale s may be negative
    matrix, rotation = scipy.linalg.rq(projection[:, :3])
    signs = np.diag(np.sign(np.diag(matrix)))
    matrix, rotation = matrix @ signs, signs @ rotation
    translation = np.linalg.solve(matrix, projection[:, 3])
    return Camera(matrix / matrix[2, 2], rotation, translation * mm_per_unit, shape_rc)


def _straight_down(path: Path, entries: dict[str, Any], mm_per_unit: float) -> Camera:
    lost = [key for key in ("width", "height", "cam") if key not in entries]
    if lost:
        raise InputError(f"{path} does not say “{lost[0]}”; focal_px, width, height and cam are wanted")
    focal, width, height = (float(_numbers(path, key, entries[key], ())) for key in ("focal_px", "width", "height"))
    x, y_down, z = _numbers(path, "cam", entries["cam"], (3,)) * mm_per_unit
    if not focal > 0:
        raise InputError(f"{path}: “focal_px” is {focal:g} pixels; above 0 is wanted")
    rows, cols = _rows_and_columns(path, width, height)
    matrix = np.array([[focal, 0, (cols - 1) / 2], [0, focal, (rows - 1) / 2], [0, 0, 1]])
    return Camera(matrix, np.diag([1.0, -1.0, -1.0]), np.array([-x, -y_down, z]), (rows, cols))
