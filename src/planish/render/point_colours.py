"""Colours of points as a picture of the page, for scans without a photo."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import distance_transform_edt

from planish.geometry.guards import TINY
from planish.mesh import rasterize
from planish.types import Floats, Pixels, Scan

FINER = 2.0
"""Pixels of the picture to the spacing of the points: with 1 the colours between them are cut at each pixel, with 4
the picture takes four times the memory and looks the same."""
MOST_PIXELS = 16_000_000


def picture_of_colours(scan: Scan, page_xy: Floats, size_mm: tuple[float, float]) -> tuple[Pixels, float]:
    """Draw the colours of a scan's points on the flat page, linear inside of each face.

    Parameters
    ----------
    scan : Scan
        With colours.
    page_xy : (n, 2) float64 [mm]
    size_mm : (float, float)

    Returns
    -------
    picture : (rows, cols, 3) uint8 or uint16
        Where there is no face, the colour of the nearest.
    px_per_mm : float
        The page's corner (0, 0) lies at pixel (-0.5, -0.5).
    """
    assert scan.colours is not None
    area = max(size_mm[0] * size_mm[1], TINY)
    px_per_mm = min(FINER * (len(page_xy) / area) ** 0.5, (MOST_PIXELS / area) ** 0.5)
    shape_rc = max(8, int(np.ceil(size_mm[1] * px_per_mm))), max(8, int(np.ceil(size_mm[0] * px_per_mm)))
    faces = scan.mesh.faces
    face, weights = rasterize(page_xy * px_per_mm - 0.5, faces, shape_rc)
    seen = face >= 0
    first = 1 - weights.sum(axis=2)
    of_corner = (first, weights[..., 0], weights[..., 1])
    picture = np.zeros((*shape_rc, 3), np.float32)
    for k, weight in enumerate(of_corner):
        picture[seen] += weight[seen][:, None] * scan.colours[faces[face[seen], k]]
    if seen.any() and not seen.all():
        nearest = distance_transform_edt(~seen, return_distances=False, return_indices=True)
        picture = picture[tuple(nearest)]
    rounded = np.rint(picture)
    drawn: Pixels = rounded.astype(np.uint16) if scan.colours.dtype == np.uint16 else rounded.astype(np.uint8)
    return drawn, float(px_per_mm)
