"""Surface reconstruction from noisy oriented points: a signed distance on a grid, meshed by marching cubes.

The distance is that of implicit moving least squares (Kolluri 2005): the weighted mean of distances to the tangent
planes of nearby points. It averages noise without shrinking curved paper.
"""

from __future__ import annotations

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from planish.errors import InputError, MissingExtraError, install_command
from planish.geometry.guards import normalize
from planish.mesh import without_small_components
from planish.types import Bools, Floats, Ints, Mesh

CELL = 1.5
"""Side of a grid cell, in point spacings."""

KERNEL_WIDTH = 1.2
"""Width of the Gaussian weights, in cells: about eight points contribute."""

NEAREST = 24
"""Nearest points per node."""

MAX_NODES = 1e8
"""Most nodes of the grid's bounding box; larger sheets get larger cells."""

SNAP = 0.15
"""Nodes closer to the surface than this share of a cell are snapped to it, which avoids slivers; vertices are projected
back to the surface afterwards."""

MERGE_TOLERANCE = 1e-3
"""Vertices closer than this, in cells, are merged."""

AROUND = 16
"""Nearest points in the test whether a vertex lies beyond the border of the points."""

BORDER_GAP_DEG = 215.0
"""A vertex is beyond the border if an angle of this size around it has no points; on a straight border it is 180."""

ONE_SIDED = 0.3
"""Only vertices are tested whose neighbours are this one-sided, relative to their distance."""

BLOCK = 50_000


def reconstruct_surface(points: Floats, normals: Floats, spacing_mm: float) -> Mesh:
    """Reconstruct the surface through points.

    Parameters
    ----------
    points : (n, 3) float64 [mm]
    normals : (n, 3) float64
        Consistently oriented.
    spacing_mm : float
        Side of the square per point.

    Returns
    -------
    Mesh
        Faces are counter-clockwise seen from the side of the normals. It ends where the points end, closes gaps of up
        to about three spacings, and has no small components.

    Raises
    ------
    InputError
        If the points form no surface.
    MissingExtraError
        If scikit-image is not installed.
    """
    marching_cubes = import_marching_cubes()
    tree = cKDTree(points)
    cell = max(
        CELL * spacing_mm, float((np.prod(np.ptp(points, axis=0) + 6 * CELL * spacing_mm) / MAX_NODES) ** (1 / 3))
    )
    low = points.min(axis=0) - 3 * cell
    at = np.floor((points - low) / cell).astype(np.int64)
    near = np.zeros(at.max(axis=0) + 5, bool)
    near[tuple(at.T)] = True
    near = ndimage.binary_dilation(near, np.ones((4, 4, 4), bool), origin=-1)  # the corners of its cell, and one more
    nodes = np.argwhere(near)
    distance_mm = _signed_distance(low + nodes * cell, points, normals, tree, KERNEL_WIDTH * cell)[0]
    distance = np.ones(near.shape, np.float32)
    distance[near] = np.where(np.abs(distance_mm) < SNAP * cell, 0, distance_mm)
    no_surface = InputError(f"the {len(points):,} points make no surface; are they those of a sheet, and dense enough?")
    try:
        vertices, faces, _, _ = marching_cubes(distance, 0.0, mask=_whole_cells(near))
    except (ValueError, RuntimeError):  # no crossing anywhere
        raise no_surface from None
    vertices, faces = _merge_vertices(vertices, faces)
    vertices = low + cell * vertices.astype(np.float64)
    distance_mm, normal = _signed_distance(vertices, points, normals, tree, KERNEL_WIDTH * cell)
    vertices -= distance_mm[:, None] * normal
    faces = np.ascontiguousarray(faces[_on_sheet(vertices, points, normals, tree)[faces].all(axis=1)])
    if not len(faces):
        raise no_surface
    used, faces = without_small_components(faces, len(vertices))
    return Mesh.owned(vertices[used], faces)


def import_marching_cubes():  # type: ignore[no-untyped-def]
    """Import scikit-image's marching cubes.

    Raises
    ------
    MissingExtraError
        If it is not installed.
    """
    try:
        from skimage.measure import marching_cubes
    except ImportError:
        raise MissingExtraError(f"meshing points needs scikit-image: {install_command('points')}") from None
    return marching_cubes


def _merge_vertices(vertices: Floats, faces: Ints) -> tuple[Floats, Ints]:
    """Merge vertices snapped to one node, and drop degenerate faces."""
    _, first, which = np.unique(
        np.rint(vertices / MERGE_TOLERANCE).astype(np.int64), axis=0, return_index=True, return_inverse=True
    )
    faces = which.reshape(-1)[faces].astype(np.int32)
    distinct = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    return vertices[first], faces[distinct]


def _signed_distance(at: Floats, points: Floats, normals: Floats, tree: cKDTree, width: float) -> tuple[Floats, Floats]:
    """f(x) = sum_i w_i n_i.(x - p_i) / sum_i w_i with w_i = exp(-(|x - p_i| / width)^2), and the mean of the n_i."""
    found, normal = np.empty(len(at)), np.empty((len(at), 3))
    for first in range(0, len(at), BLOCK):
        x = at[first : first + BLOCK]
        away, near = tree.query(x, min(NEAREST, len(points)), workers=2)
        away, near = away.reshape(len(x), -1), near.reshape(len(x), -1)
        weight = np.exp(-((away**2 - away[:, :1] ** 2) / width**2))  # of the nearest 1, so that none is lost far off
        distance_mm = ((x[:, None] - points[near]) * normals[near]).sum(axis=2)
        found[first : first + BLOCK] = (weight * distance_mm).sum(axis=1) / weight.sum(axis=1)
        normal[first : first + BLOCK] = (weight[..., None] * normals[near]).sum(axis=1)
    return found, normalize(normal)


def _whole_cells(near: Bools) -> Bools:
    """Cells all of whose eight corners are near, each at its last corner, where marching cubes looks."""
    whole = near.copy()
    for axis in range(3):
        whole &= np.roll(whole, 1, axis=axis)
    return whole


def _on_sheet(vertices: Floats, points: Floats, normals: Floats, tree: cKDTree) -> Bools:
    """Which corners of the mesh have points on all sides, or on one side of a line as at a border."""
    on = np.ones(len(vertices), bool)
    for first in range(0, len(vertices), BLOCK):
        away, near = tree.query(vertices[first : first + BLOCK], min(AROUND, len(points)), workers=2)
        around = points[near] - vertices[first : first + BLOCK, None]
        lopsided = np.linalg.norm(around.mean(axis=1), axis=1) > ONE_SIDED * away.mean(axis=1)
        gap = _widest_gap(around[lopsided], normals[near[lopsided, 0]])
        on[first + np.flatnonzero(lopsided)] = gap <= np.radians(BORDER_GAP_DEG)
    return on


def _widest_gap(around: Floats, normal: Floats) -> Floats:
    """Widest angle [rad] around the origin, in the planes of the normals (k, 3), without points (k, m, 3)."""
    across = normalize(np.cross(normal, np.eye(3)[np.abs(normal).argmin(axis=1)]))
    along = np.cross(normal, across)
    angle = np.arctan2((around * along[:, None]).sum(axis=2), (around * across[:, None]).sum(axis=2))
    angle.sort(axis=1)
    return np.asarray(np.diff(angle, axis=1, append=angle[:, :1] + 2 * np.pi).max(axis=1, initial=0))
