"""A scan made fit for flattening, with all that is found of it once and used by every later stage."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from planish.types.arrays import Floats, Ints, freeze
from planish.types.diagnostic import Diagnostic
from planish.types.sheet import Mesh, Scan


@dataclass(frozen=True, eq=False)
class Topology:
    """The edges of a mesh and the faces beside them.

    Attributes
    ----------
    edges : (e, 2) int32
        The two points of every edge, the smaller first; rows in ascending order.
    edge_faces : (e, 2) int32
        The faces at the edge; -1 in the second place where the sheet ends. Of a non-manifold edge the first two.
    edge_uses : (e,) int32
        How many faces use the edge: 1 at the border, 2 inside, more where the mesh is not a surface.
    face_edges : (m, 3) int32
        Edge k of a face joins its corners k and k + 1.
    """

    edges: Ints
    edge_faces: Ints
    edge_uses: Ints
    face_edges: Ints


@dataclass(frozen=True, eq=False)
class PreparedScan:
    """A repaired scan, its topology, and the way back to the points of the file.

    Made once by `planish.pipeline.prepare`; flattening, drawing, illumination, report and view all take it, so that
    nothing is repaired or measured twice.

    Attributes
    ----------
    source : Scan
        As it came.
    scan : Scan
        Every edge has one or two faces, all faces of a piece have the same winding (counter-clockwise seen from the
        printed side), every point is finite and used by a face.
    topology : Topology
        Of `scan.mesh`.
    mesh_rows : (n,) int32
        For every point of the source its row in `scan.mesh.points`; -1 where it was left out.
    pieces, holes : int
    warnings : tuple of Diagnostic
        What was repaired, a sentence each.
    slits_closed : bool
        Whether points in the same place were welded that close a slit within a piece.
    viewpoint : (3,) float64 [mm] or None
        Where the scanner's rays come from, if its errors lie along them.
    find_normals : callable or None
        (mesh, topology) -> (k, 3) float32; what `normals` calls when it is first asked for.
    """

    source: Scan
    scan: Scan
    topology: Topology
    mesh_rows: Ints
    pieces: int
    holes: int
    warnings: tuple[Diagnostic, ...] = ()
    slits_closed: bool = False
    viewpoint: Floats | None = None
    find_normals: Callable[[Mesh, Topology], NDArray[np.float32]] | None = None

    def __post_init__(self) -> None:
        freeze(self)

    @cached_property
    def normals(self) -> NDArray[np.float32]:
        """(k, 3) normals of the surface without the scanner's noise, at the points of `scan.mesh`."""
        assert self.find_normals is not None
        return self.find_normals(self.scan.mesh, self.topology)

    def __repr__(self) -> str:
        return (
            f"PreparedScan({len(self.scan.mesh.points):,} of {len(self.source.mesh.points):,} points, "
            f"{len(self.scan.mesh.faces):,} faces, pieces={self.pieces}, holes={self.holes})"
        )
