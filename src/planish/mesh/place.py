"""From the points that were flattened back to all points of the file, in the file's order."""

from __future__ import annotations

import numpy as np

from planish.mesh.clean import Cleaned
from planish.types import Floats


def to_file_order(cleaned: Cleaned, file_points: Floats, page_xy: Floats) -> Floats:
    """Give every point of the file a place on the page.

    Points that belong to no face of the cleaned sheet get the place of the sheet's point nearest to them in space;
    points that are not finite get the page's origin.

    Parameters
    ----------
    cleaned : Cleaned
    file_points : (n, 3) float64 [mm]
        As they came, before cleaning.
    page_xy : (k, 2) float64 [mm]
        Of the points of `cleaned.scan.mesh`.

    Returns
    -------
    (n, 2) float64 [mm]
    """
    if len(cleaned.place) == len(page_xy) and (cleaned.place == np.arange(len(page_xy))).all():
        return page_xy
    place = cleaned.place.copy()
    lost = np.flatnonzero((place < 0) & np.isfinite(file_points).all(axis=1))
    if len(lost):
        from scipy.spatial import cKDTree

        place[lost] = cKDTree(cleaned.scan.mesh.points).query(file_points[lost])[1]
    return np.asarray(np.where(place[:, None] >= 0, page_xy[place], 0.0))
