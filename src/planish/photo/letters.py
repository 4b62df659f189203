"""Letter boxes in an ink mask, and the direction of text."""

from __future__ import annotations

from dataclasses import dataclass

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
    """Bounding boxes of ink components that may be letters, or several touching ones.

    Attributes
    ----------
    left, top, right, bottom : (n,) float64 [px]
        Pixel borders: a letter one pixel wide has right - left = 1.
    """

    left: Floats
    top: Floats
    right: Floats
    bottom: Floats

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
        return Letters(self.left[which], self.top[which], self.right[which], self.bottom[which])


def find_letters(ink: Bools) -> Letters:
    """Find components of letter size; dots, accents and punctuation are dropped."""
    _, _, stats, _ = cv2.connectedComponentsWithStats(ink.astype(np.uint8), connectivity=8, ltype=cv2.CV_16U)
    left, top, width, height, area = stats[1:].T.astype(np.float64)
    size = MOST_HEIGHT * max(ink.shape)
    good = (height >= LEAST_HEIGHT) & (height <= size) & (width <= 4 * size) & (area >= 0.08 * width * height)
    good &= (width >= 0.08 * height) & (area >= 6)
    found = Letters(left, top, left + width, top + height).select(good)
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


def _usual_height(letters: Letters) -> Floats:
    """Median height of the neighbours of each letter."""
    _, near = cKDTree(letters.middle).query(letters.middle, k=min(12, len(letters.left)))
    return np.asarray(np.median(letters.height[near], axis=1))
