"""The outline of a sheet as drawn in the browser, on its photo or a view of its scan. No web framework here."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planish.errors import UsageError
from planish.types import Bools, Floats, Pixels

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


@dataclass(frozen=True)
class Cut:
    """An outline on a view of the scan from afar.

    Attributes
    ----------
    outline : Outline
    view : tuple of 2 tuples of 4 floats
        Column and row [px] are these times (x, y, z, 1), in mm.
    """

    outline: Outline
    view: tuple[tuple[float, ...], tuple[float, ...]]

    def mask_and_view(self) -> tuple[Bools, Floats]:
        """(rows, cols) bool, and the view (2, 4) on its pixels."""
        mask = self.outline.mask() > 0
        scale = np.array([mask.shape[1] / self.outline.width, mask.shape[0] / self.outline.height])
        view = np.array(self.view) * scale[:, None]
        view[:, 3] += 0.5 * scale - 0.5  # pixel centres are at integers
        return mask, view


def read_cut(text: str) -> Cut | None:
    """Read an outline on a view, such as ``400x300 2,0,0,200 0,-2,0,150 10,10 390,10 390,290``; None if there is none.

    Raises
    ------
    UsageError
        If the text is none.

    Examples
    --------
    >>> cut = read_cut("4x3 2,0,0,1 0,-2,0,1 0,0 4,0 4,3")
    >>> cut.outline.corners, cut.view[1]
    (((0.0, 0.0), (4.0, 0.0), (4.0, 3.0)), (0.0, -2.0, 0.0, 1.0))
    """
    if not text:
        return None
    size, *rest = text.split()
    try:
        column, row = (tuple(float(number) for number in part.split(",")) for part in rest[:2])
    except ValueError:
        column, row = (), ()
    whole = len(column) == len(row) == 4 and bool(np.isfinite([column, row]).all())
    if not whole or not np.cross(column[:3], row[:3]).any():
        raise UsageError(
            "cut must be the view's size, two times four numbers for column and row, and corners, such as "
            "400x300 2,0,0,200 0,-2,0,150 12,30 390,40 200,290"
        )
    outline = read_outline(" ".join([size, *rest[2:]]))
    return None if outline is None else Cut(outline, (column, row))


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
