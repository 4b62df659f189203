"""First stage: everything about a scan that later stages share, found once."""

from __future__ import annotations

from dataclasses import replace

from planish.document.surroundings import cut_to_mask, leave_out_surroundings
from planish.geometry.viewpoint import viewpoint
from planish.mesh import repair
from planish.settings import SheetRegion
from planish.surface import smooth_normals
from planish.types import Diagnostic, PreparedScan, Scan

CRUMBS = {"points-loose", "small-pieces-removed"}
"""Warnings of what a cut leaves behind, which tell nothing beside the cut's own."""


def prepare(scan: Scan, sheet: SheetRegion = "all", *, close_slits: bool = True) -> PreparedScan:
    """Repair a scan and find what all later stages need of it.

    Parameters
    ----------
    scan : Scan
    sheet : {"auto", "all"}
        Whether a table around the sheet is left out where it is plainly one; `scan.sheet`, a mask, has precedence.
    close_slits : bool
        See `planish.mesh.repair`.

    Returns
    -------
    PreparedScan
        The repaired mesh, its topology, the way back to the file's order and the scanner's viewpoint; the normals of
        the surface without noise are computed when they are first asked for.

    Raises
    ------
    InputError
        Where the scan is not a sheet that can be flattened; see `planish.mesh.repair`.
    """
    alone, warnings = _sheet_alone(scan, sheet)
    repaired = repair(alone, close_slits=close_slits)
    kept = repaired.scan
    eye = kept.viewpoint
    if eye is None:
        eye = viewpoint(kept.mesh, kept.photo_xy, repaired.topology.edges)
    return replace(
        repaired,
        source=scan,
        warnings=(*warnings, *(w for w in repaired.warnings if not warnings or w.code not in CRUMBS)),
        viewpoint=eye,
        find_normals=smooth_normals,
    )


def _sheet_alone(scan: Scan, sheet: SheetRegion) -> tuple[Scan, list[Diagnostic]]:
    if scan.sheet is not None:
        return cut_to_mask(scan)
    return leave_out_surroundings(scan) if sheet == "auto" else (scan, [])
