"""A scan from its files: mesh, photo, camera and unit brought together."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from planish.errors import InputError
from planish.geometry import depths
from planish.io.cameras import read_camera
from planish.io.filemesh import FileMesh
from planish.io.images import Photo, decode_photo, read_photo
from planish.io.meshes import read_mesh
from planish.io.polygons import Polygons, triangulate, uv_of_points
from planish.io.units import MM_PER_UNIT, Unit, decide_unit
from planish.io.views import Files, listed, matched
from planish.types import Camera, Diagnostic, Floats, Mesh, Scan, View

_OUTSIDE = 1e-4
"""How far texture coordinates may be outside 0 to 1 before that is said: rounding in the file."""


@dataclass(frozen=True, eq=False)
class ReadScan:
    """A scan, and what of its file is needed to write the flat mesh as the file had it.

    Attributes
    ----------
    scan : Scan
        In mm; the points in the file's order, the faces cut into triangles.
    unit : {"mm", "cm", "m", "in"}
        That the file's numbers were taken to be in.
    warnings : list of Diagnostic
    polygons : Polygons
        The file's own faces and texture coordinates.
    sources : tuple of Path
        The files that were read: the mesh (a folder for tifxyz), photos that are files of their own, cameras.
    """

    scan: Scan
    unit: Unit
    warnings: list[Diagnostic]
    polygons: Polygons
    sources: tuple[Path, ...] = ()


def read_scan(
    path: str | Path,
    *,
    photo: Files = None,
    camera: Files = None,
    units: str = "auto",
    inside: str | Path | None = None,
) -> ReadScan:
    """Read a scan.

    The photo is the one that `photo` names, else the texture that the mesh file names or holds. Where its parts lie
    is told by the texture coordinates; but if both `photo` and `camera` are given, by the camera. Of several photos
    the first is the main one, whose colours the page gets.

    Parameters
    ----------
    path : str or Path
        OBJ, PLY, GLB, glTF or a tifxyz folder.
    photo : str or Path, or several, optional
    camera : str or Path, or several, optional
        JSON, see `read_camera`; its numbers are in the unit of the mesh. For several photos as many in the same order,
        or one file that has all of them by name.
    units : {"auto", "mm", "cm", "m", "in"}
    inside : str or Path, optional
        For scans from strangers: the only folder from which files are read that the mesh itself names (materials,
        buffers, images, also through links); others count as missing. By default they may lie anywhere.

    Raises
    ------
    InputError
        If a file is missing, damaged, of the wrong kind, or the files do not belong together.
    """
    path, photos = Path(path), listed(photo)
    cameras = matched(photos, listed(camera))
    main, seen_by = (photos[0] if photos else None), cameras[0]
    found = read_mesh(path, None if inside is None else Path(inside))
    unit, doubts = decide_unit(found.points, units, found.unit)
    warnings = [*found.warnings, *doubts]
    points = found.points * MM_PER_UNIT[unit]
    triangles = triangulate(points, found.polygons)
    mesh = Mesh(points, found.polygons.corners[triangles])
    seen_from = _camera_of(seen_by, _photo_name(found, main), points, MM_PER_UNIT[unit])
    picture = _picture(path, found, main, seen_from, warnings)
    photo_xy = None
    if picture is not None:
        _check_same_size(seen_by, seen_from, main or found.texture, picture)
        if seen_from is None or main is None or _same_file(found.texture, main):
            photo_xy = _photo_xy(path, found.polygons, triangles, len(points), picture.pixels.shape[:2], warnings)
        if photo_xy is None and seen_from is None:
            raise InputError(
                f"{path} has no texture coordinates, so nothing tells where its points lie on the photo",
                "give {camera}",
            )
    pixels, icc = (picture.pixels, picture.icc) if picture else (None, None)
    others = [
        _view(path, found, one, where, points, MM_PER_UNIT[unit], icc, warnings)
        for one, where in zip(photos[1:], cameras[1:], strict=True)
    ]
    scan = Scan(mesh, photo=pixels, photo_xy=photo_xy, camera=seen_from, icc=icc, others=tuple(others))
    shown = found.texture if main is None else main
    files = (path, shown if picture and not isinstance(shown, bytes) else None, *photos[1:], *dict.fromkeys(cameras))
    return ReadScan(scan, unit, warnings, found.polygons, tuple(Path(file) for file in files if file is not None))


def _camera_of(path: Path | None, photo_name: str | None, points: Floats, mm_per_unit: float) -> Camera | None:
    if path is None:
        return None
    camera = read_camera(path, photo_name, mm_per_unit=mm_per_unit)
    _check_in_front(path, camera, points)
    return camera


def _view(
    path: Path,
    found: FileMesh,
    photo: Path,
    seen_by: Path | None,
    points: Floats,
    mm_per_unit: float,
    icc: bytes | None,
    warnings: list[Diagnostic],
) -> View:
    """A further photo and its camera; `icc` is the colour profile of the main one."""
    camera = _camera_of(seen_by, photo.name, points, mm_per_unit)
    picture = _picture(path, found, photo, camera, warnings)
    assert camera is not None
    assert picture is not None
    _check_same_size(seen_by, camera, photo, picture)
    if picture.icc != icc:
        warnings.append(
            Diagnostic(
                "colour-profiles-differ",
                f"{photo} has another colour profile than the first photo; its brightness was matched to that one's, "
                "its colours were taken as they are",
            )
        )
    return View(picture.pixels, camera)


def _photo_name(found: FileMesh, photo: str | Path | None) -> str | None:
    if photo is not None:
        return Path(photo).name
    return found.texture.name if isinstance(found.texture, Path) else None


def _picture(
    path: Path, found: FileMesh, photo: str | Path | None, camera: Camera | None, warnings: list[Diagnostic]
) -> Photo | None:
    """The photo that the user names, or else the texture, if it can be read: the geometry does without."""
    source = found.texture if photo is None else photo
    if source is None:
        return None
    try:
        picture = _decoded(path, source)
        if camera is not None and picture.pixels.shape[:2] != camera.shape_rc:
            upright = _decoded(path, source, upright=True)
            picture = upright if upright.pixels.shape[:2] == camera.shape_rc else picture
    except InputError as problem:
        if photo is not None:
            raise
        warnings.append(Diagnostic("texture-unreadable", f"the texture was left out: {problem.sentence}", problem.hint))
        return None
    warnings += picture.warnings
    return picture


def _decoded(path: Path, source: str | Path | bytes, *, upright: bool = False) -> Photo:
    if isinstance(source, bytes):
        return decode_photo(f"the image in {path}", source, upright=upright)
    return read_photo(source, upright=upright)


def _same_file(texture: Path | bytes | None, photo: str | Path) -> bool:
    return isinstance(texture, Path) and texture.samefile(photo)


def _check_in_front(path: str | Path, camera: Camera, points: Floats) -> None:
    finite = points[np.isfinite(points).all(1)]
    if np.median(depths(camera, finite)) <= 0:
        raise InputError(
            f"{path}: the camera looks away from the scan, which lies behind it; do the two belong together?"
        )


def _check_same_size(
    path: str | Path | None, camera: Camera | None, source: str | Path | bytes | None, picture: Photo
) -> None:
    if camera is None or picture.pixels.shape[:2] == camera.shape_rc:
        return
    name = "the texture" if isinstance(source, bytes) else str(source)
    (rows, cols), (wanted_rows, wanted_cols) = picture.pixels.shape[:2], camera.shape_rc
    raise InputError(
        f"{name} is {cols} x {rows} pixels, but {path} is for a photo of {wanted_cols} x {wanted_rows}; give the photo"
        " that the camera's numbers belong to"
    )


def _photo_xy(
    path: Path,
    polygons: Polygons,
    triangles: NDArray[np.int64],
    count: int,
    shape_rc: tuple[int, int],
    warnings: list[Diagnostic],
) -> Floats | None:
    """Texture coordinates as photo pixels: per point (n, 2) where each point has one place, else per corner (m, 3, 2).

    Pixel centres lie at integers, so u = 0 is x = -0.5. Corners without texture coordinates get NaN.
    """
    if polygons.uv is None or polygons.uv_corners is None or not (polygons.uv_corners >= 0).any():
        return None
    _say_outside(path, polygons, warnings)
    uv = np.vstack([polygons.uv, [np.nan, np.nan]])  # row -1: none
    rows, cols = shape_rc
    with np.errstate(invalid="ignore", over="ignore"):
        places = np.stack([uv[:, 0] * cols - 0.5, (1 - uv[:, 1]) * rows - 0.5], axis=1)
    places[~np.isfinite(places).all(1)] = np.nan
    row_of_point = uv_of_points(polygons, count)
    if row_of_point is not None:
        return np.asarray(places[row_of_point])
    return np.asarray(places[polygons.uv_corners[triangles]])


def _say_outside(path: Path, polygons: Polygons, warnings: list[Diagnostic]) -> None:
    assert polygons.uv is not None
    assert polygons.uv_corners is not None
    used = polygons.uv[polygons.uv_corners[polygons.uv_corners >= 0]]
    outside = int(((used < -_OUTSIDE) | (used > 1 + _OUTSIDE)).any(1).sum())
    if outside:
        warnings.append(
            Diagnostic(
                "texture-outside-photo",
                f"{path}: {outside} of {len(polygons.corners)} face corners have texture coordinates outside 0 to 1, "
                "so the photo does not show them",
            )
        )
