"""What a sheet bent in one direction leaves over: a smooth shift of the page, free in both directions."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Protocol

import numpy as np
from scipy.interpolate import BSpline

from planish.types import Floats

CELLS = (9, 11)
"""Cubic splines along and across the lines: a page in pieces of an inch."""
INVERSION_STEPS = 6
"""Of the shift; each divides its error by its steepness, which is small."""


class AnyShift(Protocol):
    """A page, from `low` to `high`, and where its places are on the bent sheet."""

    @property
    def low(self) -> Floats:
        """Its corner at the beginning of the first line."""

    @property
    def high(self) -> Floats:
        """Its corner at the end of the last line."""

    def undone(self, true: Floats) -> Floats:
        """Places (n, 2) of the bent sheet for those of the page."""


@dataclass(frozen=True, eq=False)
class Shift:
    """How far places of the page lie off where the bent sheet alone has them.

    Attributes
    ----------
    low, high : (2,) float64
        Corners of the page, along and across its lines.
    numbers : (cells, 2) float64
        Coefficients of the splines for the shift along and across.
    """

    low: Floats
    high: Floats
    numbers: Floats

    def __call__(self, page: Floats) -> Floats:
        """The shift at places of the bent sheet: (n, 2); constant beyond the page."""
        return splines(page, self.low, self.high) @ self.numbers

    def undone(self, true: Floats) -> Floats:
        """Places of the bent sheet that are shifted to given ones: (n, 2)."""
        page = true
        for _ in range(INVERSION_STEPS):
            page = true - self(page)
        return page


def no_shift(low: Floats, high: Floats) -> Shift:
    """The shift of a sheet that fits as it is."""
    return Shift(low, high, np.zeros((CELLS[0] * CELLS[1], 2)))


def splines(page: Floats, low: Floats, high: Floats) -> Floats:
    """All products of splines along and across: (n, cells)."""
    along, across = (_splines((page[:, k] - low[k]) / (high[k] - low[k]), CELLS[k]) for k in (0, 1))
    return np.asarray((along[:, :, None] * across[:, None, :]).reshape(len(page), CELLS[0] * CELLS[1]))


def _splines(place: Floats, count: int) -> Floats:
    knots = np.concatenate([[0, 0, 0], np.linspace(0, 1, count - 2), [1, 1, 1]])
    return np.asarray(BSpline(knots, np.eye(count), 3)(np.clip(place, 0, 1)))


def fit_shift(shift: Shift, page: Floats, wanted: Floats, weight: Floats, axis: Floats, stiffness: float) -> Shift:
    """Find the smoothest shift that brings places where they are wanted.

    Least squares of weight (wanted - shift)^2 + stiffness (second differences of the splines' coefficients)^2.

    Parameters
    ----------
    shift : Shift
        For its corners.
    page : (n, 2) float64
        Places on the bent sheet.
    wanted : (n,) float64
        How far each is to be moved along (axis 0) or across (axis 1).
    weight : (n,) float64
    axis : (n,) int
    stiffness : float
    """
    bend = _second_differences()
    numbers = np.zeros_like(shift.numbers)
    for k in (0, 1):
        here = axis == k
        base = splines(page[here], shift.low, shift.high)
        normal = (base * weight[here, None]).T @ base + stiffness * bend + 1e-3 * stiffness * np.eye(len(bend))
        numbers[:, k] = np.linalg.solve(normal, base.T @ (weight[here] * wanted[here]))
    return Shift(shift.low, shift.high, numbers)


def _second_differences() -> Floats:
    """Sum of squares, along, across and mixed, as a matrix: (cells, cells)."""
    first = [np.diff(np.eye(n), axis=0) for n in CELLS]
    second = [np.diff(np.eye(n), 2, axis=0) for n in CELLS]
    one = [np.eye(n) for n in CELLS]
    parts = [np.kron(second[0], one[1]), np.kron(one[0], second[1]), np.sqrt(2) * np.kron(first[0], first[1])]
    return np.asarray(sum(p.T @ p for p in parts))


def grid(low: Floats, high: Floats, step: float) -> tuple[Floats, tuple[int, int]]:
    """Places in even rows over a page: (rows * cols, 2), and how many (rows, cols)."""
    cols, rows = (2 + int((high[k] - low[k]) / step) for k in (0, 1))
    along, across = np.linspace(low[0], high[0], cols), np.linspace(low[1], high[1], rows)
    return np.array([(x, y) for y, x in product(across, along)]), (rows, cols)
