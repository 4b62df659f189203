"""Contact sheet: pictures in rows with captions."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from planish.report.drawing import INK, SOFT, Sheet, fitted, rgb_uint8
from planish.types import Bools, Pixels

GROUND = "#f2f1ee"
CARD = (560, 700)
"""Width and height that each picture may have."""
GAP, MARGIN, CAPTION, TITLE = 44, 72, 60, 130
TEXT = 26.0


def contact_sheet(pictures: Mapping[str, Pixels | Bools], title: str = "", columns: int = 4) -> NDArray[np.uint8]:
    """Arrange pictures in rows, each above its caption.

    Parameters
    ----------
    pictures : mapping of captions to (rows, cols) or (rows, cols, 3) uint8, uint16 or bool
        In reading order.
    title : str
    columns : int
        Pictures in a row.

    Returns
    -------
    (rows, cols, 3) uint8

    Examples
    --------
    >>> contact_sheet({"before": np.zeros((100, 80), bool), "after": np.ones((100, 80), bool)}, columns=2).shape
    (904, 1308, 3)
    """
    small = {caption: fitted(rgb_uint8(picture), *CARD) for caption, picture in pictures.items()}
    rows = -(-len(small) // columns)
    tallest = [_tallest(list(small.values())[r * columns : (r + 1) * columns]) for r in range(rows)]
    head = TITLE if title else 0
    height = head + sum(tallest) + rows * CAPTION + (rows - 1) * GAP + 2 * MARGIN
    sheet = Sheet(min(columns, len(small)) * (CARD[0] + GAP) - GAP + 2 * MARGIN, height, GROUND)
    if title:
        sheet.words((MARGIN, MARGIN + 40), title, 48, INK)
    top = float(MARGIN + head)
    for k, (caption, picture) in enumerate(small.items()):
        row, column = divmod(k, columns)
        left = MARGIN + column * (CARD[0] + GAP)
        place = sheet.picture(picture, (left, top + tallest[row] - picture.shape[0], CARD[0], picture.shape[0]))
        sheet.words((place[0] + place[2] / 2, top + tallest[row] + 40), caption, TEXT, SOFT, "ms")
        if column == columns - 1:
            top += tallest[row] + CAPTION + GAP
    return sheet.pixels


def _tallest(row: list[NDArray[np.uint8]]) -> int:
    return max(picture.shape[0] for picture in row)
