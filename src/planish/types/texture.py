"""Images of a scan whose faces show different ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from planish.types.arrays import Pixels


@dataclass(frozen=True, eq=False)
class Texture:
    """One of several images of a scan, read from its file when it is drawn.

    Photogrammetry programs write up to dozens of images of 8192 x 8192 pixels (0.2 GB each), so not all of them are
    kept in memory.

    Attributes
    ----------
    shape_rc : (int, int)
        Rows and columns.
    bits : {8, 16}
    read : callable
        Gives the pixels (rows, cols, 3) uint8 or uint16.
    """

    shape_rc: tuple[int, int]
    bits: int
    read: Callable[[], Pixels]

    @property
    def dtype(self) -> np.dtype:
        """Of the pixels."""
        return np.dtype(np.uint16 if self.bits == 16 else np.uint8)
