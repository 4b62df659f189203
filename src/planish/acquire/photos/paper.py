"""Paper against ground in a photo, to a part of a pixel along the outline."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from planish.color import linear_light
from planish.document.sheet_outline import find_sheet
from planish.geometry.guards import TINY_SHARE
from planish.types import Bools, Pixels

MASK_PX = 800
"""Long side of the picture on which `find_sheet` works."""
BAND_PX = 1.5
"""Half width, in its pixels, of the band around the found outline in which the outline is sought again."""
AROUND_PX = 6
"""Paper and ground beside the outline are averaged over so many of its pixels."""
FARTHEST_PX = 80.0
"""Distances from the outline are kept up to so many pixels of the photo."""
SHADE = 1.5
"""Paper must be so much brighter than the ground beside it for the outline between them to be sought again."""


@dataclass(frozen=True, eq=False)
class Paper:
    """Paper and ground in a photo.

    Attributes
    ----------
    share : (rows, cols) float32
        Of paper in every pixel: 1 on the sheet and its print, 0 on the ground, between them along the outline.
    inside_px : (rows, cols) float32
        Distance from the outline, positive on the sheet, at most `FARTHEST_PX`.
    """

    share: NDArray[np.float32]
    inside_px: NDArray[np.float32]


def find_paper(photo: Pixels, mask: Bools | None = None) -> Paper | None:
    """Tell paper from ground.

    Parameters
    ----------
    photo : (rows, cols, 3) uint8
    mask : (rows, cols) bool, optional
        The sheet, if it is known; otherwise `planish.document.sheet_outline.find_sheet` seeks it.

    Returns
    -------
    Paper, or None where no sheet stands out.
    """
    found = _brighter_than_ground(photo) if mask is None else mask
    if found is None:
        return None
    light = linear_light(256)[cv2.cvtColor(photo, cv2.COLOR_RGB2GRAY)]
    share = _share_along(found, light)
    inside = share > 0.5
    away = _distance(inside) - _distance(~inside)
    sharp = np.where(np.abs(away) < 1.5, share - 0.5, away - 0.5 * np.sign(away))
    return Paper(share, np.clip(sharp, -FARTHEST_PX, FARTHEST_PX).astype(np.float32))


def _brighter_than_ground(photo: Pixels) -> Bools | None:
    """The sheet by the channel that tells it best: wood is as bright as paper in red, and dark in blue."""
    best, most = None, 0.0
    for channel in (photo.max(axis=2), photo.min(axis=2)):
        found = find_sheet(np.repeat(channel[..., None], 3, axis=2), whole=True)
        if found is not None:
            contrast = float(np.median(channel[found])) / max(float(np.median(channel[~found])), 1.0)
            if contrast > most:
                best, most = found, contrast
    return best


def _distance(inside: Bools) -> NDArray[np.float32]:
    return np.asarray(cv2.distanceTransform(inside.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5), np.float32)


def _share_along(found: Bools, light: NDArray[np.float32]) -> NDArray[np.float32]:
    """Share of paper: the found mask, sought again along its outline; shares of a pixel add in linear light."""
    scale = max(1.0, max(found.shape) / MASK_PX)
    band, around = round(BAND_PX * scale), round(AROUND_PX * scale)
    share = found.astype(np.float32)
    square = np.ones((2 * band + 1, 2 * band + 1), np.uint8)
    inside = cv2.erode(found.astype(np.uint8), square, borderValue=0)
    outside = 1 - cv2.dilate(found.astype(np.uint8), square, borderValue=0)
    row, col = np.nonzero((inside == 0) & (outside == 0))
    if not len(row):
        return share
    reach = 2 * around
    box = np.s_[max(0, row.min() - reach) : row.max() + reach + 1, max(0, col.min() - reach) : col.max() + reach + 1]
    paper = _mean_beside(light[box], inside[box], around)
    ground = _mean_beside(light[box], outside[box], around)
    between = np.clip((light[box] - ground) / np.maximum(paper - ground, TINY_SHARE), 0, 1)
    sought = (inside[box] == 0) & (outside[box] == 0) & (paper > SHADE * ground)
    share[box][sought] = between[sought]
    return share


def _mean_beside(light: NDArray[np.float32], where: NDArray[np.uint8], reach: int) -> NDArray[np.float32]:
    """Mean brightness of a region over a window of so many pixels on each side; 0 where it is not near."""
    size = (2 * reach + 1, 2 * reach + 1)
    count = cv2.boxFilter(where.astype(np.float32), -1, size, normalize=False)
    total = cv2.boxFilter(light * where, -1, size, normalize=False)
    return np.asarray(np.where(count > 0.5, total / np.maximum(count, 1), 0), np.float32)
