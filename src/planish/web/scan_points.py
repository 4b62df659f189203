"""Some points of a scan with their colours, for a browser to show and turn. Imports nothing of the web framework."""

from __future__ import annotations

from base64 import b64encode
from typing import Any

import numpy as np

from planish.document.top_view import picture, top_view
from planish.errors import InputError
from planish.geometry.guards import normalize
from planish.mesh import area_vectors
from planish.types import Scan

MOST = 60_000
"""Points: a phone turns so many without stutter, and they fill a view of 400 pixels."""

STEPS = 30_000
"""In which positions are counted, either way from the middle: they fit two bytes."""


def scan_points(scan: Scan) -> dict[str, Any]:
    """What is seen of a scan from straight above, as points: evenly spread, in the colours of its images.

    Returns
    -------
    dict
        `centre` (x, y, z) and `step` [mm]; `points`, int16 steps from the centre, x y z of each; `colours`, uint8,
        red green blue of each; both base64 of little-endian bytes. `right` and `down`, directions in which that view
        has them.

    Raises
    ------
    InputError
        If the scan has no faces to see.
    """
    view = top_view(scan)
    row, col = np.nonzero(view.face >= 0)
    if not len(row):
        raise InputError("the scan has no faces")
    each = int(np.ceil(np.sqrt(len(row) / MOST)))
    some = (row % each == 0) & (col % each == 0) if len(row) > MOST else np.ones(len(row), bool)
    row, col = row[some], col[some]
    face, w = view.face[row, col], view.weights[row, col].astype(np.float64)
    corners = scan.mesh.points[scan.mesh.faces[face]]
    points = np.einsum("pk,pkd->pd", np.column_stack([1 - w.sum(axis=1), w]), corners)
    colours = picture(scan, view)
    if colours is None:
        facing = np.abs(
            normalize(area_vectors(scan.mesh.points, scan.mesh.faces)[face]) @ np.cross(view.right, view.down)
        )
        seen = np.repeat(np.rint(255 * facing)[:, None], 3, axis=1)
    else:
        seen = colours[row, col]
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    step = float(np.abs(points - centre).max()) / STEPS or 1.0
    return {
        "centre": centre.tolist(),
        "step": step,
        "points": b64encode(np.rint((points - centre) / step).astype("<i2").tobytes()).decode(),
        "colours": b64encode(seen.astype(np.uint8).tobytes()).decode(),
        "right": view.right.tolist(),
        "down": view.down.tolist(),
    }
