"""Rest lengths without the scanner's noise, true across creases."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray

from planish.geometry.distances import distances
from planish.geometry.grid_rows import viewpoint_of_rows
from planish.geometry.guards import TINY
from planish.mesh import Topology
from planish.parallel import ParallelFor, thread_pool
from planish.surface.arc_lengths import lengths_over, not_below_chords
from planish.surface.flipped_faces import flipped_by_noise
from planish.surface.local_quadrics import SAME_SIDE, SAME_SIDE_OF_STEEP, average_normals, onto_quadrics
from planish.surface.noise import FROM_MEAN, FROM_MEDIAN, angle_defects, local_sigma, noise_length, robust_sigma
from planish.surface.noise_plan import CLEAN, Plan, plan_for_shared, plan_smoothing
from planish.surface.normals import vertex_records
from planish.surface.quadric import points_at_folds
from planish.surface.rays import GRAZING, move_along_rays
from planish.surface.smooth_surface import MeasuredScan, Surface, find_surface, measure_scan
from planish.surface.spikes import find_spikes
from planish.types import Bools, Doubt, Floats, Ints, Mesh

WORSE = 1.2
"""Lengths are refused if by them the sheet would buckle (mean angle defect) by more than so many times what it does
raw, and a little. Right ones buckle half to a hundredth as much as raw ones; those of a coarse mesh whose points sit on
its folds 30,000 times as much (crumpled_developable). Ripple that runs one way does not buckle raw: not asked there."""

LONGEST_OF_WHITE = 6.0
"""Length, in edges, of what may be taken away as white noise. Noise that is smoothed so reads 0.5 to 3; of a clean dome
1.6 mm were taken for noise, 36 edges long. Halved, noise over 3 points on a wave would stay."""

WHITE_LEFT = 0.7
"""Part of what moved points leave of white noise that is in the page; the rest is the smooth surface's own error, which
moves no point along the sheet. With 1 the expected error is 1.4 to 3.5 times the true one, with 0.35 down to 0.4."""

SHARED_LEFT = 0.6
"""Part of strong noise that is still in the page where points moved along their rays."""

BENDS_LEFT = 0.5
"""Part of what smoothing moves a bent surface by (`Surface.rounding_mm`) that is still in the page, as curvature is not
known exactly. Measured under ripple of 0.12 mm, 40,000 to 200,000 points: 0.3 to 0.5 (curl, letter), 0.4 to 0.8 (book),
0.2 to 1.2 (wave), 0.8 to 1.5 (spread)."""

RINGS_ROUNDED, RADIUS_AT_FOLDS = 4, 4.0
"""Points within so many edges of a fold are moved onto quadrics of such a radius [edges]."""

FAINT = 0.15
"""Noise, in edges, up to which straight distances bound the lengths (`not_below_chords`). Where it is more, normals
differ because of it, points are left off the surface, and some distances are far too long."""

RADII_OF_QUADRICS, SIZE_SETTLED = (3.0, 5.0, 8.0), 0.003
"""Radii [edges] of quadrics that are tried, until all edges together get shorter by less than SIZE_SETTLED."""


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
    bias_mm : float
        Expected error of the page, rms, from what smoothing takes off the sheet's bends.
    noise_left : float
        Part of the noise, 0 to 1, that is still in the lengths: less than 1 where points were moved along their rays.
    typical_noise_mm : float
        Its median.
    smoothing : Smoothing
    turned : (m,) bool or None
        Faces that noise turned over (see `flipped_by_noise`); None where there is no noise.
    noise_length_mm : float or None
        Distance over which the noise of two points is alike (their correlation is a half); None where there is none.
    spikes : int
        Points so far off their surroundings that they were not counted.
    doubt : Doubt or None
        Why the lengths, if made without noise, are to be held against raw ones.
    """

    rest: Floats
    normals: NDArray[np.float32]
    noise_mm: Floats
    typical_noise_mm: float
    smoothing: Smoothing
    turned: Bools | None = None
    noise_left: float = 1.0
    bias_mm: float = 0.0
    noise_length_mm: float | None = None
    spikes: int = 0
    doubt: Doubt | None = None


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
    with thread_pool() as parallel_for:
        raw = distances(points, topology.edges)
        scan = measure_scan(points, faces, topology, raw, parallel_for)
        find_eye = cache(partial(viewpoint_of_rows, points, topology.edges))
        spikes, feet, axes = find_spikes(scan.points, scan.rows, scan.ring, scan.spacing, parallel_for)
        if len(spikes):
            eye = find_eye() if eye is None else eye
            points = _without_spikes(points, spikes, feet + scan.middle, axes, eye)
            raw = distances(points, topology.edges)
            scan = measure_scan(points, faces, topology, raw, parallel_for, scan.ring)
        raw_defects = angle_defects(raw, faces, topology, len(points), parallel_for)
        buckling = math.sqrt(float(np.quantile(raw_defects, 0.25))) if len(raw_defects) else 0.0
        plan = plan_smoothing(scan, buckling, parallel_for)
        if plan.rounds and eye is None:
            eye = find_eye()
        original = scan.points
        if plan.same_side:
            scan = _presmoothed(scan, faces, topology, eye, plan.same_side, parallel_for)
            plan = plan_for_shared(scan, parallel_for)
        for tried in (plan, CLEAN) if plan.rounds else (CLEAN,):
            surface = find_surface(scan, tried.rounds, parallel_for, tried.reach)
            moved, left, bias = scan.points, 1.0, 0.0
            if tried.move:
                moved, left = _onto_plane(scan, surface, eye)
                if math.isinf(tried.slack) and scan.points is original:
                    moved = _onto_own_sides(moved, scan, surface, eye, parallel_for)
                    left, bias = 1.0 if eye is None else 0.0, BENDS_LEFT * surface.rounding_mm
            elif tried.rounds and eye is not None:
                moved, left = _without_its_noise(scan, surface, eye, parallel_for)
            rest = lengths_over(moved, surface.normals, surface.bends, scan.edges, parallel_for)
            defects = angle_defects(rest, faces, topology, len(points), parallel_for)
            if not _buckles_more(defects, raw_defects, tried) and not _is_shape(surface, scan, tried):
                break
        else:
            return _without_noise(raw, surface, scan, buckling, Smoothing.REFUSED, len(spikes))
        if not tried.rounds:
            rest = not_below_chords(rest, moved, surface.normals, scan.edges, np.ones(len(points)), parallel_for)
            return _without_noise(rest, surface, scan, buckling, Smoothing.CLEAN, len(spikes))
        off = surface.off
        if scan.points is not original:
            off = off + np.einsum("ij,ij->i", original - scan.points, surface.normals).astype(np.float32)
        noise = FROM_MEAN * local_sigma(scan.points, np.abs(off), scan.spacing, parallel_for)
        typical = float(np.median(noise))
        ratio = np.where(noise < FAINT * scan.spacing, noise / max(typical, TINY), np.inf)
        rest = not_below_chords(rest, moved, surface.normals, scan.edges, ratio, parallel_for)
        length = noise_length(off, topology.edges, scan.spacing)
        turned = flipped_by_noise(moved if tried.move else scan.points, faces, surface.normals, parallel_for)
        doubt = Doubt.STRONG if scan.points is not original else None
        if math.isfinite(tried.slack) and len(defects) and np.median(defects) > WORSE * np.median(raw_defects):
            doubt = Doubt.BUCKLES
    return SmoothLengths(
        rest,
        surface.normals,
        noise,
        typical,
        Smoothing.SMOOTHED,
        turned,
        left,
        bias,
        length,
        len(spikes),
        doubt,
    )


def _buckles_more(defects: Floats, raw_defects: Floats, plan: Plan) -> bool:
    """Whether a sheet would buckle more by its new lengths than it does raw."""
    if not len(defects) or math.isinf(plan.slack):
        return False
    return bool(defects.sum() > WORSE * raw_defects.sum() + plan.slack * len(defects))


def _is_shape(surface: Surface, scan: MeasuredScan, plan: Plan) -> bool:
    """Whether what smoothing for white noise takes away is alike over so many points that it is the sheet's shape."""
    white = plan.rounds > 0 and math.isfinite(plan.slack)
    return white and noise_length(surface.off, scan.edges, scan.spacing) > LONGEST_OF_WHITE * scan.spacing


def smooth_normals(mesh: Mesh, topology: Topology) -> NDArray[np.float32]:
    """(n, 3) unit normals of a scan without its noise, at a crease those of the side that the point lies on."""
    return smooth_lengths(mesh.points, mesh.faces, topology).normals


def _presmoothed(
    scan: MeasuredScan, faces: Ints, topology: Topology, eye: Floats | None, same_side: float, parallel_for: ParallelFor
) -> MeasuredScan:
    """Scan whose points lie on local quadrics, of the least radius from which on the edges do not get shorter."""
    normals = average_normals(scan.rows, scan.ring)
    directions = normals.astype(np.float64) if eye is None else _rays(scan, eye)
    edge = scan.points[scan.edges[:, 1]] - scan.points[scan.edges[:, 0]]
    across = np.einsum("ij,ij->i", edge, directions[scan.edges[:, 0]])
    spacing = float(np.median(np.sqrt(np.maximum(np.einsum("ij,ij->i", edge, edge) - across**2, 0.0))))
    rough = onto_quadrics(
        scan.points, normals, directions, scan.ring, RADII_OF_QUADRICS[0] * spacing, parallel_for, SAME_SIDE_OF_STEEP
    )
    normals = average_normals(vertex_records(rough, faces), scan.ring)
    total = math.inf
    for radius in RADII_OF_QUADRICS:
        moved = onto_quadrics(scan.points, normals, directions, scan.ring, radius * spacing, parallel_for, same_side)
        lengths = distances(moved, scan.edges)
        if total < (1 + SIZE_SETTLED) * lengths.sum():
            break
        total = float(lengths.sum())
    return measure_scan(moved + scan.middle, faces, topology, lengths, parallel_for, scan.ring)


def _rays(scan: MeasuredScan, eye: Floats) -> Floats:
    ray = scan.points - (eye - scan.middle)
    return np.asarray(ray / np.linalg.norm(ray, axis=1, keepdims=True))


def _without_spikes(points: Floats, spikes: Ints, feet: Floats, axes: Floats, eye: Floats | None) -> Floats:
    """Spikes moved along their rays to the surface around them, or between their neighbours where rays are unknown."""
    points = points.copy()
    if eye is not None:
        ray = points[spikes] - eye
        towards = np.einsum("ij,ij->i", ray, axes)
        seen = np.abs(towards) > GRAZING * np.linalg.norm(ray, axis=1)
        shift = np.einsum("ij,ij->i", feet - points[spikes], axes) / np.where(seen, towards, 1.0)
        feet = np.where(seen[:, None], points[spikes] + shift[:, None] * ray, feet)
    points[spikes] = feet
    return points


def _without_noise(
    rest: Floats, surface: Surface, scan: MeasuredScan, buckling: float, smoothing: Smoothing, spikes: int
) -> SmoothLengths:
    """Noise is at most what both rings and angles show: folds stand out of rings, but do not buckle."""
    noise = min(robust_sigma(scan.ring_noise), buckling * scan.spacing)
    return SmoothLengths(rest, surface.normals, np.full(len(scan.points), noise), noise, smoothing, spikes=spikes)


def _onto_plane(scan: MeasuredScan, surface: Surface, eye: Floats | None) -> tuple[Floats, float]:
    """Points moved onto the smooth surface itself, along their rays if these are known."""
    normals = surface.normals.astype(np.float64)
    if eye is None:
        return scan.points - surface.off[:, None] * normals, 1.0
    ray = _rays(scan, eye)
    towards = np.einsum("ij,ij->i", normals, ray)
    seen = np.abs(towards) > GRAZING
    shift = np.where(seen, surface.off / np.where(seen, towards, 1.0), 0.0)
    return scan.points - shift[:, None] * ray, SHARED_LEFT


def _onto_own_sides(
    moved: Floats, scan: MeasuredScan, surface: Surface, eye: Floats | None, parallel_for: ParallelFor
) -> Floats:
    """Places of points, but beside folds on quadrics fitted to the points of their own side.

    So many rounds of averaging as shared noise takes round a surface off beside its folds.
    """
    folds = points_at_folds(surface.normals, scan.ring, parallel_for, RINGS_ROUNDED)
    directions = surface.normals.astype(np.float64) if eye is None else _rays(scan, eye)
    towards = np.einsum("ij,ij->i", surface.normals[folds], directions[folds])
    folds = folds[np.abs(towards) > GRAZING]
    radius = RADIUS_AT_FOLDS * scan.spacing
    fitted = onto_quadrics(scan.points, surface.normals, directions, scan.ring, radius, parallel_for, SAME_SIDE, folds)
    moved = moved.copy()
    moved[folds] = fitted[folds]
    return moved


def _without_its_noise(
    scan: MeasuredScan, surface: Surface, eye: Floats, parallel_for: ParallelFor
) -> tuple[Floats, float]:
    """Points moved along their rays onto the surface, and the part of the noise that this leaves.

    What is alike over several points does not show as noise, and stays: noise of variance s^2 that moves points by m,
    rms, leaves s^2 - m^2, of which WHITE_LEFT shows in the page.
    """
    noise = robust_sigma(surface.off)
    moved = move_along_rays(
        scan.points, surface.normals, scan.ring, eye - scan.middle, noise / scan.spacing, parallel_for
    )
    gone = np.einsum("ij,ij->i", moved - scan.points, surface.normals)
    stays = max(1 - float(np.median(gone * gone)) / max(FROM_MEDIAN**-2 * noise**2, TINY), 0.0)
    return moved, WHITE_LEFT * math.sqrt(stays)
