"""Paper against ground in a photo, to a part of a pixel along the outline."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from planish.color import linear_light
from planish.document.rim import largest_region
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
NOTCH_PX = 1600
"""Long side of the picture on which notches of the outline are sought."""
NEARBY = 0.1
"""Paper and ground are averaged so far around, in parts of its long side: a card beside the sheet is no wider."""
COLORED = 0.06
"""Ground is distinguished from print by its colour if its shares of red, green and blue differ from the paper's by so
much, in linear light; browns of wood such as (120, 85, 55) differ by 0.3 to 0.5."""
LIKE_GROUND = 0.4, 1.5
"""Otherwise a notch is at least and at most so bright, in parts of the ground nearby: in the shade of the sheet, and no
black print."""


@dataclass(frozen=True, eq=False)
class Paper:
    """Paper and ground in a photo.

    Attributes
    ----------
    share : (rows, cols) uint8
        Of paper in every pixel: 255 on the sheet and its print, 0 on the ground, between them along the outline.
    inside_px : (rows, cols) float16
        Distance from the outline, positive on the sheet, at most `FARTHEST_PX`; near the outline to 0.001.
    """

    share: NDArray[np.uint8]
    inside_px: NDArray[np.float16]

    def blanked(self, grey: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """A photo (rows, cols) with its ground black, so that the sheet's outline is a pattern like any print."""
        return np.asarray(cv2.multiply(grey, self.share, scale=1 / 255))


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
    if mask is None:
        found = _with_notches(found, photo)
    light = linear_light(256)[cv2.cvtColor(photo, cv2.COLOR_RGB2GRAY)]
    share = _share_along(found, light)
    inside = share > 0.5
    away = _distance(inside) - _distance(~inside)
    sharp = np.where(np.abs(away) < 1.5, share - 0.5, away - 0.5 * np.sign(away))
    rounded = np.round(255 * share).astype(np.uint8)
    return Paper(rounded, np.clip(sharp, -FARTHEST_PX, FARTHEST_PX).astype(np.float16))


def _brighter_than_ground(photo: Pixels) -> Bools | None:
    """The sheet by the channel that tells it best: wood is as bright as paper in red, and dark in blue."""
    best, most = None, 0.0
    for extreme in (np.maximum, np.minimum):  # faster than along the last axis
        channel = extreme(extreme(photo[..., 0], photo[..., 1]), photo[..., 2])
        found = find_sheet(np.repeat(channel[..., None], 3, axis=2), whole=True)
        if found is not None:
            contrast = float(np.median(channel[found])) / max(float(np.median(channel[~found])), 1.0)
            if contrast > most:
                best, most = found, contrast
    return best


def _with_notches(found: Bools, photo: Pixels) -> Bools:
    """The sheet without the notches of its outline, which `find_sheet` closes as it closes print.

    The ends of a gutter, the zigzag of a folded rim and tears are notches: darker than the paper around, of the colour
    of the ground nearby, and joined to it.
    """
    rows, cols = found.shape
    scale = min(1.0, NOTCH_PX / max(rows, cols))
    size = round(cols * scale), round(rows * scale)
    small = cv2.blur(linear_light(256)[cv2.resize(photo, size, interpolation=cv2.INTER_AREA)], (3, 3))
    within = cv2.resize(found.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST)
    reach = round(NEARBY * max(size))
    light = cv2.cvtColor(small, cv2.COLOR_RGB2GRAY)
    brightest = cv2.dilate(light * within, np.ones((2 * reach + 1, 2 * reach + 1), np.uint8))
    paper = _mean_color(small, (within > 0) & (light > 0.5 * brightest), reach)
    ground = _mean_color(small, within == 0, reach)
    ground_light = cv2.cvtColor(ground, cv2.COLOR_RGB2GRAY)
    # halfway between paper and ground on a scale of logarithms, as paper in half shade is paper
    dark = (ground_light > 0) & (light < np.sqrt(ground_light * cv2.cvtColor(paper, cv2.COLOR_RGB2GRAY)))
    as_bright = (light > LIKE_GROUND[0] * ground_light) & (light < LIKE_GROUND[1] * ground_light)
    nearer = _color_distance(small, ground) < _color_distance(small, paper)
    like_ground = np.where(_color_distance(ground, paper) > COLORED, nearer, as_bright)
    outside = ((within == 0) | (dark & like_ground)).astype(np.uint8)
    _, label = cv2.connectedComponents(outside, connectivity=4)
    joined = (outside > 0) & np.isin(label, np.unique(label[within == 0]))
    sheet = largest_region(~joined)
    return np.asarray(found & (cv2.resize(sheet.astype(np.uint8), (cols, rows), interpolation=cv2.INTER_NEAREST) > 0))


def _mean_color(light: NDArray[np.float32], where: Bools, reach: int) -> NDArray[np.float32]:
    return cv2.merge([_mean_beside(channel, where.astype(np.uint8), reach) for channel in cv2.split(light)])


def _color_distance(a: NDArray[np.float32], b: NDArray[np.float32]) -> NDArray[np.float32]:
    """Sum of the differences of the shares of red, green and blue, at pixels of two pictures in linear light."""
    total = [np.maximum(cv2.transform(c, np.ones((1, 3))), TINY_SHARE) for c in (a, b)]
    return sum(np.abs(p / total[0] - q / total[1]) for p, q in zip(cv2.split(a), cv2.split(b), strict=True))


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
