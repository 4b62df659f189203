"""The flat page, and all that came of a scan."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planish.types.arrays import Bools, Pixels, freeze
from planish.types.report import Report
from planish.types.sheet import Flattening


@dataclass(frozen=True, eq=False)
class Page:
    """An image of the flat page.

    Attributes
    ----------
    pixels : (rows, cols) or (rows, cols, 3) uint8 or uint16, or (rows, cols) bool (True is paper)
    known : (rows, cols) bool
        False where no scanned surface was seen.
    dpi : float
        True pixels per 25.4 mm of page.
    icc : bytes or None
        Colour profile of the pixels; sRGB where it is None.
    """

    pixels: Pixels | Bools
    known: Bools
    dpi: float
    icc: bytes | None = None

    def __post_init__(self) -> None:
        freeze(self)


@dataclass(frozen=True, eq=False)
class Restoration:
    """All that came of a scan.

    Attributes
    ----------
    flattening : Flattening
        With the place on the page of every point of the scan, in the scan's order.
    rendered, unshaded, binary : Page or None
        None where the scan has no photo, or where that stage was not asked for. Of the whole sheet.
    report : Report
        With the place of the spine, along which `planish.split` cuts these pages in two.
    clipped : (rows, cols) bool or None
        Pixels of the page with a channel at its greatest value in the photo, where shade was removed.
    light : (rows, cols, 3) float32 or None
        Linear light that blank paper had in the photo, on a coarse grid over the page, where shade was removed.
    ppi : (rows, cols) float32 [1 / inch] or None
        Photo pixels per inch of page, on a coarse grid over the page; NaN where the photo did not see it.
    """

    flattening: Flattening
    rendered: Page | None
    unshaded: Page | None
    binary: Page | None
    report: Report
    clipped: Bools | None = None
    light: NDArray[np.float32] | None = None
    ppi: NDArray[np.float32] | None = None

    def __post_init__(self) -> None:
        freeze(self)
