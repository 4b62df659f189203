"""A scan cut along the outline of its sheet, between its points where the outline runs between them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from planish.document.rim import at_places
from planish.mesh import area_vectors
from planish.types import Bools, Floats, Ints, Mesh, Scan

NEIGHBOURS = 12
"""Points of the sheet from which a point of its outline is extrapolated: three rows of a range image. With half of it
noise of 0.3 mm makes the rim ragged by as much; with twice as many it is straight where the paper curls."""

SURE_PX = 1.0
"""Points nearer to the outline than this, or than a usual edge, may be mixtures of paper and table, or lie on the table
where outline and points do not agree to a pixel: nothing is extrapolated from them, and those that are off the
continuation of the sheet by more than a usual edge do not count as the sheet's."""

HANGING = 1.5
"""Edges that are longer than this in the view, in usual ones, hang between sheet and table. Grids have up to 1.4."""

MIXED = 0.25
"""Points beside the outline that are farther than this from the continuation of the sheet, in usual edges, are mixtures
of paper and table. At 1, 46 faces at the rim of a depth camera's book page stand on end."""

SLIVER = 0.1
"""Faces of which the outline leaves less than this part of a usual one are left out: solvers stumble over slivers."""

LONG_PX = 1600
"""Long side of the mask on which distances to the outline are measured."""

SMOOTH_PX = 0.7
"""The outline of a mask runs in steps of a pixel; smoothed by this it is straight to a tenth of one."""


def cut_to_outline(scan: Scan, mask: Bools, places: Floats) -> tuple[Scan, Bools]:
    """Keep what of a scan lies on a mask; faces that cross its outline end there.

    The outer corners of such faces lie on the table, or the faces hang between it and the sheet: these corners are
    moved to the outline, on the continuation of the sheet.

    Parameters
    ----------
    scan : Scan
    mask : (rows, cols) bool
    places : (n, 2) float64 [px]
        Of the points on the mask.

    Returns
    -------
    scan : Scan
        With the same points, of which those beside the outline are moved, and fewer faces.
    left_out : (m,) bool
        Faces of the source that are not in it.
    """
    depth = depth_inside(mask, places)
    faces, points, photo_xy = scan.mesh.faces, scan.mesh.points, scan.photo_xy
    inside = at_places(mask, places) & (depth > 0)
    sure = inside & (depth >= max(SURE_PX, typical_length(places, faces, inside)))
    if sure.any():
        points, hanging = _smooth_rim(points, places, faces, sure, inside)
        inside &= _reached(sure, faces) & ~hanging
    kept = inside[faces].any(axis=1)
    kept &= np.isfinite(scan.mesh.points[faces]).all(axis=(1, 2)) & np.isfinite(places[faces]).all(axis=(1, 2))
    ends = faces[kept][:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    ends = np.concatenate([ends, ends[:, ::-1]])
    ends = ends[inside[ends[:, 0]] & ~inside[ends[:, 1]]]
    if len(ends) and inside.any():
        points = points.copy()
        edges = _Edges(places, depth, typical_length(places, faces, inside))
        outer, at = _crossings(ends, edges)
        points[outer] = continued(points, places, sure, inside, at)
        kept &= inside[faces].all(axis=1) | _worth_keeping(places, faces, inside, outer, at)
        if photo_xy is not None:
            photo_xy = _moved_places(photo_xy, faces, inside, edges)
    moved = replace(scan, mesh=Mesh(points, faces), photo_xy=photo_xy)
    return with_faces(moved, np.asarray(kept)), np.asarray(~kept)


def with_faces(scan: Scan, kept: Bools) -> Scan:
    """A scan with all of its points and some of its faces (m,)."""
    photo_xy = scan.photo_xy
    return replace(
        scan,
        mesh=Mesh(scan.mesh.points, scan.mesh.faces[kept]),
        photo_xy=photo_xy[kept] if photo_xy is not None and photo_xy.ndim == 3 else photo_xy,
        texture_of_face=None if scan.texture_of_face is None else scan.texture_of_face[kept],
        sheet=None,
    )


def left_out_share(mesh: Mesh, left_out: Bools) -> float:
    """Part of a mesh's area."""
    area = np.linalg.norm(area_vectors(mesh.points, mesh.faces), axis=1)
    return float(np.nansum(area[left_out]) / max(np.nansum(area), np.finfo(float).tiny))


def depth_inside(mask: Bools, places: Floats) -> Floats:
    """(n,) distance of places inside of the outline [mask px]; negative outside, NaN where there is no place."""
    scale = min(1.0, LONG_PX / max(mask.shape))
    small = mask
    if scale < 1:
        size = max(1, round(mask.shape[1] * scale)), max(1, round(mask.shape[0] * scale))
        small = cv2.resize(mask.astype(np.uint8) * 255, size, interpolation=cv2.INTER_AREA) > 127
    padded = np.pad(small, 2)
    signed = ndimage.distance_transform_edt(padded) - ndimage.distance_transform_edt(~padded)
    signed -= 0.5 * np.sign(signed)  # between the centres of two pixels
    signed = ndimage.gaussian_filter(signed, SMOOTH_PX)
    at = (places[:, ::-1] + 0.5) * scale - 0.5 + 2
    known = np.isfinite(at).all(axis=1)
    depth = np.full(len(places), np.nan)
    depth[known] = ndimage.map_coordinates(signed, at[known].T, order=1, mode="nearest") / scale
    return depth


@dataclass(frozen=True, eq=False)
class _Edges:
    """What tells where an edge crosses the outline: places, distances inside of it, and the usual length of edges."""

    places: Floats
    depth: Floats
    typical_px: float

    def crossing(self, inner: Ints, outer: Ints) -> Floats:
        """(k, 1) parts of edges, on their images, up to the outline; half of those that it does not cross."""
        part = self.depth[inner] / np.maximum(self.depth[inner] - self.depth[outer], 1e-9)
        return np.asarray(np.where(self.depth[outer] > 0, 0.5, np.clip(part, 0, 1))[:, None])

    def on_sheet(self, inner: Ints, outer: Ints) -> Floats:
        """(k, 1) parts of edges, as places of the view, over which the sheet goes on.

        An edge that hangs from the raised rim of the sheet down to the table is one pixel of the scanner, but seen from
        elsewhere it is long: of it counts what a usual edge would have.
        """
        length = np.linalg.norm(self.places[outer] - self.places[inner], axis=1)
        usual = np.where(length > HANGING * self.typical_px, self.typical_px / np.maximum(length, 1e-9), 1.0)
        return self.crossing(inner, outer) * usual[:, None]


def _reached(sure: Bools, faces: Ints) -> Bools:
    """(n,) points at most two faces from a sure one: others beside the outline hang on the table."""
    reached = sure.copy()
    for _ in range(2):
        reached[faces[reached[faces].any(axis=1)]] = True
    return reached


def _smooth_rim(points: Floats, places: Floats, faces: Ints, sure: Bools, inside: Bools) -> tuple[Floats, Bools]:
    """Points beside the outline compared with the continuation of the sheet.

    Returns
    -------
    points : (n, 3) float64 [mm]
        Mixtures of paper and table moved onto the sheet.
    hanging : (n,) bool
        Points so far off it that they lie on the table, or between.
    """
    points, hanging = points.copy(), np.zeros(len(points), bool)
    rim = np.flatnonzero(inside & ~sure & np.isfinite(points).all(axis=1))
    if len(rim):
        sheet = continued(points, places, sure, inside, places[rim])
        off = np.linalg.norm(points[rim] - sheet, axis=1) / typical_length(points, faces, sure)
        hanging[rim] = off > 1
        mixed = (off > MIXED) & (off <= 1)
        points[rim[mixed]] = sheet[mixed]
    return points, hanging


def typical_length(points: Floats, faces: Ints, inside: Bools) -> float:
    """Median length of the edges within the sheet."""
    ends = faces[inside[faces].all(axis=1)][:, [0, 1, 1, 2]].reshape(-1, 2)
    return float(np.median(np.linalg.norm(np.diff(points[ends], axis=1)[:, 0], axis=1))) if len(ends) else np.inf


def _crossings(ends: Ints, edges: _Edges) -> tuple[Ints, Floats]:
    """Where edges from inside to outside cross the outline: the outer points, and for each the mean place."""
    inner, outer = ends.T
    places = edges.places
    crossing = places[inner] + edges.on_sheet(inner, outer) * (places[outer] - places[inner])
    rows, number, count = np.unique(outer, return_inverse=True, return_counts=True)
    at = np.stack([np.bincount(number, crossing[:, k]) / count for k in (0, 1)], axis=1)
    return rows.astype(np.int32), at


def _worth_keeping(places: Floats, faces: Ints, inside: Bools, outer: Ints, at: Floats) -> Bools:
    """(m,) faces that, with their outer corners on the outline, run as those of the sheet do and are no slivers."""
    moved = places.copy()
    moved[outer] = at
    a, b, c = (moved[faces[:, k]] for k in range(3))
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    usual = float(np.nanmedian(area[inside[faces].all(axis=1)]))
    return np.asarray(area * np.sign(usual) > SLIVER * abs(usual))


def continued(points: Floats, places: Floats, sure: Bools, inside: Bools, at: Floats) -> Floats:
    """(k, 3) the sheet at places on its outline: planes through the nearest of its points."""
    known = sure if sure.sum() >= NEIGHBOURS else inside
    rows = np.flatnonzero(known)
    distance, near = cKDTree(places[known]).query(at, min(NEIGHBOURS, len(rows)))
    near, distance = near.reshape(len(at), -1), distance.reshape(len(at), -1)
    around = points[rows[near]]
    offset = (places[rows[near]] - at[:, None]) / np.maximum(distance.max(axis=1), 1e-9)[:, None, None]
    terms = np.concatenate([np.ones((*near.shape, 1)), offset], axis=2)
    normal = np.matmul(terms.swapaxes(1, 2), terms)
    normal[:, [1, 2], [1, 2]] += 1e-3 * near.shape[1]  # points in one line tell no slope across it
    middle = around.mean(axis=1, keepdims=True)
    fitted = np.linalg.solve(normal, np.matmul(terms.swapaxes(1, 2), around - middle))
    return np.asarray(middle[:, 0] + fitted[:, 0])


def _moved_places(photo_xy: Floats, faces: Ints, inside: Bools, edges: _Edges) -> Floats:
    """The places on the photo or the textures, those of outer corners moved to the outline."""
    moved = photo_xy.copy()
    corners = photo_xy if photo_xy.ndim == 3 else photo_xy[faces]
    crossing = inside[faces].any(axis=1) & ~inside[faces].all(axis=1)
    total, count = np.zeros((len(inside), 2)), np.zeros(len(inside))
    for a in range(3):
        towards, weight = np.zeros((len(faces), 2)), np.zeros(len(faces))
        for b in ((a + 1) % 3, (a + 2) % 3):
            use = crossing & inside[faces[:, b]] & ~inside[faces[:, a]]
            part = edges.crossing(faces[use, b], faces[use, a])
            towards[use] += corners[use, b] + part * (corners[use, a] - corners[use, b])
            weight[use] += 1
        use = weight > 0
        if photo_xy.ndim == 3:
            moved[use, a] = towards[use] / weight[use, None]
        else:
            for k in (0, 1):
                total[:, k] += np.bincount(faces[use, a], towards[use, k], len(inside))
            count += np.bincount(faces[use, a], weight[use], len(inside))
    if photo_xy.ndim == 2:
        moved[count > 0] = total[count > 0] / count[count > 0, None]
    return moved
