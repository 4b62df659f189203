"""The outline of a sheet as drawn on its photo in the browser. Imports nothing of the web framework."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planish.errors import UsageError
from planish.types import Floats, Pixels

FEWEST, MOST = 3, 60
"""Corners of an outline."""
LARGEST = 100_000
"""Pixels of a photo's side."""
LONG_SIDE = 2000
"""Pixels of the mask: a tenth of a millimetre of a letter."""


@dataclass(frozen=True)
class Outline:
    """A polygon on a photo.

    Attributes
    ----------
    width, height : int
        Of the photo [px], as the browser shows it.
    corners : tuple of (float, float)
        Column and row [px].
    """

    width: int
    height: int
    corners: tuple[tuple[float, float], ...]

    def mask(self) -> Pixels:
        """(rows, cols) uint8: 255 within the outline; of the photo's proportions, at most `LONG_SIDE` long."""
        import cv2

        scale = min(1.0, LONG_SIDE / max(self.width, self.height))
        size = max(1, round(self.height * scale)), max(1, round(self.width * scale))
        mask = np.zeros(size, np.uint8)
        corners: Floats = np.array(self.corners) * [size[1] / self.width, size[0] / self.height]
        cv2.fillPoly(mask, [np.rint(corners).astype(np.int32)], 255)
        return mask


def read_outline(text: str) -> Outline | None:
    """Read an outline such as ``4000x3000 12,30 3900,40 2000,2900``; None where there is none.

    Raises
    ------
    UsageError
        If the text is no outline.

    Examples
    --------
    >>> outline = read_outline("4x3 0,0 4,0 4,3")
    >>> outline.corners, outline.mask().shape
    (((0.0, 0.0), (4.0, 0.0), (4.0, 3.0)), (3, 4))
    """
    if not text:
        return None
    size, *places = text.split()
    try:
        width, height = (int(number) for number in size.split("x"))
        corners = tuple((float(x), float(y)) for x, y in (place.split(",") for place in places))
    except ValueError:
        example = "400x300 12,30 390,40 200,290"
        raise UsageError(f"outline must be the photo's size and corners in it, such as {example}") from None
    if not 1 <= min(width, height) <= max(width, height) <= LARGEST:
        raise UsageError(f"outline must be of a photo with sides of 1 to {LARGEST} pixels")
    inside = all(0 <= x <= width and 0 <= y <= height for x, y in corners)
    if not inside or not FEWEST <= len(corners) <= MOST:
        raise UsageError(f"outline must have {FEWEST} to {MOST} corners within the photo, and it has {len(corners)}")
    return Outline(width, height, corners)
