"""Rest lengths without the scanner's noise, true across creases."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numba import njit

from planish.mesh import Topology, neighbours
from planish.sticks.bends import CURVATURE, Bends, find_bends
from planish.sticks.creases import carry, find_sides
from planish.sticks.crew import Crew, crew
from planish.sticks.noise import angle_defects, around, ring_noise, surface_noise
from planish.sticks.normals import AREA, Ring, Rows, diffuse, surface_rows, typical_step
from planish.sticks.quadric import refit
from planish.sticks.rulings import average_along
from planish.sticks.strain import distances
from planish.sticks.vectors import cross, dot, minus, plus, row, square, unit
from planish.types import Floats, Ints, Mesh

NOISY = 0.003
GAUSS = (1 - 1 / math.sqrt(3)) / 2
SHARP = (2 * math.sin(math.radians(20.0) / 2)) ** 2


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
    points = points - points.mean(axis=0)
    ring = Ring(*neighbours(topology.edges, n))
    raw = distances(points, topology.edges)
    spacing = float(np.median(raw))
    rows = surface_rows(points, faces)
    off = ring_noise(points, rows, ring, run)
    sigma = float(np.nanmedian(off))
    raw_defects = angle_defects(raw, faces, topology, n, run)
    buckling = math.sqrt(float(np.quantile(raw_defects, 0.25)))
    wanted = 0
    if buckling > NOISY:
        wanted = int(np.clip(90 * np.quantile(around(points, off, spacing), 0.8) * 1.2 / 1.4826 / spacing, 8, 24))
    for rounds in (wanted, 0) if wanted else (0,):
        normals, bends, off = _surface(points, rows, ring, topology.edges, rounds, sigma, spacing, run)
        rest = np.empty(len(raw))
        run(_lengths, len(raw), points, normals, bends, topology.edges, rest)
        defects = angle_defects(rest, faces, topology, n, run)
        if defects.mean() <= 1.2 * raw_defects.mean() + (5e-4 if rounds else 5e-5):
            if rounds:
                noise = 1.2533 * around(points, off, spacing)
                return SmoothLengths(rest, normals, noise, float(np.median(noise)), Smoothing.SMOOTHED)
            sigma = min(sigma, buckling * spacing)
            return SmoothLengths(rest, normals, np.full(n, sigma), sigma, Smoothing.CLEAN)
    sigma = min(sigma, buckling * spacing)
    return SmoothLengths(raw, normals, np.full(n, sigma), sigma, Smoothing.REFUSED)


def _surface(points, rows, ring, edges, rounds, sigma, spacing, run, trounds=4, levels=True):
    blur = 2 * sigma**2 + 1e-4 * spacing**2
    flat = np.zeros((len(rows), 4), np.float32)
    for k in range(rounds):
        if k == int(0.4 * rounds):
            rows = _on_sides(rows, find_sides(points, rows, flat, ring, 1, blur, run))
        rows = diffuse(rows, ring, (12 if k == 0 else 8) ** 2 * typical_step(rows, edges), run)
    if rounds == 0:
        rows = _on_sides(rows, find_sides(points, rows, flat, ring, 1, blur, run))
    bends = find_bends(rows, ring, edges, trounds, 8.0, run)
    if rounds:
        rows = average_along(rows, bends, ring, run)
    source = find_sides(points, rows, bends, ring, 2, blur, run)
    step = points[edges[:, 1]] - points[edges[:, 0]]
    off = surface_noise(points, rows, bends, source, rounds * 3 / 7 * np.mean(np.einsum("ij,ij->i", step, step)), run)
    normals, bends = carry(points, rows, bends, source, run), bends[source]
    step = normals[edges[:, 0]] - normals[edges[:, 1]]
    sharp = np.unique(edges[np.einsum("ij,ij->i", step, step) > SHARP])
    return refit(points, normals, ring, sharp, sigma, run), bends, off


def _on_sides(rows: Rows, source: Ints) -> Rows:
    out = rows[source]
    out[:, AREA] = rows[:, AREA]
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def _lengths(first, last, points, normals, bends, edges, out):  # type: ignore[no-untyped-def]
    for e in range(first, last):
        i, j = edges[e, 0], edges[e, 1]
        d = minus(row(points, j), row(points, i))
        a, b = row(bends, i), row(bends, j)
        n = unit(plus(row(normals, i), GAUSS * bends[i, CURVATURE] * dot(a, d), a))
        m = unit(plus(row(normals, j), -GAUSS * bends[j, CURVATURE] * dot(b, d), b))
        middle, crease = plus(n, 1.0, m), cross(n, m)
        mm, cc = square(middle), square(crease)
        if mm < 1e-3:
            out[e] = math.sqrt(square(d))
            continue
        along = dot(d, crease) ** 2 / cc if cc > 1e-14 else 0.0
        across = max(0.0, square(d) - dot(d, middle) ** 2 / mm - along)
        out[e] = math.sqrt(along + across * 4.0 / mm)
