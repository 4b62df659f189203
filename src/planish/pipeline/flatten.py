"""Second stage: the sheet laid flat; also on its own, from plain arrays."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from planish.choices import chosen
from planish.errors import UsageError
from planish.flattening import flatten as solve
from planish.mesh import faces_to_file_order, to_file_order
from planish.pipeline.orient import to_upright_frame
from planish.pipeline.prepare import prepare
from planish.pipeline.stages import Progress, StageTimer, no_progress
from planish.settings import FlattenSettings, SheetRegion, Units, mm_per_unit
from planish.types import Diagnostic, Flattening, Mesh, PreparedScan, Scan, check_place

STRETCHED = 1e-3
"""Rms strain from which on a sheet with closed slits is tried with open ones: paper stretches by a thousandth. A cone
from which a wedge of 2 degrees was cut is strained more than that when closed."""
OPENED = 0.7
"""Slits stay open if that leaves no more than this part of the strain. A skirt keeps 0.43 of it with its dart open;
noisy letters, books and crumpled sheets with a slit whose sides meet keep 0.87 or more."""


def flatten(
    points: Any,
    faces: Any = None,
    settings: FlattenSettings | None = None,
    progress: Progress | None = None,
    *,
    units: Units = "mm",
    viewpoint: Any = None,
    **choices: Any,
) -> Flattening:
    """Flatten a mesh: the geometry alone, from plain arrays.

    Parameters
    ----------
    points : (n, 3) array_like
        Or the whole mesh: a `Mesh`, or a mesh of trimesh, Open3D or PyVista (see `Mesh`).
    faces : (m, 3) array_like of int, optional
        Rows of `points`, counter-clockwise seen from the printed side.
    settings : FlattenSettings, optional
    progress : callable, optional
        Called with (stage, share done), as `planish.restore` does.
    units : {"mm", "cm", "m", "in"} or a length
        The unit of `points`, or how long a step of 1 is, such as "7.91um"; `planish.scale_bar` makes it from a known
        length. The result is in mm in any case. A `Mesh` is in mm.
    viewpoint : (3,) array_like, optional
        In the same unit. Where the scanner's rays come from: its errors are taken out along them. Range images that
        keep their order of points, row by row, show it by themselves.
    **choices
        Settings by name, in place of `settings` or on top of them: `method="verlet"`, `lengths="straight"`,
        `verlet={"rounds": 10}`. How many points are solved is a choice of `FlattenSettings` alone, since `points` is
        the mesh here.

    Returns
    -------
    Flattening
        `page_xy` (n, 2) has every point's place in the order of the input: x right, y down, in mm.

    Raises
    ------
    InputError
        Where the arrays are no mesh (see `Mesh`), or the mesh is not a sheet that can be flattened.
    UsageError
        For a unit or a setting that there is not, a wrong value, or another unit than mm for a `Mesh`.

    Examples
    --------
    A strip bent over a quarter of a cylinder of radius 100:

    >>> angle = np.linspace(0, np.pi / 2, 50)
    >>> points = np.array([[100 * np.sin(a), y, 100 * np.cos(a)] for a in angle for y in (0.0, 10.0)])
    >>> left = np.arange(0, 98, 2)
    >>> faces = np.r_[np.c_[left, left + 2, left + 1], np.c_[left + 1, left + 2, left + 3]]
    >>> [round(float(mm), 1) for mm in flatten(points, faces).size_mm]
    [10.0, 157.1]
    >>> flatten(points, faces, lengths="unfolded").lengths
    'unfolded'
    """
    settings = chosen(FlattenSettings, settings, choices)
    step = _step_mm(units)
    mesh = _in_mm(points, faces, step)
    eye = None if viewpoint is None else step * check_place(viewpoint, "the viewpoint")
    stage = StageTimer(progress or no_progress)
    with stage("clean"):
        prepared = prepare(Scan.owned(mesh, viewpoint=eye))
    with stage("flatten") as share:
        prepared, flat = flatten_prepared(prepared, settings, share)
    with stage("turn"):
        flat = to_upright_frame(prepared, flat, "auto")
    return replace(in_file_order(prepared, flat), warnings=(*prepared.warnings, *flat.warnings))


def _step_mm(units: Units) -> float:
    """How many mm a step of 1 is; arrays have no unit that could be found by itself."""
    try:
        return mm_per_unit(units)
    except UsageError:
        raise UsageError(f"units is {units!r}; mm, cm, m, in or a length such as 7.91um is wanted") from None


def _in_mm(points: Any, faces: Any, step_mm: float) -> Mesh:
    """The mesh that a user gave, in mm."""
    if isinstance(points, Mesh):
        if faces is not None:
            raise UsageError("a whole mesh was given, and faces beside it; give points and faces, or the mesh alone")
        if step_mm != 1:
            raise UsageError("units is not mm, but a Mesh is in mm already; give points and faces in their own unit")
        return points
    mesh = Mesh(points, faces)
    return mesh if step_mm == 1 else Mesh.owned(mesh.points * step_mm, mesh.faces)


def flatten_prepared(
    prepared: PreparedScan,
    settings: FlattenSettings | None = None,
    progress: Callable[[float], None] | None = None,
    sheet: SheetRegion = "all",
) -> tuple[PreparedScan, Flattening]:
    """Flatten the repaired mesh of a scan; the page is not oriented yet.

    A dart or a tear whose sides meet was closed by the repair like any seam. Where the sheet cannot lie flat so, it is
    prepared again with its slits open, and stays open if that lets it lie much flatter.

    Parameters
    ----------
    prepared : PreparedScan
    settings : FlattenSettings, optional
    progress : callable, optional
    sheet : {"auto", "all"}
        As it was prepared.

    Returns
    -------
    prepared : PreparedScan
        As it was flattened.
    flat : Flattening
    """
    flat = _solve(prepared, settings, progress)
    if not prepared.slits_closed or flat.strain[0] <= STRETCHED:
        return prepared, flat
    opened = prepare(prepared.source, sheet, close_slits=False)
    other = _solve(opened, settings, progress)
    if other.strain[0] > OPENED * flat.strain[0]:
        return prepared, flat
    sentence = "the sheet is cut within itself and lies flat only with its cuts open, so they were left open"
    return replace(opened, warnings=(*opened.warnings, Diagnostic("slits-open", sentence))), other


def _solve(
    prepared: PreparedScan, settings: FlattenSettings | None, progress: Callable[[float], None] | None
) -> Flattening:
    return solve(prepared.scan.mesh, prepared.topology, settings, progress, eye=prepared.viewpoint)


def in_file_order(prepared: PreparedScan, flat: Flattening) -> Flattening:
    """The same flattening with all values per point and per face in the order of the source's."""
    values = to_file_order(prepared, np.c_[flat.page_xy, flat.error_mm, flat.local_strain])
    normals = None if flat.normals is None else to_file_order(prepared, flat.normals)
    of_faces = None if flat.face_strain is None else faces_to_file_order(prepared, flat.face_strain)
    return replace(
        flat,
        page_xy=values[:, :2],
        error_mm=values[:, 2],
        local_strain=values[:, 3],
        normals=normals,
        face_strain=of_faces,
    )
