"""Find the gutter between facing pages on a photo: a straight, dark valley beside the text."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from planish.photo.line_grouping import select
from planish.photo.lines import TextLines
from planish.photo.sheet_region import SheetRegion
from planish.types import Bools, Floats

BANDS = 24
"""Bands across the gutter in which the paper's brightness is measured."""
BRIGHTER_PART = 0.8
"""Quantile of a column of a band that is its paper: print has less."""
RULE = 5
"""Width up to which dark upright rules are closed over [px]."""
BESIDE = 0.1
"""Width on either side of a valley, in widths of the region, within which paper must be brighter."""
INSIDE, OUTSIDE = 0.8, 0.2
"""Share of a column of a band from which it is sheet, and up to which it is ground."""
DEEPEST = 0.3
"""Depth that counts fully, and that of ground seen between two pages."""
DEEP = 0.05
"""Least depth of a gutter in three of four bands, relative to its brightness: gutters have 0.07 to 0.22, upright folds
and thick rules 0.03 to 0.05."""
DOUBT = 0.25
"""Quantile of the bands' depths that is compared."""
SLANT, SLANTS = 0.3, 31
"""Largest slope of a gutter against the upright of the text, and the number of slopes tried."""
TOLERANCE = 3
"""Distance of the valley from a straight line [px]."""
AT_END = 4
"""Width along the region's sides in which there is no gutter [px]."""
CROSSED = 0.02
"""Largest share of text lines that cross a gutter."""
LEAST = 12
"""Least number of columns of sheet in a band, for each of the valley's sides [px]."""


@dataclass(frozen=True, eq=False)
class Gutter:
    """A straight line between two pages on the photo.

    Attributes
    ----------
    point : (2,) float64 [photo px]
    across : (2,) float64
        Unit vector from the left page to the right one.
    depth : float
        Of the valley of brightness, relative to its bottom; 0 for no gutter.
    """

    point: Floats
    across: Floats
    depth: float

    def is_right(self, photo_xy: Floats) -> Bools:
        """Which positions (n, 2) lie on the right page."""
        return np.asarray((photo_xy - self.point) @ self.across > 0)


def find_gutter(region: SheetRegion, lines: TextLines, *, always: bool = False) -> Gutter | None:
    """Find the gutter of facing pages; None if there is none.

    In bands along the lines of text the bright part of each column is the paper. A gutter is darker than paper on both
    sides, or ground is seen there between two leaves; it is one straight line from head to foot that no line of text
    crosses. Folds are steps of brightness, columns have no shade between them, rules are thin.

    Parameters
    ----------
    region : SheetRegion
        All that was segmented, both pages or a part of the second.
    lines : TextLines
    always : bool
        There are two pages: take the deepest valley, whatever its depth.
    """
    level, inside, turned = _turned(region, lines.angle)
    if not inside.any():
        return None
    depth, rows = _valleys(level, inside)
    offset = rows - rows.mean()
    best, found = -1.0, (0.0, 0, 0.0)
    for slope in np.linspace(-SLANT, SLANT, SLANTS):
        shift = np.rint(slope * offset).astype(int)
        along = np.stack([np.roll(one, -k) for one, k in zip(depth, shift, strict=True)])
        doubtful, mean = np.quantile(along, DOUBT, axis=0), along.mean(axis=0)
        score = doubtful + 0.1 * mean  # the mean decides between valleys of no depth
        if score.max() > best:
            at = int(np.argmax(score))
            best, found = float(score[at]), (float(slope), at, float(doubtful[at]))
    slope, at, deep = found
    back = cv2.invertAffineTransform(turned)
    ends = np.array([[at + slope * (y - rows.mean()), y] for y in (rows[0], rows[-1])]) @ back[:, :2].T + back[:, 2]
    first, last = region.to_photo(ends)
    down = (last - first) / np.linalg.norm(last - first)
    gutter = Gutter((first + last) / 2, np.array([down[1], -down[0]]), deep)
    crossing = np.ptp(gutter.is_right(lines.ends.reshape(-1, 2)).reshape(-1, 2).astype(int), axis=1).mean()
    return gutter if always or (deep > DEEP and crossing <= CROSSED) else None


def _turned(region: SheetRegion, angle: float) -> tuple[NDArray[np.uint8], Bools, Floats]:
    """Lightness and mask turned so that the text is level, and the affine map (2, 3) there."""
    rows, cols = region.inside.shape
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, s], [-s, c]])
    corners = np.array([[0, 0], [cols, 0], [0, rows], [cols, rows]]) @ turn.T
    map_there = np.c_[turn, -corners.min(axis=0)]
    width, height = (int(n) for n in np.ceil(np.ptp(corners, axis=0)))
    level = cv2.warpAffine(region.small[..., 0], map_there, (width, height))
    inside = cv2.warpAffine(region.inside.astype(np.uint8), map_there, (width, height), flags=cv2.INTER_NEAREST)
    return np.asarray(level, np.uint8), inside > 0, map_there


def _valleys(level: NDArray[np.uint8], inside: Bools) -> tuple[NDArray[np.float32], Floats]:
    """Depth of valleys in every band (BANDS, cols), and the bands' middle rows."""
    level = cv2.morphologyEx(level, cv2.MORPH_CLOSE, np.ones((1, RULE), np.uint8))
    top, bottom = np.flatnonzero(inside.any(axis=1))[[0, -1]]
    ends = np.linspace(top, bottom + 1, BANDS + 1).astype(int)
    wide = max(3, int(BESIDE * inside.any(axis=0).sum()))
    depth = np.zeros((BANDS, inside.shape[1]), np.float32)
    for band, first, last in zip(depth, ends[:-1], ends[1:], strict=True):
        share = inside[first:last].mean(axis=0) if last > first else np.zeros(inside.shape[1])
        sheet = share > INSIDE
        if sheet.sum() < 2 * LEAST:
            continue
        paper = np.quantile(np.where(inside[first:last], level[first:last], 0), BRIGHTER_PART, axis=0)
        paper = np.where(sheet, cv2.GaussianBlur(paper.astype(np.float32)[None], (0, 0), 1.0)[0], 0)
        window = np.ones((1, wide), np.uint8)
        left, right = (cv2.dilate(paper[None], window, anchor=(at, 0))[0] for at in (wide - 1, 0))
        band[sheet] = (np.minimum(left, right) / np.maximum(paper, 1) - 1)[sheet]
        band[share < OUTSIDE] = DEEPEST
        first_col, last_col = np.flatnonzero(sheet)[[0, -1]]
        band[: first_col + AT_END] = 0
        band[last_col - AT_END + 1 :] = 0
    depth = cv2.dilate(np.clip(depth, 0, DEEPEST), np.ones((1, 2 * TOLERANCE + 1), np.uint8))
    return depth, (ends[:-1] + ends[1:]) / 2


def larger_part(region: SheetRegion, gutter: Gutter) -> str:
    """The page of which the photo shows more: left or right."""
    right = _right_of(region, gutter)
    return "right" if (region.inside & right).sum() > (region.inside & ~right).sum() else "left"


def part_of_region(region: SheetRegion, gutter: Gutter, which: str) -> SheetRegion:
    """One page of a region."""
    right = _right_of(region, gutter)
    return replace(region, inside=region.inside & (right if which == "right" else ~right))


def part_of_lines(lines: TextLines, gutter: Gutter, which: str) -> TextLines | None:
    """Text on one page; None if there is none."""
    middle, fragments = lines.ends.mean(axis=1), lines.fragments.mean(axis=1)
    here, there = (gutter.is_right(xy) == (which == "right") for xy in (middle, fragments))
    uprights = tuple(xy for xy in lines.uprights if (gutter.is_right(xy) == (which == "right")).all())
    kept = select(lines, here)
    return kept and replace(kept, fragments=lines.fragments[there], uprights=uprights)


def _right_of(region: SheetRegion, gutter: Gutter) -> Bools:
    rows, cols = region.inside.shape
    xy = np.stack(np.meshgrid(np.arange(cols), np.arange(rows)), axis=-1).reshape(-1, 2).astype(np.float64)
    return gutter.is_right(region.to_photo(xy)).reshape(rows, cols)
