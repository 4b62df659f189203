"""The surface of a sheet from photos with known cameras, coarse to fine.

A height field through the points that all photos share is moved, patch by patch, to where the photos agree, and fitted
again with sharp creases; on photos of an eighth of the size first, on the whole ones last. The ground is painted black
beforehand, so that the outline of the sheet is a pattern like any print, which measures the rim of blank paper too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree

from planish.acquire.photos.height_field import Grid, fit_heights, interpolation
from planish.acquire.photos.outline import distance_inside
from planish.acquire.photos.paper import Paper
from planish.acquire.photos.patch_matching import RADIUS, match_patches, stack_photos
from planish.acquire.photos.visibility import seen_nodes
from planish.geometry import depths
from planish.geometry.axes import principal_axes
from planish.geometry.guards import normalize
from planish.types import Bools, Camera, Floats, Ints

Grey = NDArray[np.float32]


@dataclass(frozen=True)
class Level:
    """A step from coarse to fine: pixels along the sheet, cells of the grid along it, offsets tried, rounds."""

    pixels: int
    cells: int
    steps: int
    rounds: int


LEVELS = (Level(300, 120, 10, 2), Level(600, 160, 5, 1), Level(1200, 200, 3, 1))
STIFFNESS = 5.0
SPARSE_SIGMA_PX = 0.5
SIGMA_PX = 0.1
MARGIN = 0.25
RIM_CELLS = 5
AGREEMENT = 0.6
NEAR_POINTS = 4.0


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
    pixel_mm : float
    """

    grid: Grid
    heights: Floats
    inside_mm: Floats
    measured: Measured
    seen: Bools
    pixel_mm: float

    def within_points(self, nodes: Floats) -> Floats:
        """Positive for nodes (n, 3) near what was measured: the sheet's extent where no outline was found."""
        return NEAR_POINTS * self.grid.spacing - cKDTree(self.measured.points).query(nodes)[0]


def find_surface(
    photos: Sequence[Grey],
    papers: Sequence[Paper | None],
    cameras: Sequence[Camera],
    points: Floats,
    progress: Callable[[float], None] | None = None,
    debug=None,
) -> SheetSurface:
    """Find the surface of a sheet.

    Parameters
    ----------
    photos : sequence of (rows, cols) float32
        Grey levels 0 to 255; black where the ground is.
    papers : sequence of Paper or None
    cameras : sequence of Camera
    points : (n, 3) float64
        Points of the sheet.
    progress : callable, optional
    """
    pixel_mm = float(np.median([np.median(depths(c, points)) / c.matrix[0, 0] for c in cameras]))
    grid = sheet_grid(points, cameras, LEVELS[0].cells)
    extent = grid.spacing * LEVELS[0].cells
    sparse = Measured(
        points, np.full(len(points), SPARSE_SIGMA_PX * pixel_mm), np.zeros(len(points))
    )
    measured = sparse
    heights = _fit(grid, measured, None, pixel_mm)
    for level, finer in pairwise((None, *LEVELS)):
        assert finer is not None
        next_grid = grid.refined(grid.spacing * (LEVELS[0].cells if level is None else level.cells) / finer.cells)
        heights, grid = _resampled(grid, heights, next_grid), next_grid
        reduction = max(1.0, extent / pixel_mm / finer.pixels)
        small = [_reduced(photo, reduction) for photo in photos]
        stack = stack_photos(small, cameras, [s.shape[1] / p.shape[1] for s, p in zip(small, photos, strict=True)])
        sample = pixel_mm * reduction
        coarse = measured
        for turn in range(finer.rounds):
            nodes, normals = grid.to_space(heights), grid.normals(heights)
            seen = seen_nodes(nodes, normals, grid.faces(), grid.spacing, cameras)
            inside = distance_inside(nodes, seen, cameras, papers).reshape(grid.shape_rc)
            active = _active(inside, RIM_CELLS * grid.spacing)
            found = match_patches(
                stack, nodes, normals, seen & active.reshape(-1, 1), sample, 0.5 * sample, finer.steps
            )
            good = np.isfinite(found.offset) & (found.agreement > AGREEMENT)
            fresh = Measured(
                (nodes + found.offset[:, None] * normals)[good],
                np.maximum(found.sigma[good], SIGMA_PX * pixel_mm),
                np.full(good.sum(), RADIUS * sample),
            )
            measured = _merged(_merged(fresh, sparse), coarse)
            heights = _fit(grid, measured, heights, pixel_mm, active)
            if debug is not None:
                debug(round(reduction,2), turn, grid, heights, inside, found, good, measured)
    nodes, normals = grid.to_space(heights), grid.normals(heights)
    seen = seen_nodes(nodes, normals, grid.faces(), grid.spacing, cameras)
    inside = distance_inside(nodes, seen, cameras, papers).reshape(grid.shape_rc)
    return SheetSurface(grid, heights, inside, measured, seen, pixel_mm)


def _fit(
    grid: Grid, measured: Measured, start: Floats | None, pixel_mm: float, active: Bools | None = None
) -> Floats:
    at, height = grid.to_grid(measured.points)
    if start is None:
        upright = np.ones(len(height))
    else:
        matrix = interpolation(grid, at)
        upright = matrix @ (grid.normals(start) @ grid.axes[2])
    return fit_heights(
        grid, interpolation(grid, at), height, measured.sigma / np.maximum(upright, 0.1), STIFFNESS / pixel_mm, start, active
    )[0]


def _merged(fine: Measured, coarse: Measured) -> Measured:
    """The fine measurements, and the coarse ones that have none within their reach."""
    if not len(fine.points):
        return coarse
    away = cKDTree(fine.points).query(coarse.points)[0]
    alone = away >= coarse.reach
    return Measured(*(np.concatenate([a, b[alone]]) for a, b in (
        (fine.points, coarse.points), (fine.sigma, coarse.sigma), (fine.reach, coarse.reach))))


def _active(inside: Floats, rim_mm: float) -> Bools:
    """Nodes on the sheet or near its outline; all, where no outline was found."""
    if not np.isfinite(inside).any():
        return np.ones(inside.shape, bool)
    near = np.nan_to_num(inside, nan=-np.inf) > -rim_mm
    return np.asarray(ndimage.binary_closing(near, iterations=3) | near)


def _reduced(photo: Grey, reduction: float) -> Grey:
    if reduction == 1.0:
        return photo
    rows, cols = photo.shape
    size = round(cols / reduction), round(rows / reduction)
    return np.asarray(cv2.resize(photo, size, interpolation=cv2.INTER_AREA))


def _resampled(grid: Grid, heights: Floats, finer: Grid) -> Floats:
    rows, cols = finer.shape_rc
    at = np.mgrid[:rows, :cols] * (finer.spacing / grid.spacing)
    return np.asarray(ndimage.map_coordinates(heights, at, order=1, mode="nearest"))


def sheet_grid(points: Floats, cameras: Sequence[Camera], cells: int) -> Grid:
    """Lay a grid over the points of a sheet, as square to its printed side everywhere as possible."""
    middle = points.mean(axis=0)
    eyes = np.array([-c.rotation.T @ np.ravel(c.translation) for c in cameras])
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
        best = normalize(best + 0.1 * normal[cosine <= np.quantile(cosine, 0.05)].mean(axis=0))
    gain = np.quantile(normal @ best, 0.05) - np.quantile(normal @ up, 0.05)
    return best if gain > 0.15 else up
