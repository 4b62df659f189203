"""Rows and columns of a range image: from the file, the user, or the points themselves."""

from __future__ import annotations

import numpy as np

from planish.errors import InputError
from planish.geometry.axes import principal_axes
from planish.types import Bools, Floats

MAX_STEP = 5.0
"""Largest step between neighbours, in mean distances of evenly spread points."""

MAX_STEP_SHARE = 0.25
"""Largest step between neighbours, relative to the extent."""

MIN_SINE = 0.5
"""Least sine of the angle between column and row steps (30 degrees)."""

SAMPLE = 20_000
"""Pairs of points sampled for each candidate width."""


def grid_shape(
    points: Floats, file_shape: tuple[int, int] | None, user_shape: tuple[int, int] | None
) -> tuple[int, int]:
    """Determine rows and columns of a range image.

    Parameters
    ----------
    points : (n, 3) float64
    file_shape : (int, int) or None
        Rows and columns given in the file.
    user_shape : (int, int) or None
        Rows and columns given by the user; they take precedence.

    Raises
    ------
    InputError
        If they do not give n pixels, or none are given and the points are not organised in rows.
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
    """Detect rows and columns of organised points from neighbour distances; None if there are none.

    Parameters
    ----------
    points : (n, 3) float64
        Row by row; 0 0 0 or NaN for missing points.

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
    """Median step between points `lag` apart, and its median length, of a sample."""
    pairs = np.flatnonzero(known[:-lag] & known[lag:])
    if not len(pairs):
        return np.zeros(3), 0.0
    pairs = pairs[:: 1 + len(pairs) // SAMPLE]
    steps = points[pairs + lag] - points[pairs]
    return np.median(steps, axis=0), float(np.median(np.linalg.norm(steps, axis=1)))
