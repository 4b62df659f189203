"""Letter boxes in an ink mask, and the direction of text."""

from __future__ import annotations

from dataclasses import dataclass, fields

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from planish.types import Bools, Floats

LEAST_HEIGHT = 4
MOST_HEIGHT = 1 / 12
"""Share of the image's long side; larger components are pictures or shadows."""
MOST_LETTERS = 30_000
"""More are texture, such as wallpaper or gravel."""
NEIGHBOURS = 6
ACROSS = np.radians(3.0)
"""Width of the window of the histogram of neighbour directions."""


@dataclass(frozen=True, eq=False)
class Letters:
    """Bounding boxes of ink components that may be letters, several touching ones, or pieces of a rule.

    Attributes
    ----------
    left, top, right, bottom : (n,) float64 [px]
        Pixel borders: a letter one pixel wide has right - left = 1.
    base : (n,) float64 [px]
        Height at which each stands on its line: the bottom of a letter, the middle of a rule.
    """

    left: Floats
    top: Floats
    right: Floats
    bottom: Floats
    base: Floats

    @property
    def height(self) -> Floats:
        """Height of each box [px]."""
        return np.asarray(self.bottom - self.top)

    @property
    def middle(self) -> Floats:
        """Centre of each box: (n, 2) [px]."""
        return np.stack([self.left + self.right, self.top + self.bottom], axis=1) / 2

    def select(self, which: Bools | NDArray[np.intp]) -> Letters:
        """Return a subset."""
        return Letters(*(getattr(self, one.name)[which] for one in fields(self)))

    def joined_with(self, other: Letters) -> Letters:
        """Return these and the others, which are numbered on."""
        both = (np.concatenate([getattr(self, one.name), getattr(other, one.name)]) for one in fields(self))
        return Letters(*both)

    def rotated_half_turn(self, shape_rc: tuple[int, ...]) -> Letters:
        """The boxes after a half turn of the image, see `WorkingImage.rotated`."""
        rows, cols = (n + 1 for n in shape_rc[:2])
        return Letters(cols - self.right, rows - self.bottom, cols - self.left, rows - self.top, rows - self.base)


def find_letters(ink: Bools) -> Letters:
    """Find components of letter size; dots, accents and punctuation are dropped."""
    _, _, stats, _ = cv2.connectedComponentsWithStats(ink.astype(np.uint8), connectivity=8, ltype=cv2.CV_16U)
    left, top, width, height, area = stats[1:].T.astype(np.float64)
    size = MOST_HEIGHT * max(ink.shape)
    good = (height >= LEAST_HEIGHT) & (height <= size) & (width <= 4 * size) & (area >= 0.08 * width * height)
    good &= (width >= 0.08 * height) & (area >= 6)
    found = Letters(left, top, left + width, top + height, top + height).select(good)
    if len(found.left) > MOST_LETTERS or len(found.left) <= NEIGHBOURS:
        return found.select(np.zeros(0, np.intp))
    return found.select(found.height > 0.5 * _usual_height(found))


def text_direction(letters: Letters) -> float:
    """Angle [rad] of the text lines, clockwise from horizontal, between -90 and 90 degrees.

    Mode of the directions to nearest neighbours, which mostly lie in the same line (docstrum, O'Gorman 1993).
    """
    middle = letters.middle
    _, near = cKDTree(middle).query(middle, k=min(NEIGHBOURS, len(middle)))
    offset = (middle[near[:, 1:]] - middle[:, None]).reshape(-1, 2)
    angles = np.sort(np.arctan2(offset[:, 1], offset[:, 0]) % np.pi)
    around = np.concatenate([angles, angles + np.pi])
    first = np.searchsorted(around, angles)
    count = np.searchsorted(around, angles + ACROSS) - first
    best = int(np.argmax(count))
    angle = float(np.median(around[first[best] : first[best] + count[best]])) % np.pi
    return angle - np.pi if angle > np.pi / 2 else angle


def stroke_direction(grey: NDArray[np.uint8], ink: Bools) -> float:
    """Angle [rad] of most strokes, clockwise from horizontal, between -90 and 90 degrees; 0 without any.

    Mode of the directions across the grey gradient, weighted by its square.
    """
    at = cv2.dilate(ink.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    dx, dy = (cv2.Sobel(grey, cv2.CV_32F, *order)[at] for order in ((1, 0), (0, 1)))
    degree = np.degrees(np.arctan2(-dx, dy)) % 180
    share = np.bincount(degree.astype(int) % 180, dx**2 + dy**2, 180)
    around = np.convolve(np.concatenate([share[-3:], share, share[:3]]), np.ones(7), "valid")
    if around.max() == 0:
        return 0.0
    best = int(np.argmax(around))
    off = (degree - best - 0.5 + 90) % 180 - 90
    near = np.abs(off) < 3
    angle = best + 0.5 + float(np.average(off[near], weights=(dx**2 + dy**2)[near]))
    return float(np.radians(angle - 180 if angle > 90 else angle))


def _usual_height(letters: Letters) -> Floats:
    """Median height of the neighbours of each letter."""
    _, near = cKDTree(letters.middle).query(letters.middle, k=min(12, len(letters.left)))
    return np.asarray(np.median(letters.height[near], axis=1))
