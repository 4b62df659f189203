"""The table on which the document lay: the paper's plane z = 0, found from the sheet itself."""

from __future__ import annotations

import numpy as np

from planish.geometry.guards import TINY, normalize
from planish.mesh.measures import area_vectors
from planish.types import Floats, Mesh

CELLS = 64
"""Lowest points are gathered on a grid of so many cells a side before the plane is sought: a thousandth of the time
for a plane that is lower by the height a sheet gains within a cell, which the last step takes away."""


def onto_support_plane(mesh: Mesh) -> tuple[Floats, Floats, Floats]:
    """Turn and shift a scan so that the sheet lies on the plane z = 0, printed side up.

    A sheet at rest touches the table around its centre of mass. The plane below all points that has the least mean
    distance to the sheet does just that (it is the facet of the lower convex hull below the centre of mass), and it
    is a small linear program:  least mean(n.p) - c  with  n.p_i >= c,  n = (a, b, 1) in a frame whose third axis
    is the mean normal of the printed side.

    Parameters
    ----------
    mesh : Mesh
        In any frame, faces counter-clockwise seen from the printed side.

    Returns
    -------
    points : (n, 3) float64 [mm]
        z >= 0, up.
    rotation : (3, 3) float64
    shift : (3,) float64
        points = mesh.points @ rotation.T + shift

    Examples
    --------
    A sheet that was scanned upside down, seen by a camera that looks along +z:

    >>> sheet = Mesh(np.array([[0.0, 0, 5], [0, 1, 5], [1, 0, 5]]), np.array([[0, 1, 2]]))
    >>> onto_support_plane(sheet)[0][:, 2].round(9) + 0.0
    array([0., 0., 0.])
    """
    frame = _frame(_mean_normal(mesh))
    points = mesh.points @ frame.T
    centre = points.mean(axis=0)
    tilt = _plane_below(_lowest(points - centre))
    rotation = _frame(tilt) @ frame
    turned = mesh.points @ rotation.T
    shift = np.array([*-turned.mean(axis=0)[:2], -turned[:, 2].min()])
    return turned + shift, rotation, shift


def _mean_normal(mesh: Mesh) -> Floats:
    """Mean direction of the printed side; of a sheet rolled up so far that it has none, the thinnest direction."""
    vectors = area_vectors(mesh.points, mesh.faces)
    total = vectors.sum(axis=0)
    if np.linalg.norm(total) > 0.02 * np.linalg.norm(vectors, axis=1).sum():
        return np.asarray(total / np.linalg.norm(total))
    thinnest = np.linalg.eigh(np.cov(mesh.points.T))[1][:, 0]
    return np.asarray(thinnest if thinnest @ total >= 0 else -thinnest)


def _frame(up: Floats) -> Floats:
    """The smallest rotation that brings `up` to +z (about x where it points straight down)."""
    x, y, z = up
    if z < -1 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    k = 1 / (1 + z)
    return np.array([[1 - k * x * x, -k * x * y, -x], [-k * x * y, 1 - k * y * y, -y], [x, y, z]])


def _lowest(points: Floats) -> Floats:
    """The lowest point in every cell of a grid over the sheet."""
    low = points[:, :2].min(axis=0)
    size = np.maximum(np.ptp(points[:, :2], axis=0), TINY)
    cell = np.minimum((points[:, :2] - low) / size * CELLS, CELLS - 1).astype(np.int64) @ [1, CELLS]
    order = np.lexsort((points[:, 2], cell))
    return points[order[np.r_[True, np.diff(cell[order]) > 0]]]


def _plane_below(points: Floats) -> Floats:
    """Upward unit normal of the plane below all points that is highest at the origin, their centre."""
    from scipy.optimize import linprog

    size = np.abs(points).max() or 1.0
    p = points / size
    # z_i >= a x_i + b y_i + c; the height at the origin is c. Slopes are held below 45 degrees.
    found = linprog([0, 0, -1], np.c_[p[:, :2], np.ones(len(p))], p[:, 2], bounds=[(-1, 1), (-1, 1), (None, None)])
    if found.x is None:
        return np.array([0.0, 0.0, 1.0])
    normal = np.array([-found.x[0], -found.x[1], 1.0])
    return normalize(normal)
