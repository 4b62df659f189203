"""How finely the photo shows the page."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planish.errors import InputError
from planish.mesh import rasterise
from planish.render.chart import Chart
from planish.render.visibility import least_singular
from planish.types import Floats, Ints

CELL_MM = 1.0
MOST_CELLS = 1_000_000
USUAL_DPI = (72, 100, 150, 200, 300, 400, 600, 800, 1200)


@dataclass(frozen=True, eq=False)
class Resolution:
    """Photo pixels per inch of page, in the direction where they are fewest.

    Attributes
    ----------
    ppi : (rows, cols) float32 [1 / inch]
        Over the page, a value every millimetre (on huge pages fewer); NaN where the photo did not see it.
    median_ppi, low_ppi : float
        Median and 10 % quantile over the area that was seen.
    """

    ppi: NDArray[np.float32]
    median_ppi: float
    low_ppi: float


def resolution(sheet: Chart, faces: Ints, size_mm: tuple[float, float], photo_shape: tuple[int, ...]) -> Resolution:
    """Measure it from the map of page to photo.

    Parameters
    ----------
    sheet : Chart
    faces : (m, 3) int32
        Those that the photo saw.
    size_mm : (float, float)
    photo_shape : (int, int)
        Rows and columns.

    Raises
    ------
    InputError
        Where no part of the page falls on the photo.
    """
    cell_mm = max(CELL_MM, (size_mm[0] * size_mm[1] / MOST_CELLS) ** 0.5)
    cols, rows = (max(1, round(mm / cell_mm)) for mm in size_mm)
    face, w = rasterise(sheet.page_xy / cell_mm - 0.5, faces, (rows, cols))
    fewest = 25.4 * least_singular(sheet.jacobian)
    ppi = np.where(face >= 0, _carry(fewest[:, None], faces, face, w)[..., 0], np.nan)
    at = _carry(sheet.photo_xy, faces, face, w)
    outside = (at < -0.5).any(axis=2) | (at > np.array(photo_shape[1::-1]) - 0.5).any(axis=2)
    ppi[outside] = np.nan
    seen = ppi[np.isfinite(ppi)]
    if not len(seen):
        low, high = sheet.photo_xy.min(axis=0), sheet.photo_xy.max(axis=0)
        raise InputError(
            f"no part of the sheet falls on the photo: its places run from ({low[0]:.0f}, {low[1]:.0f}) to "
            f"({high[0]:.0f}, {high[1]:.0f}), but the photo has {photo_shape[1]} x {photo_shape[0]} pixels; is it "
            f"the photo of this scan, and the printed side up?"
        )
    return Resolution(ppi.astype(np.float32), float(np.median(seen)), float(np.quantile(seen, 0.1)))


def nearest_usual_dpi(ppi: float) -> int:
    """The usual scanning resolution nearest to a measured one, by ratio.

    Examples
    --------
    >>> nearest_usual_dpi(281.0), nearest_usual_dpi(340.0)
    (300, 300)
    """
    return min(USUAL_DPI, key=lambda usual: abs(np.log(usual / ppi)))


def _carry(values: Floats, faces: Ints, face: Ints, w: NDArray[np.float32]) -> Floats:
    """What the points carry, at every cell: (rows, cols, d)."""
    a, b, c = (values[faces[np.maximum(face, 0), k]] for k in range(3)) if len(faces) else (0.0, 0.0, 0.0)
    return np.asarray((1 - w[..., :1] - w[..., 1:]) * a + w[..., :1] * b + w[..., 1:] * c)
