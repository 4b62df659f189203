"""A range image cut along the outline of its sheet, between its pixels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from planish.document.cut import cut_to_outline
from planish.mesh import without_small_components
from planish.types import Bools, Floats, Mesh, Scan


def beside(on_sheet: Bools) -> Bools:
    """Pixels (rows, cols) of the sheet and those next to it, which the faces that cross its outline need."""
    return np.asarray(ndimage.binary_dilation(on_sheet, np.ones((3, 3), bool), iterations=2))


def trim_to_sheet(mesh: Mesh, photo_xy: Floats, sheet: Bools) -> tuple[Mesh, Floats, NDArray[np.int64]]:
    """End a mesh at the outline of the sheet, and not at the last pixel before it.

    Parameters
    ----------
    mesh : Mesh
        Of the sheet and a few pixels around it.
    photo_xy : (n, 2) float64 [px]
        Of its points.
    sheet : (h, w) bool
        On the photo.

    Returns
    -------
    mesh : Mesh
        Points beside the outline are moved to it, on the continuation of the sheet.
    photo_xy : (k, 2) float64 [px]
    used : (k,) int64
        Its points among those of the mesh that was given.
    """
    cut, _ = cut_to_outline(Scan(mesh, photo_xy=photo_xy), sheet, photo_xy)
    assert cut.photo_xy is not None
    used, faces = without_small_components(cut.mesh.faces, len(mesh.points))
    return Mesh.owned(cut.mesh.points[used], faces), cut.photo_xy[used], used
