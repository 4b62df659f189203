"""The surface of a sheet from photos with known cameras, coarse to fine.

A height field through the points that all photos share is moved, patch by patch, to where the photos agree, and fitted
again with sharp creases; on photos in which the sheet is 300 pixels long first, 1200 last. The ground is painted black
beforehand, so that the outline of the sheet is a pattern like any print, which measures the rim of blank paper too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree

from planish.acquire.photos.height_field import Grid, fit_heights, interpolation, strongest_bends
from planish.acquire.photos.outline import distance_inside
from planish.acquire.photos.paper import Paper
from planish.acquire.photos.patch_matching import RADIUS, PhotoStack, match_patches, stack_photos
from planish.acquire.photos.rim import rim_points
from planish.acquire.photos.visibility import facing_cameras, seen_nodes
from planish.geometry import camera_position, depths
from planish.geometry.axes import principal_axes
from planish.geometry.guards import normalize
from planish.types import Bools, Camera, Floats

Grey = NDArray[np.uint8]


@dataclass(frozen=True)
class Level:
    """A step from coarse to fine.

    Attributes
    ----------
    pixels : int
        Along the sheet.
    cells : int
        Of the grid along it.
    steps : int
        Offsets tried on each side.
    rounds : int
    tilted : bool
        Whether patches are tilted too: coarse surfaces may be far from the slope of a gutter or a crumple.
    """

    pixels: int
    cells: int
    steps: int
    rounds: int
    tilted: bool = False


LEVELS = (Level(300, 120, 10, 3, True), Level(600, 160, 5, 1, True), Level(1200, 200, 3, 1))
TILTS = [(np.radians(tilt), turn) for tilt in (30.0, 55.0) for turn in np.arange(0, 2 * np.pi, np.pi / 2)]
"""Of patches against the surface, and directions of the tilt across the grid."""
STEP = 0.5
"""Offsets tried, in samples: between photos 60 degrees apart a patch moves by as much."""
STIFFNESS = 5.0
"""[1 / px] Of the fit; see `fit_heights`."""
SPARSE_SIGMA_PX = 0.5
"""Standard deviation of the points that structure from motion found, in pixels of the photo."""
RIM_SIGMA_PX = 3.0
"""The same of points of the rim, which are found on the steps of a ray."""
SIGMA_PX = 0.1
"""Least standard deviation of a match: cameras are not truer."""
MARGIN = 0.25
"""Of the grid around the points, in sides of the sheet: blank margins have none."""
RIM_CELLS = 5
"""Heights are sought so far beyond the outline, which the fit may move yet."""
AGREEMENT = 0.6
"""Least mean correlation of a match."""
UNSURE = 0.5
"""Matches less sure than this part of a sample are none: shade that grows one way looks alike everywhere."""
SPECKLE_CELLS, NO_OFFSET = 6, -(2**15)
"""Matches are left out in groups of at most so many cells, neighbours of which differ by up to one step: random places
of blank paper agree now and then."""
BEND_WIDTH = 0.015
"""Half of the width over which bends are looked at, in widths of the grid: 6 mm of A4."""
SHARPEST = 0.98
"""Of the bridged places, by what may be missing there."""
STEEPEST_HALF = 1.4
"""[rad] Half of the sharpest turn that counts: paper folded flat has no width over which it could be told."""
FINE = 4.0
"""Patches of at most so many pixels a sample measure the sharpest bends."""
NEAR_POINTS = 4.0
"""Without an outline the sheet reaches so many cells beyond what was measured."""
STEEPEST = 0.1
"""Cosine of the steepest slope that the fit knows of."""
STEEP_SHARE = 0.05
"""Share of the points, the steepest, by which the direction of the grid is chosen."""
SQUARER = 0.15
"""The grid is tilted against the sheet's plane if this raises the cosine at them by so much."""


@dataclass(frozen=True, eq=False)
class Measured:
    """Places of a surface, and how far they may be off along its normal.

    Attributes
    ----------
    points : (k, 3) float64 [mm]
    sigma : (k,) float64 [mm]
    reach : (k,) float64 [mm]
        Half width of what was compared to measure each.
    """

    points: Floats
    sigma: Floats
    reach: Floats


@dataclass(frozen=True, eq=False)
class SheetSurface:
    """Heights of a sheet over a grid.

    Attributes
    ----------
    grid : Grid
    heights : (rows, cols) float64 [mm]
    inside_mm : (rows, cols) float64
        Distance from the sheet's outline; negative outside.
    measured : Measured
    seen : (rows cols, photos) bool
    likeness : (photos,) float64
        Share of the matched places, of those that a photo sees, at which it agrees with the others.
    pixel_mm : float
    """

    grid: Grid
    heights: Floats
    inside_mm: Floats
    measured: Measured
    seen: Bools
    likeness: Floats
    pixel_mm: float

    def within_points(self, nodes: Floats) -> Floats:
        """Positive for nodes (n, 3) near what was measured: the sheet's extent where no outline was found."""
        return NEAR_POINTS * self.grid.spacing - cKDTree(self.measured.points).query(nodes)[0]

    def lost_at_bends(self) -> float:
        """Length [mm] that may be missing across the sharpest bend that was bridged instead of measured.

        Across a gap of width w in which the sheet turns by t nothing tells a sharp fold, of length w / cos(t / 2), from
        an arc, of w (t / 2) / sin(t / 2). A straight ruling, that ends in what was measured, does; so the difference
        counts as far as the surface bends along its rulings too, in parts of its bend across them.
        """
        nodes, step = self.grid.to_space(self.heights), max(1, round(BEND_WIDTH * self.grid.shape_rc[1]))
        fine = self.measured.points[self.measured.reach <= self.pixel_mm * RADIUS * FINE]
        bridged = cKDTree(fine).query(nodes)[0].reshape(self.heights.shape) > 2 * self.grid.spacing
        bridged &= np.nan_to_num(self.inside_mm, nan=-1.0) > 0
        if not bridged.any():
            return 0.0
        normals = self.grid.normals(self.heights).reshape(*self.heights.shape, 3)
        turn = np.zeros(self.heights.shape)
        across = np.arccos(np.clip((normals[:, 2 * step :] * normals[:, : -2 * step]).sum(axis=2), -1, 1))
        down = np.arccos(np.clip((normals[2 * step :] * normals[: -2 * step]).sum(axis=2), -1, 1))
        turn[:, step:-step] = across
        turn[step:-step] = np.maximum(turn[step:-step], down)
        half = np.clip(turn[bridged] / 2, 1e-6, STEEPEST_HALF)
        share = strongest_bends(self.heights)[1][bridged]
        along = np.sqrt((1 - share) / (1 + share))
        missing = 2 * step * self.grid.spacing * (1 / np.cos(half) - half / np.sin(half)) * along
        return float(np.quantile(missing, SHARPEST))


def find_surface(
    photos: Sequence[Grey],
    papers: Sequence[Paper | None],
    cameras: Sequence[Camera],
    points: Floats,
    progress: Callable[[float], None],
) -> SheetSurface:
    """Find the surface of a sheet.

    Parameters
    ----------
    photos : sequence of (rows, cols) uint8
        Grey levels; black where the ground is.
    papers : sequence of Paper or None
    cameras : sequence of Camera
    points : (n, 3) float64 [mm]
        Points of the sheet.
    progress : callable
        Called with the share done.
    """
    pixel_mm = float(np.median([np.median(depths(c, points)) / c.matrix[0, 0] for c in cameras]))
    grid = sheet_grid(points, cameras, LEVELS[0].cells)
    extent = grid.spacing * LEVELS[0].cells
    sparse = Measured(points, np.full(len(points), SPARSE_SIGMA_PX * pixel_mm), np.zeros(len(points)))
    rim = rim_points(papers, cameras, points)
    measured = _merged(sparse, Measured(rim, np.full(len(rim), RIM_SIGMA_PX * pixel_mm), np.zeros(len(rim))))
    coarse = measured
    heights = _fit(grid, measured, None, pixel_mm)
    for number, level in enumerate(LEVELS):
        next_grid = grid.refined(extent / level.cells)
        heights, grid = _resampled(grid, heights, next_grid), next_grid
        reduction = max(1.0, extent / pixel_mm / level.pixels)
        small = [_reduced(photo, reduction) for photo in photos]
        stack = stack_photos(small, cameras, [s.shape[1] / p.shape[1] for s, p in zip(small, photos, strict=True)])
        coarse = measured
        for _ in range(level.rounds):
            seen, inside = _seen_and_inside(grid, heights, cameras, papers)
            active = _active(inside, RIM_CELLS * grid.spacing)
            looked_at = seen & active.reshape(-1, 1)
            fresh, likeness = _match(grid, heights, cameras, stack, looked_at, reduction * pixel_mm, level)
            fresh = replace(fresh, sigma=np.maximum(fresh.sigma, SIGMA_PX * pixel_mm))
            measured = _merged(_merged(fresh, sparse), coarse)
            heights = _fit(grid, measured, heights, pixel_mm, active)
        progress((number + 1) / len(LEVELS))
    seen, inside = _seen_and_inside(grid, heights, cameras, papers)
    return SheetSurface(grid, heights, inside, measured, seen, likeness, pixel_mm)


def _seen_and_inside(
    grid: Grid, heights: Floats, cameras: Sequence[Camera], papers: Sequence[Paper | None]
) -> tuple[Bools, Floats]:
    """Photos that see each node (nodes, photos), and each node's distance from the outline (rows, cols)."""
    nodes = grid.to_space(heights)
    seen = seen_nodes(nodes, grid.normals(heights), grid.faces(), grid.spacing, cameras)
    return seen, distance_inside(nodes, seen, cameras, papers).reshape(grid.shape_rc)


def _match(
    grid: Grid,
    heights: Floats,
    cameras: Sequence[Camera],
    stack: PhotoStack,
    seen: Bools,
    sample_mm: float,
    level: Level,
) -> tuple[Measured, Floats]:
    """Places where the photos agree, near the present surface; where they do not, with tilted patches too."""
    nodes, normals = grid.to_space(heights), grid.normals(heights)
    found = match_patches(stack, nodes, normals, seen, sample_mm, STEP * sample_mm, level.steps)
    offset, sigma, agreement = found.offset.copy(), found.sigma.copy(), found.agreement.copy()
    agrees = found.agrees.copy()
    agreement[np.isnan(offset)] = 0.0
    for tilt, turn in TILTS if level.tilted else ():
        poor = np.flatnonzero(seen.any(axis=1) & (agreement < AGREEMENT))
        across = np.cos(turn) * grid.axes[0] + np.sin(turn) * grid.axes[1]
        tilted = normalize(np.cos(tilt) * normals[poor] + np.sin(tilt) * across)
        facing = seen[poor] & facing_cameras(nodes[poor], tilted, cameras)
        other = match_patches(
            stack, nodes[poor], tilted, facing, sample_mm, STEP * sample_mm, level.steps, normals[poor]
        )
        better = np.isfinite(other.offset) & (other.agreement > agreement[poor])
        rows = poor[better]
        offset[rows], sigma[rows] = other.offset[better], other.sigma[better]
        agreement[rows], agrees[rows] = other.agreement[better], other.agrees[better]
    good = (agreement > AGREEMENT) & (sigma < UNSURE * sample_mm)
    good = _without_speckles(np.where(good, offset / (STEP * sample_mm), np.nan).reshape(grid.shape_rc)).ravel()
    places = (nodes + offset[:, None] * normals)[good]
    likeness = (agrees & seen)[good].sum(axis=0) / np.maximum(seen[good].sum(axis=0), 1)
    return Measured(places, sigma[good], np.full(len(places), RADIUS * sample_mm)), likeness


def _without_speckles(steps: Floats) -> Bools:
    """Matches (rows, cols), by their offset in steps, that go on to neighbours: false ones stand alone."""
    sixteenths = np.where(np.isfinite(steps), 16 * np.nan_to_num(steps), NO_OFFSET).astype(np.int16)
    kept = cv2.filterSpeckles(sixteenths, NO_OFFSET, SPECKLE_CELLS, 16)[0]
    return np.asarray(kept != NO_OFFSET)


def _fit(grid: Grid, measured: Measured, start: Floats | None, pixel_mm: float, active: Bools | None = None) -> Floats:
    """Heights through measured places; an error along the normal is larger along the vertical."""
    columns_rows, height = grid.to_grid(measured.points)
    at = interpolation(grid, columns_rows)
    upright = np.ones(len(height)) if start is None else at @ (grid.normals(start) @ grid.axes[2])
    sigma = measured.sigma / np.maximum(upright, STEEPEST)
    return fit_heights(grid, at, height, sigma, STIFFNESS / pixel_mm, start, active)[0]


def _merged(fine: Measured, coarse: Measured) -> Measured:
    """The fine measurements, and the coarse ones that have none within their reach."""
    if not len(fine.points):
        return coarse
    away = cKDTree(fine.points).query(coarse.points)[0]
    alone = away >= coarse.reach
    return Measured(
        *(
            np.concatenate([a, b[alone]])
            for a, b in ((fine.points, coarse.points), (fine.sigma, coarse.sigma), (fine.reach, coarse.reach))
        )
    )


def _active(inside: Floats, rim_mm: float) -> Bools:
    """Nodes on the sheet or near its outline; all, where no outline was found."""
    if not np.isfinite(inside).any():
        return np.ones(inside.shape, bool)
    near = np.nan_to_num(inside, nan=-np.inf) > -rim_mm
    return np.asarray(ndimage.binary_closing(near, iterations=3) | near)


def _reduced(photo: Grey, reduction: float) -> NDArray[np.float32]:
    rows, cols = photo.shape
    size = round(cols / reduction), round(rows / reduction)
    return np.asarray(cv2.resize(photo.astype(np.float32), size, interpolation=cv2.INTER_AREA))


def _resampled(grid: Grid, heights: Floats, finer: Grid) -> Floats:
    rows, cols = finer.shape_rc
    at = np.mgrid[:rows, :cols] * (finer.spacing / grid.spacing)
    return np.asarray(ndimage.map_coordinates(heights, at, order=1, mode="nearest"))


def sheet_grid(points: Floats, cameras: Sequence[Camera], cells: int) -> Grid:
    """Lay a grid over the points of a sheet, as square to its printed side everywhere as possible."""
    middle = points.mean(axis=0)
    eyes = np.array([camera_position(c) for c in cameras])
    axes, _ = principal_axes(points)
    up = axes[2] if ((eyes - middle) @ axes[2]).mean() > 0 else -axes[2]
    up = _squarest(points, eyes, up)
    right = normalize(axes[0] - (axes[0] @ up) * up)
    frame = np.stack([right, np.cross(up, right), up])
    local = (points - middle) @ frame.T
    low, high = local[:, :2].min(axis=0), local[:, :2].max(axis=0)
    spacing = float((high - low).max()) / cells
    margin = MARGIN * float((high - low).max())
    cols, rows = (int(n) + 1 for n in np.ceil((high - low + 2 * margin) / spacing))
    origin = middle + np.append(low - margin, 0) @ frame
    return Grid(origin, frame, spacing, (rows, cols))


def _squarest(points: Floats, eyes: Floats, up: Floats) -> Floats:
    """The direction whose greatest angle to the surface's normals is least, if one is plainly better than `up`."""
    near = cKDTree(points).query(points, 16)[1]
    around = points[near] - points[near].mean(axis=1, keepdims=True)
    normal = np.linalg.svd(around, full_matrices=False)[2][:, 2]
    normal *= np.sign((normal * (eyes.mean(axis=0) - points)).sum(axis=1))[:, None]
    best = up
    for _ in range(30):
        cosine = normal @ best
        best = normalize(best + 0.1 * normal[cosine <= np.quantile(cosine, STEEP_SHARE)].mean(axis=0))
    gain = np.quantile(normal @ best, STEEP_SHARE) - np.quantile(normal @ up, STEEP_SHARE)
    return best if gain > SQUARER else up
