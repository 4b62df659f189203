"""Where the light of lasers lies, from JSON or CSV: fixed planes, one for each photo, or turned and shifted ones."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from planish.errors import InputError
from planish.geometry.guards import normalize
from planish.io.cameras import camera_as_json, camera_from_json
from planish.io.files import read_bytes, write_json
from planish.types import Camera, Diagnostic, Floats

_KEYS = {
    "lasers",
    "axis",
    "angles_deg",
    "direction",
    "positions_mm",
    "planes",
    "photos",
    "background",
    "camera",
    "note",
}


SAME_FOCAL = 0.02
"""Two calibrations of one camera agree on its focal length to this part, or one of them is none."""


def check_camera(path: str | Path, held: Camera, given: Camera) -> None:
    """Refuse a camera that cannot be the one with which the lasers in a file were found.

    Raises
    ------
    InputError
    """
    focal, held_focal = given.matrix[0, 0], held.matrix[0, 0]
    if given.shape_rc != held.shape_rc or abs(focal / held_focal - 1) > SAME_FOCAL:
        raise InputError(
            f"the lasers in {path} were found with a camera of {held.shape_rc[1]} x {held.shape_rc[0]} pixels and a "
            f"focal length of {held_focal:.0f}, the camera given has {given.shape_rc[1]} x {given.shape_rc[0]} and "
            f"{focal:.0f}; give the camera that the lasers belong to"
        )


def read_rig(path: str | Path) -> tuple[Floats, Camera, list[Diagnostic]]:
    """Read two lasers that do not move, and the camera that stands with them.

    Parameters
    ----------
    path : str or Path
        JSON with ``"lasers": [[a, b, c, d], [a, b, c, d]]``, the upper one first, and ``"camera"`` in planish's own
        form, as `write_rig` makes it. Planes are a x + b y + c z + d = 0 [mm] in the camera's world.

    Returns
    -------
    planes : (2, 4) float64
        With (a, b, c) of length 1.
    camera : Camera
    notes : list of Diagnostic
        What the file says of itself.

    Raises
    ------
    InputError
        If the file says nothing of the kind.
    """
    path = Path(path)
    entries = _told(path)
    lost = [key for key in ("lasers", "camera") if key not in entries]
    if lost:
        raise InputError(f"{path} does not say “{lost[0]}”; `planish calibrate laser-lines` makes such a file")
    planes = _planes(path, "lasers", entries["lasers"], 2)
    if len(planes) != 2:
        raise InputError(f"{path} has {len(planes)} lasers; two are wanted, the upper one first")
    notes = [Diagnostic("calibration-note", str(entries["note"]))] if "note" in entries else []
    return planes, camera_from_json(path, entries["camera"]), notes


def write_rig(
    path: str | Path,
    planes: Floats,
    camera: Camera,
    note: str | None = None,
    axis: tuple[Floats, Floats] | None = None,
) -> None:
    """Write lasers and their camera so that `read_rig` takes them back.

    For a sweep also point and direction of the axis that they turn about.
    """
    entries: dict[str, Any] = {"lasers": planes.tolist()}
    if axis is not None:
        entries["axis"] = {"point": axis[0].tolist(), "direction": axis[1].tolist()}
    entries["camera"] = camera_as_json(camera)
    write_json(path, entries if note is None else {**entries, "note": note})


def read_motion(path: str | Path, photo_names: list[str]) -> tuple[str, Floats]:
    r"""Read where a mirror or a slide stood at each photo.

    Parameters
    ----------
    path : str or Path
        CSV with a column angle_deg or position_mm and, if the rows are in another order than the photos, photo.
    photo_names : list of str
        File names of the photos, in their order.

    Returns
    -------
    name : {"angles_deg", "positions_mm"}
    values : (photos,) float64

    Raises
    ------
    InputError

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(f"{folder}/a.csv").write_text("photo,angle_deg\n2.jpg,0.5\n1.jpg,0.25\n")
    ...     read_motion(f"{folder}/a.csv", ["1.jpg", "2.jpg"])
    ('angles_deg', array([0.25, 0.5 ]))
    """
    path = Path(path)
    rows = _rows(path)
    for column, name in (("angle_deg", "angles_deg"), ("position_mm", "positions_mm")):
        if rows and column in rows[0]:
            values = _numbers(path, column, [row[column] for row in rows], 1)
            return name, _in_order(path, values, _photos(rows), photo_names)
    raise InputError(f"{path} has no column “angle_deg” or “position_mm”; one of them and one row a photo are wanted")


def read_sweep(
    path: str | Path, photo_names: list[str], motion: str | Path | None = None, camera: Camera | None = None
) -> Floats | tuple[Floats, Floats]:
    r"""Read the planes of a sweep's photos, or the background by which they are to be found.

    Parameters
    ----------
    path : str or Path
        CSV with the columns a, b, c, d and, if the rows are in another order than the photos, photo. Or JSON with

        - ``"planes"``: for each photo [a, b, c, d], or a list of such with several lines; and ``"photos"``, the names
          of the files, if these are in another order;
        - ``"lasers"``: [[a, b, c, d], ...] at angle 0, ``"axis"``: {"point": [x, y, z], "direction": [x, y, z]} and
          ``"angles_deg"`` for each photo: a turning mirror or table that carries the laser;
        - ``"lasers"``, ``"direction"`` and ``"positions_mm"`` for each photo: a laser on a slide with an encoder;
        - ``"background"``: two of {"plane": [a, b, c, d], "region": [left, top, right, bottom]}: parts of the photos
          in which the laser falls on known planes.
    photo_names : list of str
        File names of the photos, in their order.
    motion : str or Path, optional
        Angles or positions for each photo, as for `read_motion`, instead of those in the JSON.
    camera : Camera, optional
        That took the photos; a camera in the JSON must be the same.

    Returns
    -------
    (photos, lines, 4) float64, or for a background its planes (k, 4) and regions (k, 4) [photo px]

    Raises
    ------
    InputError

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(f"{folder}/a.csv").write_text("photo,a,b,c,d\n2.jpg,0,0,2,-8\n1.jpg,0,0,1,-3\n")
    ...     read_sweep(f"{folder}/a.csv", ["1.jpg", "2.jpg"]).tolist()
    [[[0.0, 0.0, 1.0, -3.0]], [[0.0, 0.0, 1.0, -4.0]]]
    """
    path = Path(path)
    entries = _from_csv(path) if path.suffix.lower() == ".csv" else _told(path)
    if camera is not None and "camera" in entries:
        check_camera(path, camera_from_json(path, entries["camera"]), camera)
    if motion is not None:
        if "lasers" not in entries:
            raise InputError(f"{path} has no “lasers” that could move; `planish calibrate laser` finds them")
        name, values = read_motion(motion, photo_names)
        entries = {**entries, name: values.tolist()}
    if "background" in entries:
        return _background(path, entries["background"])
    if "planes" in entries:
        planes = entries["planes"]
        if isinstance(planes, list) and planes and np.ndim(planes[0]) == 1:
            planes = [[plane] for plane in planes]
        found = _planes(path, "planes", planes, 3)
    elif "lasers" in entries:
        found = _moved(path, entries, _planes(path, "lasers", entries["lasers"], 2))
    else:
        raise InputError(f"{path} says nothing of the laser: “planes”, “lasers” or “background” is wanted")
    return _in_order(path, found, entries.get("photos"), photo_names)


def _told(path: Path) -> dict[str, Any]:
    data = read_bytes(path)
    try:
        entries = json.loads(data)
    except (ValueError, RecursionError) as problem:
        raise InputError(f"{path} is no JSON file: {problem}") from None
    if not isinstance(entries, dict):
        raise InputError(f"{path} holds no lasers: a JSON object with their planes is wanted")
    unknown = sorted(entries.keys() - _KEYS)
    if unknown:
        raise InputError(f"{path} has “{unknown[0]}”, which is not known; known are {', '.join(sorted(_KEYS))}")
    return entries


def _from_csv(path: Path) -> dict[str, Any]:
    rows = _rows(path)
    lost = [key for key in "abcd" if not rows or key not in rows[0]]
    if lost:
        raise InputError(f"{path} has no column “{lost[0]}”; columns a, b, c, d and one row a photo are wanted")
    return {"planes": [[row[key] for key in "abcd"] for row in rows], "photos": _photos(rows)}


def _rows(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(read_bytes(path).decode("utf-8-sig", "replace").splitlines(), skipinitialspace=True))


def _photos(rows: list[dict[str, str]]) -> list[str] | None:
    return [row["photo"] for row in rows] if "photo" in rows[0] else None


def _numbers(path: Path, name: str, value: object, dimensions: int) -> Floats:
    try:
        array = np.array(value, np.float64)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{path}: “{name}” is no even array of numbers") from None
    if array.ndim != dimensions or not array.size or not np.isfinite(array).all():
        raise InputError(
            f"{path}: “{name}” is empty, not finite, or has {array.ndim} levels where {dimensions} are wanted"
        )
    return array


def _planes(path: Path, name: str, value: object, dimensions: int) -> Floats:
    planes = _numbers(path, name, value, dimensions)
    length = np.linalg.norm(planes[..., :3], axis=-1, keepdims=True)
    if planes.shape[-1] != 4 or not (length > 0).all():
        raise InputError(f"{path}: “{name}” must hold planes [a, b, c, d] whose a, b, c are not all 0")
    return np.asarray(planes / length)


def _vector(path: Path, name: str, value: object) -> Floats:
    vector = _numbers(path, name, value, 1)
    if vector.shape != (3,):
        raise InputError(f"{path}: “{name}” has {len(vector)} numbers; 3 are wanted")
    return vector


def _moved(path: Path, entries: dict[str, Any], lasers: Floats) -> Floats:
    """Fixed planes turned about an axis, or shifted along a direction, for each photo."""
    if "angles_deg" in entries:
        axis = entries.get("axis")
        if not isinstance(axis, dict) or not {"point", "direction"} <= axis.keys():
            raise InputError(f"{path} has “angles_deg” but no “axis” with “point” and “direction”")
        point, direction = (_vector(path, name, axis[name]) for name in ("point", "direction"))
        if not np.linalg.norm(direction) > 0:
            raise InputError(f"{path}: the axis's “direction” is 0")
        angles = np.radians(_numbers(path, "angles_deg", entries["angles_deg"], 1))
        turns = Rotation.from_rotvec(np.outer(angles, normalize(direction))).as_matrix()
        normals = np.einsum("fij,lj->fli", turns, lasers[:, :3])
        # points on the axis keep their distance from the plane
        return np.concatenate([normals, (lasers[:, :3] @ point + lasers[:, 3] - normals @ point)[..., None]], axis=2)
    if "positions_mm" in entries:
        if "direction" not in entries:
            raise InputError(f"{path} has no “direction” [x, y, z] in which the laser moves by “positions_mm”")
        direction = _vector(path, "direction", entries["direction"])
        if not np.linalg.norm(direction) > 0:
            raise InputError(f"{path}: “direction” is 0")
        way = np.outer(_numbers(path, "positions_mm", entries["positions_mm"], 1), normalize(direction))
        planes = np.repeat(lasers[None], len(way), axis=0)
        planes[..., 3] -= way @ lasers[:, :3].T
        return planes
    raise InputError(
        f"{path} does not say where the lasers are in each photo: “angles_deg” or “positions_mm” is wanted"
    )


def _background(path: Path, value: object) -> tuple[Floats, Floats]:
    if not isinstance(value, list) or len(value) < 2 or not all(isinstance(part, dict) for part in value):
        raise InputError(f"{path}: “background” must hold two planes, each with its “region” of the photo")
    lost = [key for part in value for key in ("plane", "region") if key not in part]
    if lost:
        raise InputError(f"{path}: a part of the “background” has no “{lost[0]}”")
    planes = _planes(path, "background", [part["plane"] for part in value], 2)
    regions = _numbers(path, "region", [part["region"] for part in value], 2)
    if regions.shape[1] != 4:
        raise InputError(f"{path}: a “region” must be [left, top, right, bottom] in photo pixels")
    return planes, regions


def _in_order(path: Path, planes: Floats, listed: object, photo_names: list[str]) -> Floats:
    if listed is not None:
        if not isinstance(listed, list) or len(listed) != len(planes):
            raise InputError(f"{path}: “photos” must name one file for each of the {len(planes)} rows or planes")
        names = [Path(str(name)).name for name in listed]
        lost = [name for name in photo_names if name not in names]
        if lost:
            raise InputError(f"{path} has nothing for the photo {lost[0]}; it tells of {', '.join(names[:4])} ...")
        missing = [name for name in names if name not in photo_names]
        if missing:
            raise InputError(f"{path} tells of {missing[0]}, but no such photo was given; is it missing?")
        return planes[[names.index(name) for name in photo_names]]
    if len(planes) != len(photo_names):
        raise InputError(
            f"there are {len(photo_names)} photos, but {path} tells of {len(planes)}; is a photo missing or "
            "doubled, or the laser-off photo among them?"
        )
    return planes
