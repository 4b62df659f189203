"""Letters in a picture of ink, and the way in which their lines run."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from planish.types import Bools, Floats

LEAST_HEIGHT = 4
MOST_HEIGHT = 1 / 12
"""Of the picture's long side: larger ink is a picture or a shadow."""
MOST_LETTERS = 30_000
"""Wallpaper and gravel have more."""
NEIGHBOURS = 6
ACROSS = np.radians(3.0)
"""Width of the window in which the neighbours' directions are counted."""


@dataclass(frozen=True, eq=False)
class Letters:
    """Boxes around pieces of ink that may be letters, or several that touch.

    Attributes
    ----------
    left, top, right, bottom : (n,) float64 [px]
        Borders of the pixels: a letter one pixel wide has right - left = 1.
    """

    left: Floats
    top: Floats
    right: Floats
    bottom: Floats

    @property
    def height(self) -> Floats:
        """Of each box [px]."""
        return np.asarray(self.bottom - self.top)

    @property
    def middle(self) -> Floats:
        """Of each box: (n, 2) [px]."""
        return np.stack([self.left + self.right, self.top + self.bottom], axis=1) / 2

    def only(self, which: Bools | NDArray[np.intp]) -> Letters:
        """Some of them."""
        return Letters(self.left[which], self.top[which], self.right[which], self.bottom[which])


def letters_in(ink: Bools) -> Letters:
    """Box all ink of a letter's size; dots, accents and punctuation are left out."""
    _, _, stats, _ = cv2.connectedComponentsWithStats(ink.astype(np.uint8), connectivity=8, ltype=cv2.CV_16U)
    left, top, width, height, area = stats[1:].T.astype(np.float64)
    size = MOST_HEIGHT * max(ink.shape)
    good = (height >= LEAST_HEIGHT) & (height <= size) & (width <= 4 * size) & (area >= 0.08 * width * height)
    good &= (width >= 0.08 * height) & (area >= 6)
    found = Letters(left, top, left + width, top + height).only(good)
    if len(found.left) > MOST_LETTERS or len(found.left) <= NEIGHBOURS:
        return found.only(np.zeros(0, np.intp))
    return found.only(found.height > 0.5 * _usual_height(found))


def direction(letters: Letters) -> float:
    """Angle [rad] of the lines, clockwise from level, between -90 and 90 degrees.

    Most letters' nearest neighbours are those before and after them in their line (O'Gorman 1993): of the directions
    to some nearest neighbours the commonest counts.
    """
    middle = letters.middle
    _, near = cKDTree(middle).query(middle, k=min(NEIGHBOURS, len(middle)))
    way = (middle[near[:, 1:]] - middle[:, None]).reshape(-1, 2)
    angles = np.sort(np.arctan2(way[:, 1], way[:, 0]) % np.pi)
    around = np.concatenate([angles, angles + np.pi])
    first = np.searchsorted(around, angles)
    count = np.searchsorted(around, angles + ACROSS) - first
    best = int(np.argmax(count))
    angle = float(np.median(around[first[best] : first[best] + count[best]])) % np.pi
    return angle - np.pi if angle > np.pi / 2 else angle


def _usual_height(letters: Letters) -> Floats:
    """Median height of the letters nearest to each."""
    _, near = cKDTree(letters.middle).query(letters.middle, k=min(12, len(letters.left)))
    return np.asarray(np.median(letters.height[near], axis=1))
