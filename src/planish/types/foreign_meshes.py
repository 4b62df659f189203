"""Meshes of other libraries as points and faces, known by their attributes so that none of them is imported."""

from __future__ import annotations

from typing import Any

import numpy as np

from planish.errors import InputError

_CORNERS = 3


def mesh_arrays(mesh: Any) -> tuple[Any, Any]:
    """Points and faces of a mesh object; unchecked, in the object's own unit.

    Parameters
    ----------
    mesh : object
        With `vertices` and `faces` (trimesh), `vertices` and `triangles` (Open3D), `vertex.positions` and
        `triangle.indices` (Open3D's tensor mesh), or `points` and `faces` (PyVista).

    Returns
    -------
    points, faces : array_like
        (n, 3) and (m, 3) for triangles.

    Raises
    ------
    InputError
        If it has none of these, or PyVista's faces are not triangles.
    """
    if hasattr(mesh, "vertices"):
        for name in ("faces", "triangles"):
            if hasattr(mesh, name):
                return np.asarray(mesh.vertices), np.asarray(getattr(mesh, name))
    if hasattr(mesh, "vertex") and hasattr(mesh, "triangle"):
        return mesh.vertex.positions.numpy(), mesh.triangle.indices.numpy()
    if hasattr(mesh, "points") and hasattr(mesh, "faces"):
        return np.asarray(mesh.points), _without_counts(np.asarray(mesh.faces))
    raise InputError(
        f"a {type(mesh).__name__} was given and no faces; a mesh needs both, or an object that has vertices and faces "
        "(trimesh), vertices and triangles (Open3D), or points and faces (PyVista)"
    )


def _without_counts(faces: np.ndarray) -> np.ndarray:
    """(m, 3) corners from VTK's flat list, in which each face is preceded by the number of its corners.

    Examples
    --------
    >>> _without_counts(np.array([3, 0, 1, 2, 3, 2, 1, 3])).tolist()
    [[0, 1, 2], [2, 1, 3]]
    """
    if faces.ndim != 1 or not faces.size:
        return faces
    rows = faces.reshape(-1, _CORNERS + 1) if faces.size % (_CORNERS + 1) == 0 else None
    if rows is None or (rows[:, 0] != _CORNERS).any():
        raise InputError("the mesh has faces that are no triangles; triangles are wanted", "call mesh.triangulate()")
    return rows[:, 1:]
