"""Lines of text: letters that stand side by side, and the smooth curve on which they stand."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from planish.geometry.guards import TINY_PX
from planish.photo.letters import Letters, direction, letters_in
from planish.photo.look import NEARBY, Look, ink
from planish.types import Floats, Ints

WORD_GAP = 2.2
"""Widest gap inside a line, in heights of its letters; wider ones are closed when the sheet's shape is known."""
LIKE_HEIGHT = 2.6
"""Ratio of heights of neighbouring letters."""
OVERLAP = 0.4
"""Part of its height that a letter shares with its neighbour."""
FEWEST = 4
"""Letters in a line."""
SCRAP = 3
"""Letters in a word that is text, if it stands beside some."""
STRAIGHT = 0.13
"""Median distance of a line's letters from its curve, in heights: print has 0.03 to 0.08, leaves on a lawn 0.2."""
LONG = 8
"""Letters in a line that is asked whether it stands on its head."""
SUREST = 3.0
"""Standard deviations: figures and capitals, which are as straight above as below, may all err to the same side."""
HELD_UPRIGHT = 1.3
"""The same that says: of ten documents photographed nine are not upside down."""
LEVEL = np.radians(8)
"""Text that leans by more is turned before its lines are sought."""


@dataclass(frozen=True, eq=False)
class TextLines:
    """Places on the baselines of lines of text, on the photo.

    Attributes
    ----------
    photo_xy : (n, 2) float64 [photo px]
        Foot of a letter, on its baseline.
    line : (n,) int32
        Which line it belongs to; lines count from 0, letters in a line from left to right.
    height : (lines,) float64 [photo px]
        Median height of the lines' letters.
    ends : (lines, 2, 2) float64 [photo px]
        Where the line begins and ends.
    angle : float [rad]
        Direction of the lines on the photo, clockwise from level.
    upright : float
        How sure it is that they do not run the other way [standard deviations].
    straightness : float
        Median distance of the letters from their lines' curves, in heights.
    paper : (lines,) float64
        Mean grey around the lines' letters, 0 to 255.
    scraps : (k, 2, 2) float64 [photo px]
        Where all that may be text begins and ends, also what is too short to tell a line.
    """

    photo_xy: Floats
    line: Ints
    height: Floats
    ends: Floats
    angle: float
    upright: float
    straightness: float
    paper: Floats
    scraps: Floats


def text_lines(look: Look) -> TextLines | None:
    """Find the lines of text on a photo, at any angle; None where there are too few letters to look at.

    Letters stand on a line; their heads do not all reach one. What is straighter is taken for their feet, unless it is
    hardly straighter and the photo would be upside down.
    """
    turned, angle, letters = _levelled(look)
    if letters is None:
        return None
    scraps = [chain for chain in _chains(letters) if len(chain) >= SCRAP]
    chains = [chain for chain in scraps if len(chain) >= FEWEST]
    upright = _standing(letters, chains) + HELD_UPRIGHT * float(np.cos(angle))
    if upright < 0:
        letters, chains = _upside_down(letters, turned.grey.shape), [chain[::-1] for chain in chains]
        scraps = [chain[::-1] for chain in scraps]
        turned, angle = turned.turned(np.pi), angle + np.pi
    return _gathered(turned, letters, chains, scraps, angle, abs(upright))


def _upside_down(letters: Letters, shape_rc: tuple[int, ...]) -> Letters:
    """The boxes in the picture turned by half, see `Look.turned`."""
    rows, cols = (n + 1 for n in shape_rc[:2])
    return Letters(cols - letters.right, rows - letters.bottom, cols - letters.left, rows - letters.top)


def _levelled(look: Look) -> tuple[Look, float, Letters | None]:
    """The picture with its text about level, by how much it leant, and its letters."""
    letters = letters_in(ink(look.grey))
    if len(letters.left) < 2 * FEWEST:
        return look, 0.0, None
    angle = direction(letters)
    if abs(angle) < LEVEL:
        return look, angle, letters
    turned = look.turned(-angle)
    letters = letters_in(ink(turned.grey))
    return turned, angle, letters if len(letters.left) >= 2 * FEWEST else None


def _chains(letters: Letters) -> list[Ints]:
    """Letters that are each other's nearest to the right and to the left, in order."""
    count = len(letters.left)
    height, middle = letters.height, letters.middle
    squeezed = middle * [1.0, 2.5]  # neighbours to the side come before those above and below
    _, near = cKDTree(squeezed).query(squeezed, k=min(10, count))
    one, other = np.repeat(np.arange(count), near.shape[1]), near.ravel()
    gap = letters.left[other] - letters.right[one]
    lower, higher = np.minimum(height[one], height[other]), np.maximum(height[one], height[other])
    shared = np.minimum(letters.bottom[one], letters.bottom[other]) - np.maximum(letters.top[one], letters.top[other])
    good = (middle[other, 0] > middle[one, 0]) & (gap > -0.4 * lower) & (gap < WORD_GAP * higher)
    good &= (shared > OVERLAP * lower) & (higher < LIKE_HEIGHT * lower)
    one, other, gap = one[good], other[good], gap[good]
    right = _nearest(one, other, gap, count)
    left = _nearest(other, one, gap, count)
    here = np.flatnonzero(right >= 0)
    here = here[left[right[here]] == here]
    links = coo_array((np.ones(len(here)), (here, right[here])), shape=(count, count))
    _, chain = connected_components(links, directed=False)
    order = np.lexsort((middle[:, 0], chain))
    return np.split(order.astype(np.int32), np.flatnonzero(np.diff(chain[order])) + 1)


def _nearest(one: Ints, other: Ints, gap: Floats, count: int) -> Ints:
    """For each of `one` the `other` with the least gap; -1 where there is none."""
    order = np.argsort(-gap, kind="stable")
    found = np.full(count, -1, np.int32)
    found[one[order]] = other[order]  # the last one written has the least gap
    return found


def _feet(letters: Letters, chain: Ints) -> tuple[Floats, float]:
    """Weights (k,) of a chain's letters, 0 for those that do not stand on its baseline, and how far off it is usual."""
    return _stand(letters.middle[chain, 0], letters.bottom[chain], float(np.median(letters.height[chain])))


def _stand(x: Floats, y: Floats, height: float) -> tuple[Floats, float]:
    t = (x - x.mean()) / max(float(np.ptp(x)), TINY_PX)
    powers = t[:, None] ** np.arange(1 + min(3, max(1, len(x) // 6)))
    weight = np.ones(len(x))
    for scale in (0.4, 0.25, 0.15, 0.15):
        root = np.sqrt(weight)[:, None]
        off = y - powers @ np.linalg.lstsq(powers * root, y * root[:, 0], rcond=None)[0]
        weight = np.clip(1 - (off / (2 * scale * height)) ** 2, 0, 1) ** 2 + 1e-3
    return np.where(np.abs(off) < 0.15 * height, weight, 0.0), float(np.median(np.abs(off))) / height


def _standing(letters: Letters, chains: list[Ints]) -> float:
    """How much straighter lines are along their letters' feet than along their heads, in standard deviations."""
    long = [chain for chain in chains if len(chain) >= LONG]
    if len(long) < 2:
        return 0.0
    off = np.array([[_off_line(letters, chain, edge) for edge in (letters.top, letters.bottom)] for chain in long])
    weight = np.array([len(chain) for chain in long])
    straighter = off[:, 0] - off[:, 1]
    mean = float(np.average(straighter, weights=weight))
    doubt = float(np.sqrt(np.average((straighter - mean) ** 2, weights=weight) / len(long)))
    return float(np.clip(mean / max(doubt, 1e-3), -SUREST, SUREST))


def _off_line(letters: Letters, chain: Ints, edge: Floats) -> float:
    """How far the letters' feet, or heads, usually are off a smooth line, in their heights."""
    return _stand(letters.middle[chain, 0], edge[chain], float(np.median(letters.height[chain])))[1]


def _gathered(
    look: Look, letters: Letters, chains: list[Ints], scraps: list[Ints], angle: float, upright: float
) -> TextLines | None:
    stands = [_feet(letters, chain) for chain in chains]
    kept = [
        (chain, weight > 0)
        for chain, (weight, off) in zip(chains, stands, strict=True)
        if off < STRAIGHT and (weight > 0).sum() >= FEWEST - 1
    ]
    if not kept:
        return None
    feet = [np.stack([letters.middle[c, 0], letters.bottom[c]], axis=1)[on] - 0.5 for c, on in kept]
    ends = [
        [[letters.left[c[0]], xy[0, 1]], [letters.right[c[-1]], xy[-1, 1]]]
        for (c, _), xy in zip(kept, feet, strict=True)
    ]
    short = [
        [[letters.left[c[0]], letters.bottom[c[0]]], [letters.right[c[-1]], letters.bottom[c[-1]]]] for c in scraps
    ]
    off = np.concatenate([np.full(len(c), o) for c, (_, o) in zip(chains, stands, strict=True)])
    side = int(max(look.grey.shape) * NEARBY) | 1
    level = np.asarray(cv2.blur(look.grey, (side, side)), np.uint8)
    return TextLines(
        photo_xy=look.on_photo(np.concatenate(feet)),
        line=np.repeat(np.arange(len(feet), dtype=np.int32), [len(xy) for xy in feet]),
        height=np.array([np.median(letters.height[c]) for c, _ in kept]) * look.px,
        ends=look.on_photo(np.array(ends).reshape(-1, 2)).reshape(-1, 2, 2),
        angle=angle,
        upright=upright,
        straightness=float(np.median(off)),
        paper=np.array([_median_at(level, xy) for xy in feet]),
        scraps=look.on_photo(np.array(short).reshape(-1, 2)).reshape(-1, 2, 2),
    )


def _median_at(level: NDArray[np.uint8], xy: Floats) -> float:
    x, y = np.clip(np.rint(xy).astype(int), 0, np.array(level.shape[::-1]) - 1).T
    return float(np.median(level[y, x]))
