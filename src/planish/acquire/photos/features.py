"""Local features of photos: SIFT (Lowe 2004), the larger ones first."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import cv2
import numpy as np
from numba import get_num_threads
from numpy.typing import NDArray

Features = tuple[NDArray[np.float32], NDArray[np.uint8]]

LONG_SIDE_PX = 1600
"""Photos are reduced to this long side first. On ten photos of 7 megapixels of a typeset page this gave 4,400 points
and cameras true to 0.08 mm; the whole photos gave 5,700 and took three times as long. Small features are parts of
letters that stand a hundred times on a page, and match by chance."""

MOST = 8192
"""Features kept of a photo, the largest first."""

CONTRAST = 0.02
"""Half of OpenCV's threshold, since paper in shade has little contrast."""


def find_features(photos: Sequence[NDArray[np.uint8]]) -> list[Features]:
    """Find the features of photos.

    Parameters
    ----------
    photos : sequence of (rows, cols) uint8

    Returns
    -------
    list of (keypoints, descriptors)
        For each photo (k, 4) float32 column, row, radius [photo px, pixel centres at integers] and angle [rad], and
        (k, 128) uint8 RootSIFT (Arandjelovic and Zisserman 2012): 512 times the root of the descriptor over its sum.
    """
    # OpenCV's own threads serve only parts of SIFT; each photo at work takes 0.4 GB
    with ThreadPoolExecutor(get_num_threads()) as pool:
        return list(pool.map(_features, photos))


def _features(photo: NDArray[np.uint8]) -> Features:
    rows, cols = photo.shape
    scale = min(1.0, LONG_SIDE_PX / max(rows, cols))
    size = max(1, round(cols * scale)), max(1, round(rows * scale))
    small = photo if scale == 1.0 else cv2.resize(photo, size, interpolation=cv2.INTER_AREA)
    points, descriptors = cv2.SIFT.create(contrastThreshold=CONTRAST).detectAndCompute(small, None)
    if descriptors is None:
        return np.zeros((0, 4), np.float32), np.zeros((0, 128), np.uint8)
    each = np.array([[*point.pt, point.size / 2, np.radians(point.angle)] for point in points])
    larger = np.argsort(-each[:, 2], kind="stable")[:MOST]
    each, descriptors = each[larger], descriptors[larger]
    to_photo = np.array([cols / size[0], rows / size[1]])
    each[:, :2] = (each[:, :2] + 0.5) * to_photo - 0.5
    each[:, 2] *= to_photo.mean()
    root = np.sqrt(descriptors / np.maximum(descriptors.sum(axis=1, keepdims=True), 1e-9))
    return each.astype(np.float32), np.rint(np.clip(512 * root, 0, 255)).astype(np.uint8)
