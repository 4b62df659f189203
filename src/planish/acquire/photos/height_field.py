"""A surface as heights over a grid, fitted to measured places with sharp creases.

The heights z minimise

    sum_k w_k rho(z(x_k) - h_k) + stiffness sum_i |D2 z|_i

rho is Huber's function, D2 z the second differences (z_uu, sqrt 2 z_uv, z_vv) of a node [mm]. The plain norm, not its
square, makes the sum of bends small, not that of their squares: paper folds along a line, or not at all.
The minimum is found by iteratively reweighted least squares, as in Multiview Rectification of Folded Documents (You
et al. 2018).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage, sparse
from scipy.sparse.linalg import LinearOperator, cg, splu

from planish.geometry.guards import normalize
from planish.types import Bools, Floats, Ints

ROUNDS = 12
"""Of reweighting. A sharp roof of 1,500 noisy places is right to 0.033 mm rms after 8 rounds, 0.020 after 16, 0.019
after 32."""
HUBER = 2.0
"""Residuals count linearly from so many standard deviations on."""
SMALLEST_BEND = 0.02
"""Bends below this share of the grid's spacing [mm per mm] cost like their square, so that the weights stay finite: an
angle of one degree between neighbouring cells."""
TOLERANCE, MOST_STEPS = 1e-4, 30
"""Conjugate gradients, preconditioned with the factors of an earlier round, solve a round in so many steps or not at
all. A factorization takes as long as thirty."""
RANK = 1e-6
"""Weight of heights that nothing measured, against a singular matrix."""


@dataclass(frozen=True, eq=False)
class Grid:
    """A plane grid in space, over which heights are given.

    Attributes
    ----------
    origin : (3,) float64 [mm]
        Place of node (0, 0) at height 0.
    axes : (3, 3) float64
        Unit rows: along columns, along rows, and up.
    spacing : float [mm]
    shape_rc : (int, int)
    """

    origin: Floats
    axes: Floats
    spacing: float
    shape_rc: tuple[int, int]

    def to_grid(self, points: Floats) -> tuple[Floats, Floats]:
        """Columns and rows (n, 2) of points, and their heights (n,) [mm]."""
        local = (points - self.origin) @ self.axes.T
        return local[:, :2] / self.spacing, local[:, 2]

    def to_space(self, heights: Floats) -> Floats:
        """Places (rows cols, 3) of all nodes, row by row."""
        rows, cols = self.shape_rc
        v, u = np.mgrid[:rows, :cols] * self.spacing
        local = np.stack([u.ravel(), v.ravel(), heights.ravel()], axis=1)
        return np.asarray(self.origin + local @ self.axes)

    def normals(self, heights: Floats) -> Floats:
        """Upward unit normals (rows cols, 3) at all nodes."""
        dv, du = np.gradient(heights, self.spacing)
        local = np.stack([-du.ravel(), -dv.ravel(), np.ones(heights.size)], axis=1)
        return np.asarray(normalize(local) @ self.axes)

    def faces(self) -> Ints:
        """Two triangles a cell (m, 3), counter-clockwise seen from above."""
        rows, cols = self.shape_rc
        index = np.arange(rows * cols, dtype=np.int32).reshape(rows, cols)
        a, b, c, d = (k.ravel() for k in (index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]))
        return np.concatenate([np.stack([a, b, c], axis=1), np.stack([b, d, c], axis=1)])

    def refined(self, spacing: float) -> Grid:
        """The same extent with another spacing."""
        rows, cols = (int(np.floor((n - 1) * self.spacing / spacing)) + 1 for n in self.shape_rc)
        return Grid(self.origin, self.axes, spacing, (rows, cols))


def interpolation(grid: Grid, columns_rows: Floats) -> sparse.csr_matrix:
    """Bilinear interpolation of node values at places (n, 2), as a matrix (n, nodes); places outside are clamped."""
    rows, cols = grid.shape_rc
    u, v = np.clip(columns_rows, 0, [cols - 1.001, rows - 1.001]).T
    j, i = u.astype(np.int64), v.astype(np.int64)
    fu, fv = u - j, v - i
    node = i * cols + j
    at = np.stack([node, node + 1, node + cols, node + cols + 1], axis=1)
    share = np.stack([(1 - fu) * (1 - fv), fu * (1 - fv), (1 - fu) * fv, fu * fv], axis=1)
    k = np.repeat(np.arange(len(u)), 4)
    return sparse.csr_matrix((share.ravel(), (k, at.ravel())), (len(u), rows * cols))


def fit_heights(
    grid: Grid,
    at: sparse.csr_matrix,
    measured: Floats,
    sigma: Floats,
    stiffness: float,
    start: Floats | None = None,
    active: Bools | None = None,
) -> tuple[Floats, Floats]:
    """Fit heights to measurements.

    Parameters
    ----------
    grid : Grid
    at : (k, nodes) sparse
        What each measurement is of the heights; see `interpolation`.
    measured, sigma : (k,) float64 [mm]
        Heights and their standard deviations.
    stiffness : float [1 / mm]
        Cost of a node's bend of 1 mm, where a deviation of one sigma costs 1/2.
    start : (rows, cols) float64 [mm], optional
    active : (rows, cols) bool, optional
        Nodes whose heights are sought; the others get that of the nearest. By default all.

    Returns
    -------
    heights : (rows, cols) float64 [mm]
    weight : (k,) float64
        Of the measurements at the end: 1, or less beyond `HUBER` standard deviations.
    """
    active = np.ones(grid.shape_rc, bool) if active is None else active
    bends = [b[:, active.ravel()] for b in _second_differences(active)]
    at = at[:, active.ravel()]
    size = int(active.sum())
    smallest = SMALLEST_BEND * grid.spacing
    z = np.full(size, np.median(measured)) if start is None else start[active]
    bend_weight, weight = np.ones(active.size), np.ones(len(measured))
    factors = None
    for k in range(ROUNDS):
        if start is not None or k:
            residual = np.abs(at @ z - measured)
            weight = HUBER * sigma / np.maximum(residual, HUBER * sigma)
            bend_weight = 1 / np.sqrt(sum((b @ z) ** 2 for b in bends) + smallest**2)
        data = at.T @ sparse.diags(weight / sigma**2)
        stiff = sum(b.T @ sparse.diags(stiffness * bend_weight) @ b for b in bends)
        matrix = (data @ at + stiff + RANK * sparse.eye(size)).tocsc()
        right = data @ measured + RANK * z
        solved = (
            None
            if factors is None
            else cg(matrix, right, z, rtol=TOLERANCE, maxiter=MOST_STEPS, M=LinearOperator(matrix.shape, factors.solve))
        )
        if solved is None or solved[1] != 0:  # the weights have changed too much: factorize anew
            factors = splu(matrix, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
            z = factors.solve(right)
        else:
            z = solved[0]
    nearest = ndimage.distance_transform_edt(~active, return_distances=False, return_indices=True)
    heights = np.zeros(grid.shape_rc)
    heights[active] = z
    return heights[tuple(nearest)], weight


def _second_differences(active: Bools) -> list[sparse.csr_matrix]:
    """Matrices (nodes, nodes) of z_uu, z_vv and sqrt 2 z_uv [mm]; rows that reach beyond the active nodes are empty."""
    cols = active.shape[1]
    inner = np.flatnonzero(active)

    def stencil(offsets: list[int], values: list[float]) -> sparse.csr_matrix:
        padded = np.pad(active, 1)
        whole = np.ones(len(inner), bool)
        row, col = np.divmod(inner, cols)
        for offset in offsets:
            down = round(offset / cols)
            whole &= padded[row + 1 + down, col + 1 + offset - down * cols]
        node = inner[whole]
        j = (node[:, None] + offsets).ravel()
        return sparse.csr_matrix(
            (np.tile(values, len(node)), (np.repeat(node, len(offsets)), j)), (active.size, active.size)
        )

    twist = np.sqrt(2) / 4
    return [
        stencil([-1, 0, 1], [1, -2, 1]),
        stencil([-cols, 0, cols], [1, -2, 1]),
        stencil([-cols - 1, -cols + 1, cols - 1, cols + 1], [twist, -twist, -twist, twist]),
    ]
