"""Working image: a small grey copy of the photo for letter and line detection, and its ink mask."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from planish.color import to_grey
from planish.types import Bools, Floats, Pixels

LONG_SIDE = 1700
"""Approximate long side of the working image [px]: letters of a page of 60 lines are 8 px high there, enough to locate
a baseline to a quarter of a pixel."""
NEARBY = 1 / 28
"""Side of the neighbourhood of the local threshold, as a share of the long side: a few lines of text."""
FAINTEST = 0.06
"""Least relative contrast of ink to its neighbourhood."""
GRAIN = 4.0
"""Least contrast of ink, in multiples of the photo's noise."""


@dataclass(frozen=True, eq=False)
class WorkingImage:
    """A small grey copy of the photo, possibly rotated so that its text is level.

    Attributes
    ----------
    grey : (rows, cols) uint8
    to_photo : (2, 3) float64
        photo (x, y) = to_photo @ (x, y, 1) of the working image.
    """

    grey: NDArray[np.uint8]
    to_photo: Floats

    @property
    def pixel_size(self) -> float:
        """Size of a pixel of the working image [photo px]."""
        return float(np.sqrt(abs(np.linalg.det(self.to_photo[:, :2]))))

    def to_photo_xy(self, xy: Floats) -> Floats:
        """Map positions (n, 2) of the working image to the photo."""
        return np.asarray(xy @ self.to_photo[:, :2].T + self.to_photo[:, 2])

    def rotated(self, clockwise: float) -> WorkingImage:
        """Rotate the whole image by an angle [rad]; the new corners are 0."""
        rows, cols = self.grey.shape
        c, s = np.cos(clockwise), np.sin(clockwise)
        rotation = np.array([[c, -s], [s, c]])
        corners = np.array([[0, 0], [cols, 0], [0, rows], [cols, rows]], float) @ rotation.T
        low, size = corners.min(axis=0), np.ceil(np.ptp(corners, axis=0)).astype(int)
        forward = np.c_[rotation, -low]
        grey = cv2.warpAffine(self.grey, forward, (int(size[0]), int(size[1])), flags=cv2.INTER_LINEAR)
        inverse = np.c_[rotation.T, rotation.T @ low]
        linear = self.to_photo[:, :2]
        return WorkingImage(
            np.asarray(grey, np.uint8), np.c_[linear @ inverse[:, :2], linear @ inverse[:, 2] + self.to_photo[:, 2]]
        )


def working_image(photo: Pixels, long_side: int = LONG_SIDE) -> WorkingImage:
    """Convert a photo to grey and downsample it by an integer factor, averaging.

    Parameters
    ----------
    photo : (rows, cols, 3) uint8 or uint16
    long_side : int
        Approximate long side of the result [px].
    """
    step = max(1, round(max(photo.shape[:2]) / long_side))
    rows, cols = (n // step for n in photo.shape[:2])
    part = np.asarray(photo[: rows * step, : cols * step])
    if step > 1:  # downsampling before the conversion takes a tenth of the time
        part = cv2.resize(part, (cols, rows), interpolation=cv2.INTER_AREA)
    middle = (step - 1) / 2
    return WorkingImage(to_grey(part), np.array([[step, 0, middle], [0, step, middle]], float))


def ink_mask(grey: NDArray[np.uint8]) -> Bools:
    """Threshold the image locally: pixels darker than their neighbourhood by more than noise."""
    side = int(max(grey.shape) * NEARBY) | 1
    level = cv2.blur(grey, (side, side))
    fine = cv2.GaussianBlur(grey, (0, 0), 0.8)
    grain = float(np.median(cv2.absdiff(grey, fine))) + 0.5
    least = np.maximum(FAINTEST * level, GRAIN * grain)
    return np.asarray(level.astype(np.float32) - fine > least)
