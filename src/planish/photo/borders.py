"""Detect the outline of a whole sheet on a photo: four corners and the sides between them."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import cv2
import numpy as np
from numpy.typing import NDArray

from planish.color import to_uint8
from planish.geometry.guards import normalize
from planish.photo.lines import TextLines
from planish.types import Bools, Floats, Pixels

LONG_SIDE = 560
"""Long side of the downsampled image for segmentation [px]."""
RIM = 2
"""Width of the image rim, in its pixels."""
REACHES = 0.1
"""Largest share of the rim that a whole sheet may touch; beyond it the sheet is cropped."""
COLOUR = 2.0
"""Weight of chroma against lightness: shadows change lightness only."""
LEAST_AREA = 0.08
"""Least share of the photo covered by the sheet."""
FULL = 0.88
"""Least overlap of the sheet and the quadrilateral of its corners, relative to either."""
SMOOTH = 0.012
"""Largest rms distance of a side from a smooth curve, relative to its length."""
PER_SIDE = 60
"""Positions sampled per side."""
CORNER = 0.03
"""Share of a side dropped at each end: smoothing rounds corners."""
BRIGHTER = 12.0
"""Least difference between the inside and outside of a side [levels of 255]."""
TILED = 40
"""Most vertices of the hull from which corners are chosen."""


@dataclass(frozen=True, eq=False)
class Borders:
    """Sides of a sheet on the photo.

    Attributes
    ----------
    sides : tuple of four (k, 2) float64 [photo px]
        Top, right, bottom and left, each in clockwise order; top as the text reads, or as the photo shows it.
    sigma_px : float [photo px]
        Standard deviation of a position across its side: a pixel of the downsampled image.
    """

    sides: tuple[Floats, Floats, Floats, Floats]
    sigma_px: float

    @property
    def angle(self) -> float:
        """Direction of the top and bottom sides, from left to right [rad]."""
        top, _, bottom, _ = self.sides
        along_side = top[-1] - top[0] + bottom[0] - bottom[-1]
        return float(np.arctan2(along_side[1], along_side[0]))


def find_borders(photo: Pixels, lines: TextLines | None) -> Borders | None:
    """Detect the outline of the sheet; None if there is none with four sides.

    A watershed (Meyer 1991) on smoothed lightness and chroma, seeded by the text (or the centre of the photo) and by
    the photo's rim.
    """
    small, step = _small(photo)
    inside = _segment(small, lines, step)
    outline = _outline(inside)
    if outline is None:
        return None
    corners = _corners(outline)
    if corners is None or not _covers(corners, inside):
        return None
    sides = [_sample_side(outline, corners[k], corners[(k + 1) % 4]) for k in range(4)]
    if not all(_is_smooth(side) and _has_contrast(small, side) for side in sides):
        return None
    first = _top_side(corners, 0.0 if lines is None else lines.angle)
    on_photo = [(side + 0.5) * step - 0.5 for side in sides]
    top, right, bottom, residual = (on_photo[(first + k) % 4] for k in range(4))
    return Borders((top, right, bottom, residual), step)


def _small(photo: Pixels) -> tuple[NDArray[np.uint8], float]:
    """Downsampled photo in Lab with chroma amplified, and its pixel size [photo px]."""
    step = max(1.0, max(photo.shape[:2]) / LONG_SIDE)
    size = (max(8, round(photo.shape[1] / step)), max(8, round(photo.shape[0] / step)))
    rough = max(1, int(step / 3))
    part = to_uint8(photo[::rough, ::rough])  # averaging 48 million pixels would take most of the time
    small = cv2.resize(np.ascontiguousarray(part), size, interpolation=cv2.INTER_AREA)
    lab = cv2.cvtColor(cv2.medianBlur(small, 5), cv2.COLOR_RGB2LAB).astype(np.float32)
    lab[..., 1:] = 128 + COLOUR * (lab[..., 1:] - 128)
    return np.clip(lab, 0, 255).astype(np.uint8), step


def _segment(small: NDArray[np.uint8], lines: TextLines | None, step: float) -> Bools:
    """Segment the sheet: what belongs to the text, or the centre of the photo, rather than to its rim."""
    rows, cols = small.shape[:2]
    markers = np.zeros((rows, cols), np.int32)
    if lines is None:
        cv2.ellipse(markers, (cols // 2, rows // 2), (cols // 8, rows // 8), 0, 0, 360, 1, -1)
    else:
        hull = cv2.convexHull((lines.photo_xy / step).astype(np.float32)).astype(np.int32)
        cv2.fillConvexPoly(markers, hull, 1)
    markers[_background(small, markers == 1) & (markers == 0)] = 2
    smooth = cv2.bilateralFilter(small, 7, 30, 3)
    cv2.watershed(smooth, markers)
    return np.asarray(markers == 1)


def _background(small: NDArray[np.uint8], sheet: Bools) -> Bools:
    """Background marker: the photo's rim except where the sheet touches it."""
    rim = np.ones(sheet.shape, bool)
    rim[RIM:-RIM, RIM:-RIM] = False
    paper_level, ground = np.median(small[sheet], axis=0), np.median(small[rim], axis=0)
    from_paper = np.linalg.norm(small - paper_level, axis=2)
    alike = rim & (from_paper < 0.5 * np.linalg.norm(ground - paper_level))
    if alike.sum() > REACHES * rim.sum():
        return rim
    return rim & ~cv2.dilate(alike.astype(np.uint8), np.ones((4 * RIM + 1,) * 2, np.uint8)).astype(bool)


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


def _is_smooth(side: Floats) -> bool:
    """Whether a side is close to a polynomial of degree 5 over its chord."""
    chord = side[-1] - side[0]
    length = float(np.linalg.norm(chord))
    if length < 20:
        return False
    along = (side - side[0]) @ chord / length**2
    offset = (side - side[0]) @ np.array([-chord[1], chord[0]]) / length**2
    residual = offset - np.polyval(np.polyfit(along, offset, 5), along)
    return bool(np.sqrt((residual**2).mean()) < SMOOTH and np.abs(offset).max() < 0.25)


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
