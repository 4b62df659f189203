"""A faint laser line on a bright board: where each row is coloured more than its surroundings."""

from __future__ import annotations

import cv2
import numpy as np

from planish.acquire.laser.stripes import Direction
from planish.types import Bools, Floats, Pixels

SURROUNDINGS_PX = 31
"""Width that the line is compared with: several times a line's width, less than a square of the board."""
OUTSTANDING = 5.0
"""Standard deviations by which the line must stand out. Of 600 pixels in a row noise alone reaches 3.2; with 2.5 rows
without a line count too, with 10 a line of 20 levels over noise of 2 is lost."""
HALF_WIDTH_PX = 3


def faint_line(photo: Pixels, inside: Bools, along: Direction) -> tuple[Floats, int]:
    """Find one line in the colour in which most rows show it.

    Parameters
    ----------
    photo : (rows, cols, 3) uint8 or uint16
    inside : (rows, cols) bool
        Where the board is.
    along : {"rows", "columns"}
        The line crosses every row, or every column.

    Returns
    -------
    at : (rows,) or (cols,) float64
        Where the line crosses each, by the centroid; NaN where it is not seen.
    channel : int
        0 red, 1 green, 2 blue.
    """
    shown = photo.astype(np.float32) if along == "rows" else photo.swapaxes(0, 1).astype(np.float32)
    mask = inside if along == "rows" else inside.T
    best: tuple[Floats, int] = np.full(len(mask), np.nan), 0
    for channel in range(3):
        others = np.maximum(shown[..., (channel + 1) % 3], shown[..., (channel + 2) % 3])
        colour = np.ascontiguousarray(shown[..., channel] - others)
        excess = cv2.GaussianBlur(colour, (5, 1), 0) - cv2.blur(colour, (SURROUNDINGS_PX, 1))
        if not mask.any():
            continue
        noise = 1.4826 * float(np.median(np.abs(excess[mask] - np.median(excess[mask]))))
        at = _centroids(np.where(mask, excess, 0.0), max(OUTSTANDING * noise, 1e-6))
        if np.isfinite(at).sum() > np.isfinite(best[0]).sum():
            best = at, channel
    return best


def _centroids(excess: Floats, least: float) -> Floats:
    rows, cols = excess.shape
    peak = excess.argmax(axis=1)
    near = np.clip(peak[:, None] + np.arange(-HALF_WIDTH_PX, HALF_WIDTH_PX + 1), 0, cols - 1)
    weight = np.maximum(excess[np.arange(rows)[:, None], near], 0.0)
    with np.errstate(invalid="ignore"):
        at = (weight * near).sum(axis=1) / weight.sum(axis=1)
    return np.where(excess[np.arange(rows), peak] > least, at, np.nan)
