"""Rest lengths without the scanner's noise, true across creases."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numba import njit

from planish.mesh import Topology, neighbours
from planish.sticks import noise, normals, quadric
from planish.sticks.crew import Crew, crew
from planish.sticks.strain import distances
from planish.types import Floats, Ints, Mesh


class Smoothing(Enum):
    """What became of the lengths; the value is the sentence for the user."""

    SMOOTHED = "Noise was found and taken out of the lengths."
    CLEAN = "No noise was found; only lengths across creases were put right."
    REFUSED = "Smoothing would have bent the sheet more than its noise does, so the lengths were left as they are."


@dataclass(frozen=True, eq=False)
class SmoothLengths:
    """Lengths of a mesh's edges over the surface that was scanned, and what they were found from.

    Attributes
    ----------
    rest : (e,) float64 [mm]
        Of the topology's edges.
    normals : (n, 3) float32
        Unit normals of the surface; at a crease those of the side that the point lies on.
    noise_mm : (n,) float64
        Standard deviation of the scanner's noise around every point.
    typical_noise_mm : float
        Its median.
    smoothing : Smoothing
    """

    rest: Floats
    normals: Floats
    noise_mm: Floats
    typical_noise_mm: float
    smoothing: Smoothing


def smooth_lengths(points: Floats, faces: Ints, topology: Topology) -> SmoothLengths:
    with crew() as run:
        return _smooth_lengths(points, faces, topology, run)


def smooth_normals(mesh: Mesh, topology: Topology) -> Floats:
    return smooth_lengths(mesh.points, mesh.faces, topology).normals


def _smooth_lengths(points: Floats, faces: Ints, topology: Topology, run: Crew) -> SmoothLengths:
    n = len(points)
    ring = neighbours(topology.edges, n)
    raw = distances(points, topology.edges)
    inner = _inner(topology, n)
    rows = normals.normal_rows(points, faces)
    spacing = float(np.median(raw))
    off = np.abs(noise.residuals(points, rows, ring, run))
    sigma = 1.4826 / 1.36 * float(np.nanmedian(off))
    raw_defect = noise.angle_defect(raw, faces, topology.face_edges, inner)
    rounds = _rounds(sigma / spacing, np.sqrt(raw_defect / 3.4))
    for k in range(rounds):
        if k == int(0.4 * rounds):
            rows = normals.to_crease_sides(points, rows, ring, sigma, spacing, run)
        reach = (12 if k == 0 else 8) ** 2 * normals.typical_step(rows, topology.edges)
        rows = normals.diffuse(rows, ring, max(reach, 1e-8), run)
    if rounds == 0:
        rows = normals.to_crease_sides(points, rows, ring, sigma, spacing, run)
    rows = quadric.refine(points, rows, ring, _at_sharp_edges(rows, topology.edges), sigma, run)
    rest = np.empty(len(raw))
    run(_fold_rule, len(raw), points, rows, topology.edges, rest)
    defect = noise.angle_defect(rest, faces, topology.face_edges, inner)
    smoothing = Smoothing.SMOOTHED if rounds else Smoothing.CLEAN
    if defect > 2 * raw_defect + 5e-4:
        rest, smoothing = raw, Smoothing.REFUSED
    return SmoothLengths(rest, rows[:, :3], np.full(n, sigma), sigma, smoothing)


def _rounds(noise: float, buckling: float) -> int:
    level = min(noise, 1.3 * buckling)
    return 0 if level < 0.003 else min(40, max(16, int(np.ceil(90 * level - 0.3))))


def _inner(topology: Topology, count: int) -> Floats:
    inner = np.ones(count, bool)
    inner[topology.edges[topology.edge_uses != 2]] = False
    return inner


def _at_sharp_edges(rows: Floats, edges: Ints) -> Ints:
    step = rows[edges[:, 0], :3] - rows[edges[:, 1], :3]
    return np.unique(edges[np.einsum("ij,ij->i", step, step) > 4 * np.sin(np.radians(20)) ** 2])


@njit(cache=True, nogil=True, error_model="numpy")
def _fold_rule(first, last, points, rows, edges, out):  # type: ignore[no-untyped-def]
    for e in range(first, last):
        i, j = edges[e, 0], edges[e, 1]
        dx, dy, dz = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1], points[j, 2] - points[i, 2]
        ax, ay, az = np.float64(rows[i, 0]), np.float64(rows[i, 1]), np.float64(rows[i, 2])
        bx, by, bz = np.float64(rows[j, 0]), np.float64(rows[j, 1]), np.float64(rows[j, 2])
        mx, my, mz = ax + bx, ay + by, az + bz
        cx, cy, cz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        mm, cc, dd = mx * mx + my * my + mz * mz, cx * cx + cy * cy + cz * cz, dx * dx + dy * dy + dz * dz
        if mm < 1e-3:
            out[e] = np.sqrt(dd)
            continue
        along = (dx * cx + dy * cy + dz * cz) ** 2 / cc if cc > 1e-14 else 0.0
        across = max(0.0, dd - (dx * mx + dy * my + dz * mz) ** 2 / mm - along)
        half = np.arccos(min(1.0, np.sqrt(mm) / 2.0))
        arc, fold = 1.0 + half * half / 3.0, 1.0 / np.cos(half) ** 2
        t = min(1.0, max(0.0, (2.0 * half - np.radians(12.0)) / np.radians(16.0)))
        t = t * t * (3.0 - 2.0 * t)
        out[e] = np.sqrt(along + (arc + (fold - arc) * t) * across)
