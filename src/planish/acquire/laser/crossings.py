"""Detected crossings of a swept laser line with the rows or columns of the photos."""

from __future__ import annotations

from typing import NamedTuple

from planish.acquire.laser.stripes import Direction
from planish.types import Diagnostic, Floats


class Sweep(NamedTuple):
    """Crossings of the laser lines with the rows (or columns) of every photo.

    Attributes
    ----------
    at, sd : (frames, count, lines) float32 [px]
        Position and its standard deviation; NaN where no line was detected.
    along : {"rows", "columns"}
    warnings : list of Diagnostic
    """

    at: Floats
    sd: Floats
    along: Direction
    warnings: list[Diagnostic]
