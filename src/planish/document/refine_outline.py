"""The outline of a sheet that was found on a small picture, refined on the photo itself."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from planish.document.rim import largest_region
from planish.types import Bools, Floats

FINE_PX = 1600
"""Long side of the picture on which it is refined: a quarter of a millimetre of a scene of 400 mm."""

BAND = 2
"""The outline moves by at most so many pixels of the small picture, twice what resizing may shift it by."""

NEAR = 8.0
"""Standard deviation of the window over which the levels of paper and ground are averaged [small px]: 4 mm, wider than
a line of print, narrower than shade."""


def refine_outline(photo: NDArray[np.uint8], inside: Bools, paper: NDArray[np.uint8]) -> Bools:
    """Put the outline where the brightness is halfway between the paper within and the ground beyond it.

    Parameters
    ----------
    photo : (rows, cols, 3) uint8
    inside : (h, w) bool
        The sheet on a small picture.
    paper : (h, w) uint8
        Its brightness without print.

    Returns
    -------
    (rows, cols) bool

    Examples
    --------
    >>> photo = np.full((300, 400, 3), 40, np.uint8)
    >>> photo[:, :203] = 220
    >>> coarse = np.zeros((75, 100), bool)
    >>> coarse[:, :49] = True  # up to 196
    >>> refine_outline(photo, coarse, photo[::4, ::4, 0]).sum(axis=1)[150]
    np.int64(203)
    """
    rows, cols = photo.shape[:2]
    scale = min(1.0, FINE_PX / max(rows, cols))
    size = max(2, round(cols * scale)), max(2, round(rows * scale))
    fine = cv2.resize(photo, size, interpolation=cv2.INTER_AREA).max(axis=2).astype(np.float32)
    kernel = np.ones((2 * BAND + 1, 2 * BAND + 1), np.uint8)
    within = cv2.erode(inside.astype(np.uint8), kernel, borderType=cv2.BORDER_REPLICATE) > 0
    beyond = cv2.dilate(inside.astype(np.uint8), kernel) == 0
    ground = cv2.resize(photo, inside.shape[::-1], interpolation=cv2.INTER_AREA).max(axis=2)
    levels = [_average(values.astype(np.float32), where) for values, where in ((paper, within), (ground, beyond))]
    halfway, contrast = (cv2.resize(v, size, interpolation=cv2.INTER_LINEAR) for v in _halfway(*levels))
    sure, near, coarse = (
        cv2.resize(v.astype(np.float32), size, interpolation=cv2.INTER_LINEAR) for v in (within, ~beyond, inside)
    )
    paper_part = np.clip(0.5 + (fine - halfway) / np.maximum(contrast, 1), 0, 1)  # of a pixel that the outline crosses
    part = np.where(contrast > 0, np.maximum(sure > 0.5, (near > 0.5) * paper_part), coarse)
    sheet = largest_region(part > 0.5)
    part = np.where(sheet, np.maximum(part, 0.51), np.where(part > 0.5, 0, part))  # without holes and specks
    return cv2.resize(part.astype(np.float32), (cols, rows), interpolation=cv2.INTER_LINEAR) > 0.5


def _average(values: NDArray[np.float32], where: Bools) -> tuple[Floats, Floats]:
    """The mean of values around every pixel, and how much of them there is."""
    weight = cv2.GaussianBlur(where.astype(np.float32), (0, 0), NEAR)
    return cv2.GaussianBlur(np.where(where, values, 0).astype(np.float32), (0, 0), NEAR), weight


def _halfway(paper: tuple[Floats, Floats], ground: tuple[Floats, Floats]) -> tuple[Floats, Floats]:
    """Halfway between two levels, and their difference; 0 where one of them is unknown or the paper is not brighter."""
    (a, have_a), (b, have_b) = paper, ground
    paper_level, ground_level = a / np.maximum(have_a, 1e-6), b / np.maximum(have_b, 1e-6)
    known = (have_a > 0.01) & (have_b > 0.01)
    return 0.5 * (paper_level + ground_level), np.where(known, np.maximum(paper_level - ground_level, 0), 0)
