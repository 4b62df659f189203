"""Several photos of one sheet: how much of each a place of the page takes, and how bright each was exposed.

The page takes every place from the photo that shows it best, since a mean of several is softer than the best of them:
surface and cameras are never so true that print falls exactly on print. Only along seams a few millimetres are mixed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planish.color import LUMINANCE
from planish.render.photo_view import PhotoView
from planish.types import Bools, Floats

Light = NDArray[np.float32]

RIM_MM = 3.0
"""This near to the rim of what a photo shows, to hidden parts and turned edges, others are preferred."""
CALM_MM = 6.0
"""Over so much of the page photos are compared: seams are few and do not wind."""
SEAM_MM = 1.0
"""Standard deviation of a seam's softness."""
FADE_MM = 10.0
"""Over so much of the page what differs in light along a seam is evened out."""
LINES = (
    [[0, 0, 0], [1, -2, 1], [0, 0, 0]],
    [[0, 1, 0], [0, -2, 0], [0, 1, 0]],
    [[1, 0, 0], [0, -2, 0], [0, 0, 1]],
    [[0, 0, 1], [0, -2, 0], [1, 0, 0]],
)
EDGE_MM = 2.0
"""So near to the sheet's edge detail is not looked at: a soft photo smears the dark table over the paper there."""
NOISE = 0.01
"""Detail fainter than this part of white, in code values, says nothing of sharpness."""
USABLE = (0.02, 0.95)
"""Light of places from which exposures are compared: neither lost in noise nor clipped."""
ENOUGH_CELLS = 50
"""That two photos must both see for their exposures to be compared."""


@dataclass(frozen=True, eq=False)
class Blend:
    """How the page is put together from its photos.

    Attributes
    ----------
    cell_mm : float
        Of the cells that shares and gains are given for.
    shares : (photos, rows, cols) float32
        Weight of each photo at the middle of each cell.
    gains : (photos, rows, cols, 3) float32
        That its linear light is multiplied by.
    best : (rows, cols) int64
        Number of the photo with the greatest share; -1 where none sees the page.
    """

    cell_mm: float
    shares: Light
    gains: Light
    best: NDArray[np.int64]


def blend(views: Sequence[PhotoView], samples: Sequence[tuple[Light, Light, Bools]], cell_mm: float) -> Blend:
    """Decide which photo the page takes where.

    A photo is as good as its pixels per mm of page, in the direction where they are fewest (that holds the angle at
    which it looks), times how sharp it is there beside the others.

    Parameters
    ----------
    views : sequence of PhotoView
    samples : sequence of (light, detail, known)
        What each shows, in cells: mean light (rows, cols, 3), mean `detail` (rows, cols, 4), whether it is known.
    cell_mm : float
    """
    known = np.array([sample[2] for sample in samples])
    light = np.array([sample[0] for sample in samples])
    ppi = np.where(known, [np.nan_to_num(view.resolution.ppi) for view in views], 0)
    good = np.log(np.maximum(ppi, 1e-3)) + _sharpness(np.array([sample[1] for sample in samples]), known, cell_mm)
    calm = np.array([_smooth(g, k, CALM_MM / cell_mm) for g, k in zip(good, known, strict=True)])
    inner = np.array([_inner(k, RIM_MM / cell_mm) for k in known])
    worth = np.where(known, calm + np.log(np.maximum(inner, 1e-3)), -np.inf)
    best = np.where(known.any(axis=0), worth.argmax(axis=0), -1)
    shares = _shares(best, inner, SEAM_MM / cell_mm)
    return Blend(cell_mm, shares, _gains(light, known, inner, shares, FADE_MM / cell_mm), best)


def detail(light: Light, known: Bools) -> Light:
    """Strength of the finest detail at each pixel in four directions: (rows, cols, 4).

    The squares of second differences of code values across, down and along both diagonals.
    """
    import cv2

    code = np.sqrt(np.clip(np.where(known, light @ LUMINANCE, 0), 0, 1)).astype(np.float32)
    inside = cv2.erode(known.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    strength = [cv2.filter2D(code, cv2.CV_32F, np.array(line, np.float32)) ** 2 * inside for line in LINES]
    return np.stack(strength, axis=-1)


def _sharpness(details: Light, known: Bools, cell_mm: float) -> Light:
    """Logarithm of each photo's contrast of fine detail beside the best one's, in the direction where it is least.

    A photo that looks along the paper squeezes the print one way, which makes it stand out; what it lost the other way
    counts. 0 where there is no detail.
    """
    import cv2

    side = 2 * max(1, round(EDGE_MM / cell_mm)) + 1
    inside = [cv2.erode(k.astype(np.uint8), np.ones((side, side)), borderValue=0) > 0 for k in known]
    near = np.array(
        [
            [_smooth(way, k, CALM_MM / cell_mm) for way in np.moveaxis(each, -1, 0)]
            for each, k in zip(details, inside, strict=True)
        ]
    )
    return np.asarray(0.5 * np.log((near + NOISE**2) / (near.max(axis=0) + NOISE**2)).min(axis=1), np.float32)


def _shares(best: NDArray[np.int64], inner: Light, sigma: float) -> Light:
    """Weights that go over softly from each cell's best photo to the next, and to 0 at the rim of each."""
    import cv2

    soft = [cv2.GaussianBlur((best == i).astype(np.float32), (0, 0), sigma) for i in range(len(inner))]
    return np.ascontiguousarray(np.array(soft, np.float32) * inner)


def _gains(light: Light, known: Bools, inner: Light, shares: Light, fade: float) -> Light:
    """One gain for each photo and colour that makes their exposures equal, and a smooth field for what remains."""
    exposure = _exposures(light, known & (inner == 1))
    even = light * np.exp(exposure)[:, None, None]
    total = shares.sum(axis=0)
    page = (shares[..., None] * even).sum(axis=0) / np.maximum(total, 1e-6)[..., None]
    gains = np.empty_like(light)
    for i in range(len(light)):
        both = known[i] & (total > 0) & _usable(even[i]) & _usable(page)
        left = np.log(np.where(both[..., None], page / np.maximum(even[i], 1e-6), 1))
        slow = np.stack([_smooth(left[..., k], both, fade) for k in range(3)], axis=-1)
        gains[i] = np.exp(exposure[i] + slow)
    return gains


def _exposures(light: Light, known: Bools) -> Floats:
    """Logarithm of the gain (photos, 3) that makes each photo as bright as the first.

    Least squares over all pairs of g_i - g_j = median log (light_j / light_i) over the cells that both see, each
    weighted by their number. Shade falls alike in all photos and print is where it is; what glares is outvoted.
    """
    count = len(light)
    rows, right, weights = [], [], []
    for i in range(count):
        for j in range(i):
            both = known[i] & known[j] & _usable(light[i]) & _usable(light[j])
            if both.sum() >= ENOUGH_CELLS:
                rows.append(np.eye(count)[i] - np.eye(count)[j])
                right.append(np.median(np.log(light[j][both] / light[i][both]), axis=0))
                weights.append(float(both.sum()))
    rows.append(np.eye(count)[0])
    right.append(np.zeros(3))
    weights.append(sum(weights) + 1.0)
    root = np.sqrt(weights)[:, None]
    found: Floats = np.linalg.lstsq(root * np.array(rows), root * np.array(right), rcond=1e-9)[0]
    return found - found[0]


def _usable(light: Light) -> Bools:
    return np.asarray((light > USABLE[0]).all(axis=-1) & (light < USABLE[1]).all(axis=-1))


def _smooth(values: Light, known: Bools, sigma: float) -> Light:
    """Gaussian mean over what is known; elsewhere drawn on from there, and to 0 far from it."""
    import cv2

    weight = cv2.GaussianBlur(known.astype(np.float32), (0, 0), sigma)
    total = cv2.GaussianBlur(np.where(known, values, 0).astype(np.float32), (0, 0), sigma)
    return np.asarray(total / np.maximum(weight, 1e-4), np.float32)


def _inner(known: Bools, rim: float) -> Light:
    """From 0 at the rim of what is known to 1 so many cells inside; the page's own borders are no rim."""
    import cv2

    away = cv2.distanceTransform(known.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return np.asarray(np.clip((away - 0.5) / rim, 0, 1), np.float32)
