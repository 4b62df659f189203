"""Elasticity once more, on few large cells that know which parts of a sheet hang together.

A plain grid takes the two sides of a cut for one piece and a slender arm for a stout one, and so holds back just the
motions that a comb, a ring cut open or a C still has to make. Here each cell is split into patches, the parts of the
sheet in it that hang together; patches share the corners of their cells where an edge of the mesh joins them, and
nowhere else. There are so few that the sparse matrix is factored outright.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.sparse import coo_array, csc_array, diags_array
from scipy.sparse.linalg import SuperLU, splu

from planish.geometry.guards import TINY
from planish.types import Floats, Ints, read_only

SMALL = 0.1
"""A patch with less than this part of the usual number of points joins its largest neighbour: hung on by one corner
it could spin. With 0.25 so many points lie outside their cells that the steps become too long; with 0.03 some spin."""

GROUND = 1e-6
"""Share of the diagonal that ties every corner down, as the pieces of a sheet are free to move as a whole."""


class Patches(NamedTuple):
    """The coarse level of the preconditioner.

    Attributes
    ----------
    patch : (n,) int32
        Of each point.
    share : (n, 2) float64
        Where a point lies in the cell of its patch along x and y; outside 0 to 1 where its own patch was too small.
    corner : (p, 4) int32
        Nodes at the lower left, lower right, upper left and upper right of each patch.
    factor : SuperLU
        Of the stiffness of all nodes.
    piece : (nodes,) int32
        Nodes that hang together have the same number.
    rigid : (nodes, 2, 3) float64
        Motions of each piece as a whole, orthonormal: along x, along y, about its middle.
    """

    patch: Ints
    share: Floats
    corner: Ints
    factor: SuperLU
    piece: Ints
    rigid: Floats


def make_patches(xy: Floats, edges: Ints, mass: Floats, low: Floats, side: float) -> Patches:
    """Cut a layout into patches and factor their stiffness.

    Parameters
    ----------
    xy : (n, 2) float64 [mm]
    edges : (e, 2) int32
    mass : (n,) float64
        Half the sum of w r^2 over the sticks at each point.
    low : (2,) float64 [mm]
        Corner of the grid.
    side : float [mm]
        Of its cells.
    """
    patch, cell, size = _split(xy, edges, low, side)
    across = _between(read_only(edges), patch)
    heir = _heirs(patch[across], size)
    keeps = heir == np.arange(len(heir))
    number = (np.cumsum(keeps, dtype=np.int32) - np.int32(1))[heir]
    cell = cell[keeps]
    share, mass_of_patch = _assign(xy, mass, low, side, number, cell, patch)
    across = _between(read_only(across), patch)
    corner, nodes = _share_corners(cell, patch[across])
    matrix = _stiffness(corner, mass_of_patch / side**2, nodes)
    far = across[np.abs(cell[patch[across[:, 0]]] - cell[patch[across[:, 1]]]).max(1) > 1]
    if len(far):
        matrix = matrix + _long_edges(xy, far, corner[patch], share, nodes)
    matrix = (matrix + GROUND * diags_array(matrix.diagonal())).tocsc()
    factor = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    piece, rigid = _rigid_motions(cell, corner, patch[across], nodes)
    return Patches(patch, share, corner, factor, piece, rigid)


def solve_patches(patches: Patches, force: Floats) -> Floats:
    """(nodes, 2) displacements of the nodes under forces (n, 2) on the points.

    Pieces do not move as a whole. The forces in a sheet have no moment where it lies now, but a little where it lay
    when the patches were cut, and nothing holds the whole back.
    """
    load = _load(patches.patch, patches.share, patches.corner, force, len(patches.piece))
    _take_out(load, patches.piece, patches.rigid)
    broad = patches.factor.solve(load.ravel()).reshape(-1, 2)
    _take_out(broad, patches.piece, patches.rigid)
    return np.asarray(broad)


@njit(cache=True, nogil=True)
def _find(parent, i):  # type: ignore[no-untyped-def]
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@njit(cache=True, nogil=True)
def _join(parent, i, j):  # type: ignore[no-untyped-def]
    a, b = _find(parent, i), _find(parent, j)
    parent[max(a, b)] = min(a, b)


@njit(cache=True, nogil=True)
def _number(parent):  # type: ignore[no-untyped-def]
    """Consecutive numbers for the groups of a forest whose roots come first in their groups."""
    number = np.empty(len(parent), np.int32)
    count = 0
    for i in range(len(parent)):
        if parent[i] == i:
            number[i] = count
            count += 1
        else:
            number[i] = number[_find(parent, i)]
    return number, count


@njit(cache=True, nogil=True)
def _split(xy, edges, low, side):  # type: ignore[no-untyped-def]
    """Patch of each point; column and row of the cell of each patch, and how many points it has."""
    place = np.empty((len(xy), 2), np.int32)
    for i in range(len(xy)):
        place[i, 0], place[i, 1] = int((xy[i, 0] - low[0]) / side), int((xy[i, 1] - low[1]) / side)
    parent = np.arange(len(xy)).astype(np.int32)
    for e in range(len(edges)):
        i, j = edges[e, 0], edges[e, 1]
        if place[i, 0] == place[j, 0] and place[i, 1] == place[j, 1]:
            _join(parent, i, j)
    patch, count = _number(parent)
    cell, size = np.empty((count, 2), np.int64), np.zeros(count, np.int64)
    for i in range(len(xy)):
        cell[patch[i], 0], cell[patch[i], 1] = place[i, 0], place[i, 1]
        size[patch[i]] += 1
    return patch, cell, size


@njit(cache=True, nogil=True)
def _between(edges, patch):  # type: ignore[no-untyped-def]
    """Edges from one patch to another."""
    across = np.empty_like(edges)
    count = 0
    for e in range(len(edges)):
        if patch[edges[e, 0]] != patch[edges[e, 1]]:
            across[count, 0], across[count, 1] = edges[e, 0], edges[e, 1]
            count += 1
    return across[:count].copy()


@njit(cache=True, nogil=True)
def _assign(xy, mass, low, side, number, cell, patch):  # type: ignore[no-untyped-def]
    """Give each point the new number of its patch, its share of the cell, and its mass to the patch."""
    share, total = np.empty_like(xy), np.zeros(len(cell))
    for i in range(len(xy)):
        p = number[patch[i]]
        patch[i] = p
        total[p] += mass[i]
        for d in range(2):
            share[i, d] = (xy[i, d] - low[d]) / side - cell[p, d]
    return share, total


@njit(cache=True, nogil=True)
def _heirs(pairs, size):  # type: ignore[no-untyped-def]
    """The patch that takes each patch's points: itself, or its largest neighbour where it is small itself."""
    heir = np.arange(len(size))
    usual = np.sum(size * size) / np.sum(size)  # the size of the patch of a point taken at random
    for p in range(len(pairs)):
        for a, b in ((pairs[p, 0], pairs[p, 1]), (pairs[p, 1], pairs[p, 0])):
            larger = size[b] > size[a] or (size[b] == size[a] and b < a)
            if size[a] < SMALL * usual and larger and (heir[a] == a or size[b] > size[heir[a]]):
                heir[a] = b
    for a in range(len(heir)):
        while heir[a] != heir[heir[a]]:
            heir[a] = heir[heir[a]]
    return heir


@njit(cache=True, nogil=True)
def _share_corners(cell, pairs):  # type: ignore[no-untyped-def]
    """Nodes at the corners of each patch; patches that an edge joins have those of their common corners in common."""
    parent = np.arange(4 * len(cell)).astype(np.int32)
    for p in range(len(pairs)):
        a, b = pairs[p, 0], pairs[p, 1]
        for k in range(4):
            column = cell[a, 0] + k % 2 - cell[b, 0]
            row = cell[a, 1] + k // 2 - cell[b, 1]
            if 0 <= column <= 1 and 0 <= row <= 1:
                _join(parent, 4 * a + k, 4 * b + 2 * row + column)
    node, count = _number(parent)
    return node.reshape(-1, 4), count


@njit(cache=True, nogil=True)
def _rigid_motions(cell, corner, pairs, nodes):  # type: ignore[no-untyped-def]
    parent = np.arange(len(cell)).astype(np.int32)
    for p in range(len(pairs)):
        _join(parent, pairs[p, 0], pairs[p, 1])
    piece_of_patch, count = _number(parent)
    piece = np.empty(nodes, np.int32)
    at = np.empty((nodes, 2))
    for p in range(len(cell)):
        for k in range(4):
            piece[corner[p, k]] = piece_of_patch[p]
            at[corner[p, k], 0], at[corner[p, k], 1] = cell[p, 0] + k % 2, cell[p, 1] + k // 2
    sums = np.zeros((count, 3))
    for i in range(nodes):
        sums[piece[i], 0] += at[i, 0]
        sums[piece[i], 1] += at[i, 1]
        sums[piece[i], 2] += 1.0
    moment = np.zeros(count)
    for i in range(nodes):
        for d in range(2):
            at[i, d] -= sums[piece[i], d] / sums[piece[i], 2]
        moment[piece[i]] += at[i, 0] ** 2 + at[i, 1] ** 2
    rigid = np.zeros((nodes, 2, 3))
    for i in range(nodes):
        rigid[i, 0, 0] = rigid[i, 1, 1] = 1.0 / np.sqrt(sums[piece[i], 2])
        rigid[i, 0, 2], rigid[i, 1, 2] = -at[i, 1] / np.sqrt(moment[piece[i]]), at[i, 0] / np.sqrt(moment[piece[i]])
    return piece, rigid


@njit(cache=True, nogil=True)
def _take_out(field, piece, rigid):  # type: ignore[no-untyped-def]
    """Take the motions of whole pieces out of a field over the nodes."""
    part = np.zeros((piece.max() + 1, 3))
    for i in range(len(piece)):
        for k in range(3):
            part[piece[i], k] += field[i, 0] * rigid[i, 0, k] + field[i, 1] * rigid[i, 1, k]
    for i in range(len(piece)):
        for k in range(3):
            field[i, 0] -= part[piece[i], k] * rigid[i, 0, k]
            field[i, 1] -= part[piece[i], k] * rigid[i, 1, k]


def _square() -> Floats:
    """(8, 8) stiffness of one square of stiffness 1: the couplings that `grid` lists."""
    matrix = np.empty((4, 2, 4, 2))
    x, y = np.array([-1, 1, -1, 1]), np.array([-1, -1, 1, 1])
    for i in range(4):
        for j in range(4):
            along, aside = ((1 / 6, -5 / 48), (1 / 48, -1 / 12)), ((1 / 6, 1 / 48), (-5 / 48, -1 / 12))
            matrix[i, 0, j, 0] = along[int(y[i] != y[j])][int(x[i] != x[j])]
            matrix[i, 1, j, 1] = aside[int(y[i] != y[j])][int(x[i] != x[j])]
            matrix[i, 0, j, 1] = matrix[i, 1, j, 0] = (x[i] * y[j] + y[i] * x[j]) / 32
    return matrix.reshape(8, 8)


def _stiffness(corner: Ints, kappa: Floats, nodes: int) -> csc_array:
    at = (2 * corner[:, :, None] + np.arange(2)).reshape(-1, 8)
    rows, columns = np.repeat(at, 8, axis=1), np.tile(at, (1, 8))
    values = kappa[:, None] * _square().ravel()
    return coo_array((values.ravel(), (rows.ravel(), columns.ravel())), shape=(2 * nodes, 2 * nodes)).tocsc()


def _long_edges(xy: Floats, edges: Ints, corner: Ints, share: Floats, nodes: int) -> csc_array:
    """Stiffness u u^T of edges so long that their ends lie in cells without a common corner, one by one."""
    arm = xy[edges[:, 1]] - xy[edges[:, 0]]
    arm /= np.maximum(np.linalg.norm(arm, axis=1, keepdims=True), TINY)
    rows = np.arange(len(edges)).repeat(16)
    at, value = [], []
    for end, sign in ((0, -1.0), (1, 1.0)):
        i = edges[:, end]
        s, t = share[i].T
        weight = np.stack([(1 - s) * (1 - t), s * (1 - t), (1 - s) * t, s * t], axis=1)
        at.append(2 * corner[i][:, :, None] + np.arange(2))
        value.append(sign * weight[:, :, None] * arm[:, None, :])
    columns, values = np.concatenate(at, axis=1), np.concatenate(value, axis=1)
    stretch = coo_array((values.ravel(), (rows, columns.ravel())), shape=(len(edges), 2 * nodes)).tocsr()
    return (stretch.T @ stretch).tocsc()


@njit(cache=True, nogil=True)
def _load(patch, share, corner, force, nodes):  # type: ignore[no-untyped-def]
    load = np.zeros((nodes, 2))
    for i in range(len(patch)):
        s, t = share[i, 0], share[i, 1]
        a, b, c, d = corner[patch[i]]
        for k in range(2):
            low, high = (1.0 - t) * force[i, k], t * force[i, k]
            load[a, k] += (1.0 - s) * low
            load[b, k] += s * low
            load[c, k] += (1.0 - s) * high
            load[d, k] += s * high
    return load
