"""From the points that were flattened back to all points of the file, in the file's order."""

from __future__ import annotations

import numpy as np

from planish.mesh.repair import Cleaned
from planish.types import Floats


def to_file_order(cleaned: Cleaned, file_points: Floats, values: Floats) -> Floats:
    """Give every point of the file its values: its place on the page, or whatever else was found for it.

    Points that belong to no face of the cleaned sheet get the values of the sheet's point nearest to them in space;
    points that are not finite get 0.

    Parameters
    ----------
    cleaned : Cleaned
    file_points : (n, 3) float64 [mm]
        As they came, before cleaning.
    values : (k, d) float64
        Of the points of `cleaned.scan.mesh`.

    Returns
    -------
    (n, d) float64
    """
    if len(cleaned.place) == len(values) and (cleaned.place == np.arange(len(values))).all():
        return values
    place = cleaned.place.copy()
    lost = np.flatnonzero((place < 0) & np.isfinite(file_points).all(axis=1))
    if len(lost):
        from scipy.spatial import cKDTree

        place[lost] = cKDTree(cleaned.scan.mesh.points).query(file_points[lost])[1]
    return np.asarray(np.where(place[:, None] >= 0, values[place], 0.0))


def from_file_order(cleaned: Cleaned, values: Floats) -> Floats:
    """Values of the file's points, (n,) or (n, k), for the points of the cleaned mesh."""
    kept = cleaned.place >= 0
    out = np.zeros((len(cleaned.scan.mesh.points), *values.shape[1:]))
    out[cleaned.place[kept]] = values[kept]
    return out
