"""The ground that a sheet lies on: wood with grain, plain grey, or white."""

from __future__ import annotations

from typing import Literal, get_args

import cv2
import numpy as np
from numpy.typing import NDArray

from planish.errors import UsageError

Table = Literal["wood", "plain", "white"]

WOOD = np.array([0.30, 0.17, 0.085])
"""Mean reflectance of wooden tables: red, green, blue; an oak table under varnish."""

PLAIN = np.array([0.13, 0.135, 0.14])
"""A table without any grain: grey laminate."""

WHITE = np.array([0.80, 0.80, 0.78])
"""White laminate, a little darker than paper: nothing but a shadow tells the sheet from it."""

PLANK_MM = 95.0
"""Width of the planks of a wooden table."""


def table_top(kind: Table, half_mm: float, cell_mm: float, rng: np.random.Generator) -> NDArray[np.float32]:
    """Draw a table's reflectance on a square around the origin.

    Wood is value noise: octaves of random numbers, stretched along x and interpolated by cubic splines, with rings
    bent by the coarsest of them, dark pores, and joints between planks.

    Parameters
    ----------
    kind : {"wood", "plain", "white"}
    half_mm : float
        Half the side of the square.
    cell_mm : float
        Side of a cell.
    rng : numpy.random.Generator

    Returns
    -------
    (n, n, 3) float32
        Linear reflectance, 0 to 1; row 0 is at y = -half_mm.

    Examples
    --------
    >>> table_top("wood", 100.0, 1.0, np.random.default_rng(0)).shape
    (200, 200, 3)
    """
    if kind not in get_args(Table):
        raise UsageError(f"there is no table {kind!r}; choose one of {', '.join(get_args(Table))}")
    count = round(2 * half_mm / cell_mm)
    if kind != "wood":
        even = PLAIN if kind == "plain" else WHITE
        return np.broadcast_to(even.astype(np.float32), (count, count, 3)).copy()
    side = 2 * half_mm
    y = np.linspace(-half_mm, half_mm, count, dtype=np.float32)[:, None]
    plank = np.floor(y / PLANK_MM).astype(int)
    plank -= plank.min()
    tone = (1 + 0.10 * rng.standard_normal(plank.max() + 1)).astype(np.float32)[plank]
    bend = _value_noise(rng, side, (260.0, 60.0), count)
    rings = np.sin(2 * np.pi * (y / 9.0 + 3.0 * bend))
    value = 0.10 * rings
    for length, width, height in ((120.0, 8.0, 0.10), (45.0, 2.2, 0.10), (16.0, 0.9, 0.10), (6.0, 0.5, 0.07)):
        value += height * _value_noise(rng, side, (length, width), count)
    pores = _value_noise(rng, side, (5.0, 0.55), count)
    value -= 0.45 * np.clip(pores - 1.3, 0, 0.8)
    joint = np.abs(np.mod(y, PLANK_MM)) < 1.2
    grey = tone * np.exp(value) * np.where(joint, np.float32(0.4), np.float32(1))
    depth = np.clip(1.1 - grey[..., None], -0.5, 0.8) * np.array([0.0, 0.10, 0.18])  # dark wood is redder
    return np.asarray(np.clip(grey[..., None] * WOOD * (1 - depth), 0, 1), np.float32)


def _value_noise(
    rng: np.random.Generator, side_mm: float, grain_mm: tuple[float, float], count: int
) -> NDArray[np.float32]:
    """Random field (count, count) of unit variance with so long and so wide grains."""
    cols, rows = (max(4, int(np.ceil(side_mm / grain)) + 3) for grain in grain_mm)
    coarse = rng.standard_normal((min(rows, count), min(cols, count)), np.float32)
    field = cv2.resize(coarse, (count, count), interpolation=cv2.INTER_CUBIC)
    return np.asarray(field / field.std(), np.float32)
