"""Parts of a scene, each put in place, become one mesh: what the readers of 3MF, COLLADA, X3D and USD share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planish.errors import InputError
from planish.io.filemesh import FileMesh, check_faces
from planish.io.polygons import Polygons
from planish.io.textures import Image, MeshImages
from planish.io.units import Unit
from planish.io.uv_charts import without_whole_shifts
from planish.types import Diagnostic, Floats, Pixels


@dataclass(frozen=True, eq=False)
class Part:
    """A piece of a scene.

    Attributes
    ----------
    points : (n, 3) float64
        In place.
    sizes : (p,) int
        Corners of each polygon.
    corners : (k,) int
        Rows of `points`.
    uv : (t, 2) float64 or None
        v up.
    uv_corners : (k,) int or None
        Rows of `uv`; -1 for none.
    image : Path, bytes or None
    image_name : str
    colours : (n, 3) uint8 or uint16, or None
    """

    points: Floats
    sizes: NDArray[np.integer[Any]]
    corners: NDArray[np.integer[Any]]
    uv: Floats | None = None
    uv_corners: NDArray[np.integer[Any]] | None = None
    image: Image | None = None
    image_name: str = ""
    colours: Pixels | None = None


def joined(
    path: Path, parts: Sequence[Part], unit: Unit | None, warnings: Sequence[Diagnostic] = (), *, repeats: bool = True
) -> FileMesh:
    """All parts as one mesh; polygons of fewer than three corners are left out.

    Raises
    ------
    InputError
        If they hold no surface.
    """
    if not parts:
        raise InputError(f"{path} holds no triangles; a triangle mesh of a sheet is wanted")
    names = list(dict.fromkeys(part.image_name for part in parts if part.image_name))
    points, sizes, corners, uv, uv_corners, of_face = [], [], [], [], [], []
    point_count = uv_count = 0
    for part in parts:
        real = part.sizes >= 3
        kept = np.repeat(real, part.sizes)
        rows = np.asarray(part.corners, np.int64)[kept]
        bad = rows[(rows < 0) | (rows >= len(part.points))]
        if len(bad):
            raise InputError(
                f"{path}: a face uses point {bad[0]}, but its mesh has {len(part.points)} points (counted from 0); was"
                " the file damaged?"
            )
        points.append(part.points)
        sizes.append(part.sizes[real])
        corners.append(rows + point_count)
        none = np.full(len(rows), -1, np.int64)
        if part.uv is not None and part.uv_corners is not None:
            at = np.asarray(part.uv_corners, np.int64)[kept]
            uv_corners.append(np.where((at >= 0) & (at < len(part.uv)), at + uv_count, -1))
            uv.append(part.uv)
            uv_count += len(part.uv)
        else:
            uv_corners.append(none)
        point_count += len(part.points)
        of_face.append(np.full(int(real.sum()), names.index(part.image_name) if part.image_name else -1, np.int32))
    flat = np.concatenate(corners).astype(np.int32)
    polygons = Polygons(np.concatenate(sizes).astype(np.int32), flat)
    if uv:
        polygons = Polygons(polygons.sizes, flat, np.concatenate(uv), np.concatenate(uv_corners).astype(np.int32))
    all_points = np.concatenate(points)
    check_faces(path, all_points, polygons)
    images = MeshImages(
        tuple(names),
        tuple(next((part.image for part in parts if part.image_name == name), None) for name in names),
        np.concatenate(of_face),
        tuple(warnings),
    )
    if repeats:
        polygons = without_whole_shifts(polygons, images.of_face >= 0)
    colours = None
    if all(part.colours is not None for part in parts):
        colours = np.concatenate([part.colours for part in parts if part.colours is not None])
    return FileMesh(all_points, polygons, images, colours, unit, warnings=list(warnings))
