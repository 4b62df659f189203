"""The flattened sheet to its file: OBJ, PLY, GLB or a tifxyz folder."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from planish.errors import OutputError, UsageError
from planish.io.files import write_bytes
from planish.io.gltf_write import glb_bytes, one_uv_per_point
from planish.io.obj import obj_parts
from planish.io.ply_write import ply_parts
from planish.io.polygons import Polygons, of_triangles, triangulate, uv_of_points
from planish.io.scans import ReadScan
from planish.io.tifxyz import write_tifxyz
from planish.mesh import rasterize
from planish.settings import mm_per_unit
from planish.types import Floats, Ints

UvUnit = Literal["mm", "unit"]
"""What a step of 1 in texture coordinates is: a mm, or the longer side of the page."""

SUFFIXES = (".obj", ".ply", ".glb", ".tifxyz", "")
"""The last two for a tifxyz folder."""

_MOST_GRID_POINTS = 20_000
"""Along the longer side of a tifxyz."""


@dataclass(frozen=True, eq=False)
class _Flat:
    """What is written: points in `unit`, and the faces of the file."""

    points: Floats
    polygons: Polygons
    comment: str
    mm_per_unit: float


def write_flat(
    path: str | Path,
    found: ReadScan,
    page_xy: Floats,
    *,
    as_: Literal["points", "uv"] = "points",
    uv: UvUnit = "mm",
    triangles: bool = False,
    scalars: Mapping[str, Floats] | None = None,
    face_scalars: Mapping[str, Floats] | None = None,
) -> None:
    """Write a flattened scan: its points in their order and its faces as they were.

    Parameters
    ----------
    path : str or Path
        .obj, .ply or .glb, or for a tifxyz folder .tifxyz or no suffix. GLB is in metres, cuts larger faces into
        triangles, and repeats points that have several texture coordinates, after the others.
    found : ReadScan
    page_xy : (n, 2) float64 [mm]
        x right, y down: where each point of the scan lies on the page.
    as_ : {"points", "uv"}
        points: the points move to the plane z = 0, in mm, y up, so that the page is not mirrored seen from +z; the
        texture coordinates stay. uv: the points stay in space, in the file's own numbers, and their place on the page
        [mm], y up, becomes their texture coordinate. A tifxyz is the second kind: the page as a regular grid of
        points in space.
    uv : {"mm", "unit"}
        With "unit" texture coordinates run from 0 to 1 along the longer side of the page, and equally far a mm along
        the shorter.
    triangles : bool
        Cut larger faces into triangles, those of `found.scan.mesh`.
    scalars : mapping of str to (n,) or (m,) float64, optional
        Further numbers of each point or triangle, such as strain. Only PLY holds them; the first colours the mesh.
    face_scalars : mapping of str to (m,) float64, optional
        The same of triangles alone, also where there are as many of them as points.

    Raises
    ------
    OutputError
        If the suffix is another, the format cannot hold what is asked for, or the file cannot be written.
    UsageError
        If scalars are neither one a point nor one a triangle.
    """
    path = Path(path)
    check_flat_name(path, as_, uv)
    numbers = {**(scalars or {}), **(face_scalars or {})}
    if numbers and path.suffix.lower() != ".ply":
        raise OutputError(f"{path} cannot hold {next(iter(numbers))}; only .ply holds numbers of each point and face")
    if path.suffix.lower() in ("", ".tifxyz"):
        _write_grid(path, found, page_xy)
        return
    flat = _flat(found, page_xy, as_, uv)
    if triangles:
        flat = replace(flat, polygons=_cut(found, flat.polygons))
    if path.suffix.lower() == ".obj":
        digits = 6 + round(np.log10(flat.mm_per_unit))
        write_bytes(path, obj_parts(flat.points, flat.polygons, comment=flat.comment, digits=digits))
    elif path.suffix.lower() == ".ply":
        _write_ply(path, found, flat, scalars or {}, face_scalars or {})
    else:
        _write_glb(path, found, flat)


def check_flat_name(path: str | Path, as_: str = "points", uv: UvUnit = "mm") -> None:
    """Refuse a name whose suffix is no kind of flat mesh, or that has no texture coordinates, before long work.

    Raises
    ------
    OutputError
        For the suffix.
    UsageError
        For texture coordinates of 0 to 1 where places on the page are no texture coordinates.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise OutputError(
            f"{path}: a flat mesh is written as .obj, .ply, .glb or a tifxyz folder; {suffix} is none of them"
        )
    if suffix in ("", ".tifxyz") and as_ != "uv":
        raise OutputError(
            f"{path}: a tifxyz folder holds where the page lies in space, not flat points",
            "set {as_=uv}, or write .obj for flat points",
        )
    if uv == "unit" and (as_ != "uv" or suffix in ("", ".tifxyz")):
        raise UsageError(
            f"{path} holds no places on the page as texture coordinates, so they cannot be 0 to 1",
            "set {as_=uv} and write .obj, .ply or .glb",
        )


def uv_unit_mm(page_xy: Floats) -> float:
    """Length [mm] of a step of 1 in texture coordinates from 0 to 1: the longer side of the page."""
    return float(np.nanmax(page_xy, initial=0.0)) or 1.0


def _flat(found: ReadScan, page_xy: Floats, as_: str, uv: UvUnit) -> _Flat:
    height = np.nanmax(page_xy[:, 1], initial=0.0)
    up = np.stack([page_xy[:, 0], height - page_xy[:, 1]], axis=1)
    if as_ == "points":
        comment = "units: mm\nthe flattened sheet: the scan's points in their order, moved to the plane z = 0"
        return _Flat(np.c_[up, np.zeros(len(up))], found.polygons, comment, 1.0)
    step = uv_unit_mm(page_xy) if uv == "unit" else 1.0
    polygons = Polygons(found.polygons.sizes, found.polygons.corners, up / step, found.polygons.corners)
    scale = "in mm" if uv == "mm" else f"in parts of {step:.9g} mm"
    comment = f"units: {found.unit}\nthe scan's points; texture coordinates are their places on the page {scale}, y up"
    return _Flat(_file_points(found), polygons, comment, mm_per_unit(found.unit))


def _cut(found: ReadScan, polygons: Polygons) -> Polygons:
    """Polygons cut into the triangles that were flattened."""
    rows = triangulate(found.scan.mesh.points, polygons)
    uv_corners = None if polygons.uv_corners is None else polygons.uv_corners[rows]
    return of_triangles(polygons.corners[rows], polygons.uv, uv_corners)


def _file_points(found: ReadScan) -> Floats:
    return found.scan.mesh.points / mm_per_unit(found.unit)


# PLY


def _write_ply(
    path: Path, found: ReadScan, flat: _Flat, scalars: Mapping[str, Floats], face_scalars: Mapping[str, Floats]
) -> None:
    count, triangles = len(flat.points), len(found.scan.mesh.faces)
    point_columns: dict[str, NDArray] = {}
    face_columns: dict[str, NDArray] = {}
    comments = flat.comment.splitlines()
    for number, (name, values) in enumerate(scalars.items()):
        if len(values) not in (count, triangles):
            raise UsageError(
                f"{name} has {len(values)} values; {count} (a point) or {triangles} (a triangle) are wanted"
            )
        columns = point_columns if len(values) == count else face_columns
        columns[name] = values if len(values) == count else _mean_of_triangles(flat.polygons, values)
        if number == 0:
            colours, highest = _coloured(columns[name])
            columns |= colours
            comments.append(f"colours: {name} from 0 (dark) to {highest:.4g} (bright)")
    for name, values in face_scalars.items():
        if len(values) != triangles:
            raise UsageError(f"{name} has {len(values)} values; {triangles} (a triangle) are wanted")
        face_columns[name] = _mean_of_triangles(flat.polygons, values)
    uv = _uv_of_each_point(flat.polygons, count)
    parts = ply_parts(
        flat.points,
        flat.polygons,
        point_uv=uv,
        point_columns=point_columns,
        face_columns=face_columns,
        comments=comments,
    )
    write_bytes(path, parts)


def _uv_of_each_point(polygons: Polygons, count: int) -> Floats | None:
    """Texture coordinates (n, 2), NaN for none; None where there are none at all, or a point has several."""
    rows = uv_of_points(polygons, count)
    if polygons.uv is None or rows is None:
        return None
    return np.asarray(np.vstack([polygons.uv, [np.nan, np.nan]])[rows])


def _mean_of_triangles(polygons: Polygons, values: Floats) -> Floats:
    """A number of each polygon from those of the triangles it was cut into."""
    return np.asarray(np.bincount(polygons.triangle_owner, values) / (polygons.sizes - 2))


def _coloured(values: Floats) -> tuple[dict[str, NDArray], float]:
    """Colours from dark blue (0) to yellow (the 99 % quantile of the size of the values), and that quantile."""
    size = np.nan_to_num(np.abs(values), nan=0.0, posinf=0.0)
    highest = float(np.quantile(size, 0.99)) if len(size) else 0.0
    grey = np.clip(size * (255 / highest if highest > 0 else 0.0), 0, 255).round().astype(np.uint8)
    bgr = cv2.applyColorMap(grey[:, None], cv2.COLORMAP_VIRIDIS).reshape(-1, 3)
    return {"red": bgr[:, 2], "green": bgr[:, 1], "blue": bgr[:, 0]}, highest


# GLB


def _write_glb(path: Path, found: ReadScan, flat: _Flat) -> None:
    rows = triangulate(found.scan.mesh.points, flat.polygons)
    faces = flat.polygons.corners[rows]
    points, uv = flat.points * flat.mm_per_unit, None
    if flat.polygons.uv is not None and flat.polygons.uv_corners is not None:
        faces, source, uv = one_uv_per_point(len(points), faces, flat.polygons.uv, flat.polygons.uv_corners[rows])
        points = points[source]
    write_bytes(path, glb_bytes(points, faces, uv))


# tifxyz


def _write_grid(path: Path, found: ReadScan, page_xy: Floats) -> None:
    """The page as a regular grid of points in space, about as many as the scan has."""
    faces = found.scan.mesh.faces
    size = np.nanmax(page_xy, axis=0)
    step = max(_median_step(page_xy, faces), size.max() / _MOST_GRID_POINTS)
    cols, rows = (int(n) for n in np.floor(size / step) + 1)
    face, weights = rasterize(page_xy / step, faces, (rows, cols))
    a, b, c = (_file_points(found)[faces[np.maximum(face, 0), k]] for k in range(3))
    xyz = a + weights[..., :1] * (b - a) + weights[..., 1:] * (c - a)
    xyz[face < 0] = np.nan
    write_tifxyz(path, xyz, per_unit=mm_per_unit(found.unit) / step)


def _median_step(page_xy: Floats, faces: Ints) -> float:
    """Side [mm] of the square that each point has to itself: two triangles large."""
    a, b, c = (page_xy[faces[:, k]] for k in range(3))
    twice = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    return float(np.sqrt(np.median(twice[np.isfinite(twice)])))
