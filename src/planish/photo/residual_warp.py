"""Residual 2D B-spline warp after the cylinder fit."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Protocol

import numpy as np
from scipy.interpolate import BSpline

from planish.types import Floats

CELLS = (9, 11)
"""Cubic B-splines along and across the text lines: one per inch of a page."""
INVERSION_STEPS = 6
"""Fixed-point iterations of the inverse; each divides its error by the warp's small gradient."""


class PageWarp(Protocol):
    """A page, from `low` to `high`, and the map from page positions to the cylinder."""

    @property
    def low(self) -> Floats:
        """Page corner at the beginning of the first line."""

    @property
    def high(self) -> Floats:
        """Page corner at the end of the last line."""

    def inverse(self, true: Floats) -> Floats:
        """Map page positions (n, 2) to cylinder positions (n, 2)."""


@dataclass(frozen=True, eq=False)
class ResidualWarp:
    """Displacement field of the page that the cylinder alone does not explain.

    Attributes
    ----------
    low, high : (2,) float64
        Corners of the page, along and across the text lines.
    coefficients : (cells, 2) float64
        B-spline coefficients of the displacement along and across.
    """

    low: Floats
    high: Floats
    coefficients: Floats

    def __call__(self, page: Floats) -> Floats:
        """Displacement at cylinder positions: (n, 2); constant beyond the page."""
        return spline_basis(page, self.low, self.high) @ self.coefficients

    def inverse(self, true: Floats) -> Floats:
        """Map page positions (n, 2) to cylinder positions (n, 2)."""
        page = true
        for _ in range(INVERSION_STEPS):
            page = true - self(page)
        return page


def identity_warp(low: Floats, high: Floats) -> ResidualWarp:
    """Return a warp that displaces nothing."""
    return ResidualWarp(low, high, np.zeros((CELLS[0] * CELLS[1], 2)))


def spline_basis(page: Floats, low: Floats, high: Floats) -> Floats:
    """Tensor-product B-spline basis: (n, cells)."""
    along, across = (_spline_basis_1d((page[:, k] - low[k]) / (high[k] - low[k]), CELLS[k]) for k in (0, 1))
    return np.asarray((along[:, :, None] * across[:, None, :]).reshape(len(page), CELLS[0] * CELLS[1]))


def _spline_basis_1d(position: Floats, count: int) -> Floats:
    knots = np.concatenate([[0, 0, 0], np.linspace(0, 1, count - 2), [1, 1, 1]])
    return np.asarray(BSpline(knots, np.eye(count), 3)(np.clip(position, 0, 1)))


def fit_warp(
    warp: ResidualWarp, page: Floats, target: Floats, weight: Floats, axis: Floats, stiffness: float
) -> ResidualWarp:
    """Fit a smooth warp to target displacements.

    Penalised least squares: sum of weight (target - warp)^2 + stiffness (second differences of coefficients)^2.

    Parameters
    ----------
    warp : ResidualWarp
        Gives the page corners.
    page : (n, 2) float64
        Cylinder positions.
    target : (n,) float64
        Target displacement along (axis 0) or across (axis 1) the text lines.
    weight : (n,) float64
    axis : (n,) int
    stiffness : float
    """
    bend = _second_differences()
    coefficients = np.zeros_like(warp.coefficients)
    for k in (0, 1):
        mask = axis == k
        basis = spline_basis(page[mask], warp.low, warp.high)
        normal = (basis * weight[mask, None]).T @ basis + stiffness * bend + 1e-3 * stiffness * np.eye(len(bend))
        coefficients[:, k] = np.linalg.solve(normal, basis.T @ (weight[mask] * target[mask]))
    return ResidualWarp(warp.low, warp.high, coefficients)


def _second_differences() -> Floats:
    """Penalty matrix (cells, cells): squared second differences along, across and mixed."""
    first = [np.diff(np.eye(n), axis=0) for n in CELLS]
    second = [np.diff(np.eye(n), 2, axis=0) for n in CELLS]
    one = [np.eye(n) for n in CELLS]
    parts = [np.kron(second[0], one[1]), np.kron(one[0], second[1]), np.sqrt(2) * np.kron(first[0], first[1])]
    return np.asarray(sum(p.T @ p for p in parts))


def grid(low: Floats, high: Floats, step: float) -> tuple[Floats, tuple[int, int]]:
    """Regular grid over a page: positions (rows * cols, 2) and shape (rows, cols)."""
    cols, rows = (2 + int((high[k] - low[k]) / step) for k in (0, 1))
    along, across = np.linspace(low[0], high[0], cols), np.linspace(low[1], high[1], rows)
    return np.array([(x, y) for y, x in product(across, along)]), (rows, cols)
