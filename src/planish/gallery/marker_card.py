"""Printed cards with ArUco markers beside a sheet: what tells the size."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from planish.types import Floats

DICTIONARY = cv2.aruco.DICT_4X4_50
"""Fifty markers of 4 x 4 cells with a black rim of one cell."""

CELLS = 6
"""Cells across a marker, with its rim."""


@dataclass(frozen=True)
class MarkerCard:
    """A marker on the table z = 0, with white paper around it.

    Attributes
    ----------
    number : int
        Of the dictionary DICT_4X4_50.
    centre_mm : (float, float)
        On the table.
    turn_deg : float
        Of the marker's upper side, counter-clockwise from the x axis as seen from above.
    side_mm : float
        Side of the black square.
    quiet_mm : float
        White around it.
    """

    number: int
    centre_mm: tuple[float, float]
    turn_deg: float = 0.0
    side_mm: float = 40.0
    quiet_mm: float = 10.0

    @property
    def corners(self) -> Floats:
        """Corners of the black square, (4, 3) [mm]: upper left, then clockwise, as OpenCV counts them.

        Examples
        --------
        >>> MarkerCard(0, (100.0, 0.0)).corners.tolist()
        [[80.0, 20.0, 0.0], [120.0, 20.0, 0.0], [120.0, -20.0, 0.0], [80.0, -20.0, 0.0]]
        """
        return self._square(self.side_mm / 2)

    @property
    def outline(self) -> Floats:
        """Corners of the card's paper, (4, 3) [mm]."""
        return self._square(self.side_mm / 2 + self.quiet_mm)

    def _square(self, half: float) -> Floats:
        angle = np.radians(self.turn_deg)
        right, up = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
        xy = half * np.array([up - right, up + right, right - up, -up - right]) + self.centre_mm
        return np.column_stack([xy, np.zeros(4)])


def card_cells(number: int) -> NDArray[np.uint8]:
    """Cells of a marker of DICT_4X4_50 with its black rim: (6, 6) uint8, 1 is white.

    Examples
    --------
    >>> card_cells(0)[1:5].tolist()
    [[0, 1, 0, 1, 1, 0], [0, 0, 1, 0, 1, 0], [0, 0, 0, 1, 1, 0], [0, 0, 0, 1, 0, 0]]
    """
    drawn = cv2.aruco.generateImageMarker(cv2.aruco.getPredefinedDictionary(DICTIONARY), number, CELLS)
    return (np.asarray(drawn) > 127).astype(np.uint8)
