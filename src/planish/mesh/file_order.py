"""From the points that were flattened back to all points of the file, in the file's order."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from planish.types import Floats, Ints, PreparedScan

Real = TypeVar("Real", np.float32, np.float64)


def to_file_order(prepared: PreparedScan, values: NDArray[Real]) -> NDArray[Real]:
    """Give every point of the source its values: its place on the page, or whatever else was found for it.

    Points that belong to no face of the repaired sheet get the values of the sheet's point nearest to them in space;
    points that are not finite get 0.

    Parameters
    ----------
    prepared : PreparedScan
    values : (k, d) float
        Of the points of `prepared.scan.mesh`.

    Returns
    -------
    (n, d) float
        Of the dtype of `values`.
    """
    rows = prepared.mesh_rows
    if len(rows) == len(values) and (rows == np.arange(len(values))).all():
        return values
    rows, points = rows.copy(), prepared.source.mesh.points
    lost = np.flatnonzero((rows < 0) & np.isfinite(points).all(axis=1))
    if len(lost):
        from scipy.spatial import cKDTree

        rows[lost] = cKDTree(prepared.scan.mesh.points).query(points[lost])[1]
    out = values[rows]
    out[rows < 0] = 0
    return out


def from_file_order(prepared: PreparedScan, values: Floats) -> Floats:
    """Values of the source's points, (n,) or (n, k), for the points of the repaired mesh."""
    kept = prepared.mesh_rows >= 0
    out = np.zeros((len(prepared.scan.mesh.points), *values.shape[1:]))
    out[prepared.mesh_rows[kept]] = values[kept]
    return out


def faces_to_file_order(prepared: PreparedScan, values: Floats) -> Floats:
    """Give every face of the source its value; NaN for those that the repair left out.

    Parameters
    ----------
    prepared : PreparedScan
    values : (k,) float64
        Of the faces of `prepared.scan.mesh`.

    Returns
    -------
    (m,) float64
    """
    rows, faces = prepared.mesh_rows, prepared.scan.mesh.faces
    wanted = rows[prepared.source.mesh.faces]
    if np.array_equal(wanted, faces):
        return values
    sides, tips = _sorted_corners(faces, len(rows))
    order = np.lexsort((tips, sides))
    sides, tips = sides[order], tips[order]
    wanted_sides, wanted_tips = _sorted_corners(wanted, len(rows))
    first = np.searchsorted(sides, wanted_sides)
    out = np.full(len(wanted), np.nan)
    for at in (first, first + 1):  # no edge of the repaired mesh has more than two faces
        at = np.minimum(at, len(faces) - 1)
        same = (sides[at] == wanted_sides) & (tips[at] == wanted_tips) & (wanted.min(axis=1) >= 0)
        out[same] = values[order[at[same]]]
    return out


def _sorted_corners(faces: Ints, points: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The two lower corners of every face as one number, and the highest; windings do not count."""
    low, middle, high = np.sort(faces, axis=1).astype(np.int64).T
    return low * points + middle, high
