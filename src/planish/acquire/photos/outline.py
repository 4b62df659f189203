"""The outline of the sheet on its surface: where the photos, taken together, see paper end."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import ndimage

from planish.acquire.photos.paper import Paper
from planish.geometry import depths, project
from planish.types import Bools, Camera, Floats, Ints

SNAP = 0.1
"""Nodes closer to the outline than this share of an edge count as on it, which avoids slivers."""


def distance_inside(points: Floats, seen: Bools, cameras: Sequence[Camera], papers: Sequence[Paper | None]) -> Floats:
    """How far inside of the outline points lie [mm]: the median over the photos that see them.

    Parameters
    ----------
    points : (n, 3) float64 [mm]
    seen : (n, photos) bool
    cameras : sequence of Camera
    papers : sequence of Paper or None
        None where no outline was found.

    Returns
    -------
    (n,) float64 [mm]
        Negative outside; NaN where no photo with an outline sees the point. True near the outline only.
    """
    inside = np.full((len(points), len(cameras)), np.nan)
    for k, (camera, paper) in enumerate(zip(cameras, papers, strict=True)):
        if paper is None:
            continue
        rows, cols = paper.inside_px.shape
        xy = project(camera, points)
        here = seen[:, k] & (xy > 0).all(axis=1) & (xy < [cols - 1, rows - 1]).all(axis=1)
        px = ndimage.map_coordinates(paper.inside_px.astype(np.float32), xy[here].T[::-1], order=1)
        inside[here, k] = px * depths(camera, points[here]) / camera.matrix[0, 0]
    some = np.isfinite(inside).any(axis=1)
    out = np.full(len(points), np.nan)
    out[some] = np.nanmedian(inside[some], axis=1)
    return out


def clip_mesh(points: Floats, faces: Ints, inside: Floats) -> tuple[Floats, Ints, Ints, Floats]:
    """Cut a mesh along the line where a value given at its points is 0, and keep the side where it is positive.

    Parameters
    ----------
    points : (n, 3) float64
    faces : (m, 3) int32
    inside : (n,) float64

    Returns
    -------
    points : (k, 3) float64
    faces : (l, 3) int32
    ends : (k, 2) int32, share : (k,) float64
        Every point lies `share` of the way from the first to the second of these old points.

    Examples
    --------
    >>> square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    >>> two = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    >>> points, faces, _, _ = clip_mesh(square, two, np.array([1.0, -1, -1, 1]))
    >>> sorted(points[:, 0].round(6).tolist()), len(faces)
    ([0.0, 0.0, 0.5, 0.5, 0.5], 3)
    """
    value = np.array(inside)
    edges = np.unique(np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    for a, b in (edges.T, edges.T[::-1]):
        with np.errstate(divide="ignore", invalid="ignore"):
            share = value[a] / (value[a] - value[b])
        value[a[(value[a] * value[b] < 0) & (share < SNAP)]] = 0.0
    crossed = edges[value[edges].min(axis=1) * value[edges].max(axis=1) < 0]
    share = value[crossed[:, 0]] / (value[crossed[:, 0]] - value[crossed[:, 1]])
    number = {(int(a), int(b)): len(points) + k for k, (a, b) in enumerate(crossed)}
    kept = faces[(value[faces] >= 0).all(axis=1) & (value[faces] > 0).any(axis=1)]
    cut = faces[(value[faces].min(axis=1) < 0) & (value[faces].max(axis=1) > 0)]
    new = [triangle for face in cut for triangle in _parts(face, value, number)]
    ends = np.concatenate([np.stack([np.arange(len(points))] * 2, axis=1), crossed])
    share = np.concatenate([np.zeros(len(points)), share])
    all_faces = np.concatenate([kept, np.array(new, np.int32).reshape(-1, 3)])
    used, corners = np.unique(all_faces, return_inverse=True)
    ends, share = ends[used].astype(np.int32), share[used]
    cut_points = points[ends[:, 0]] + share[:, None] * (points[ends[:, 1]] - points[ends[:, 0]])
    return cut_points, corners.reshape(-1, 3).astype(np.int32), ends, share


def _parts(face: Ints, value: Floats, number: dict[tuple[int, int], int]) -> list[tuple[int, int, int]]:
    """The triangles of a cut face's positive side."""
    corners: list[int] = []
    for k in range(3):
        a, b = int(face[k]), int(face[(k + 1) % 3])
        if value[a] >= 0:
            corners.append(a)
        if value[a] * value[b] < 0:
            corners.append(number[min(a, b), max(a, b)])
    return [(corners[0], corners[k], corners[k + 1]) for k in range(1, len(corners) - 1)]
