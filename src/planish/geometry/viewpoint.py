"""The viewpoint of a range scanner, found from the places of its points on the photo."""

from __future__ import annotations

import numpy as np

from planish.geometry.resection import resect
from planish.types import Floats, Ints, Mesh

MAX_MISFIT_PX = 0.02
"""Misfit, in pixels of the scanner, up to which points lie on the rays of its pixels. Scans along the rays read 0.0002
with any noise, errors across the rays show at once: 0.05 mm at 0.4 mm a pixel read 0.12."""

SAMPLE = 20_000
"""Points, and edges, that are examined."""

MIN_REGULAR = 0.95
"""Part of the edges that must lead from a pixel to one beside it: borders and mended holes may do otherwise."""


def viewpoint(mesh: Mesh, photo_xy: Floats | None, edges: Ints) -> Floats | None:
    """(3,) centre of projection [mm] of the scanner's rays, or None where the points do not show one.

    A range image has one point for each pixel, so that its points lie on the photo in straight rows and columns, and
    one camera sees all of them exactly where they are, whatever the noise: errors are along the rays. A mesh that was
    put together from several views, or made anew by a program, has no such rows.

    Parameters
    ----------
    mesh : Mesh
    photo_xy : (n, 2) or (m, 3, 2) float64 [photo px], or None
    edges : (e, 2) int32
        Of the mesh.
    """
    if photo_xy is None or photo_xy.ndim != 2:
        return None
    edges = edges[:: len(edges) // SAMPLE + 1]
    step = np.abs(photo_xy[edges[:, 1]] - photo_xy[edges[:, 0]])
    pixel = float(np.median(step.max(axis=1)))
    if not pixel > 0:
        return None
    in_pixels = step / pixel
    if (np.abs(in_pixels - np.rint(in_pixels)).max(axis=1) < MAX_MISFIT_PX).mean() < MIN_REGULAR:
        return None
    every = len(photo_xy) // SAMPLE + 1
    points, photo_xy = mesh.points[::every], photo_xy[::every]
    camera = resect(points, photo_xy)
    if camera is None:
        return None
    seen = points @ camera[:, :3].T + camera[:, 3]
    misfit = seen[:, :2] / seen[:, 2:] - photo_xy
    if not np.sqrt((misfit**2).sum(axis=1).mean()) < MAX_MISFIT_PX * pixel:
        return None
    return np.asarray(-np.linalg.solve(camera[:, :3], camera[:, 3]))
