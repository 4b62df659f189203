"""Rows and columns of points that may be a range image: told by the file, by the user, or by the points themselves."""

from __future__ import annotations

import numpy as np

from planish.errors import InputError
from planish.geometry.axes import principal_axes
from planish.types import Bools, Floats

MAX_STEP = 5.0
"""Neighbours in a row, and in a column, lie within so many times the mean distance of as many points spread evenly."""

MAX_STEP_SHARE = 0.25
"""Nor are they neighbours if they lie this part of the whole apart."""

MIN_SINE = 0.5
"""A step down a column leads across a step along a row: at least the sine of 30 degrees between them."""

SAMPLE = 20_000
"""Pairs of points that are looked at for each possible width."""


def grid_shape(
    points: Floats, file_shape: tuple[int, int] | None, user_shape: tuple[int, int] | None
) -> tuple[int, int]:
    """Rows and columns of a range image.

    Parameters
    ----------
    points : (n, 3) float64
    file_shape : (int, int) or None
        Rows and columns that the file names.
    user_shape : (int, int) or None
        Rows and columns that the user names; they win.

    Raises
    ------
    InputError
        If they do not make n pixels, or none are named and the points stand in no order of rows.
    """
    wanted = user_shape or file_shape
    if wanted is None:
        found = detect_grid_shape(points)
        if found is None:
            raise InputError(
                f"the {len(points):,} points stand in no order of rows and columns",
                "give {size} if they are a range image, or use `planish acquire points`, which takes any order",
            )
        return found
    rows, cols = wanted
    if rows * cols != len(points):
        raise InputError(
            f"{cols} x {rows} pixels would be {rows * cols:,} points, but there are {len(points):,}; a range image has "
            "a point for every pixel, 0 0 0 where nothing was seen. Points without those are for `planish acquire "
            "points`"
        )
    return rows, cols


def detect_grid_shape(points: Floats) -> tuple[int, int] | None:
    """Rows and columns in which points stand, found from how near they are to their neighbours; None if in no rows.

    Parameters
    ----------
    points : (n, 3) float64
        Row after row; 0 0 0 or NaN where a pixel holds none.

    Examples
    --------
    >>> row, col = np.mgrid[:30, :40]
    >>> points = np.stack([col, row, 0.1 * col + 300], axis=-1).reshape(-1, 3)
    >>> detect_grid_shape(points)
    (30, 40)
    >>> detect_grid_shape(np.random.default_rng(0).permutation(points)) is None
    True
    """
    known: Bools = np.asarray(np.isfinite(points).all(axis=1) & points.any(axis=1))
    spread = points[known]
    if len(spread) < 4:
        return None
    axes = principal_axes(spread[:: 1 + len(spread) // SAMPLE])[0]
    sides = np.ptp(spread @ axes[:2].T, axis=0)
    reach = min(MAX_STEP * float(np.sqrt(sides.prod() / len(spread))), MAX_STEP_SHARE * float(sides.max()))
    along, length = _step(points, known, 1)
    if not 0 < length <= reach:
        return None
    best, width = reach, 0
    for cols in (k for k in range(2, len(points) // 2 + 1) if len(points) % k == 0):
        down, distance = _step(points, known, cols)
        size = float(np.linalg.norm(along) * np.linalg.norm(down))
        if 0 < distance <= best and np.linalg.norm(np.cross(along, down)) > MIN_SINE * size:
            best, width = distance, cols
    return (len(points) // width, width) if width else None


def _step(points: Floats, known: Bools, lag: int) -> tuple[Floats, float]:
    """Median step between points that stand `lag` apart, and its median length; of a sample."""
    pairs = np.flatnonzero(known[:-lag] & known[lag:])
    if not len(pairs):
        return np.zeros(3), 0.0
    pairs = pairs[:: 1 + len(pairs) // SAMPLE]
    steps = points[pairs + lag] - points[pairs]
    return np.median(steps, axis=0), float(np.median(np.linalg.norm(steps, axis=1)))
