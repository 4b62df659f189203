"""The errors of a range scanner: white, correlated over neighbouring pixels, or growing over the sheet."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from planish.types import Floats

Noise = float | tuple[float, float]
"""Standard deviation [mm]: one for the whole sheet, or at its top left and bottom right corners, linear between."""


def noise_at(
    lattice_rc: NDArray[np.int64],
    place: Floats,
    noise_mm: Noise,
    correlation_px: float,
    rng: np.random.Generator,
    axes: int = 1,
) -> Floats:
    """Draw normal errors for the points of a scan.

    Parameters
    ----------
    lattice_rc : (n, 2) int
        Row and column of every point in the range image.
    place : (n, 2) float64
        On the sheet, 0 to 1 both ways from its top left corner.
    noise_mm : float or (float, float)
    correlation_px : float
        Standard deviation of the Gaussian that white noise is blurred with, before it is brought back to `noise_mm`;
        0 keeps it white.
    rng : numpy.random.Generator
    axes : int
        Independent errors for every point.

    Returns
    -------
    (n, axes) float64 [mm]

    Examples
    --------
    >>> rc = np.argwhere(np.ones((200, 200)))
    >>> errors = noise_at(rc, rc / 199, (0.1, 0.3), 2.0, np.random.default_rng(0))
    >>> float(errors.std().round(2))
    0.2
    """
    first, last = noise_mm if isinstance(noise_mm, tuple) else (noise_mm, noise_mm)
    if first == last == 0:
        return np.zeros((len(place), axes))
    if correlation_px > 0:
        low = lattice_rc.min(axis=0)
        shape = lattice_rc.max(axis=0) - low + 1
        fields = [_correlated(shape, correlation_px, rng)[tuple((lattice_rc - low).T)] for _ in range(axes)]
        unit = np.stack(fields, axis=1)
    else:
        unit = rng.standard_normal((len(place), axes))
    return unit * (first + (last - first) * place.mean(axis=1))[:, None]


def _correlated(shape: NDArray[np.int64], correlation_px: float, rng: np.random.Generator) -> Floats:
    """White noise blurred and brought back to a standard deviation of 1."""
    field: Floats = ndimage.gaussian_filter(rng.standard_normal(shape), correlation_px, mode="wrap")
    return field / field.std()
