"""A surface as heights over a grid, fitted to measured places with sharp creases and straight rulings.

The heights z minimise

    sum_k w_k rho(z(x_k) - h_k) + stiffness sum_i (bending |D2 z|_i + straightness a_i |z_rr|_i)

rho is Huber's function, D2 z the second differences (z_uu, sqrt 2 z_uv, z_vv) of a node [mm]. The plain norm, not its
square, makes the sum of bends small, not that of their squares: paper folds along a line, or not at all. z_rr is the
second difference along the ruling through a node, the direction in which the surface bends least: paper does not
stretch, so it is developable, and bends in one direction alone (its Gaussian curvature is zero). This carries a fold
that ends in a measured rim through blank paper, as through the gutter of a book. a is 0 where the surface bends in both
directions alike and 1 where it bends in one.
The minimum is found by iteratively reweighted least squares, as in Multiview Rectification of Folded Documents (You
et al. 2018); the rulings are those of the surface found last.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage, sparse
from scipy.linalg import solveh_banded

from planish.geometry.guards import TINY_SHARE, normalize
from planish.types import Bools, Floats, Ints

ROUNDS = 12
"""Of reweighting. A sharp roof of 1,500 noisy places is right to 0.033 mm rms after 8 rounds, 0.020 after 16, 0.019
after 32."""
HUBER = 2.0
"""Residuals count linearly from so many standard deviations on."""
SMALLEST_BEND = 0.02
"""Bends below this share of the grid's spacing [mm per mm] cost like their square, so that the weights stay finite: an
angle of one degree between neighbouring cells."""
BENDING, STRAIGHTNESS = 0.1, 5.0
"""Of the stiffness. With 0.3 and 5 the page of a crumpled sheet is 1.6 mm off instead of 1.4, that of an open book
alike; with 0.03 and 2 noise is kept, and the open book comes out 1.5 % too large (docs/design-notes-photos.md)."""
HOP = 2.0
"""Second differences along rulings reach so many cells to both sides. With 1 the fold of a gutter stops short of the
middle between its ends; with 3 pages are 0.05 to 0.1 mm truer than with 2, and a fit takes twice as long."""
RULING_CELLS = 1.5
"""Standard deviation of the window in cells, over which the direction of the strongest bend is found; not varied."""
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
    nearest = ndimage.distance_transform_edt(~active, return_distances=False, return_indices=True)
    z = np.full(size, np.median(measured)) if start is None else start[active]
    weight = np.ones(len(measured))
    stiff = stiffness * sum(b.T @ b for b in bends)
    for k in range(ROUNDS):
        if start is not None or k:
            residual = np.abs(at @ z - measured)
            weight = HUBER * sigma / np.maximum(residual, HUBER * sigma)
            bend = np.sqrt(sum((b @ z) ** 2 for b in bends) + smallest**2)
            along, share = _along_rulings(_spread(z, active, nearest), active)
            curve = np.sqrt((along @ z) ** 2 + (smallest * HOP**2 / 4) ** 2)
            stiff = sum(b.T @ sparse.diags(BENDING * stiffness / bend) @ b for b in bends)
            stiff += along.T @ sparse.diags(STRAIGHTNESS * stiffness / HOP**2 * share / curve) @ along
        data = at.T @ sparse.diags(weight / sigma**2)
        matrix = data @ at + stiff + RANK * sparse.eye(size)
        z = _solve(matrix, data @ measured + RANK * z, active)
    return _spread(z, active, nearest), weight


def _spread(z: Floats, active: Bools, nearest: Ints) -> Floats:
    """Heights (rows, cols) of active nodes, and of the nearest active one elsewhere."""
    heights = np.zeros(active.shape)
    heights[active] = z
    return heights[tuple(nearest)]


def _solve(matrix: sparse.spmatrix, right: Floats, active: Bools) -> Floats:
    """Solve for the active nodes, in the order along the grid's shorter side: nodes that are near have near numbers."""
    row, col = np.nonzero(active)
    order = np.lexsort((row, col)) if active.any(axis=1).sum() < active.any(axis=0).sum() else np.arange(len(row))
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    entries = matrix.tocoo()
    i, j = place[entries.row], place[entries.col]
    lower = i >= j
    i, j = i[lower], j[lower]
    bands = np.zeros((int((i - j).max()) + 1, len(order)), order="F")
    bands[i - j, j] = entries.data[lower]
    return np.asarray(solveh_banded(bands, right[order], lower=True, overwrite_ab=True, check_finite=False)[place])


def _along_rulings(heights: Floats, active: Bools) -> tuple[sparse.csr_matrix, Floats]:
    """Second differences [mm] of active nodes along their rulings, as a matrix, and each one's share a."""
    across, share = strongest_bends(heights)
    rows, cols = active.shape
    row, col = np.nonzero(active)
    ends = [
        np.stack([col - sign * HOP * np.sin(across[active]), row + sign * HOP * np.cos(across[active])], axis=1)
        for sign in (1, -1)
    ]
    whole = np.ones(len(row), bool)
    padded = np.pad(active, 1)
    for end in ends:
        j, i = np.clip(np.floor(end).astype(np.int64), -1, [cols - 1, rows - 1]).T + 1
        whole &= padded[i, j] & padded[i, j + 1] & padded[i + 1, j] & padded[i + 1, j + 1]
    grid = Grid(np.zeros(3), np.eye(3), 1.0, active.shape)
    both = sum(interpolation(grid, end[whole])[:, active.ravel()] for end in ends)
    middle = sparse.eye(len(row), format="csr")[whole]
    return both - 2 * middle, share[active][whole]


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


def strongest_bends(heights: Floats) -> tuple[Floats, Floats]:
    """Direction in which a surface bends most, and how much it bends in that direction alone.

    The direction is the first eigenvector of the squared second differences, averaged over a window; mountains and
    valleys add up in the square.

    Parameters
    ----------
    heights : (rows, cols) float64 [mm]

    Returns
    -------
    across : (rows, cols) float64 [rad]
        From the direction of the columns to that of the rows. The ruling is at right angles to it.
    share : (rows, cols) float64
        (p - q) / (p + q) for the mean squares p and q of the bends across and along the ruling: 1 on a developable
        surface.
    """
    uu, vv, uv = np.zeros_like(heights), np.zeros_like(heights), np.zeros_like(heights)
    uu[:, 1:-1] = heights[:, 2:] - 2 * heights[:, 1:-1] + heights[:, :-2]
    vv[1:-1] = heights[2:] - 2 * heights[1:-1] + heights[:-2]
    uv[1:-1, 1:-1] = (heights[2:, 2:] - heights[2:, :-2] - heights[:-2, 2:] + heights[:-2, :-2]) / 4
    a, b, c = (ndimage.gaussian_filter(m, RULING_CELLS) for m in (uu**2 + uv**2, uv * (uu + vv), vv**2 + uv**2))
    return 0.5 * np.arctan2(2 * b, a - c), np.hypot(a - c, 2 * b) / (a + c + TINY_SHARE)
