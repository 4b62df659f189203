"""The sheet apart from its surroundings: the table around it is left out where it is plainly one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from planish.document.rim import at_places, share_around, with_margin
from planish.document.sheet_outline import find_sheet
from planish.geometry import project
from planish.geometry.axes import principal_axes
from planish.geometry.resection import resect
from planish.mesh import area_vectors
from planish.types import Bools, Diagnostic, Floats, Mesh, Scan

MIN_AREA = 0.05
"""Part of the scanned area that must be surroundings for them to be left out."""

MIN_AROUND = 0.6
"""Part of all directions from the middle of the paper in which surroundings must follow it closely. A sheet alone that
is dark on one side, as beside a spine, has a quarter to a half of them; a sheet on a table all, or three quarters where
it reaches the border of the scan."""

FLATNESS = 0.01
"""Distance from their common plane, as part of their extent, within which surroundings are a table: 4 mm over 400 mm,
more than the noise of a depth camera."""

MIN_FLAT = 0.8
"""Part of the surroundings that must lie in that plane; the rest may be hands, weights, a second sheet."""

MAX_SHEET_FLAT = 0.9
"""If more of the sheet lies in the plane of the table, shape does not tell them apart, and a dark frame printed on a
flat sheet would look the same: then nothing is left out unasked."""


def leave_out_surroundings(scan: Scan) -> tuple[Scan, list[Diagnostic]]:
    """Reduce a scan to the faces of its sheet, if the sheet plainly lies on a table.

    The photo tells paper from ground (`find_sheet`); the ground must lie all around the sheet, and in one plane from
    which the sheet rises. Anything less plain is kept: a sheet alone never loses a point.

    Parameters
    ----------
    scan : Scan

    Returns
    -------
    scan : Scan
        With the same points; only faces are left out.
    warnings : list of Diagnostic
    """
    places = _places(scan)
    if scan.photo is None or places is None:
        return scan, []
    mask = find_sheet(scan.photo, whole=True)
    if mask is None:
        return scan, []
    near = with_margin(mask)
    scale = near.shape[1] / mask.shape[1]
    faces = scan.mesh.faces
    outside = np.asarray(~at_places(near, places, scale)[faces].any(axis=1))
    area = np.linalg.norm(area_vectors(scan.mesh.points, faces), axis=1)
    share = float(area[outside].sum() / max(area.sum(), np.finfo(float).tiny))
    if share < MIN_AREA or share_around(near, places[faces[outside][:, 0]], scale) < MIN_AROUND:
        return scan, []
    inside = np.asarray(at_places(mask, places)[faces].all(axis=1))
    flat_ground, flat_sheet = _flat_shares(scan.mesh, outside, inside)
    if flat_ground < MIN_FLAT or not inside.any():
        return scan, []
    if flat_sheet > MAX_SHEET_FLAT:
        sentence = (
            f"{100 * share:.0f} % of the scan may be ground around the sheet, in the same plane; all of it was kept"
        )
        return scan, [Diagnostic("surroundings-doubtful", sentence, "cut the mesh to the sheet if that is so")]
    photo_xy = scan.photo_xy
    kept = replace(
        scan,
        mesh=Mesh(scan.mesh.points, faces[inside]),
        photo_xy=photo_xy[inside] if photo_xy is not None and photo_xy.ndim == 3 else photo_xy,
        texture_of_face=None if scan.texture_of_face is None else scan.texture_of_face[inside],
    )
    cut = float(area[~inside].sum() / area.sum())
    sentence = f"the sheet lies on a table, and {100 * cut:.0f} % of the scan around it were left out"
    return kept, [Diagnostic("surroundings-left-out", sentence, "set {sheet=all} to keep them")]


def _places(scan: Scan) -> Floats | None:
    """(n, 2) places of all points on the photo; None where it is no single view of them, as in a texture atlas."""
    points, photo_xy = scan.mesh.points, scan.photo_xy
    if scan.camera is not None and photo_xy is None:
        return project(scan.camera, points)
    if photo_xy is None:
        return None
    if photo_xy.ndim == 3:
        corner, places = scan.mesh.faces.ravel(), photo_xy.reshape(-1, 2)
        photo_xy = np.full((len(points), 2), np.nan)
        photo_xy[corner] = places
        if np.nanmax(np.abs(photo_xy[corner] - places), initial=0.0) > 1.0:  # a pixel
            return None
    known = np.isfinite(photo_xy).all(axis=1) & np.isfinite(points).all(axis=1)
    if scan.camera is None and (known.sum() < len(points) // 2 or resect(points[known], photo_xy[known]) is None):
        return None
    return photo_xy


def _flat_shares(mesh: Mesh, outside: Bools, inside: Bools) -> tuple[float, float]:
    """Parts of the surroundings and of the sheet that lie in the plane of the surroundings."""
    ground, sheet = (_some(mesh, faces) for faces in (outside, inside))
    if len(ground) < 3:
        return 0.0, 1.0
    tolerance = FLATNESS * float(np.linalg.norm(np.ptp(ground, axis=0)))
    used = ground
    for _ in range(10):  # reweighted to the nearer half: a hand on the table does not tilt the plane
        middle = used.mean(axis=0)
        normal = principal_axes(used)[0][2]
        away = np.abs((ground - middle) @ normal)
        used = ground[away <= max(np.median(away), tolerance / 2)]
    flat = [float((np.abs((points - middle) @ normal) <= tolerance).mean()) for points in (ground, sheet)]
    return flat[0], flat[1]


def _some(mesh: Mesh, faces: Bools, most: int = 5000) -> Floats:
    """At most so many corners of faces, evenly spread over the mesh."""
    rows = mesh.faces[faces][:, 0]
    points = mesh.points[rows[:: max(1, len(rows) // most)]]
    return points[np.isfinite(points).all(axis=1)]
