"""Height and length of the noise of a mesh, without smoothing it."""

from __future__ import annotations

from typing import NamedTuple

from planish.geometry.distances import distances
from planish.mesh import Topology
from planish.parallel import thread_pool
from planish.surface.noise import length_of
from planish.surface.noise_plan import BUCKLED
from planish.surface.noise_scale import noise_scale
from planish.surface.smooth_surface import measure_scan
from planish.types import Mesh


class ScanNoise(NamedTuple):
    """Noise of a scan, told from patches of growing radius.

    Attributes
    ----------
    height_mm : float
        Standard deviation across the surface; 0 where none stands out of the sheet's own shape.
    length_mm : float
        Distance over which two points' noise is alike (their correlation is a half).
    spacing_mm : float
        Median length of the edges.
    """

    height_mm: float
    length_mm: float
    spacing_mm: float


def scan_noise(mesh: Mesh, topology: Topology) -> ScanNoise:
    """Measure the noise of a mesh.

    Examples
    --------
    >>> from planish.gallery import sheet, sheet_mesh
    >>> from planish.mesh import topology
    >>> mesh, _ = sheet_mesh(sheet("wave"), 20_000, noise_mm=0.2)
    >>> noise = scan_noise(mesh, topology(mesh.faces, len(mesh.points)))
    >>> round(noise.height_mm, 1)
    0.2
    """
    with thread_pool() as parallel_for:
        raw = distances(mesh.points, topology.edges)
        scan = measure_scan(mesh.points, mesh.faces, topology, raw, parallel_for)
        least = BUCKLED * scan.spacing
        scale = noise_scale(scan.points, scan.rows, scan.ring, scan.spacing, least, parallel_for)
    return ScanNoise(scale.height, length_of(scale.alike, scan.spacing), scan.spacing)
