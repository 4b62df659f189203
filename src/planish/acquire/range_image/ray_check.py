"""Are depths measured along the camera's axis or along each pixel's ray? The table around a sheet tells."""

from __future__ import annotations

import numpy as np

from planish.geometry.axes import principal_axes
from planish.geometry.guards import TINY_MM
from planish.geometry.triangulation import rays
from planish.types import Bools, Camera, Diagnostic, Floats

MIN_GROUND = 2000
"""Least number of ground pixels; fewer span too little of the view to be bent."""

SAMPLE = 40_000

FLATTER = 3.0
"""The ground must be so many times as flat the other way. Halved, a table cloth could decide; doubled, noise of a
sixth of the bend would hide it."""

MIN_BEND_MM = 1.0
"""Least bend of the ground, rms, that is told: depths of 0.5 m taken the wrong way bend a table of half a
metre by 5 (half of it: warped tables; twice: sheets seen from afar go untold)."""


def depth_direction_warnings(depth: Floats, camera: Camera, ground: Bools, along: str) -> list[Diagnostic]:
    """A warning where the ground is flat only if depths are measured the other way.

    Parameters
    ----------
    depth : (rows, cols) float64 [mm]
        Along the camera's axis, as `along` says that the file has them; NaN where there is none.
    camera : Camera
    ground : (rows, cols) bool
        Pixels that do not show the sheet.
    along : {"z", "ray"}
        How the numbers of the file were read.
    """
    row, col = np.nonzero(ground & np.isfinite(depth))
    if len(row) < MIN_GROUND:
        return []
    step = 1 + len(row) // SAMPLE
    row, col = row[::step], col[::step]
    directions, _ = rays(camera, np.stack([col, row], axis=1).astype(np.float64))
    cosine = directions @ camera.rotation[2]
    read = depth[row, col]
    other = read * cosine if along == "z" else read / cosine  # as depths along the axis
    bends = [_bend(directions * (z / cosine)[:, None]) for z in (read, other)]
    if bends[0] < MIN_BEND_MM or bends[0] < FLATTER * max(bends[1], TINY_MM):
        return []
    way = "along the line of sight of each pixel" if along == "z" else "along the axis of the camera"
    sentence = (
        f"the ground around the sheet is bent by {bends[0]:.1f} mm, and flat to {bends[1]:.1f} mm if depths are "
        f"measured {way}"
    )
    return [Diagnostic("depth-direction", sentence, f"set {{depth_along={'ray' if along == 'z' else 'z'}}}")]


def _bend(points: Floats) -> float:
    """Rms distance from their common plane of the nearer two thirds of points: hands and edges do not count."""
    used = points
    for _ in range(8):
        middle = used.mean(axis=0)
        normal = principal_axes(used)[0][2]
        away = np.abs((points - middle) @ normal)
        used = points[away <= np.quantile(away, 2 / 3)]
    return float(np.sqrt((((used - middle) @ normal) ** 2).mean()))
