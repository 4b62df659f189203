"""Two places that a user marked in a photo, on the surface of the sheet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planish.errors import InputError
from planish.geometry import depths, project
from planish.types import Camera, Floats, Ints, Mesh

PLACE_PX = 1.0
"""Standard deviation of a place that was read off a photo, along the distance."""
RULER_MM = 0.2
"""Of a length measured with a ruler."""


@dataclass(frozen=True, eq=False)
class MarkedPlaces:
    """Two places on the faces of a mesh.

    Attributes
    ----------
    corners : (2, 3) int32
        Points of the face that holds each.
    weights : (2, 3) float64
        Barycentric coordinates in it.
    apart_px : float [photo px]
        Distance of the places in the photo.
    """

    corners: Ints
    weights: Floats
    apart_px: float

    def apart(self, page_xy: Floats) -> float:
        """Distance of the places on a page, where the mesh's points lie at `page_xy` (n, 2)."""
        first, second = (self.weights[..., None] * page_xy[self.corners]).sum(axis=1)
        return float(np.linalg.norm(second - first))

    def relative_error(self, distance_mm: float) -> float:
        """Standard error of a size that rests on their distance: of the two places and of the ruler."""
        return float(np.hypot(np.sqrt(2) * PLACE_PX / self.apart_px, RULER_MM / distance_mm))


def places_on_sheet(mesh: Mesh, camera: Camera, photo_xy: Floats, name: str) -> MarkedPlaces:
    """Find the places of the sheet that a photo shows at two of its pixels.

    Parameters
    ----------
    mesh : Mesh
    camera : Camera
    photo_xy : (2, 2) float64
        Column and row, pixel centres at integers.
    name : str
        Of the photo, for messages.

    Raises
    ------
    InputError
        If a place is not on the sheet.
    """
    seen_xy, depth = project(camera, mesh.points), depths(camera, mesh.points)
    faces, weights = zip(*(_face_at(mesh, seen_xy, depth, xy, name) for xy in photo_xy), strict=True)
    return MarkedPlaces(mesh.faces[list(faces)], np.array(weights), float(np.linalg.norm(photo_xy[1] - photo_xy[0])))


def _face_at(mesh: Mesh, seen_xy: Floats, depth: Floats, xy: Floats, name: str) -> tuple[int, Floats]:
    """The nearest of the faces that cover a pixel, and barycentric coordinates in it."""
    a, b, c = (seen_xy[mesh.faces[:, k]] for k in range(3))
    twice_area = _cross(b - a, c - a)
    with np.errstate(divide="ignore", invalid="ignore"):
        weights = np.stack([_cross(b - xy, c - xy), _cross(c - xy, a - xy), _cross(a - xy, b - xy)], 1)
        weights /= twice_area[:, None]
    covering = np.flatnonzero((weights >= 0).all(axis=1))
    if not len(covering):
        raise InputError(f"the marked place of {name} is not on the sheet that was found; mark two places of its print")
    nearest = covering[depth[mesh.faces[covering]].mean(axis=1).argmin()]
    perspective = weights[nearest] / depth[mesh.faces[nearest]]
    return int(nearest), perspective / perspective.sum()


def _cross(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
