"""Tell the noise of an acquired scan, and what to do where it is more than a scan should have."""

from __future__ import annotations

from dataclasses import replace

from planish.acquire.grid_mesh import AcquiredScan
from planish.mesh import topology
from planish.surface.scan_noise import scan_noise
from planish.types import Diagnostic

NOISY = 0.25
"""Noise, in edges, from which a scan is said to be noisy: normals do not tell its creases any more, and moving points
onto quadrics takes off folds (`surface.noise_plan.STRONG`). With half of it fair depth maps (0.2 mm at 1 mm a pixel)
are called noisy, with twice of it one frame of a depth camera is not."""


def with_noise(acquired: AcquiredScan, remedy: str) -> AcquiredScan:
    """The scan with the height and length of its noise, and a warning with a remedy if it is too much.

    Where none stands out of the sheet's own shape, the height stays as the device itself tells it, without a length.
    """
    mesh = acquired.scan.mesh
    noise = scan_noise(mesh, topology(mesh.faces, len(mesh.points)))
    if not noise.height_mm:
        return acquired
    warnings = acquired.warnings
    if noise.height_mm > NOISY * noise.spacing_mm:
        sentence = (
            f"the scan is noisy: {noise.height_mm:.2g} mm (standard deviation), alike over {noise.length_mm:.2g} mm, "
            f"with points {noise.spacing_mm:.2g} mm apart; folds come out rounded and sizes less exact"
        )
        warnings = (*warnings, Diagnostic("scan-noisy", sentence, remedy))
    return replace(acquired, noise_mm=noise.height_mm, noise_length_mm=noise.length_mm, warnings=warnings)
