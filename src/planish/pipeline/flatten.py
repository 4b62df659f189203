"""Second stage: the sheet laid flat; also on its own, from plain arrays."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from planish.flattening import flatten as solve
from planish.mesh import to_file_order
from planish.pipeline.orient import to_upright_frame
from planish.pipeline.prepare import prepare
from planish.settings import FlattenSettings
from planish.types import Flattening, Floats, Ints, Mesh, PreparedScan, Scan


def flatten(
    mesh: Mesh | Floats,
    faces: Ints | None = None,
    settings: FlattenSettings | None = None,
    progress: Callable[[float], None] | None = None,
    *,
    viewpoint: Floats | None = None,
) -> Flattening:
    """Flatten a mesh: the geometry alone, from plain arrays.

    Parameters
    ----------
    mesh : Mesh or (n, 3) float64 [mm]
        Or the points alone, with `faces` beside them.
    faces : (m, 3) int, optional
        Counter-clockwise seen from the printed side.
    settings : FlattenSettings, optional
    progress : callable, optional
        Called with the share of the work that is done.
    viewpoint : (3,) float [mm], optional
        Where the scanner's rays come from: its errors are taken out along them. Range images that keep their order of
        points, row by row, show it by themselves.

    Returns
    -------
    Flattening
        `page_xy` (n, 2) has every point's place in the order of the input: x right, y down, in mm.

    Raises
    ------
    InputError
        Where the mesh is not a sheet that can be flattened.

    Examples
    --------
    A strip bent over a quarter of a cylinder of radius 100:

    >>> angle = np.linspace(0, np.pi / 2, 50)
    >>> points = np.array([[100 * np.sin(a), y, 100 * np.cos(a)] for a in angle for y in (0.0, 10.0)])
    >>> left = np.arange(0, 98, 2)
    >>> faces = np.r_[np.c_[left, left + 2, left + 1], np.c_[left + 1, left + 2, left + 3]]
    >>> [round(float(mm), 1) for mm in flatten(points, faces).size_mm]
    [10.0, 157.1]
    """
    sheet = mesh if isinstance(mesh, Mesh) else Mesh(mesh, np.zeros((0, 3), np.int32) if faces is None else faces)
    prepared = prepare(Scan(sheet, viewpoint=None if viewpoint is None else np.asarray(viewpoint, np.float64)))
    flat = to_upright_frame(prepared, flatten_prepared(prepared, settings, progress), "auto")
    return replace(in_file_order(prepared, flat), warnings=(*prepared.warnings, *flat.warnings))


def flatten_prepared(
    prepared: PreparedScan,
    settings: FlattenSettings | None = None,
    progress: Callable[[float], None] | None = None,
) -> Flattening:
    """Flatten the repaired mesh of a scan; the page is not oriented yet."""
    return solve(prepared.scan.mesh, prepared.topology, settings, progress, eye=prepared.viewpoint)


def in_file_order(prepared: PreparedScan, flat: Flattening) -> Flattening:
    """The same flattening with all values per point in the order of the source's points."""
    values = to_file_order(prepared, np.c_[flat.page_xy, flat.error_mm, flat.local_strain])
    normals = None if flat.normals is None else to_file_order(prepared, flat.normals)
    return replace(flat, page_xy=values[:, :2], error_mm=values[:, 2], local_strain=values[:, 3], normals=normals)
