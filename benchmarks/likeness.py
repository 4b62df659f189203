"""How like two pictures of a page are, as the DocUNet benchmark measures it (Ma et al. 2018)."""

from pathlib import Path

import cv2
import numpy as np

PIXELS = 598_400
SCALES = (0.0448, 0.2856, 0.3001, 0.2363, 0.1333)
"""Exponents of the five scales, from the finest."""
FEATURES, ALIKE, WITHIN = 6000, 0.75, 0.01
"""SIFT: how many, how much nearer than the next one a match must be, how close to the fit, in parts of the page."""


def grey(path: Path) -> np.ndarray:
    return cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)


def ms_ssim(a: np.ndarray, b: np.ndarray) -> float:
    """Structural similarity over five scales (Wang, Simoncelli and Bovik 2003, eq. 7), Gaussian window of 11 pixels."""
    a, b = a.astype(np.float64), b.astype(np.float64)
    total = 1.0
    for k, exponent in enumerate(SCALES):
        mean_a, mean_b = _window(a), _window(b)
        var_a, var_b, both = _window(a * a) - mean_a**2, _window(b * b) - mean_b**2, _window(a * b) - mean_a * mean_b
        similar = (2 * both + (0.03 * 255) ** 2) / (var_a + var_b + (0.03 * 255) ** 2)
        if k == len(SCALES) - 1:
            similar = similar * (2 * mean_a * mean_b + (0.01 * 255) ** 2) / (mean_a**2 + mean_b**2 + (0.01 * 255) ** 2)
        total *= max(similar.mean(), 0.0) ** exponent
        a, b = (cv2.resize(x, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA) for x in (a, b))
    return float(total)


def _window(x: np.ndarray) -> np.ndarray:
    return cv2.GaussianBlur(x, (11, 11), 1.5)


def as_docunet(page: np.ndarray, true: np.ndarray) -> float:
    """MS-SSIM with both brought to the true page's shape, at 598,400 pixels."""
    scale = (PIXELS / true.size) ** 0.5
    size = (round(true.shape[1] * scale), round(true.shape[0] * scale))
    return ms_ssim(*(cv2.resize(x, size, interpolation=cv2.INTER_AREA) for x in (page, true)))


def brought_onto(page: np.ndarray, true: np.ndarray) -> np.ndarray | None:
    """The page turned, shifted and scaled onto the true one by features (Lowe 2004); None where too few are alike."""
    sift = cv2.SIFT_create(FEATURES)
    (places, found), (true_places, wanted) = (sift.detectAndCompute(x, None) for x in (page, true))
    if found is None or wanted is None or len(wanted) < 2:
        return None
    pairs = cv2.BFMatcher().knnMatch(found, wanted, 2)
    good = [first for first, second in pairs if first.distance < ALIKE * second.distance]
    if len(good) < 8:
        return None
    a = np.array([places[match.queryIdx].pt for match in good])
    b = np.array([true_places[match.trainIdx].pt for match in good])
    moved, _ = cv2.estimateAffinePartial2D(a, b, ransacReprojThreshold=WITHIN * max(true.shape))
    return None if moved is None else cv2.warpAffine(page, moved, true.shape[::-1], borderValue=255)


def local_distortion(moved: np.ndarray, true: np.ndarray) -> float:
    """Mean length of the dense flow near print between a page on the true one and that, in parts of its long side.

    By Kroeger's inverse search at half size, as SIFT flow, which Ma et al. used, is not to be had as a library.
    """
    halves = [cv2.resize(x, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA) for x in (true, moved)]
    flow = cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM).calc(*halves, None)
    print_near = cv2.dilate((halves[0] < 128).astype(np.uint8), np.ones((5, 5))) > 0
    return float(np.linalg.norm(flow, axis=2)[print_near].mean() / max(halves[0].shape))
