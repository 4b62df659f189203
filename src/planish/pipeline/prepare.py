"""First stage: everything about a scan that later stages share, found once."""

from __future__ import annotations

from dataclasses import replace

from planish.document.surroundings import leave_out_surroundings
from planish.geometry.viewpoint import viewpoint
from planish.mesh import repair
from planish.settings import SheetRegion
from planish.surface import smooth_normals
from planish.types import PreparedScan, Scan


def prepare(scan: Scan, sheet: SheetRegion = "all", *, close_slits: bool = True) -> PreparedScan:
    """Repair a scan and find what all later stages need of it.

    Parameters
    ----------
    scan : Scan
    sheet : {"auto", "all"}
        Whether a table around the sheet is left out where it is plainly one.
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
    alone, warnings = leave_out_surroundings(scan) if sheet == "auto" else (scan, [])
    repaired = repair(alone, close_slits=close_slits)
    kept = repaired.scan
    eye = kept.viewpoint
    if eye is None:
        eye = viewpoint(kept.mesh, kept.photo_xy, repaired.topology.edges)
    return replace(
        repaired,
        source=scan,
        warnings=(*warnings, *repaired.warnings),
        viewpoint=eye,
        find_normals=smooth_normals,
    )
