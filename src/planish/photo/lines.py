"""Text line detection: letters linked to their neighbours, and a smooth baseline through them."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from planish.geometry.guards import TINY_PX
from planish.photo.letters import Letters, find_letters, text_direction
from planish.photo.working_image import NEARBY, WorkingImage, ink_mask
from planish.types import Floats, Ints

WORD_GAP = 2.2
"""Widest gap within a line, in letter heights; wider ones are closed once the sheet's shape is known."""
LIKE_HEIGHT = 2.6
"""Largest ratio of heights of neighbouring letters."""
OVERLAP = 0.4
"""Least vertical overlap of neighbouring letters, relative to the lower one."""
FEWEST = 4
"""Least number of letters in a line."""
FRAGMENT = 3
"""Least number of letters in a fragment of text beside other text."""
STRAIGHT = 0.13
"""Largest median distance of letters from their baseline, in letter heights: print has 0.03 to 0.08, leaves 0.2."""
LONG = 8
"""Least number of letters in a line that votes on orientation."""
MAX_SIGMA = 3.0
"""Limit of the score [standard deviations]: errors of digits and capitals, straight on both sides, are correlated."""
UPRIGHT_PRIOR = 1.3
"""Prior [standard deviations]: nine of ten photographed documents are not upside down."""
LEVEL = np.radians(8)
"""Text with a larger skew is rotated before its lines are detected."""


@dataclass(frozen=True, eq=False)
class TextLines:
    """Positions on the baselines of text lines, on the photo.

    Attributes
    ----------
    photo_xy : (n, 2) float64 [photo px]
        Base point of each letter.
    line : (n,) int32
        Its line, from 0; letters of a line are ordered from left to right.
    height : (lines,) float64 [photo px]
        Median letter height of each line.
    ends : (lines, 2, 2) float64 [photo px]
        Beginning and end of each line.
    angle : float [rad]
        Direction of the lines on the photo, clockwise from horizontal.
    upright : float
        Confidence that they are not upside down [standard deviations].
    straightness : float
        Median distance of letters from their baselines, in letter heights.
    paper_level : (lines,) float64
        Mean grey around the letters of each line, 0 to 255.
    fragments : (k, 2, 2) float64 [photo px]
        Beginning and end of everything that may be text, including what is too short for a line.
    """

    photo_xy: Floats
    line: Ints
    height: Floats
    ends: Floats
    angle: float
    upright: float
    straightness: float
    paper_level: Floats
    fragments: Floats


def find_text_lines(image: WorkingImage) -> TextLines | None:
    """Detect text lines at any angle; None if there are too few letters.

    Letters share a baseline, but their tops do not line up. The straighter edge is taken as the baseline, with a prior
    against upside-down photos.
    """
    rotated, angle, letters = _deskewed(image)
    if letters is None:
        return None
    fragments = [chain for chain in _link_letters(letters) if len(chain) >= FRAGMENT]
    chains = [chain for chain in fragments if len(chain) >= FEWEST]
    upright = _upright_score(letters, chains) + UPRIGHT_PRIOR * float(np.cos(angle))
    if upright < 0:
        letters, chains = _rotated_half_turn(letters, rotated.grey.shape), [chain[::-1] for chain in chains]
        fragments = [chain[::-1] for chain in fragments]
        rotated, angle = rotated.rotated(np.pi), angle + np.pi
    return _collect(rotated, letters, chains, fragments, angle, abs(upright))


def _rotated_half_turn(letters: Letters, shape_rc: tuple[int, ...]) -> Letters:
    """The boxes after a half turn of the image, see `WorkingImage.rotated`."""
    rows, cols = (n + 1 for n in shape_rc[:2])
    return Letters(cols - letters.right, rows - letters.bottom, cols - letters.left, rows - letters.top)


def _deskewed(image: WorkingImage) -> tuple[WorkingImage, float, Letters | None]:
    """The deskewed image, its skew angle and its letters."""
    letters = find_letters(ink_mask(image.grey))
    if len(letters.left) < 2 * FEWEST:
        return image, 0.0, None
    angle = text_direction(letters)
    if abs(angle) < LEVEL:
        return image, angle, letters
    rotated = image.rotated(-angle)
    letters = find_letters(ink_mask(rotated.grey))
    return rotated, angle, letters if len(letters.left) >= 2 * FEWEST else None


def _link_letters(letters: Letters) -> list[Ints]:
    """Link letters that are mutual nearest neighbours to the right and left; return the chains, in order."""
    count = len(letters.left)
    height, middle = letters.height, letters.middle
    squeezed = middle * [1.0, 2.5]  # prefers neighbours to the side over those above and below
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
    """For each of `one` the `other` with the smallest gap; -1 if there is none."""
    order = np.argsort(-gap, kind="stable")
    found = np.full(count, -1, np.int32)
    found[one[order]] = other[order]  # the last assignment has the smallest gap
    return found


def _baseline_weights(letters: Letters, chain: Ints) -> tuple[Floats, float]:
    """Weights (k,) of a chain's letters, 0 for those off its baseline, and their median residual [letter heights]."""
    return _fit_baseline(letters.middle[chain, 0], letters.bottom[chain], float(np.median(letters.height[chain])))


def _fit_baseline(x: Floats, y: Floats, height: float) -> tuple[Floats, float]:
    t = (x - x.mean()) / max(float(np.ptp(x)), TINY_PX)
    powers = t[:, None] ** np.arange(1 + min(3, max(1, len(x) // 6)))
    weight = np.ones(len(x))
    for scale in (0.4, 0.25, 0.15, 0.15):
        root = np.sqrt(weight)[:, None]
        residual = y - powers @ np.linalg.lstsq(powers * root, y * root[:, 0], rcond=None)[0]
        weight = np.clip(1 - (residual / (2 * scale * height)) ** 2, 0, 1) ** 2 + 1e-3
    return np.where(np.abs(residual) < 0.15 * height, weight, 0.0), float(np.median(np.abs(residual))) / height


def _upright_score(letters: Letters, chains: list[Ints]) -> float:
    """How much straighter letter bottoms are than letter tops [standard deviations]."""
    long = [chain for chain in chains if len(chain) >= LONG]
    if len(long) < 2:
        return 0.0
    residual = np.array(
        [[_baseline_residual(letters, chain, edge) for edge in (letters.top, letters.bottom)] for chain in long]
    )
    weight = np.array([len(chain) for chain in long])
    straighter = residual[:, 0] - residual[:, 1]
    mean = float(np.average(straighter, weights=weight))
    sigma = float(np.sqrt(np.average((straighter - mean) ** 2, weights=weight) / len(long)))
    return float(np.clip(mean / max(sigma, 1e-3), -MAX_SIGMA, MAX_SIGMA))


def _baseline_residual(letters: Letters, chain: Ints, edge: Floats) -> float:
    """Median distance of letter bottoms, or tops, from a smooth curve [letter heights]."""
    return _fit_baseline(letters.middle[chain, 0], edge[chain], float(np.median(letters.height[chain])))[1]


def _collect(
    image: WorkingImage, letters: Letters, chains: list[Ints], fragments: list[Ints], angle: float, upright: float
) -> TextLines | None:
    fits = [_baseline_weights(letters, chain) for chain in chains]
    kept = [
        (chain, weight > 0)
        for chain, (weight, residual) in zip(chains, fits, strict=True)
        if residual < STRAIGHT and (weight > 0).sum() >= FEWEST - 1
    ]
    if not kept:
        return None
    feet = [np.stack([letters.middle[c, 0], letters.bottom[c]], axis=1)[on] - 0.5 for c, on in kept]
    ends = [
        [[letters.left[c[0]], xy[0, 1]], [letters.right[c[-1]], xy[-1, 1]]]
        for (c, _), xy in zip(kept, feet, strict=True)
    ]
    short = [
        [[letters.left[c[0]], letters.bottom[c[0]]], [letters.right[c[-1]], letters.bottom[c[-1]]]] for c in fragments
    ]
    residual = np.concatenate([np.full(len(c), o) for c, (_, o) in zip(chains, fits, strict=True)])
    side = int(max(image.grey.shape) * NEARBY) | 1
    level = np.asarray(cv2.blur(image.grey, (side, side)), np.uint8)
    return TextLines(
        photo_xy=image.to_photo_xy(np.concatenate(feet)),
        line=np.repeat(np.arange(len(feet), dtype=np.int32), [len(xy) for xy in feet]),
        height=np.array([np.median(letters.height[c]) for c, _ in kept]) * image.pixel_size,
        ends=image.to_photo_xy(np.array(ends).reshape(-1, 2)).reshape(-1, 2, 2),
        angle=angle,
        upright=upright,
        straightness=float(np.median(residual)),
        paper_level=np.array([_median_at(level, xy) for xy in feet]),
        fragments=image.to_photo_xy(np.array(short).reshape(-1, 2)).reshape(-1, 2, 2),
    )


def _median_at(level: NDArray[np.uint8], xy: Floats) -> float:
    x, y = np.clip(np.rint(xy).astype(int), 0, np.array(level.shape[::-1]) - 1).T
    return float(np.median(level[y, x]))
