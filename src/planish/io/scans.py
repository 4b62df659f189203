"""A scan from its files: mesh, photo, camera and unit brought together."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from planish.errors import InputError
from planish.io.cameras import read_camera
from planish.io.filemesh import FileMesh
from planish.io.images import Photo, decode_photo, read_photo
from planish.io.meshes import read_mesh
from planish.io.polygons import Polygons, triangulate
from planish.io.units import MM_PER_UNIT, Unit, decide_unit
from planish.types import Bools, Camera, Floats, Mesh, Scan, _freeze

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
    warnings : list of str
    polygons : Polygons
        The file's own faces and texture coordinates.
    grid : (rows, cols) bool or None
        For a file that is a grid of points: which cells hold one.
    """

    scan: Scan
    unit: Unit
    warnings: list[str]
    polygons: Polygons
    grid: Bools | None = field(default=None)

    def __post_init__(self) -> None:
        _freeze(self)


def read_scan(
    path: str | Path, *, photo: str | Path | None = None, camera: str | Path | None = None, units: str = "auto"
) -> ReadScan:
    """Read a scan.

    The photo is the one that `photo` names, else the texture that the mesh file names or holds. Where its parts lie
    is told by the texture coordinates; but if both `photo` and `camera` are given, by the camera.

    Parameters
    ----------
    path : str or Path
        OBJ, PLY, GLB, glTF or a tifxyz folder.
    photo : str or Path, optional
    camera : str or Path, optional
        JSON, see `read_camera`; its numbers are in the unit of the mesh.
    units : {"auto", "mm", "cm", "m", "in"}

    Raises
    ------
    InputError
        If a file is missing, damaged, of the wrong kind, or the files do not belong together.
    """
    path = Path(path)
    found = read_mesh(path)
    unit, told = decide_unit(found.points, units, found.unit)
    warnings = [*found.warnings, *told]
    points = found.points * MM_PER_UNIT[unit]
    mesh = Mesh(points, found.polygons.corners[triangulate(points, found.polygons)])
    picture = _picture(found, photo, warnings)
    photo_name = _photo_name(found, photo)
    seen_from = None
    if camera is not None:
        seen_from = read_camera(camera, photo_name, mm_per_unit=MM_PER_UNIT[unit])
        _check_same_size(camera, seen_from, photo_name, picture)
    by_camera = seen_from is not None and photo is not None and not _same_file(found.texture, photo)
    photo_xy = None
    if picture is not None and not by_camera:
        photo_xy = _photo_xy(path, found, points, picture.pixels.shape[:2], warnings)
        if photo_xy is None and seen_from is None:
            raise InputError(
                f"{path} has no texture coordinates, so nothing tells where its points lie on the photo; give --camera"
            )
    scan = Scan(
        mesh,
        photo=picture.pixels if picture else None,
        photo_xy=photo_xy,
        camera=seen_from,
        icc=picture.icc if picture else None,
    )
    return ReadScan(scan, unit, warnings, found.polygons, found.grid)


def _picture(found: FileMesh, photo: str | Path | None, warnings: list[str]) -> Photo | None:
    """The photo that the user names, else the texture."""
    if photo is not None:
        picture = read_photo(photo)
    elif isinstance(found.texture, Path):
        picture = read_photo(found.texture)
    elif isinstance(found.texture, bytes):
        picture = decode_photo("the texture in the mesh file", found.texture)
    else:
        return None
    warnings += picture.warnings
    return picture


def _photo_name(found: FileMesh, photo: str | Path | None) -> str | None:
    if photo is not None:
        return Path(photo).name
    return found.texture.name if isinstance(found.texture, Path) else None


def _same_file(texture: Path | bytes | None, photo: str | Path) -> bool:
    return isinstance(texture, Path) and texture.samefile(photo)


def _check_same_size(path: str | Path, camera: Camera, photo_name: str | None, picture: Photo | None) -> None:
    if picture is None or picture.pixels.shape[:2] == camera.shape_rc:
        return
    (rows, cols), (asked_rows, asked_cols) = picture.pixels.shape[:2], camera.shape_rc
    raise InputError(
        f"{photo_name or 'the photo'} is {cols} x {rows} pixels, but {path} is for a photo of {asked_cols} x {asked_rows};"
        " give the photo that the camera's numbers belong to"
    )


def _photo_xy(
    path: Path, found: FileMesh, points: Floats, shape_rc: tuple[int, int], warnings: list[str]
) -> Floats | None:
    """Texture coordinates as photo pixels: per point (n, 2) where each point has one place, else per corner (m, 3, 2).

    Pixel centres lie at integers, so u = 0 is x = -0.5. Corners without texture coordinates get NaN.
    """
    polygons = found.polygons
    if polygons.uv is None or polygons.uv_corners is None:
        return None
    rows, cols = shape_rc
    with np.errstate(invalid="ignore", over="ignore"):
        places = np.stack([polygons.uv[:, 0] * cols - 0.5, (1 - polygons.uv[:, 1]) * rows - 0.5], axis=1)
    places = np.vstack([places, [np.nan, np.nan]])  # row -1: none
    places[~np.isfinite(places).all(1)] = np.nan
    _say_outside(path, polygons, warnings)
    row_of_point = np.full(len(points), -1, np.int64)
    row_of_point[polygons.corners] = polygons.uv_corners
    if (row_of_point[polygons.corners] == polygons.uv_corners).all():
        return np.asarray(places[row_of_point])
    triangles = triangulate(points, polygons)
    return np.asarray(places[polygons.uv_corners[triangles]])


def _say_outside(path: Path, polygons: Polygons, warnings: list[str]) -> None:
    assert polygons.uv is not None
    assert polygons.uv_corners is not None
    used = polygons.uv[polygons.uv_corners[polygons.uv_corners >= 0]]
    outside = int(((used < -_OUTSIDE) | (used > 1 + _OUTSIDE)).any(1).sum())
    if outside:
        warnings.append(
            f"{path}: {outside} of {len(polygons.corners)} face corners have texture coordinates outside 0 to 1, so the"
            " photo does not show them"
        )
