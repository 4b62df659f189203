"""From the points that were flattened back to all points of the file, in the file's order."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from planish.types import Floats, PreparedScan

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
