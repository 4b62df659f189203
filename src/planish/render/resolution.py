"""Effective resolution: photo pixels per inch of page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planish.dpi import MM_PER_INCH
from planish.errors import InputError
from planish.render.rasterize_ids import rasterize_ids
from planish.render.uv_map import UVMap
from planish.render.visibility import least_singular
from planish.types import Ints

CELL_MM = 1.0
MOST_CELLS = 1_000_000
USUAL_DPI = (72, 100, 150, 200, 300, 400, 600, 800, 1200)
COARSE_PPI, FINER = 200.0, 1.5
"""A photo coarser than this is drawn finer than it is, by at least this factor: resampled letters of few pixels are
read better on more of them."""


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


def cells(size_mm: tuple[float, float]) -> tuple[float, tuple[int, int]]:
    """Side of the cells [mm] in which a page of this size is looked at, and their rows and columns."""
    cell_mm = max(CELL_MM, (size_mm[0] * size_mm[1] / MOST_CELLS) ** 0.5)
    return cell_mm, (max(1, round(size_mm[1] / cell_mm)), max(1, round(size_mm[0] / cell_mm)))


def combined_resolution(several: Sequence[Resolution], best: NDArray[np.int64]) -> Resolution:
    """The resolution of a page that takes each cell from another photo: number `best` (rows, cols), -1 for none."""
    ppi = np.take_along_axis(np.array([found.ppi for found in several]), np.maximum(best, 0)[None], axis=0)[0]
    return _summary(np.where(best >= 0, ppi, np.float32(np.nan)))


def resolution(
    sheet: UVMap,
    faces: Ints,
    size_mm: tuple[float, float],
    shapes: Sequence[tuple[int, ...]],
    image: Ints | None = None,
    name: str = "the photo",
) -> Resolution:
    """Measure it from the map of page to photo.

    Parameters
    ----------
    sheet : UVMap
    faces : (m, 3) int32
        Those that the photo saw.
    size_mm : (float, float)
    shapes : sequence of (int, int)
        Rows and columns of each image.
    image : (m,) int32, optional
        The number of each face's image, where there are several.
    name : str
        Of the photo, for the message.

    Raises
    ------
    InputError
        Where no part of the page falls on the photo.
    """
    cell_mm, (rows, cols) = cells(size_mm)
    face = rasterize_ids(sheet.page_xy / cell_mm - 0.5, faces, (rows, cols))
    ppi = np.full((rows, cols), np.nan, np.float32)
    images = np.zeros(len(faces), np.int32) if image is None else image, np.array([shape[:2] for shape in shapes])
    _fill(face, faces, MM_PER_INCH * least_singular(sheet.jacobian), sheet.photo_xy, *images, ppi)
    if not np.isfinite(ppi).any():
        low, high = sheet.photo_xy.min(axis=0), sheet.photo_xy.max(axis=0)
        raise InputError(
            f"no part of the sheet falls on {name}: its places run from ({low[0]:.0f}, {low[1]:.0f}) to "
            f"({high[0]:.0f}, {high[1]:.0f}), but the photo has {shapes[0][1]} x {shapes[0][0]} pixels; is it "
            f"the photo of this scan, and the printed side up?"
        )
    return _summary(ppi)


def _summary(ppi: NDArray[np.float32]) -> Resolution:
    seen = ppi[np.isfinite(ppi)]
    return Resolution(ppi, float(np.median(seen)), float(np.quantile(seen, 0.1)))


def usual_dpi_for(ppi: float) -> int:
    """The least usual scanning resolution that keeps what a photo resolves; the largest one beyond that.

    Examples
    --------
    >>> [usual_dpi_for(ppi) for ppi in (78, 281, 340, 5000)]
    [150, 300, 400, 1200]
    """
    least = ppi * (FINER if ppi < COARSE_PPI else 1.0)
    return next((usual for usual in USUAL_DPI if usual >= least), USUAL_DPI[-1])


@njit(cache=True)
def _fill(face, faces, fewest, photo_xy, image, shapes, ppi):  # type: ignore[no-untyped-def]
    """Fill in the mean over the corners of the face at each cell, where that lies on the photo."""
    for r in range(face.shape[0]):
        for q in range(face.shape[1]):
            if face[r, q] < 0:
                continue
            a, b, c = faces[face[r, q]]
            x = (photo_xy[a, 0] + photo_xy[b, 0] + photo_xy[c, 0]) / 3
            y = (photo_xy[a, 1] + photo_xy[b, 1] + photo_xy[c, 1]) / 3
            shape = shapes[image[face[r, q]]]
            if -0.5 <= x <= shape[1] - 0.5 and -0.5 <= y <= shape[0] - 0.5:
                ppi[r, q] = (fewest[a] + fewest[b] + fewest[c]) / 3
