"""A sheet that stands out from the plane it lies on, by its shape alone: on white tables, or without colours."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from planish.document.rim import DIRECTIONS
from planish.document.top_view import TopView, top_view
from planish.geometry.guards import TINY, TINY_MM, normalize
from planish.mesh import area_vectors
from planish.types import Bools, Floats, Scan

TRIES = 300
SAMPLE = 4000
NEAR_PLANE = 0.004
"""Part of the scan's extent within which points lie in a plane: 2 mm over 500 mm."""

MIN_GROUND = 0.3
"""Part of the view from above that the plane must fill in one piece."""

MIN_SHEET = 0.02
"""Part of that view that the sheet must fill."""

MIN_BESIDE = 0.8
"""Part of the sheet's rim that must have the plane beside it, or a gap that nobody saw and the plane behind it."""

MIN_AROUND = 0.95
"""Part of all directions from the middle of the sheet in which the plane must lie beyond it: a table that is larger
than its sheet has all of them, a comb's other teeth, beside one that stands up, half."""

STEEP = 0.5
"""Cosine of 60 degrees: faces steeper than that hang between a sheet and its table, or are the side of a box."""

MIN_STEEP = 0.94
"""Part of the rim that must end in steep faces or gaps: 0.96 to 0.99 for a crumpled sheet that touches its table
hardly anywhere, 0.72 for a letter of which one third lies flat, of which only the rest would be found. A bump within a
sheet has slopes of 20 to 50 degrees. A tongue cut into a sheet, four times as long as wide, has 0.915."""

MAX_SLENDER = 4.0
"""Greatest length of the sheet in its mean widths. The rim of a longer strip, cut into a sheet and standing up, is
steep but for its short ends: 0.95 for a tongue seven times as long as wide. Halved, letters are hardly found."""

MAYBE_STEEP = 0.25
"""From this part of the rim on something may be a sheet on a table, which is told: 0.28 for a Miura fold, 0.33 for a
wave and 0.35 for a spread, which meet their table at gentle slopes on the other sides; hills in a bare sheet have none.
Halved, nothing changes; doubled, these three are not told."""

GAP_PX = 120
"""Greatest width of a gap that nobody saw, behind a box or a raised rim: 200 mm of a table of 1.3 m."""

RIM_PX = 4
"""Width of the rim in which these are looked for."""


@dataclass(frozen=True, eq=False)
class Raised:
    """What stands out of the dominant plane of a scan.

    Attributes
    ----------
    view : TopView
        Along the normal of the plane.
    mask : (rows, cols) bool
        In that view.
    ends_in_steps : bool
        Whether it ends in steps all around, with the plane beyond them. Otherwise it may as well be a part of one
        surface.
    slender : bool
        Whether it is so long that it may be a strip which hangs on the rest by its short ends.
    above : (n,) bool
        Points of the scan above the plane.
    normal : (3,) float64
        Of the plane, upwards.
    tolerance_mm : float
        Within which points lie in a plane.
    """

    view: TopView
    mask: Bools
    ends_in_steps: bool
    slender: bool
    above: Bools
    normal: Floats
    tolerance_mm: float

    @property
    def plain(self) -> bool:
        """Whether it ends as a sheet that touches its table hardly anywhere."""
        return self.ends_in_steps and not self.slender


def raised_sheet(scan: Scan) -> Raised | None:
    """Find the largest thing that stands out of the dominant plane of a scan and is surrounded by it.

    The plane must be one piece, lie beyond the thing on all sides, and begin beside its rim; gaps count as steps down
    to it only where they are holes in what was seen: those between the teeth of a comb, which are open to the outside,
    are not. Of a sheet alone only a part with steps around nearly all of it, as the lid of a box folded from it, would
    pass for plain. None where there is no such thing.
    """
    points = np.where(np.isfinite(scan.mesh.points), scan.mesh.points, np.nan)
    if not (len(scan.mesh.faces) and np.isfinite(points).all(axis=1).any()):
        return None
    plane = dominant_plane(points[scan.mesh.faces[:, 0]], NEAR_PLANE * _extent(points))
    if plane is None:
        return None
    middle, normal, noise = plane
    if np.nansum(area_vectors(points, scan.mesh.faces) @ normal) < 0:
        normal = -normal
    view = top_view(scan, normal)
    seen = view.face >= 0
    height = np.full(view.face.shape, np.nan)
    corner = scan.mesh.faces[view.face[seen]]
    w = view.weights[seen].astype(np.float64)
    height[seen] = (np.column_stack([1 - w.sum(axis=1), w]) * ((points - middle) @ normal)[corner]).sum(axis=1)
    tolerance = max(3 * noise, 0.5 * NEAR_PLANE * _extent(points), TINY_MM)
    upright = np.zeros(seen.shape)
    upright[seen] = np.abs(normalize(area_vectors(points, scan.mesh.faces)) @ normal)[view.face[seen]]
    ground = _largest_piece(seen & (np.abs(height) < tolerance))
    if ground.sum() < MIN_GROUND * seen.sum():
        return None
    mask = _largest_inside(seen & (np.nan_to_num(height) > 2 * tolerance), seen)
    if mask is None or mask.sum() < MIN_SHEET * seen.sum() or _share_beyond(ground, mask) < MIN_AROUND:
        return None
    hidden = np.asarray(ndimage.binary_fill_holes(seen)) & ~seen
    steps, beside = _shares_of_rim(mask, ground, hidden | (seen & (upright < STEEP)))
    if steps < MAYBE_STEEP:
        return None
    away = (points - middle) @ normal
    below = away < -2 * tolerance  # a floor under the table is not the sheet above it
    return Raised(
        replace(view, places=np.where(below[:, None], np.nan, view.places)),
        mask,
        ends_in_steps=steps >= MIN_STEEP and beside >= MIN_BESIDE,
        slender=_slenderness(mask) > MAX_SLENDER,
        above=away > 2 * tolerance,
        normal=normal,
        tolerance_mm=tolerance,
    )


def _extent(points: Floats) -> float:
    finite = points[np.isfinite(points).all(axis=1)]
    return float(np.linalg.norm(np.quantile(finite, 0.99, axis=0) - np.quantile(finite, 0.01, axis=0)))


def dominant_plane(points: Floats, near: float) -> tuple[Floats, Floats, float] | None:
    """The plane with most points near it [mm] (RANSAC), fitted to these: a point, its normal, and their scatter."""
    points = points[np.isfinite(points).all(axis=1)]
    points = points[:: 1 + len(points) // SAMPLE]
    if len(points) < 100:
        return None
    rng = np.random.default_rng(0)
    best, used = 0, np.zeros(len(points), bool)
    for _ in range(TRIES):
        a, b, c = points[rng.choice(len(points), 3, replace=False)]
        normal = np.cross(b - a, c - a)
        length = float(np.linalg.norm(normal))
        if length < TINY:
            continue
        within = np.abs((points - a) @ normal) < near * length
        if within.sum() > best:
            best, used = int(within.sum()), within
    if best < 3:
        return None
    middle = points[used].mean(axis=0)
    normal = np.linalg.svd(points[used] - middle, full_matrices=False)[2][2]
    residual = (points[used] - middle) @ normal
    return middle, np.asarray(normal), 1.4826 * float(np.median(np.abs(residual - np.median(residual))))


def _largest_inside(raised: Bools, seen: Bools) -> Bools | None:
    """The largest raised region that does not reach the border of the view; its holes filled."""
    whole = cv2.morphologyEx(seen.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((41, 41), np.uint8))
    outside = ndimage.binary_dilation(~ndimage.binary_fill_holes(np.pad(whole > 0, 1)), iterations=3)[1:-1, 1:-1]
    closed = cv2.morphologyEx(raised.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
    _, label, stats, _ = cv2.connectedComponentsWithStats(closed)
    reaches = np.unique(label[outside])
    for k in np.argsort(-stats[:, cv2.CC_STAT_AREA]):
        if k and k not in reaches:
            return np.asarray(ndimage.binary_fill_holes(label == k))
    return None


def _largest_piece(region: Bools) -> Bools:
    _, label, stats, _ = cv2.connectedComponentsWithStats(region.astype(np.uint8))
    if len(stats) < 2:
        return region
    return np.asarray(label == 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA])))


def _share_beyond(ground: Bools, mask: Bools) -> float:
    """Part of all directions from the middle of a region in which ground lies beyond its farthest pixel."""
    middle = np.argwhere(mask).mean(axis=0)

    def farthest(region: Bools) -> Floats:
        away = np.argwhere(region) - middle
        sector = (np.arctan2(away[:, 0], away[:, 1]) / (2 * np.pi) + 0.5) * DIRECTIONS
        out = np.zeros(DIRECTIONS)
        np.maximum.at(out, sector.astype(int) % DIRECTIONS, np.hypot(away[:, 0], away[:, 1]))
        return out

    return float((farthest(ground) > farthest(mask) + RIM_PX).mean())


def _slenderness(mask: Bools) -> float:
    """Length of a region in its mean widths."""
    length = max(cv2.minAreaRect(np.argwhere(mask).astype(np.float32))[1])
    return float(length**2 / mask.sum())


def _shares_of_rim(mask: Bools, ground: Bools, steep: Bools) -> tuple[float, float]:
    """Parts of a region's rim that are a step, and that have the ground beside them, or behind a gap."""
    kernel = np.ones((2 * RIM_PX + 1, 2 * RIM_PX + 1), np.uint8)
    rim = mask & ~ndimage.binary_erosion(mask)
    near_steep = cv2.dilate(steep.astype(np.uint8), kernel) > 0
    reach: NDArray[np.uint8] = np.ones((2 * GAP_PX + 1, 2 * GAP_PX + 1), np.uint8)
    near_ground = cv2.dilate(ground.astype(np.uint8), kernel) > 0
    behind_gap = near_steep & (cv2.dilate(ground.astype(np.uint8), reach) > 0)
    return float(near_steep[rim].mean()), float((near_ground | behind_gap)[rim].mean())
