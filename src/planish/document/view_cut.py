"""A scan cut along an outline that was drawn on a view of it from any side."""

from __future__ import annotations

import numpy as np

from planish.document.cut import left_out_share, with_faces
from planish.document.given_outline import doubtful_outline
from planish.document.rim import at_places
from planish.document.top_view import TopView, picture
from planish.errors import InputError
from planish.mesh import rasterize
from planish.types import Bools, Diagnostic, Floats, Mesh, Scan


def cut_in_view(scan: Scan, mask: Bools, view: Floats) -> tuple[Scan, list[Diagnostic]]:
    """Reduce a scan to the faces that lie within a mask on a view of it, however deep.

    Faces across the outline go as a whole: from most sides, nothing tells where the sheet goes on behind its rim.

    Parameters
    ----------
    scan : Scan
    mask : (rows, cols) bool
    view : (2, 4) float64
        Column and row on the mask are this times (x, y, z, 1).

    Raises
    ------
    InputError
        Where no face lies within the mask.

    Examples
    --------
    >>> mesh = Mesh([[0, 0, 0], [9, 0, 0], [0, 9, 0], [90, 0, 5], [99, 0, 5], [90, 9, 5]], [[0, 1, 2], [3, 4, 5]])
    >>> from_the_side = np.array([[1.0, 0, 0, 0], [0, 0, -1, 20]])
    >>> mask = np.zeros((40, 120), bool)
    >>> mask[18:, :] = True  # z below 2
    >>> cut_in_view(Scan(mesh), mask, from_the_side)[0].mesh.faces
    array([[0, 1, 2]], dtype=int32)
    """
    places = scan.mesh.points @ view[:, :3].T + view[:, 3]
    kept = np.asarray(at_places(mask, places)[scan.mesh.faces].all(axis=1))
    if not kept.any():
        raise InputError("no part of the scan lies within the outline that was drawn on it")
    towards = -np.cross(view[0, :3], view[1, :3])  # column, row and the way into the picture are right-handed
    nearness = scan.mesh.points @ towards
    face, weights = rasterize(places, scan.mesh.faces, (mask.shape[0], mask.shape[1]), nearness=nearness)
    seen = picture(scan, TopView(places, face, weights, view[0, :3], view[1, :3]))
    doubts = doubtful_outline(mask, seen, (scan.mesh, places), nearness)
    return with_faces(scan, kept), [*doubts, outside_of_mask(scan.mesh, np.asarray(~kept))]


def outside_of_mask(mesh: Mesh, left_out: Bools) -> Diagnostic:
    """What part of a scan a mask left out."""
    share = left_out_share(mesh, left_out)
    sentence = f"{100 * share:.0f} % of the scan lie outside of the mask of the sheet and were left out"
    return Diagnostic("surroundings-left-out", sentence)
