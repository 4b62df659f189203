"""What a reader of one format hands over: the mesh as the file has it, before units and photo."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from planish.errors import InputError
from planish.io.polygons import Polygons
from planish.io.textures import Image, MeshImages
from planish.io.units import Unit
from planish.types import Diagnostic, Floats, Pixels, freeze


@dataclass(frozen=True, eq=False)
class FileMesh:
    """A mesh in the numbers of its file.

    Attributes
    ----------
    points : (n, 3) float64 [file's unit]
        In the file's order; some may not be finite.
    polygons : Polygons
    images : MeshImages or None
        That the texture coordinates belong to, and the image of each face.
    colours : (n, 3) uint8 or uint16, or None
        Of the points.
    unit : {"mm", "cm", "m", "in"} or None
        What the file says itself.
    warnings : list of Diagnostic
    """

    points: Floats
    polygons: Polygons
    images: MeshImages | None = None
    colours: Pixels | None = None
    unit: Unit | None = None
    warnings: list[Diagnostic] = field(default_factory=list)

    def __post_init__(self) -> None:
        freeze(self)

    @property
    def texture(self) -> Image | None:
        """The image that most faces show; None where there is none, or its file is missing."""
        return self.images.files[self.images.shown[0]] if self.images is not None and self.images.shown else None


def check_faces(path: Path, points: Floats, polygons: Polygons) -> None:
    """Refuse what is no surface: no points, no faces, a face whose point does not exist, no point that is a number."""
    if not len(points):
        raise InputError(f"{path} holds no points; a triangle mesh of a sheet is wanted")
    if not len(polygons.sizes):
        raise InputError(
            f"{path} holds {len(points)} points and no faces; is this a point cloud, or was the file cut short?"
            " A triangle mesh is wanted: `planish acquire grid` makes one of a range image, `planish acquire points` of"
            " other points"
        )
    bad = np.flatnonzero((polygons.corners < 0) | (polygons.corners >= len(points)))
    if len(bad):
        owner = np.searchsorted(np.cumsum(polygons.sizes), bad[0], side="right")
        raise InputError(
            f"{path}: face {owner} uses point {polygons.corners[bad[0]]}, but the file has {len(points)} points"
            " (both counted from 0); was the file cut short?"
        )
    if not np.isfinite(points).all(1).any():
        raise InputError(f"{path}: none of its {len(points)} points has three finite coordinates")
