"""The one image of a mesh that is used: found beside the file, chosen among several."""

from __future__ import annotations

from pathlib import Path, PureWindowsPath

import numpy as np

from planish.io.polygons import Polygons
from planish.types import Bools, Diagnostic, Ints


def find_beside(path: Path, name: str, inside: Path | None = None) -> Path | None:
    """Find a file that a mesh file names: where it says, else of that name beside the mesh (as after a move).

    Only within the folder `inside`, where one is given: a mesh from a stranger may name any file of this machine.
    """
    for candidate in (path.parent / name, path.parent / PureWindowsPath(name).name):
        try:
            if candidate.is_file() and (inside is None or candidate.resolve().is_relative_to(inside.resolve())):
                return candidate
        except (OSError, ValueError):
            continue
    return None


def use_one_image(
    path: Path, polygons: Polygons, names: list[str], image_of_face: Ints
) -> tuple[Polygons, int | None, list[Diagnostic]]:
    """Choose the image that most faces use; faces on another lose their texture coordinates.

    Parameters
    ----------
    path : Path
        Of the mesh, for the warning.
    polygons : Polygons
    names : list of str
        Of the images.
    image_of_face : (p,) int
        Number of the image of each polygon; -1 for none.

    Returns
    -------
    polygons : Polygons
    chosen : int or None
        Number of the image; None where there is none, or there are no texture coordinates.
    warnings : list of Diagnostic
    """
    if polygons.uv_corners is None or not names:
        return polygons, None, []
    counts = np.bincount(image_of_face[image_of_face >= 0], minlength=len(names))
    chosen = int(np.argmax(counts))
    if not counts.any():  # named, but not tied to any face: it is meant for all
        return polygons, chosen, []
    others = int(counts.sum() - counts[chosen])
    warnings = []
    if others:
        warnings.append(
            Diagnostic(
                "several-images",
                f"{path} has {len(names)} images; {names[chosen]} is used, and {others} faces on others stay blank",
            )
        )
    return _without_uv(polygons, image_of_face != chosen), chosen, warnings


def find_image(path: Path, name: str, inside: Path | None = None) -> tuple[Path | None, list[Diagnostic]]:
    """The image file that a mesh file names, and a warning where there is none."""
    found = find_beside(path, name, inside)
    if found is not None:
        return found, []
    return None, [Diagnostic("image-missing", f"{path} names the image {name}, which does not exist")]


def _without_uv(polygons: Polygons, blank: Bools) -> Polygons:
    """The same polygons, those that are marked (p,) without texture coordinates."""
    assert polygons.uv_corners is not None
    if not blank.any():
        return polygons
    uv_corners = np.where(np.repeat(blank, polygons.sizes), -1, polygons.uv_corners).astype(np.int32)
    return Polygons(polygons.sizes, polygons.corners, polygons.uv, uv_corners)
