"""How like two pictures of a page are, as the DocUNet benchmark measures it."""

from pathlib import Path

import cv2
import numpy as np

PIXELS = 598_400
SCALES = (0.0448, 0.2856, 0.3001, 0.2363, 0.1333)
"""Exponents of the five scales, from the finest."""


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
