"""The map from page to photo: a mesh fine enough for its faces to be taken as flat."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from planish.geometry import depths, project
from planish.render.patch import refine
from planish.types import Bools, Camera, Floats, Ints, Scan

FINE_MM = 1.0
"""Faces longer than this on the page are cut into curved pieces; over 1 mm of paper no bend is seen."""
MAX_FACES = 1_000_000
"""No finer than this many pieces in all."""
SOME_FACES = 20_000
"""Of a mesh, to tell how coarse it is."""
BEYOND_PX = 1e6
"""No photo reaches so far from its corner; places that lie there, or are not numbers, are not on it."""


@dataclass(frozen=True, eq=False)
class UVMap:
    """The sheet on the page and on the photo.

    Attributes
    ----------
    faces : (m, 3) int32
    page_xy : (n, 2) float64 [mm]
    photo_xy : (n, 2) float64 [photo px]
    points : (n, 3) float64 [mm]
    jacobian : (n, 2, 2) float64 [photo px per mm]
        d photo (x, y) / d page (x, y), the mean over the faces around each point.
    image : (m,) int32 or None
        Of a scan with several textures: the number of the one that each face shows, whose pixels its places count.
    """

    faces: Ints
    page_xy: Floats
    photo_xy: Floats
    points: Floats
    jacobian: Floats
    image: Ints | None = None


def uv_map(scan: Scan, page_xy: Floats) -> UVMap:
    """Map page to photo.

    Between the points the way over a coarse mesh is curved (see `refine`); with a known camera it goes through
    space, so that the perspective inside a face is right, and the camera's misfit at the points is spread smoothly.

    Parameters
    ----------
    scan : Scan
        With `photo_xy`, or with a camera, or both.
    page_xy : (n, 2) float64 [mm]
    """
    faces, page, points, photo = _split_seams(scan, page_xy)
    seen = None if scan.camera is None else _projected(scan.camera, points)
    photo = seen if photo is None else photo
    assert photo is not None
    image = scan.texture_of_face if scan.textures else None
    on_photo, photo = _without_invalid(faces, photo)
    on_photo &= True if image is None else image >= 0
    faces, image = faces[on_photo], None if image is None else image[on_photo]
    misfit = np.zeros_like(page) if seen is None else np.where(np.isfinite(seen), photo - seen, 0)
    pieces = _pieces_per_edge(page, faces)
    if pieces > 1:
        carried = np.concatenate([points, photo if scan.camera is None else misfit], axis=1)
        page, carried, faces = refine(page, carried, faces, pieces)
        points, photo = carried[:, :3], carried[:, 3:]
        image = None if image is None else np.repeat(image, pieces**2)
        if scan.camera is not None:
            photo = photo + project(scan.camera, points)
    return UVMap(faces, page, photo, points, _jacobians(page, photo, faces), image)


def _split_seams(scan: Scan, page_xy: Floats) -> tuple[Ints, Floats, Floats, Floats | None]:
    """Faces, page, points, photo with one photo place a point; points with several, at seams, become several."""
    faces, photo = scan.mesh.faces, scan.photo_xy
    if photo is None or photo.ndim == 2:
        return faces, page_xy, scan.mesh.points, photo
    point, corner_xy = faces.reshape(-1), photo.reshape(-1, 2)
    one = np.zeros_like(page_xy)
    one[point] = corner_xy
    if not scan.textures and np.abs(one[point] - corner_xy).max() < 1e-3:
        return faces, page_xy, scan.mesh.points, one
    image = np.zeros(len(faces)) if scan.texture_of_face is None else scan.texture_of_face
    key = np.c_[point, corner_xy, np.repeat(image, 3)]
    _, first, corner = np.unique(key, axis=0, return_index=True, return_inverse=True)
    source = point[first]
    split = corner.reshape(-1, 3).astype(np.int32)
    return split, page_xy[source], scan.mesh.points[source], corner_xy[first]


def _projected(camera: Camera, points: Floats) -> Floats:
    """Places on the photo, NaN for what lies behind the camera."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(depths(camera, points)[:, None] > 0, project(camera, points), np.nan))


def _without_invalid(faces: Ints, photo_xy: Floats) -> tuple[Bools, Floats]:
    """Which faces have all corners on a photo; and the places, where those on none lie in the middle of the others."""
    good = np.asarray((np.abs(photo_xy) < BEYOND_PX).all(axis=1))
    if good.all():
        return np.ones(len(faces), bool), photo_xy
    middle = photo_xy[good].mean(axis=0) if good.any() else np.zeros(2)
    return np.asarray(good[faces].all(axis=1)), np.where(good[:, None], photo_xy, middle)


def _pieces_per_edge(page_xy: Floats, faces: Ints) -> int:
    if not len(faces):
        return 1
    some = page_xy[faces[:: max(1, len(faces) // SOME_FACES)]]
    edge = np.linalg.norm(some - np.roll(some, 1, axis=1), axis=2)
    wanted = int(np.ceil(float(np.quantile(edge, 0.9)) / FINE_MM)) if edge.max() > 2 * FINE_MM else 1
    return max(1, min(wanted, int(np.sqrt(MAX_FACES / len(faces)))))


@njit(cache=True)
def _jacobians(page, photo, faces):  # type: ignore[no-untyped-def]
    """J = (sum D_photo adj(D_page)) / (sum det D_page) over the faces of a point; D holds two edges as columns."""
    total = np.zeros((len(page), 2, 2))
    area = np.zeros(len(page))
    for f in range(len(faces)):
        a, b, c = faces[f]
        u1, v1 = page[b, 0] - page[a, 0], page[b, 1] - page[a, 1]
        u2, v2 = page[c, 0] - page[a, 0], page[c, 1] - page[a, 1]
        x1, y1 = photo[b, 0] - photo[a, 0], photo[b, 1] - photo[a, 1]
        x2, y2 = photo[c, 0] - photo[a, 0], photo[c, 1] - photo[a, 1]
        for i in (a, b, c):
            total[i, 0, 0] += x1 * v2 - x2 * v1
            total[i, 0, 1] += x2 * u1 - x1 * u2
            total[i, 1, 0] += y1 * v2 - y2 * v1
            total[i, 1, 1] += y2 * u1 - y1 * u2
            area[i] += u1 * v2 - u2 * v1
    for i in range(len(page)):
        if area[i] != 0:
            for k in range(2):
                total[i, k, 0] /= area[i]
                total[i, k, 1] /= area[i]
    return total
