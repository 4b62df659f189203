"""Rest lengths without the scanner's noise, true across creases."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planish.crew import Crew, crew
from planish.mesh import Topology, neighbours
from planish.sticks.bends import CURVATURE, Bends, find_bends
from planish.sticks.creases import carry, find_sides, to_sides
from planish.sticks.noise import FROM_MEAN, angle_defects, around, ring_noise, surface_noise, typical
from planish.sticks.normals import NOISE, Ring, Rows, diffuse, surface_rows, typical_step
from planish.sticks.quadric import points_at_folds, refit
from planish.sticks.rays import onto_surface
from planish.sticks.rulings import average_along
from planish.sticks.strain import distances
from planish.sticks.vectors import cross, dot, minus, plus, row, square, unit
from planish.types import Floats, Ints, Mesh

BUCKLED = 0.003
"""Noise, in spacings, from which on there is something to smooth. Clean scans read 0 to 0.002 (4,000 to 300,000
points, regular and random meshes); 0.03 mm of noise alike over 3 pixels reads 0.003 and makes the sheet 0.01 % too
large, white noise of this size 0.001 %."""

BENT, MOSTLY_NOISE = 3.4, 0.5
"""The buckling must also make up for enough of what normals of neighbours differ by: for the more, the more they
do. Its square over theirs is 0.9 to 2.8 for white noise, 0.2 to 0.4 if alike over one pixel, 0.09 to 0.2 over three;
up to 0.07 on clean random meshes, 0.09 to 0.16 on real ones with 2 to 3 degrees between points (handheld_sheet), which
smoothing harms. The limit is BENT times the difference in radians, at most MOSTLY_NOISE."""

ROUNDS_PER_NOISE, FEWEST, MOST = 60, 6, 24
"""Rounds of smoothing for noise of one spacing. Fewer than 8 leave 0.02 % of 0.07 mm that is alike over one pixel,
and more than 24 gain less than a hundredth of what the noise itself does at 0.2 mm."""

NOISIEST = 0.9
"""The rounds are right for all but this part of a sheet whose noise varies."""

LEAST_NOISE = 0.1
"""Of the variance of the typical noise: below, true bends are what normals differ by."""

FIRST_REACH, REACH = 12**2, 8**2
"""Normals that differ by more than so many typical steps (squared) are across a crease. With 3 to 5 the outliers of
the noise lock in (book, 0.2 mm: 0.3 % too large); the first round must take them in."""

ACROSS = 8.0
"""The same for the fit of bends."""

MIDWAY = 0.4
"""Sides of creases are chosen after this part of the rounds: noise is down by then, and creases are not yet blurred."""

BENDS_SMOOTHED = 4
"""Rounds; 8 are no better, 2 leave 10 % more error in the normals."""

GAUSS = (1 - 1 / math.sqrt(3)) / 2
"""Where on an edge its slope is taken: the two points of Gauss-Legendre quadrature, exact for polynomials to x^3."""

BEND, POLYGON = math.radians(20), math.radians(30)
"""An edge along which the sheet bends by more is no chord of an arc but the side of a polygon."""

WORSE, NOISY_SLACK, CLEAN_SLACK = 1.2, 1e-3, 5e-5
"""Lengths are refused if by them the sheet would buckle (mean angle defect [rad]) by more than so many times what it
does raw, and a little: NOISY_SLACK after smoothing, else CLEAN_SLACK. Right ones buckle half to a hundredth as much as
raw ones; those of a coarse mesh whose points sit on its folds 30,000 times as much (crumpled_developable)."""


class Smoothing(Enum):
    """What became of the lengths; the value is the sentence for the user."""

    SMOOTHED = "The scan is noisy; lengths are those of the smooth surface."
    CLEAN = "The scan is free of noise; only lengths across bends and creases were put right."
    REFUSED = "No smooth surface with creases explains the scan better, so lengths are as scanned."


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
        Standard deviation of the scanner's noise around every point, across the surface.
    typical_noise_mm : float
        Its median.
    smoothing : Smoothing
    """

    rest: Floats
    normals: NDArray[np.float32]
    noise_mm: Floats
    typical_noise_mm: float
    smoothing: Smoothing


class _Scan(NamedTuple):
    """What all attempts start from."""

    points: Floats
    middle: Floats
    edges: Ints
    ring: Ring
    rows: Rows
    spacing: float
    mean_square_edge: float
    ring_noise: Floats


class _Surface(NamedTuple):
    """Normals and bends at the points, and the points' distance from the surface."""

    normals: NDArray[np.float32]
    bends: Bends
    off: Floats


def smooth_lengths(points: Floats, faces: Ints, topology: Topology, *, eye: Floats | None = None) -> SmoothLengths:
    """Measure the edges of a scan over the surface that it is a noisy scan of.

    Noise makes every edge too long, by 2 % at 0.07 mm of noise and 0.5 mm between points, and edges across a crease
    are too short. What it takes to put both right are normals without noise and sharp at creases: an edge is then as
    long as its projection on the planes of its ends, unfolded. How much noise there is shows in the scan itself:
    paper does not buckle, so that angles sum up to a full turn around every point of a clean one.

    1. Normals are averaged with their neighbours', but not across creases [1]_, and the places they belong to with
       them. Points on a crease take the normal of the side they lie on.
    2. Paper bends in one direction only: normals are averaged further along the rulings, where they are all the same.
    3. Each is carried back from its place to its point along the bend, and at folds fitted anew to the points of its
       own side.

    Parameters
    ----------
    points : (n, 3) float64 [mm]
    faces : (m, 3) int32
    topology : Topology
        Of the same faces.
    eye : (3,) float64 [mm], optional
        Where the scanner's rays come from, if it is known that its errors lie along them. Then noisy points are
        also moved along their rays onto the surface: what is left of white noise is a half to a fifth.

    Returns
    -------
    SmoothLengths
        With raw lengths, and saying so, where the new ones would make the sheet buckle more than it does.

    References
    ----------
    .. [1] Zheng, Fu, Au and Tai, "Bilateral normal filtering for mesh denoising", IEEE TVCG 17 (2011), on points.

    Examples
    --------
    >>> from planish.gallery import sheet, sheet_mesh
    >>> from planish.mesh import topology
    >>> mesh, truth_xy = sheet_mesh(sheet("wave", steepness_deg=15.0), 60_000, noise_mm=0.07)
    >>> edges = (found := topology(mesh.faces, len(mesh.points))).edges
    >>> smooth = smooth_lengths(mesh.points, mesh.faces, found)
    >>> true, raw = distances(truth_xy, edges).sum(), distances(mesh.points, edges).sum()
    >>> f"{raw / true - 1:.2%} {smooth.rest.sum() / true - 1:.2%}"
    '0.37% 0.01%'
    """
    raw = distances(points, topology.edges)
    with crew() as run:
        scan = _look_at(points, faces, topology, raw, run)
        raw_defects = angle_defects(raw, faces, topology, len(points), run)
        buckling = math.sqrt(float(np.quantile(raw_defects, 0.25))) if len(raw_defects) else 0.0
        noisy = _is_noisy(buckling, typical_step(scan.rows, scan.edges))
        wanted = _look_for_noise(scan, run) if noisy else 0
        for rounds in dict.fromkeys((wanted, 0)):
            surface = _find_surface(scan, rounds, run)
            rest = _measure(scan, surface, eye if rounds else None, run)
            defects = angle_defects(rest, faces, topology, len(points), run)
            slack = NOISY_SLACK if rounds else CLEAN_SLACK
            if defects.sum() <= WORSE * raw_defects.sum() + slack * len(defects):
                break
        else:
            return _without_noise(raw, surface, scan, buckling, Smoothing.REFUSED)
        if not rounds:
            return _without_noise(rest, surface, scan, buckling, Smoothing.CLEAN)
        noise = FROM_MEAN * around(scan.points, surface.off, scan.spacing, run)
    return SmoothLengths(rest, surface.normals, noise, float(np.median(noise)), Smoothing.SMOOTHED)


def smooth_normals(mesh: Mesh, topology: Topology) -> NDArray[np.float32]:
    """(n, 3) unit normals of a scan without its noise, at a crease those of the side that the point lies on."""
    return smooth_lengths(mesh.points, mesh.faces, topology).normals


def _look_at(points: Floats, faces: Ints, topology: Topology, raw: Floats, run: Crew) -> _Scan:
    middle = np.array([points[:, k].mean() for k in range(3)]) if len(points) else np.zeros(3)
    centred = points - middle  # float32 holds 300 mm to 0.03 micrometres
    ring = Ring(*neighbours(topology.edges, len(points)))
    rows = surface_rows(centred, faces)
    spacing = float(np.median(raw)) if len(raw) else 0.0
    mean_square = float(raw @ raw) / max(len(raw), 1)
    return _Scan(
        centred, middle, topology.edges, ring, rows, spacing, mean_square, ring_noise(centred, rows, ring, run)
    )


def _is_noisy(buckling: float, step: float) -> bool:
    """Tell noise from bends, by how much the sheet buckles and the squared difference of normals of neighbours."""
    return buckling > BUCKLED and buckling**2 > min(BENT * math.sqrt(step), MOSTLY_NOISE) * step


def _look_for_noise(scan: _Scan, run: Crew) -> int:
    """Note where there is more and less noise, and say how many rounds of smoothing it asks for."""
    noise = FROM_MEAN * around(scan.points, scan.ring_noise, scan.spacing, run)
    scan.rows[:, NOISE] = np.maximum((noise / np.median(noise)) ** 2, LEAST_NOISE)
    return int(np.clip(ROUNDS_PER_NOISE * np.quantile(noise, NOISIEST) / scan.spacing, FEWEST, MOST))


def _without_noise(
    rest: Floats, surface: _Surface, scan: _Scan, buckling: float, smoothing: Smoothing
) -> SmoothLengths:
    """Noise is at most what both rings and angles show: folds stand out of rings, but do not buckle."""
    noise = min(typical(scan.ring_noise), buckling * scan.spacing)
    return SmoothLengths(rest, surface.normals, np.full(len(scan.points), noise), noise, smoothing)


def _find_surface(scan: _Scan, rounds: int, run: Crew) -> _Surface:
    points, rows, ring, edges = scan.points, scan.rows, scan.ring, scan.edges
    flat = np.zeros((len(rows), 4), np.float32)
    rows, spare = rows.copy(), np.empty_like(rows)
    for k in range(max(rounds, 1)):
        if k == int(MIDWAY * rounds):
            noise = typical(surface_noise(points, rows, flat, 0.0, run))
            to_sides(rows, find_sides(points, rows, flat, ring, 1, noise, scan.spacing, run), spare, run)
            rows, spare = spare, rows
        if rounds:
            diffuse(rows, ring, (REACH if k else FIRST_REACH) * typical_step(rows, edges), spare, run)
            rows, spare = spare, rows
    bends = find_bends(rows, ring, ACROSS**2 * typical_step(rows, edges), BENDS_SMOOTHED, run)
    if rounds:
        rows, spare = average_along(rows, bends, ring, spare, run)
    patch = rounds * 3 / 7 * scan.mean_square_edge  # a point and six neighbours, of equal weights, seen from one side
    off = surface_noise(points, rows, bends, patch, run)
    noise = typical(off)
    source = find_sides(points, rows, bends, ring, 2, noise, scan.spacing, run)
    normals = carry(points, rows, bends, source, run)
    folds = points_at_folds(normals, ring, run)
    return _Surface(refit(points, normals, ring, folds, noise, scan.spacing, run), bends[source], off)


def _measure(scan: _Scan, surface: _Surface, eye: Floats | None, run: Crew) -> Floats:
    points = scan.points
    if eye is not None:
        points = onto_surface(points, surface.normals, scan.ring, np.asarray(eye) - scan.middle, run)
    rest = np.empty(len(scan.edges))
    run(_over_surface, len(rest), points, surface.normals, surface.bends, scan.edges, rest)
    return rest


@njit(cache=True, nogil=True, error_model="numpy")
def _over_surface(first, last, points, normals, bends, edges, out):  # type: ignore[no-untyped-def]
    """Lengths of edges on two planes that meet between their ends, unfolded.

    With c along the fold and m between the two normals, which stand at an angle phi, an edge d is as long as

        L^2 = (d.c)^2 + (|d|^2 - (d.c)^2 - (d.m)^2) / cos^2(phi / 2)

    What noise adds to d along m drops out. On a bent sheet the planes are those of the edge's two Gauss points.
    """
    for e in range(first, last):
        i, j = edges[e, 0], edges[e, 1]
        d = minus(row(points, j), row(points, i))
        n, k = _at_gauss_point(normals, bends, i, d, 1.0), _at_gauss_point(normals, bends, j, d, -1.0)
        m, c = plus(n, 1.0, k), cross(n, k)
        mm, cc = square(m), square(c)  # 4 cos^2(phi / 2) and sin^2(phi)
        out[e] = math.sqrt(square(d))
        if mm > 1e-3:
            along = dot(d, c) ** 2 / cc if cc > 1e-14 else 0.0
            across = max(0.0, square(d) - along - dot(d, m) ** 2 / mm)
            out[e] = math.sqrt(along + 4.0 * across / mm)


@njit(cache=True, nogil=True)
def _at_gauss_point(normals, bends, i, d, sign):  # type: ignore[no-untyped-def]
    bend = row(bends, i)
    turn = bends[i, CURVATURE] * dot(bend, d)
    share = min(1.0, max(0.0, (POLYGON - abs(turn)) / (POLYGON - BEND)))
    return unit(plus(row(normals, i), sign * GAUSS * share * turn, bend))
