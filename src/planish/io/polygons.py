"""The faces of a file as it gave them, and their triangles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planish.types import Bools, Floats, Ints, freeze


@dataclass(frozen=True, eq=False)
class Polygons:
    """Faces of any number of corners, with the texture coordinates of each corner.

    Attributes
    ----------
    sizes : (p,) int32
        Corners of each polygon, at least 3.
    corners : (k,) int32
        The points of all polygons, one polygon after the other.
    uv : (t, 2) float64 or None
        Texture coordinates, u right, v up, both 0 to 1 over the image.
    uv_corners : (k,) int32 or None
        Row of `uv` of each corner; -1 where it has none.
    """

    sizes: Ints
    corners: Ints
    uv: Floats | None = None
    uv_corners: Ints | None = None

    def __post_init__(self) -> None:
        freeze(self)

    @property
    def all_triangles(self) -> bool:
        """Whether every polygon is a triangle."""
        return len(self.corners) == 3 * len(self.sizes)

    @property
    def triangle_owner(self) -> NDArray[np.int64]:
        """(m,) the polygon that each triangle of `triangulate` was cut from."""
        return np.repeat(np.arange(len(self.sizes)), self.sizes - 2)


def of_triangles(faces: Ints, uv: Floats | None = None, uv_faces: Ints | None = None) -> Polygons:
    """Polygons that are triangles: faces (m, 3), and rows of `uv` (m, 3), which are the faces' own if not given."""
    corners = np.ascontiguousarray(faces, np.int32).reshape(-1)
    sizes = np.full(len(faces), 3, np.int32)
    if uv is None:
        return Polygons(sizes, corners)
    return Polygons(sizes, corners, uv, corners if uv_faces is None else np.asarray(uv_faces, np.int32).reshape(-1))


def uv_of_points(polygons: Polygons, count: int) -> NDArray[np.int64] | None:
    """Row of `uv` of each of the `count` points, -1 for none; None where a point has different ones at its corners."""
    if polygons.uv is None or polygons.uv_corners is None:
        return np.full(count, -1)
    rows = np.full(count, -1)
    rows[polygons.corners] = polygons.uv_corners
    found = rows[polygons.corners]
    differ = np.flatnonzero(found != polygons.uv_corners)
    same = (polygons.uv[found[differ]] == polygons.uv[polygons.uv_corners[differ]]).all(1)
    none = np.minimum(found, polygons.uv_corners)[differ] < 0
    return rows if (same & ~none).all() else None


def triangulate(points: Floats, polygons: Polygons) -> NDArray[np.int64]:
    """Cut every polygon into triangles, keeping its winding and adding no points.

    Quads are cut along the shorter diagonal that lies inside, larger polygons as a fan or, where that would leave the
    polygon, ear by ear.

    Parameters
    ----------
    points : (n, 3) float64
    polygons : Polygons

    Returns
    -------
    triangle_corners : (m, 3) int64
        Rows of `polygons.corners`; a polygon of s corners gives s - 2 triangles, in the polygons' order.

    Examples
    --------
    >>> square = np.array([[0.0, 0, 0], [4, 0, 0], [4, 3, 0], [0, 3, 0]])
    >>> triangulate(square, Polygons(np.array([4], np.int32), np.array([0, 1, 2, 3], np.int32)))
    array([[0, 1, 2],
           [0, 2, 3]])
    """
    if polygons.all_triangles:
        return np.arange(len(polygons.corners)).reshape(-1, 3)
    sizes = polygons.sizes.astype(np.int64)
    first_corner = np.cumsum(sizes) - sizes
    first_triangle = np.cumsum(sizes - 2) - (sizes - 2)
    triangles = np.empty((int((sizes - 2).sum()), 3), np.int64)
    for size in np.unique(sizes):
        which = np.flatnonzero(sizes == size)
        loops = first_corner[which, None] + np.arange(size)
        with np.errstate(invalid="ignore", over="ignore"):  # points that are not finite are the mesh room's business
            cut = _cut_loops(points[polygons.corners[loops]])
        rows = first_triangle[which, None] + np.arange(size - 2)
        triangles[rows] = loops[np.arange(len(which))[:, None, None], cut]
    return triangles


def _cut_loops(xyz: Floats) -> NDArray[np.int64]:
    """Triangles (p, s - 2, 3) of p polygons of s corners each, as corner numbers 0 to s - 1; xyz (p, s, 3)."""
    count, size, _ = xyz.shape
    fan = np.stack([np.zeros(size - 2, np.int64), np.arange(1, size - 1), np.arange(2, size)], axis=1)
    cut = np.repeat(fan[None], count, axis=0)
    if size == 3:
        return cut
    fits = _turns_one_way(xyz, fan)
    if size == 4:
        other = np.array([[1, 2, 3], [1, 3, 0]])
        shorter = _distance2(xyz[:, 1], xyz[:, 3]) < _distance2(xyz[:, 0], xyz[:, 2])
        other_fits = _turns_one_way(xyz, other)
        cut[other_fits & (shorter | ~fits)] = other
        return cut
    for p in np.flatnonzero(~fits):
        cut[p] = _clip_ears(xyz[p])
    return cut


def _turns_one_way(xyz: Floats, triangles: NDArray[np.int64]) -> Bools:
    """(p,) whether all these triangles of each polygon face the way that the polygon does."""
    a, b, c = (xyz[:, triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    facing = np.einsum("ptk,pk->pt", normals, _newell(xyz))
    return (facing > 0).all(1)


def _newell(xyz: Floats) -> Floats:
    """Newell's normals (p, 3) of p polygons: the sum of the cross products of the corners that follow one another."""
    arms = xyz - xyz[:, :1]
    return np.cross(arms, np.roll(arms, -1, axis=1)).sum(1)


def _distance2(a: Floats, b: Floats) -> Floats:
    return ((a - b) ** 2).sum(1)


def _clip_ears(xyz: Floats) -> NDArray[np.int64]:
    """Triangles (s - 2, 3) of one polygon (s, 3), which may be concave, seen along its Newell normal."""
    xy = _seen_along(_newell(xyz[None])[0], xyz)
    left = list(range(len(xyz)))
    triangles = []
    while len(left) > 3:
        ears = (k for k in range(len(left)) if _is_ear(xy, left, k))
        k = next(ears, 0)  # a polygon that crosses itself has none at last: cut it anyhow, keeping the count
        triangles.append([left[k - 1], left[k], left[(k + 1) % len(left)]])
        del left[k]
    return np.array([*triangles, left])


def _seen_along(normal: Floats, xyz: Floats) -> Floats:
    """The polygon (s, 2) as seen against its normal, by leaving out the axis that the normal follows most."""
    axis = int(np.argmax(np.abs(normal)))
    xy = xyz[:, [(axis + 1) % 3, (axis + 2) % 3]]
    return xy if normal[axis] >= 0 else xy[:, ::-1]


def _is_ear(xy: Floats, left: list[int], k: int) -> bool:
    """Whether the corner k of those left is convex and no other corner lies in its triangle."""
    three = [left[k - 1], left[k], left[(k + 1) % len(left)]]
    a, b, c = xy[three]
    others = xy[[i for i in left if i not in three]]
    inside = (_turn(a, b, others) >= 0) & (_turn(b, c, others) >= 0) & (_turn(c, a, others) >= 0)
    return bool(_turn(a, b, c) > 0) and not inside.any()


def _turn(a: Floats, b: Floats, c: Floats) -> Floats:
    """Twice the area of the triangles a, b, c[...]; greater than 0 where they are counter-clockwise."""
    return np.asarray((b[0] - a[0]) * (c[..., 1] - a[1]) - (b[1] - a[1]) * (c[..., 0] - a[0]))
