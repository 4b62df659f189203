"""What was left out of a scan, as a picture: dark beside the sheet that was kept."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from planish.document.top_view import picture, top_view
from planish.geometry import project
from planish.geometry.guards import normalize
from planish.mesh import area_vectors, rasterize
from planish.types import Bools, Floats, Mesh, Pixels, PreparedScan, Scan

CODES = {"surroundings-left-out", "hand-left-out"}
"""Of the warnings that tell of what was left out."""

DARK = 4
"""What was left out is shown so many times as dark."""


def cut_picture(prepared: PreparedScan) -> Pixels | None:
    """Picture of a scan in which all but the sheet is dark.

    Returns
    -------
    (rows, cols, 3) uint8 or uint16, or None
        The photo where it is a view of the scan, else the scan from straight above: its textures, its colours, or its
        shape alone. None where nothing was left out.
    """
    if not any(w.code in CODES for w in prepared.warnings):
        return None
    source, kept = prepared.source, prepared.scan
    places = _corners_on_photo(kept)
    if source.photo is not None and places is not None:
        return _darkened(source.photo, places)
    faces = source.mesh.faces
    both = np.concatenate([source.mesh.points, kept.mesh.points])  # points that were moved to the outline as well
    corners, colours = source.photo_xy, source.colours
    if corners is not None and corners.ndim == 2:
        corners = corners[faces]
    if colours is not None:
        colours = np.concatenate([colours, np.zeros((len(kept.mesh.points), 3), colours.dtype)])
    scan = replace(source, mesh=Mesh(both, faces), photo_xy=corners, colours=colours)
    view = top_view(scan)
    pixels = picture(scan, view)
    if pixels is None:
        facing = np.append(np.abs(normalize(area_vectors(both, faces))[:, 2]), 0.0)  # the last for "no face"
        pixels = np.repeat(np.rint(255 * np.nan_to_num(facing))[view.face][..., None], 3, axis=2).astype(np.uint8)
    return _darkened(pixels, view.places[len(source.mesh.points) :][kept.mesh.faces])


def _corners_on_photo(scan: Scan) -> Floats | None:
    """(m, 3, 2) places of the corners of all faces on the photo; None where it is an atlas or their places unknown."""
    if scan.photo_xy is None:
        return None if scan.camera is None else project(scan.camera, scan.mesh.points)[scan.mesh.faces]
    if scan.photo_xy.ndim == 2:
        return scan.photo_xy[scan.mesh.faces]
    return scan.photo_xy


def _darkened(pixels: Pixels, corners: Floats) -> Pixels:
    faces = np.arange(corners.size // 2, dtype=np.int32).reshape(-1, 3)
    face, _ = rasterize(corners.reshape(-1, 2), faces, (pixels.shape[0], pixels.shape[1]))
    kept: Bools = face >= 0
    return np.where(kept[..., None], pixels, pixels // DARK)
