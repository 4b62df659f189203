"""The surface that a mesh is a noisy scan of: its normals, sharp at creases, and how it is bent."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planish.mesh import Topology, neighbours
from planish.parallel import ParallelFor
from planish.surface.creases import assign_crease_sides, normals_at_points, take_side_normals
from planish.surface.curvature import CURVATURE, ShapeOperators, shape_operators
from planish.surface.noise import ring_noise, robust_sigma, surface_noise
from planish.surface.normals import OneRing, VertexRecords, diffuse, median_edge, sample, vertex_records
from planish.surface.quadric import points_at_folds, refit
from planish.surface.rulings import average_along
from planish.types import Floats, Ints

REACH = 8.0**2
"""Normals that differ by more than 8 typical steps (squared) are across a crease. With 5 outliers of the noise stay
(0.2 mm: sheets 0.1 % too large, not 0.02), with 12 small creases go (crumpled: 0.16 % too small, not 0.07)."""

MIDWAY = 0.4
"""Sides of creases are chosen after this part of the rounds, for the first time; 0.2 and 0.7 are as good."""

BENDS_SMOOTHED = 4
"""Rounds of smoothing for the bends: 8 are no better, 2 leave 10 % more error in the normals. On clean meshes one would
do, but not on coarse real ones, whose little noise goes unnoticed (handheld_sheet: 1.20 mm out, not 1.08)."""

PATCH = 3 / 7
"""Variance across the surface that a round adds to the patch a place is the average of, in mean squared edges: a point
and six neighbours of equal weights, seen along one axis."""


class MeasuredScan(NamedTuple):
    """A mesh, with what is measured of it once.

    Attributes
    ----------
    points : (n, 3) float64 [mm]
        About their middle, as float32 then holds 300 mm to 0.03 micrometres.
    middle : (3,) float64 [mm]
    edges : (e, 2) int32
    ring : OneRing
    rows : VertexRecords
    spacing : float [mm]
        Median length of the edges.
    mean_square : float [mm^2]
        Mean of their squares.
    ring_noise : (n,) float32 [mm]
    """

    points: Floats
    middle: Floats
    edges: Ints
    ring: OneRing
    rows: VertexRecords
    spacing: float
    mean_square: float
    ring_noise: NDArray[np.float32]


class Surface(NamedTuple):
    """A smooth surface with creases, at the points of a scan.

    Attributes
    ----------
    normals : (n, 3) float32
    bends : ShapeOperators
    off : (n,) float32 [mm]
        Distance of the points from it.
    rounding_mm : float
        By how much smoothing moves the surface where it is bent, rms: half its curvature times the mean square width of
        the patch that each place is the average of. This is put right by the curvature as it was measured.
    """

    normals: NDArray[np.float32]
    bends: ShapeOperators
    off: NDArray[np.float32]
    rounding_mm: float


def measure_scan(
    points: Floats,
    faces: Ints,
    topology: Topology,
    raw: Floats,
    parallel_for: ParallelFor,
    ring: OneRing | None = None,
) -> MeasuredScan:
    """Prepare a mesh whose edges are `raw` long, and whose one-rings may be known."""
    middle = np.array([points[:, k].mean() for k in range(3)]) if len(points) else np.zeros(3)
    centred = points - middle
    ring = OneRing(*neighbours(topology.edges, len(points))) if ring is None else ring
    rows = vertex_records(centred, faces)
    some = raw[sample(len(raw))]
    spacing = float(np.median(some)) if len(some) else 0.0
    mean_square = float(raw @ raw) / max(len(raw), 1)
    noise = ring_noise(centred, rows, ring, parallel_for)
    return MeasuredScan(centred, middle, topology.edges, ring, rows, spacing, mean_square, noise)


def find_surface(scan: MeasuredScan, rounds: int, parallel_for: ParallelFor, least_reach: float = 0.0) -> Surface:
    """Smooth the normals of a scan in `rounds` rounds; with none, only points on creases are assigned a side."""
    points, ring, edges = scan.points, scan.ring, scan.edges
    rows, spare = scan.rows.copy(), np.empty_like(scan.rows)
    flat = np.zeros((len(rows), 4), np.float32)
    for k in range(max(rounds, 1)):
        if k == int(MIDWAY * rounds):
            noise = robust_sigma(surface_noise(points, rows, flat, 0.0, parallel_for))
            take_side_normals(
                rows,
                assign_crease_sides(points, rows, flat, ring, 1, noise, scan.spacing, parallel_for),
                spare,
                parallel_for,
            )
            rows, spare = spare, rows
        if rounds:
            diffuse(rows, ring, max(REACH * median_edge(rows, edges), least_reach), spare, parallel_for)
            rows, spare = spare, rows
    bends = shape_operators(
        rows, ring, max(REACH * median_edge(rows, edges), least_reach), BENDS_SMOOTHED, parallel_for
    )
    if rounds:
        rows, spare = average_along(rows, bends, ring, spare, parallel_for)
    patch = rounds * PATCH * scan.mean_square
    noise = robust_sigma(surface_noise(points, rows, bends, patch, parallel_for))
    source = assign_crease_sides(points, rows, bends, ring, 2, noise, scan.spacing, parallel_for)
    off = surface_noise(points, rows, bends, patch, parallel_for, source)
    normals = normals_at_points(points, rows, bends, source, parallel_for)
    folds = points_at_folds(normals, ring, parallel_for)
    normals = refit(points, normals, ring, folds, noise, scan.spacing, parallel_for)
    rounding = 0.5 * patch * float(np.sqrt(np.mean(bends[:, CURVATURE] ** 2))) if len(bends) else 0.0
    return Surface(normals, bends[source], off, rounding)
