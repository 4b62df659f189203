"""How a region on a photo ends: what lies around it, and whether its rim is an edge or the fall of a shade."""

from __future__ import annotations

import cv2
import numpy as np
from scipy import ndimage

from planish.types import Bools, Floats, Ints

MASK_PX = 800
"""Long side of the small picture with which places on the photo are compared."""

MARGIN = 0.02
"""Surroundings begin this part of the photo's long side outside of the region: nearer, a border of the sheet may be
shade, dark print or a ragged outline. A scan of a sheet alone has nothing there."""

DIRECTIONS = 72

RIM = 0.005
"""Half the width of a rim, as a part of the photo's long side, at least `RIM_PX`. Over twice of it a paper's edge on
its table falls by all of the contrast; the shade along a spine, 20 to 40 mm wide, by a third (half of it: the edges of
coarse clouds, blurred over four pixels, look soft; twice: shade of 10 mm looks like an edge)."""
RIM_PX = 2.0

NARROW = 0.25
"""Width of what sticks out of a sheet, in sides of a square of its area: 60 mm for a letter, a thumb and its hand.
Halved, only the thumb's tip is; doubled, half of a narrow sheet."""


def with_margin(mask: Bools) -> Bools:
    """The region on a small picture, with a margin around it."""
    scale = min(1.0, MASK_PX / max(mask.shape))
    size = max(1, round(mask.shape[1] * scale)), max(1, round(mask.shape[0] * scale))
    small = cv2.resize(mask.astype(np.uint8), size, interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.dilate(small, _disc(2 * round(MARGIN * max(size)) + 1)) > 0)


def at_places(mask: Bools, photo_xy: Floats, scale: float = 1.0) -> Bools:
    """(n,) whether the mask is true at places on the photo; false beside it."""
    with np.errstate(invalid="ignore"):
        column, row = np.nan_to_num(np.floor((photo_xy + 0.5) * scale), nan=-1, posinf=-1, neginf=-1).T
    inside = (row >= 0) & (row < mask.shape[0]) & (column >= 0) & (column < mask.shape[1])
    out = np.zeros(len(photo_xy), bool)
    out[inside] = mask[row[inside].astype(int), column[inside].astype(int)]
    return out


def share_around(near: Bools, photo_xy: Floats, scale: float) -> float:
    """Part of all directions from the middle of a region in which places follow it closely.

    Parameters
    ----------
    near : (rows, cols) bool
        The region with its margin.
    photo_xy : (k, 2) float64 [photo px]
        Of the surroundings.
    scale : float
        From the photo to `near`.
    """
    ring = cv2.dilate(near.astype(np.uint8), _disc(4 * round(MARGIN * max(near.shape)) + 1)) > 0
    close = photo_xy[at_places(np.asarray(ring), photo_xy, scale)]
    middle = np.argwhere(near).mean(axis=0)[::-1] / scale
    angle = np.arctan2(*(close - middle).T[::-1])
    hit = np.unique(np.floor((angle / (2 * np.pi) + 0.5) * DIRECTIONS).clip(0, DIRECTIONS - 1))
    return len(hit) / DIRECTIONS


def rim_drops(bright: Floats, mask: Bools, seen: Bools) -> Floats:
    """How much darker it is just outside of a region than just inside, all along its rim, as parts of its contrast.

    Parameters
    ----------
    bright : (rows, cols) float64
        Logarithm of the brightness.
    mask : (rows, cols) bool
    seen : (rows, cols) bool
        Where there is something to see: the rim counts only where it has that on its other side.

    Returns
    -------
    (k,) float64
        1 at an edge, near 0 on a surface whose brightness falls slowly; empty where nothing lies outside.

    Examples
    --------
    >>> column = np.tile(np.arange(200.0), (100, 1))
    >>> edge, fall = np.where(column < 100, 2.0, 1.0), 2 - np.clip((column - 60) / 80, 0, 1)
    >>> [round(float(np.median(rim_drops(b, column < 100, np.ones((100, 200), bool)))), 2) for b in (edge, fall)]
    [1.0, 0.05]
    """
    outside = seen & ~mask
    if not outside.any() or not mask.any():
        return np.zeros(0)
    contrast = float(np.median(bright[mask]) - np.median(bright[outside]))
    at, inwards = rim_pixels(mask)
    reach = max(RIM_PX, RIM * max(mask.shape))
    within, beyond = (
        ndimage.map_coordinates(bright, at + s * reach * inwards, order=1, mode="nearest") for s in (1, -1)
    )
    rows, cols = np.rint(at - reach * inwards).astype(int)
    on_photo = (rows >= 0) & (rows < mask.shape[0]) & (cols >= 0) & (cols < mask.shape[1])
    counts = on_photo & outside[rows.clip(0, mask.shape[0] - 1), cols.clip(0, mask.shape[1] - 1)]
    return np.asarray((within - beyond)[counts] / max(contrast, 1e-9))


def rim_pixels(mask: Bools) -> tuple[Ints, Floats]:
    """(2, k) rows and columns of the pixels along the rim of a region, on both sides of it, and (2, k) the way inwards.

    Examples
    --------
    >>> at, inwards = rim_pixels(np.arange(9) < np.full((5, 1), 4))
    >>> np.unique(at[1]).tolist(), np.unique(inwards.round(2), axis=1).ravel().tolist()
    ([3, 4], [0.0, -1.0])
    """
    depth = ndimage.distance_transform_edt(mask) - ndimage.distance_transform_edt(~mask)
    smooth = ndimage.gaussian_filter(depth, RIM_PX)
    at = np.stack(np.nonzero(np.abs(depth) < 1.1)).astype(np.int32)
    inwards = np.stack([ndimage.sobel(smooth, axis)[tuple(at)] for axis in (0, 1)])
    return at, np.asarray(inwards / np.maximum(np.hypot(*inwards), 1e-9))


def largest_region(mask: Bools) -> Bools:
    """The largest connected region, holes filled."""
    _, label, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8))
    if len(stats) < 2:
        return np.zeros_like(mask)
    region = (label == 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))).astype(np.uint8)
    outlines = cv2.findContours(region, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[0]
    return np.asarray(cv2.drawContours(region, outlines, -1, 1, cv2.FILLED).astype(bool))


def sticking_out(mask: Bools) -> float:
    """Part of a region that sticks out of the rest in one narrow piece, as a hand does that holds a sheet.

    Parameters
    ----------
    mask : (rows, cols) bool

    Examples
    --------
    >>> sheet = np.zeros((200, 300), bool)
    >>> sheet[20:150, 60:240] = True
    >>> bare = sticking_out(sheet)
    >>> sheet[140:200, 140:160] = True
    >>> bare < 0.01, 0.03 < sticking_out(sheet) < 0.05
    (True, True)
    """
    scale = min(1.0, MASK_PX / max(mask.shape))
    small = cv2.resize(np.pad(mask, 1).astype(np.uint8), None, fx=scale, fy=scale, interpolation=cv2.INTER_NEAREST)
    stats = cv2.connectedComponentsWithStats(((small > 0) & ~body(small > 0)).astype(np.uint8))[2]
    return float(stats[1:, cv2.CC_STAT_AREA].max(initial=0) / max(int(small.sum()), 1))


def body(mask: Bools) -> Bools:
    """A region without what is narrower than a quarter of it: opened by a disc."""
    padded = np.pad(mask, 1).astype(np.uint8)
    opened = cv2.morphologyEx(padded, cv2.MORPH_OPEN, _disc(2 * round(0.5 * NARROW * float(mask.sum()) ** 0.5) + 1))
    return np.asarray(opened[1:-1, 1:-1] > 0)


def _disc(side: int) -> np.ndarray:
    return cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
