"""Where a swept laser line was found on the photos."""

from __future__ import annotations

from typing import NamedTuple

from planish.acquire.laser.stripes import Direction
from planish.types import Diagnostic, Floats


class Sweep(NamedTuple):
    """Where the laser lines cross the rows (or columns) of every photo.

    Attributes
    ----------
    at, sd : (frames, count, lines) float32 [px]
        Place and its standard deviation; NaN where no line was found.
    along : {"rows", "columns"}
    warnings : list of Diagnostic
    """

    at: Floats
    sd: Floats
    along: Direction
    warnings: list[Diagnostic]
