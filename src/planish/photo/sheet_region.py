"""Segment the sheet on a photo: by colours that its ground has, up to the photo's edge where the sheet is cut off."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import find_objects

from planish.color import to_uint8
from planish.photo.lines import TextLines
from planish.types import Bools, Floats, Ints, Pixels

LONG_SIDE = 560
"""Long side of the downsampled image for segmentation [px]."""
COARSER = 2
"""The ground's colours are learned on an image smaller by this factor."""
COLOUR = 2.0
"""Weight of chroma against lightness: shadows change lightness only."""
RIM = 2
"""Width of the rim of the coarser image, in its pixels."""
PIECES = 64
"""Pieces of the rim, each of which is ground or sheet."""
FAINT = 8.0
"""Least contrast of the sheet's edge towards a piece of the rim that is ground [levels of 255]."""
MOSTLY = 0.3
"""Quantile of the contrast along the edge that must reach it."""
BESIDE = 9
"""Width of the window of that contrast [px of the coarser image]."""
FEWEST_PX = 5
ROUNDS = 6
"""Repetitions, as pieces that are found to be sheet may hide others."""
ITERATIONS, LEAST_GROUND = 4, 20
"""Of GrabCut, and the number of pixels from which it can learn a mixture of five colours."""
REFINED = 4
"""Half width of the band around GrabCut's outline within which the strongest edge is followed [px]."""
BLACK, ALL_BLACK = 6, 0.98
"""Level of black bars that pad a photo, and the share of a row that must have it."""
LEAST_SHOWN = 0.2
"""Least share of rows or columns between them; what is blacker is a dark photo."""
MIXED = 3
"""Width of a bar's edge, which the median filter and downsampling mix [px]."""


@dataclass(frozen=True, eq=False)
class SheetRegion:
    """The sheet on a downsampled photo.

    Attributes
    ----------
    small : (rows, cols, 3) uint8
        The photo in Lab, chroma amplified, without black bars around it.
    inside : (rows, cols) bool
    step : float [photo px]
        Size of its pixels.
    corner : (2,) float64 [px]
        Its first pixel in the downsampled photo, x and y.
    """

    small: NDArray[np.uint8]
    inside: Bools
    step: float
    corner: NDArray[np.float64]

    def to_photo(self, xy: Floats) -> Floats:
        """Map positions (n, 2) of the small image to the photo."""
        return np.asarray((xy + self.corner + 0.5) * self.step - 0.5)


def sheet_regions(photo: Pixels, lines: TextLines | None) -> Iterator[SheetRegion]:
    """Segment the sheet by its colours, then by edges alone.

    The photo's rim is ground, unless no edge parts it from the text. GrabCut (Rother, Kolmogorov and Blake 2004) learns
    the colours of ground and sheet from there, so that coloured or dark print is no ground; a watershed (Meyer 1991)
    then follows the edge to a pixel. From the same seeds the watershed alone is second: it stops at the sheet's edge
    where something lies beside it whose colours the rim does not have, such as a hand.

    Parameters
    ----------
    photo : (rows, cols, 3) uint8 or uint16
    lines : TextLines or None
        If none, the centre of the photo is taken for sheet.
    """
    small, step = _small(photo)
    top, bottom, left, right = _padding(small[..., 0])
    small = np.ascontiguousarray(small[top:bottom, left:right])
    rows, cols = small.shape[:2]
    size = (max(8, cols // COARSER), max(8, rows // COARSER))
    coarse = cv2.resize(small, size, interpolation=cv2.INTER_AREA)
    seed = np.zeros(coarse.shape[:2], np.uint8)
    if lines is None:
        cv2.ellipse(seed, (size[0] // 2, size[1] // 2), (size[0] // 8, size[1] // 8), 0, 0, 360, 1, -1)
    else:
        on_coarse = (lines.photo_xy / step - [left, top]) * (size[0] / cols)
        cv2.fillConvexPoly(seed, cv2.convexHull(on_coarse.astype(np.float32)).astype(np.int32), 1)
    sheet, ground = _rim(coarse, seed > 0)
    corner = np.array([left, top], float)
    yield SheetRegion(small, _refined(small, _by_colours(coarse, sheet, ground)), step, corner)
    yield SheetRegion(small, _by_edges(small, sheet, ground), step, corner)


def _small(photo: Pixels) -> tuple[NDArray[np.uint8], float]:
    """Downsampled photo in Lab with chroma amplified, and its pixel size [photo px]."""
    step = max(1.0, max(photo.shape[:2]) / LONG_SIDE)
    size = (max(8, round(photo.shape[1] / step)), max(8, round(photo.shape[0] / step)))
    rough = max(1, int(step / 3))
    part = to_uint8(photo[::rough, ::rough])  # averaging 48 million pixels would take most of the time
    small = cv2.resize(np.ascontiguousarray(part), size, interpolation=cv2.INTER_AREA)
    lab = cv2.cvtColor(cv2.medianBlur(small, 5), cv2.COLOR_RGB2LAB).astype(np.float32)
    lab[..., 1:] = 128 + COLOUR * (lab[..., 1:] - 128)
    return np.clip(lab, 0, 255).astype(np.uint8), step


def _padding(lightness: NDArray[np.uint8]) -> tuple[int, int, int, int]:
    """First and last row and column between black bars, which pad photos of some collections."""
    ends = []
    for axis in (1, 0):
        black = (lightness <= BLACK).mean(axis=axis) > ALL_BLACK
        shown = np.flatnonzero(~black)
        first, last = (int(shown[0]), int(shown[-1]) + 1) if len(shown) else (0, len(black))
        first, last = first + MIXED * (first > 0), last - MIXED * (last < len(black))
        if last - first < LEAST_SHOWN * len(black):
            first, last = 0, len(black)
        ends += [first, last]
    return ends[0], ends[1], ends[2], ends[3]


def _rim_pieces(smooth: NDArray[np.uint8]) -> Ints:
    """Number of the piece of the rim at each pixel, from 0; -1 elsewhere.

    Pieces are about as long as each other, and end where the colour changes: half sheet, half ground is neither.
    """
    rows, cols = smooth.shape[:2]
    y, x = np.mgrid[:rows, :cols]
    around = np.full((rows, cols), -1)
    for on, place in (
        (x < RIM, 2 * cols + 2 * rows - 1 - y),
        (y >= rows - RIM, 2 * cols + rows - 1 - x),
        (x >= cols - RIM, cols + y),
        (y < RIM, x),
    ):
        around[on] = place[on]
    rim = around >= 0
    count = 2 * (rows + cols)
    colour = np.zeros((count, 3))
    colour[around[rim]] = smooth[rim]
    step = np.linalg.norm(np.roll(colour, -RIM, axis=0) - np.roll(colour, RIM, axis=0), axis=1)
    most = np.max([np.roll(step, k) for k in range(-2 * RIM, 2 * RIM + 1)], axis=0)
    ends = (step == most) & (step > FAINT)
    ends |= np.diff(np.arange(count) * PIECES // count, prepend=0) > 0
    return np.asarray(np.where(rim, np.cumsum(ends)[around], -1), np.int32)


def _rim(coarse: NDArray[np.uint8], seed: Bools) -> tuple[Bools, Bools]:
    """What is surely sheet, and what is surely ground: the seed, and the pieces of the rim by the edge between."""
    smooth = cv2.bilateralFilter(coarse, 7, 30, 3)
    pieces = _rim_pieces(smooth)
    level = smooth.astype(np.float32)
    joined: set[int] = set()
    for _ in range(ROUNDS):
        sheet = seed | np.isin(pieces, list(joined))
        basins = np.where(sheet, 1, np.where(pieces >= 0, pieces + 2, 0)).astype(np.int32)
        cv2.watershed(smooth, basins)
        boxes = find_objects(np.maximum(basins, 0))
        more = {
            k
            for k in range(pieces.max() + 1)
            if k not in joined
            and k + 1 < len(boxes)
            and (box := boxes[k + 1]) is not None
            and _no_edge(level, basins, k + 2, box)
        }
        if not more:
            break
        joined |= more
    return sheet, (pieces >= 0) & ~sheet


def _no_edge(level: NDArray[np.float32], basins: Ints, number: int, box: tuple[slice, slice]) -> bool:
    """Whether a basin and the sheet's, number 1, are about as bright and coloured beside their common edge."""
    around = tuple(slice(max(0, one.start - BESIDE), one.stop + BESIDE) for one in box)
    level, inside, outside = level[around], basins[around] == 1, basins[around] == number
    edge = _grown(inside, 1) & _grown(outside, 1) & ~inside & ~outside
    if edge.sum() < FEWEST_PX:
        return False
    (one, seen), (other, also) = (_mean_beside(level, basin, edge) for basin in (inside, outside))
    both = (seen > FEWEST_PX) & (also > FEWEST_PX)
    if both.sum() < FEWEST_PX:
        return False
    return bool(np.quantile(np.linalg.norm(one - other, axis=1)[both], MOSTLY) < FAINT)


def _mean_beside(level: NDArray[np.float32], basin: Bools, edge: Bools) -> tuple[NDArray[np.float32], Ints]:
    """Mean colour of a basin beside each pixel of an edge, and the number of its pixels there."""
    weight = basin.astype(np.float32)
    window = (BESIDE, BESIDE)
    count = cv2.boxFilter(weight, -1, window, normalize=False)[edge]
    total = cv2.boxFilter(level * weight[..., None], -1, window, normalize=False)[edge]
    return total / np.maximum(count, 1)[:, None], count


def _grown(mask: Bools, by: int) -> Bools:
    kernel = np.ones((2 * by + 1,) * 2, np.uint8)
    return np.asarray(cv2.dilate(mask.astype(np.uint8), kernel) > 0)


def _by_colours(coarse: NDArray[np.uint8], sheet: Bools, ground: Bools) -> Bools:
    """Segment by the colours of sheet and ground, beginning with both in doubt."""
    if ground.sum() < LEAST_GROUND:
        return np.ones(ground.shape, bool)
    mask = np.full(ground.shape, cv2.GC_PR_FGD, np.uint8)
    mask[ground], mask[sheet] = cv2.GC_BGD, cv2.GC_FGD
    cv2.setRNGSeed(0)  # its mixtures start at random
    cv2.grabCut(coarse, mask, None, np.zeros((1, 65)), np.zeros((1, 65)), ITERATIONS, cv2.GC_INIT_WITH_MASK)
    return np.asarray((mask == cv2.GC_FGD) | (mask == cv2.GC_PR_FGD))


def _refined(small: NDArray[np.uint8], coarse: Bools) -> Bools:
    """Move the outline of a coarse region to the strongest edge near it."""
    inside = _at_full_size(coarse, small.shape)
    return _by_watershed(small, ~_grown(~inside, REFINED), ~_grown(inside, REFINED), inside)


def _by_edges(small: NDArray[np.uint8], sheet: Bools, ground: Bools) -> Bools:
    """Segment by the strongest edges between what is surely sheet and surely ground."""
    sheet, ground = (_at_full_size(mask, small.shape) for mask in (sheet, ground))
    return _by_watershed(small, sheet, ground, ~ground)


def _at_full_size(coarse: Bools, shape_rc: tuple[int, ...]) -> Bools:
    whole = cv2.resize(coarse.astype(np.uint8), shape_rc[1::-1], interpolation=cv2.INTER_NEAREST)
    return np.asarray(whole > 0)


def _by_watershed(small: NDArray[np.uint8], sheet: Bools, ground: Bools, at_border: Bools) -> Bools:
    """Watershed from two seeds; it leaves out the image's own border, where `at_border` holds."""
    if not ground.any() or not sheet.any():
        return at_border
    markers = np.where(sheet, 1, np.where(ground, 2, 0)).astype(np.int32)
    cv2.watershed(cv2.bilateralFilter(small, 7, 30, 3), markers)
    found = markers == 1
    for ends in (np.s_[:1], np.s_[-1:], np.s_[:, :1], np.s_[:, -1:]):
        found[ends] = at_border[ends]
    return np.asarray(found)
