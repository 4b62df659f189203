"""The outline of a whole sheet on a photo: four corners and the four sides between them."""

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
"""Of the picture that the outline is sought in [px]."""
RIM = 2
"""Pixels of that picture."""
REACHES = 0.1
"""Of the rim, that a whole sheet may reach: more is a sheet that the photo cuts off."""
COLOUR = 2.0
"""A step in colour counts so much more than one in brightness: shadows change only this."""
LEAST_AREA = 0.08
"""Of the photo, that a sheet covers."""
FULL = 0.88
"""Part of the quadrilateral between its corners that a sheet covers, and the other way round, however it is bent."""
SMOOTH = 0.012
"""Rms distance of a side from a smooth curve, in parts of its length."""
PER_SIDE = 60
"""Places taken from each."""
CORNER = 0.03
"""Part of a side at its ends that is left out: corners are rounded by the smoothing."""
BRIGHTER = 12.0
"""By so much [levels of 255] what lies inside of a side differs from what lies outside."""
TILED = 40
"""Vertices of the hull that corners are chosen from."""


@dataclass(frozen=True, eq=False)
class Borders:
    """The sides of a sheet on the photo.

    Attributes
    ----------
    sides : tuple of four (k, 2) float64 [photo px]
        Top, right, bottom and left, each in clockwise order; top as the text reads, or as the photo shows it.
    doubt_px : float [photo px]
        How far off its side a place usually is found: a pixel of the small picture that it is sought in.
    """

    sides: tuple[Floats, Floats, Floats, Floats]
    doubt_px: float

    @property
    def angle(self) -> float:
        """Direction of the top and bottom sides, from left to right [rad]."""
        top, _, bottom, _ = self.sides
        way = top[-1] - top[0] + bottom[0] - bottom[-1]
        return float(np.arctan2(way[1], way[0]))


def borders_in(photo: Pixels, lines: TextLines | None) -> Borders | None:
    """Find the outline of the sheet: None where there is none that has four sides.

    The photo is divided in two by a watershed (Meyer 1991) on its smoothed brightness and colour, from the text, or
    the middle of the photo, and from the photo's rim.
    """
    small, step = _small(photo)
    inside = _divided(small, lines, step)
    outline = _outline(inside)
    if outline is None:
        return None
    corners = _corners(outline)
    if corners is None or not _covers(corners, inside):
        return None
    sides = [_side(outline, corners[k], corners[(k + 1) % 4]) for k in range(4)]
    if not all(_is_smooth(side) and _differs(small, side) for side in sides):
        return None
    first = _top(corners, 0.0 if lines is None else lines.angle)
    on_photo = [(side + 0.5) * step - 0.5 for side in sides]
    top, right, bottom, left = (on_photo[(first + k) % 4] for k in range(4))
    return Borders((top, right, bottom, left), step)


def _small(photo: Pixels) -> tuple[NDArray[np.uint8], float]:
    """The photo small, in Lab, its colours stretched; and photo pixels in one of its own."""
    step = max(1.0, max(photo.shape[:2]) / LONG_SIDE)
    size = (max(8, round(photo.shape[1] / step)), max(8, round(photo.shape[0] / step)))
    rough = max(1, int(step / 3))
    part = to_uint8(photo[::rough, ::rough])  # averaging every pixel of 48 million takes longer than all the rest
    small = cv2.resize(np.ascontiguousarray(part), size, interpolation=cv2.INTER_AREA)
    lab = cv2.cvtColor(cv2.medianBlur(small, 5), cv2.COLOR_RGB2LAB).astype(np.float32)
    lab[..., 1:] = 128 + COLOUR * (lab[..., 1:] - 128)
    return np.clip(lab, 0, 255).astype(np.uint8), step


def _divided(small: NDArray[np.uint8], lines: TextLines | None, step: float) -> Bools:
    """What belongs to the text, or to the middle of the photo, rather than to its rim."""
    rows, cols = small.shape[:2]
    markers = np.zeros((rows, cols), np.int32)
    if lines is None:
        cv2.ellipse(markers, (cols // 2, rows // 2), (cols // 8, rows // 8), 0, 0, 360, 1, -1)
    else:
        hull = cv2.convexHull((lines.photo_xy / step).astype(np.float32)).astype(np.int32)
        cv2.fillConvexPoly(markers, hull, 1)
    markers[_ground(small, markers == 1) & (markers == 0)] = 2
    smooth = cv2.bilateralFilter(small, 7, 30, 3)
    cv2.watershed(smooth, markers)
    return np.asarray(markers == 1)


def _ground(small: NDArray[np.uint8], sheet: Bools) -> Bools:
    """The photo's rim, but for where a corner of the sheet, or a little of one side, reaches it."""
    rim = np.ones(sheet.shape, bool)
    rim[RIM:-RIM, RIM:-RIM] = False
    paper, ground = np.median(small[sheet], axis=0), np.median(small[rim], axis=0)
    from_paper = np.linalg.norm(small - paper, axis=2)
    alike = rim & (from_paper < 0.5 * np.linalg.norm(ground - paper))
    if alike.sum() > REACHES * rim.sum():
        return rim
    return rim & ~cv2.dilate(alike.astype(np.uint8), np.ones((4 * RIM + 1,) * 2, np.uint8)).astype(bool)


def _outline(inside: Bools) -> Floats | None:
    """The outer border of the largest part: (n, 2), clockwise as it is seen."""
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
    """Four places of the outline with the greatest quadrilateral between them: (4, 2), in the outline's order."""
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


def _side(outline: Floats, begin: Floats, end: Floats) -> Floats:
    """Evenly spaced places of the outline between two corners, these left out."""
    i, j = (int(np.argmin(((outline - corner) ** 2).sum(axis=1))) for corner in (begin, end))
    part = outline[i : j + 1] if j > i else np.concatenate([outline[i:], outline[: j + 1]])
    away = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(part, axis=0), axis=1))])
    at = np.linspace(CORNER, 1 - CORNER, PER_SIDE) * away[-1]
    even = np.stack([np.interp(at, away, part[:, k]) for k in (0, 1)], axis=1)
    kernel = np.ones(3) / 3
    even[1:-1] = np.stack([np.convolve(even[:, k], kernel, "valid") for k in (0, 1)], axis=1)
    return even


def _is_smooth(side: Floats) -> bool:
    """Whether a side lies close to a curve of six numbers over its chord."""
    chord = side[-1] - side[0]
    length = float(np.linalg.norm(chord))
    if length < 20:
        return False
    along = (side - side[0]) @ chord / length**2
    off = (side - side[0]) @ np.array([-chord[1], chord[0]]) / length**2
    left = off - np.polyval(np.polyfit(along, off, 5), along)
    return bool(np.sqrt((left**2).mean()) < SMOOTH and np.abs(off).max() < 0.25)


def _differs(small: NDArray[np.uint8], side: Floats) -> bool:
    """Whether inside and outside of a side look different along most of it."""
    way = np.gradient(side, axis=0)
    out = normalize(np.stack([way[:, 1], -way[:, 0]], axis=1))
    inner, outer = (_colours(small, side + sign * 5 * out) for sign in (-1, 1))
    seen = np.isfinite(outer[:, 0]) & np.isfinite(inner[:, 0])
    if seen.sum() < 0.3 * len(side):
        return False
    return bool(np.median(np.linalg.norm(inner - outer, axis=1)[seen]) > BRIGHTER)


def _colours(small: NDArray[np.uint8], xy: Floats) -> Floats:
    """Of the nearest pixels; NaN beside the photo."""
    x, y = np.rint(xy).astype(int).T
    on = (x >= 0) & (y >= 0) & (x < small.shape[1]) & (y < small.shape[0])
    colour = small[np.clip(y, 0, small.shape[0] - 1), np.clip(x, 0, small.shape[1] - 1)].astype(np.float64)
    return np.where(on[:, None], colour, np.nan)


def _top(corners: Floats, angle: float) -> int:
    """Number of the side, from corner k to the next, that runs most along the lines of text, from left to right."""
    way = np.roll(corners, -1, axis=0) - corners
    along = way @ np.array([np.cos(angle), np.sin(angle)])
    return int(np.argmax(along / np.linalg.norm(way, axis=1)))
