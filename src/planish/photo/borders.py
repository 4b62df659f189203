"""Detect the outline of the sheet on a photo: four corners and the sides between them, each judged by itself."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations

import cv2
import numpy as np
from numpy.typing import NDArray

from planish.geometry.guards import normalize
from planish.photo.gutter import Gutter
from planish.photo.sheet_region import SheetRegion
from planish.types import Bools, Floats

LEAST_AREA = 0.08
"""Least share of the photo covered by the sheet."""
FULL = 0.75
"""Least overlap of the sheet and the quadrilateral of its corners, relative to either."""
SMOOTH = 0.012
"""Largest rms distance of a side from a smooth curve, relative to its length."""
SHORTEST = 20.0
"""Length of the shortest side [px of the downsampled image]."""
BOWED = 0.25
"""Largest distance of a side from its chord, relative to that."""
MOST_OF_IT = 0.6
"""Least share of a side that must follow a smooth curve: a folded corner or a finger costs the rest."""
PER_SIDE = 60
"""Positions sampled per side."""
CORNER = 0.03
"""Share of a side dropped at each end: smoothing rounds corners."""
BRIGHTER = 12.0
"""Least difference between the inside and outside of a side [levels of 255]."""
AT_RIM = 3.0
"""Distance from the photo's edge within which the sheet is cut off by it [px of the downsampled image]."""
TILED = 40
"""Most vertices of the hull from which corners are chosen."""
NAMES = ("top", "right", "bottom", "left")


@dataclass(frozen=True, eq=False)
class Borders:
    """Outline and sides of a sheet on the photo.

    Attributes
    ----------
    sides : sequence of four (k, 2) float64 [photo px]
        Top, right, bottom and left, each in clockwise order; top as the text reads, or as the photo shows it. Of a
        plain side only what is smooth.
    plain : sequence of four bool
        Whether a side is the sheet's edge, seen on most of its length.
    cropped : sequence of four bool
        Whether the photo's edge cuts the sheet off there.
    outline : (n, 2) float64 [photo px]
        Of all that belongs to the sheet.
    sigma_px : float [photo px]
        Standard deviation of a position across its side: a pixel of the downsampled image.
    """

    sides: Sequence[Floats]
    plain: Sequence[bool]
    cropped: Sequence[bool]
    outline: Floats
    sigma_px: float

    @property
    def angle(self) -> float:
        """Direction of the top and bottom sides, from left to right [rad]."""
        top, _, bottom, _ = self.sides
        along_side = top[-1] - top[0] + bottom[0] - bottom[-1]
        return float(np.arctan2(along_side[1], along_side[0]))


def find_borders(regions: Iterable[SheetRegion], angle: float, gutter: Gutter | None = None) -> Borders | None:
    """Detect the outline of the sheet; None if there is none with four corners.

    Every side is judged by itself: it is plain if most of it is smooth and differs from what lies outside. Of the
    segmentations that with most plain sides is taken, the first if several have as many.

    Parameters
    ----------
    regions : iterable of SheetRegion
        See `sheet_regions`; the next is asked for only while a side is not plain.
    angle : float [rad]
        Direction of the text on the photo: the top side is the most parallel to it.
    gutter : Gutter, optional
        Where another page follows: that is no side.
    """
    best = None
    for region in regions:
        found = _borders_of(region, angle, gutter)
        if found is not None and (best is None or sum(found.plain) > sum(best.plain)):
            best = found
        if best is not None and all(best.plain):
            break
    return best


def _borders_of(region: SheetRegion, angle: float, gutter: Gutter | None) -> Borders | None:
    """The sides of a region."""
    outline = _outline(region.inside)
    if outline is None:
        return None
    corners = _corners(outline)
    if corners is None:
        return None
    whole = _covers(corners, region.inside)
    sampled = [_sample_side(outline, corners[k], corners[(k + 1) % 4]) for k in range(4)]
    on_rim = [_on_rim(side, region.inside.shape) for side in sampled]
    first = _top_side(corners, angle)
    sides, plain, cropped = [], [], []
    for k in range(first, first + 4):
        side, rim = sampled[k % 4], on_rim[k % 4]
        smooth = _smooth_part(side, rim | _on_gutter(region, side, gutter)) if whole else None
        plain.append(smooth is not None and _has_contrast(region.small, smooth))
        cropped.append(bool(rim.mean() > 0.5))
        sides.append(region.to_photo(side if smooth is None else smooth))
    return Borders(tuple(sides), tuple(plain), tuple(cropped), region.to_photo(outline), region.step)


def _outline(inside: Bools) -> Floats | None:
    """Outer contour of the largest region: (n, 2), clockwise on the image."""
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (7, 7))
    whole = cv2.morphologyEx(inside.astype(np.uint8), cv2.MORPH_OPEN, kernel)
    found, _ = cv2.findContours(whole, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    if not found:
        return None
    largest = max(found, key=cv2.contourArea)
    if cv2.contourArea(largest) < LEAST_AREA * inside.size:
        return None
    outline = largest[:, 0].astype(np.float64)
    return outline if cv2.contourArea(largest, oriented=True) > 0 else outline[::-1]


def _corners(outline: Floats) -> Floats | None:
    """Four points of the outline that span the largest quadrilateral: (4, 2), in the outline's order."""
    hull = cv2.convexHull(outline.astype(np.float32), clockwise=False)
    length = cv2.arcLength(hull, True)
    for tolerance in (0.004, 0.008, 0.016, 0.03):
        few = cv2.approxPolyDP(hull, tolerance * length, True)[:, 0].astype(np.float64)
        if len(few) <= TILED:
            break
    if not 4 <= len(few) <= TILED:
        return None
    if cv2.contourArea(few.astype(np.float32), oriented=True) < 0:
        few = few[::-1]
    four = np.array(list(combinations(range(len(few)), 4)))
    a, b, c, d = (few[four[:, k]] for k in range(4))
    across, other = c - a, d - b
    area = across[:, 0] * other[:, 1] - across[:, 1] * other[:, 0]
    return np.asarray(few[four[int(np.argmax(area))]])


def _covers(corners: Floats, inside: Bools) -> bool:
    quad = np.zeros(inside.shape, np.uint8)
    cv2.fillConvexPoly(quad, corners.astype(np.int32), 1)
    both = float((inside & (quad > 0)).sum())
    return both > FULL * inside.sum() and both > FULL * quad.sum()


def _sample_side(outline: Floats, begin: Floats, end: Floats) -> Floats:
    """Evenly spaced positions of the outline between two corners, without these."""
    i, j = (int(np.argmin(((outline - corner) ** 2).sum(axis=1))) for corner in (begin, end))
    part = outline[i : j + 1] if j > i else np.concatenate([outline[i:], outline[: j + 1]])
    away = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(part, axis=0), axis=1))])
    at = np.linspace(CORNER, 1 - CORNER, PER_SIDE) * away[-1]
    evenly_spaced = np.stack([np.interp(at, away, part[:, k]) for k in (0, 1)], axis=1)
    kernel = np.ones(3) / 3
    evenly_spaced[1:-1] = np.stack([np.convolve(evenly_spaced[:, k], kernel, "valid") for k in (0, 1)], axis=1)
    return evenly_spaced


def _on_rim(side: Floats, shape_rc: tuple[int, ...]) -> Bools:
    """Which positions of a side lie on the photo's edge: the sheet goes on beyond."""
    rows, cols = shape_rc[:2]
    return np.asarray(((side < AT_RIM) | (side > np.array([cols, rows]) - 1 - AT_RIM)).any(axis=1))


def _on_gutter(region: SheetRegion, side: Floats, gutter: Gutter | None) -> Bools:
    """Which positions of a side lie where the page was parted from the facing one."""
    if gutter is None:
        return np.zeros(len(side), bool)
    away = np.abs((region.to_photo(side) - gutter.point) @ gutter.across)
    return np.asarray(away < (1 + AT_RIM) * region.step)


def _smooth_part(side: Floats, cut_off: Bools) -> Floats | None:
    """The part of a side that is close to a polynomial over its chord; None if that is too little.

    Of degree 5 through all of it, or of degree 3 through most of it (least absolute deviations).
    """
    chord = side[-1] - side[0]
    length = float(np.linalg.norm(chord))
    free = ~cut_off
    if length < SHORTEST or free.mean() < MOST_OF_IT:
        return None
    along = (side - side[0]) @ chord / length**2
    offset = (side - side[0]) @ np.array([-chord[1], chord[0]]) / length**2
    if np.abs(offset).max() > BOWED:
        return None
    if free.all() and np.sqrt(((offset - np.polyval(np.polyfit(along, offset, 5), along)) ** 2).mean()) < SMOOTH:
        return side
    weight = free.astype(float)
    for _ in range(20):
        away = np.abs(offset - np.polyval(np.polyfit(along, offset, 3, w=np.sqrt(weight)), along))
        weight = free / np.maximum(away, 0.1 * SMOOTH)
    near = free & (away < SMOOTH)
    return side[near] if near.mean() > MOST_OF_IT else None


def _has_contrast(small: NDArray[np.uint8], side: Floats) -> bool:
    """Whether inside and outside differ along most of a side."""
    along_side = np.gradient(side, axis=0)
    outward = normalize(np.stack([along_side[:, 1], -along_side[:, 0]], axis=1))
    inner, outer = (_colours(small, side + sign * 5 * outward) for sign in (-1, 1))
    seen = np.isfinite(outer[:, 0]) & np.isfinite(inner[:, 0])
    if seen.sum() < 0.3 * len(side):
        return False
    return bool(np.median(np.linalg.norm(inner - outer, axis=1)[seen]) > BRIGHTER)


def _colours(small: NDArray[np.uint8], xy: Floats) -> Floats:
    """Colours of the nearest pixels; NaN outside of the photo."""
    x, y = np.rint(xy).astype(int).T
    on = (x >= 0) & (y >= 0) & (x < small.shape[1]) & (y < small.shape[0])
    colour = small[np.clip(y, 0, small.shape[0] - 1), np.clip(x, 0, small.shape[1] - 1)].astype(np.float64)
    return np.where(on[:, None], colour, np.nan)


def _top_side(corners: Floats, angle: float) -> int:
    """Index of the side, from corner k to the next, most parallel to the text direction."""
    along_side = np.roll(corners, -1, axis=0) - corners
    along = along_side @ np.array([np.cos(angle), np.sin(angle)])
    return int(np.argmax(along / np.linalg.norm(along_side, axis=1)))
