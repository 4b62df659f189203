"""First stage: everything about a scan that later stages share, found once."""

from __future__ import annotations

from dataclasses import replace

from planish.geometry.viewpoint import viewpoint
from planish.mesh import repair
from planish.surface import smooth_normals
from planish.types import PreparedScan, Scan


def prepare(scan: Scan) -> PreparedScan:
    """Repair a scan and find what all later stages need of it.

    Parameters
    ----------
    scan : Scan

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
    repaired = repair(scan)
    sheet = repaired.scan
    eye = viewpoint(sheet.mesh, sheet.photo_xy, repaired.topology.edges)
    return replace(repaired, viewpoint=eye, find_normals=smooth_normals)
