"""The photo made small, and its ink: what letters, lines and borders are looked for in."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from planish.color import to_grey
from planish.types import Bools, Floats, Pixels

LONG_SIDE = 1700
"""Of the small picture [px], about: letters of a page of 60 lines are 8 px high there, which is enough to tell where
they stand to a quarter of a pixel once a line has some."""
NEARBY = 1 / 28
"""Side of the neighbourhood that a pixel is compared with, in parts of the long side: a few lines of text."""
FAINTEST = 0.06
"""So much darker than its neighbourhood, as a part of it, is the faintest ink."""
GRAIN = 4.0
"""Ink is darker than its neighbourhood by so many times the photo's own grain."""


@dataclass(frozen=True, eq=False)
class Look:
    """A small grey picture of the photo, perhaps turned so that its text is level.

    Attributes
    ----------
    grey : (rows, cols) uint8
    to_photo : (2, 3) float64
        photo (x, y) = to_photo @ (x, y, 1) of the small picture.
    """

    grey: NDArray[np.uint8]
    to_photo: Floats

    @property
    def px(self) -> float:
        """Photo pixels in one of its own."""
        return float(np.sqrt(abs(np.linalg.det(self.to_photo[:, :2]))))

    def on_photo(self, xy: Floats) -> Floats:
        """Places (n, 2) of the small picture on the photo."""
        return np.asarray(xy @ self.to_photo[:, :2].T + self.to_photo[:, 2])

    def turned(self, clockwise: float) -> Look:
        """The whole picture turned by an angle [rad]; what comes in at the corners is grey 0."""
        rows, cols = self.grey.shape
        c, s = np.cos(clockwise), np.sin(clockwise)
        turn = np.array([[c, -s], [s, c]])
        corners = np.array([[0, 0], [cols, 0], [0, rows], [cols, rows]], float) @ turn.T
        low, size = corners.min(axis=0), np.ceil(np.ptp(corners, axis=0)).astype(int)
        forth = np.c_[turn, -low]
        grey = cv2.warpAffine(self.grey, forth, (int(size[0]), int(size[1])), flags=cv2.INTER_LINEAR)
        back = np.c_[turn.T, turn.T @ low]
        linear = self.to_photo[:, :2]
        return Look(np.asarray(grey, np.uint8), np.c_[linear @ back[:, :2], linear @ back[:, 2] + self.to_photo[:, 2]])


def look_at(photo: Pixels, long_side: int = LONG_SIDE) -> Look:
    """Make a photo grey, and small by a whole number of pixels averaged.

    Parameters
    ----------
    photo : (rows, cols, 3) uint8 or uint16
    long_side : int
        About how many pixels the picture shall have.
    """
    step = max(1, round(max(photo.shape[:2]) / long_side))
    rows, cols = (n // step for n in photo.shape[:2])
    part = np.asarray(photo[: rows * step, : cols * step])
    if step > 1:  # first small, then grey: a tenth of the work
        part = cv2.resize(part, (cols, rows), interpolation=cv2.INTER_AREA)
    middle = (step - 1) / 2
    return Look(to_grey(part), np.array([[step, 0, middle], [0, step, middle]], float))


def ink(grey: NDArray[np.uint8]) -> Bools:
    """Find what is darker than its neighbourhood by more than the paper's and the sensor's grain."""
    side = int(max(grey.shape) * NEARBY) | 1
    level = cv2.blur(grey, (side, side))
    fine = cv2.GaussianBlur(grey, (0, 0), 0.8)
    grain = float(np.median(cv2.absdiff(grey, fine))) + 0.5
    least = np.maximum(FAINTEST * level, GRAIN * grain)
    return np.asarray(level.astype(np.float32) - fine > least)
