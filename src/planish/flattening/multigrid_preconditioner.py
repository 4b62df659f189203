"""A preconditioner for the sticks: elasticity on a regular grid under the sheet, by multigrid.

To long waves a net of sticks is an elastic sheet. For sticks in all directions its stiffness is that of the
isotropic material with C_1111 = 3/8 and C_1122 = C_1212 = 1/8 times the sum of w r^2 over the area. On squares
with bilinear displacements u, v the energy of that material couples, for each cell of stiffness kappa,

    a corner with itself        kappa (1/6 in uu and vv, sigma/16 in uv)
    with its neighbour along x  kappa (-5/48 in uu, 1/48 in vv)
    with its neighbour along y  kappa (1/48 in uu, -5/48 in vv)
    with the corner across      kappa (-1/12 in uu and vv, -sigma/16 in uv)

where sigma is 1 at the lower left and upper right corner and -1 at the others. Short waves are left to each point's
own block of the Hessian.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planish.flattening.energy import Net, stiffness
from planish.flattening.lengths import median_edge
from planish.flattening.patches import Patches, make_patches, solve_patches
from planish.mesh import bounds
from planish.parallel import ParallelFor
from planish.types import Floats, Ints

Float32s = NDArray[np.float32]

ONE, QUARTER = np.float32(1), np.float32(0.25)
SELF, SHEAR = np.float32(1 / 6), np.float32(1 / 16)
ALONG, ASIDE, ACROSS = np.float32(-5 / 48), np.float32(1 / 48), np.float32(-1 / 12)

CELL = 2.0
"""Side of the finest cells in median edges. With 1.5, 2 and 3, conjugate gradients need 27, 29 and 34 steps on 30,000
points in rows, 36, 38 and 43 on a random mesh; smaller cells cost more than they save."""

OVERLAP = 0.5
"""Part of what points, grids and patches each ask for, as all three answer to waves of middling length. It makes full
steps safe: five test sheets take 82 steps together with 1, 77 with 0.75, 70 with 0.5, 69 with 0.4."""

DAMPING = 0.05
"""Share of a point's mean stiffness added to its block, which has no grip across a straight row of sticks. With 0.2
conjugate gradients take a step or two more."""

FEW = 1500
"""Cells that hold some of the sheet on the level that is solved outright, at most: 4 ms to factor. On a comb of
30,000 points conjugate gradients take 51 steps with 400, 40 with 1,500, 36 with 5,000."""


class Preconditioner(NamedTuple):
    """What takes forces to steps.

    Attributes
    ----------
    node : (n,) int32
        Lower left node of the finest cell that each point lies in, counted row by row.
    share : (n, 2) float32
        Where in its cell a point lies, 0 to 1 along x and y.
    block : (n, 3) float32
        Inverse xx, xy, yy of each point's own stiffness.
    kappa : tuple of (rows + 2, cols + 2) float32
        Stiffness of the cells of each level, finest first, with a rim of zeros.
    patches : Patches
        The level that is solved outright.
    """

    node: Ints
    share: Float32s
    block: Float32s
    kappa: tuple[Float32s, ...]
    patches: Patches


def make_preconditioner(net: Net, edges: int, xy: Floats, parallel_for: ParallelFor) -> Preconditioner:
    """Build the preconditioner for sticks that lie as they do in `xy`, of which the first `edges` are edges."""
    low, high = bounds(xy)
    size = high - low
    side = _side(CELL * median_edge(net.rest[:edges]), size, len(xy))
    cols, rows = (size / side).astype(int) + 1
    node, share = np.empty(len(xy), np.int32), np.empty((len(xy), 2), np.float32)
    parallel_for(_locate, len(xy), xy, low, side, cols, node, share)
    own = stiffness(net, xy, parallel_for)
    block = np.empty((len(xy), 3), np.float32)
    parallel_for(_invert, len(xy), own, block)
    mass = own[:, 3] / OVERLAP
    kappa = [_spread(node, mass / side**2, rows, cols)]
    while np.count_nonzero(kappa[-1]) > FEW:
        kappa.append(_coarsen(kappa[-1]))
    patches = make_patches(xy, net.pairs[:edges], mass, low, side * 2 ** (len(kappa) - 1))
    return Preconditioner(node, share, block, tuple(kappa), patches)


def precondition(p: Preconditioner, force: Floats, parallel_for: ParallelFor) -> Floats:
    """(n, 2) step that a force on each point asks for; a symmetric and positive definite map.

    The sum of three: what each point's own block asks for, what the fine grids do, what the patches do.
    """
    step = np.empty_like(force)
    load = _nodes(p.kappa[0])
    _restrict(p.node, p.share, force, load)
    wave = _cycle(p.kappa, load)
    broad = solve_patches(p.patches, force)
    q = p.patches
    parallel_for(_prolong, len(force), p.node, p.share, p.block, wave, q.patch, q.share, q.corner, broad, force, step)
    return step


def _side(wanted: float, size: Floats, points: int) -> float:
    """Side of the finest cells: as wanted, but not so small that empty cells outnumber the points by far."""
    return float(max(wanted, np.sqrt(size.prod() / (4 * points)), size.sum() / (4 * points)) or 1.0)


def _coarsen(fine: Float32s) -> Float32s:
    """Stiffness of cells twice as wide."""
    inner = fine[1:-1, 1:-1]
    rows, cols = (inner.shape[0] + 1) // 2, (inner.shape[1] + 1) // 2
    whole = np.zeros((2 * rows, 2 * cols), np.float32)
    whole[: inner.shape[0], : inner.shape[1]] = inner
    return np.pad(np.float32(0.25) * whole.reshape(rows, 2, cols, 2).sum((1, 3)), 1)


def _cycle(kappa: tuple[Float32s, ...], load: Float32s) -> Float32s:
    """One V-cycle: a sweep on each level, down; a sweep in the opposite order on each level, up."""
    wave = np.zeros_like(load)
    _sweep(kappa[0], load, wave, False)
    if len(kappa) > 1:
        coarse = _nodes(kappa[1])
        _restrict_rest(kappa[0], load, wave, coarse)
        _add_wave(_cycle(kappa[1:], coarse), wave)
    _sweep(kappa[0], load, wave, True)
    return wave


def _nodes(kappa: Float32s) -> Float32s:
    """Zeros for x and y at every node between the cells, with a rim of nodes that stay so."""
    return np.zeros((kappa.shape[0] + 1, kappa.shape[1] + 1, 2), np.float32)


@njit(cache=True, nogil=True)
def _locate(first, last, xy, low, side, cols, node, share):  # type: ignore[no-untyped-def]
    for i in range(first, last):
        x, y = (xy[i, 0] - low[0]) / side, (xy[i, 1] - low[1]) / side
        node[i] = int(y) * (cols + 1) + int(x)
        share[i, 0], share[i, 1] = x - int(x), y - int(y)


@njit(cache=True, nogil=True)
def _spread(node, mass, rows, cols):  # type: ignore[no-untyped-def]
    """Stiffness of each cell: what belongs to the points in it."""
    kappa = np.zeros((rows + 2, cols + 2), np.float32)
    for i in range(len(node)):
        kappa[node[i] // (cols + 1) + 1, node[i] % (cols + 1) + 1] += mass[i]
    return kappa


@njit(cache=True, nogil=True, error_model="numpy")
def _invert(first, last, stiffness, block):  # type: ignore[no-untyped-def]
    for i in range(first, last):
        a, b, c = stiffness[i, 0], stiffness[i, 1], stiffness[i, 2]
        extra = DAMPING * 0.5 * (a + c)
        a += extra
        c += extra
        determinant = a * c - b * b
        scale = OVERLAP / determinant if determinant > 0.0 else 0.0
        block[i, 0], block[i, 1], block[i, 2] = scale * c, -scale * b, scale * a


@njit(cache=True, nogil=True)
def _restrict(node, share, force, load):  # type: ignore[no-untyped-def]
    cols = load.shape[1] - 2
    for i in range(len(node)):
        r, c = node[i] // cols + 1, node[i] % cols + 1
        s, t = share[i, 0], share[i, 1]
        for d in range(2):
            f = np.float32(force[i, d])
            low, high = (ONE - t) * f, t * f
            load[r, c, d] += (ONE - s) * low
            load[r, c + 1, d] += s * low
            load[r + 1, c, d] += (ONE - s) * high
            load[r + 1, c + 1, d] += s * high


@njit(cache=True, nogil=True)
def _prolong(first, last, node, share, block, wave, patch, patch_share, corner, broad, force, step):  # type: ignore[no-untyped-def]
    cols = wave.shape[1] - 2
    for i in range(first, last):
        r, c = node[i] // cols + 1, node[i] % cols + 1
        s, t = share[i, 0], share[i, 1]
        ps, pt = patch_share[i, 0], patch_share[i, 1]
        p = patch[i]
        for d in range(2):
            below = (ONE - s) * wave[r, c, d] + s * wave[r, c + 1, d]
            above = (ONE - s) * wave[r + 1, c, d] + s * wave[r + 1, c + 1, d]
            fine = (ONE - t) * below + t * above
            low = (1.0 - ps) * broad[corner[p, 0], d] + ps * broad[corner[p, 1], d]
            high = (1.0 - ps) * broad[corner[p, 2], d] + ps * broad[corner[p, 3], d]
            step[i, d] = fine + (1.0 - pt) * low + pt * high
        step[i, 0] += block[i, 0] * force[i, 0] + block[i, 1] * force[i, 1]
        step[i, 1] += block[i, 1] * force[i, 0] + block[i, 2] * force[i, 1]


@njit(cache=True, nogil=True)
def _pull(kappa, wave, r, c):  # type: ignore[no-untyped-def]
    """Force on node (r, c) by the nodes around it."""
    sw, se, nw, ne = kappa[r - 1, c - 1], kappa[r - 1, c], kappa[r, c - 1], kappa[r, c]
    west, east, south, north = sw + nw, se + ne, sw + se, nw + ne
    u = ALONG * (west * wave[r, c - 1, 0] + east * wave[r, c + 1, 0])
    u += ASIDE * (south * wave[r - 1, c, 0] + north * wave[r + 1, c, 0])
    v = ASIDE * (west * wave[r, c - 1, 1] + east * wave[r, c + 1, 1])
    v += ALONG * (south * wave[r - 1, c, 1] + north * wave[r + 1, c, 1])
    rising_u = sw * wave[r - 1, c - 1, 0] + ne * wave[r + 1, c + 1, 0]
    rising_v = sw * wave[r - 1, c - 1, 1] + ne * wave[r + 1, c + 1, 1]
    falling_u = se * wave[r - 1, c + 1, 0] + nw * wave[r + 1, c - 1, 0]
    falling_v = se * wave[r - 1, c + 1, 1] + nw * wave[r + 1, c - 1, 1]
    u += ACROSS * (rising_u + falling_u) - SHEAR * (rising_v - falling_v)
    v += ACROSS * (rising_v + falling_v) - SHEAR * (rising_u - falling_u)
    return -u, -v


@njit(cache=True, nogil=True, error_model="numpy")
def _sweep(kappa, load, wave, backwards):  # type: ignore[no-untyped-def]
    """Gauss-Seidel: each node in turn goes where the forces on it cancel."""
    rows, cols = load.shape[0], load.shape[1]
    for row in range(1, rows - 1):
        r = rows - 1 - row if backwards else row
        for col in range(1, cols - 1):
            c = cols - 1 - col if backwards else col
            rising, falling = kappa[r - 1, c - 1] + kappa[r, c], kappa[r - 1, c] + kappa[r, c - 1]
            a, b = SELF * (rising + falling), SHEAR * (rising - falling)
            if a <= 0.0:
                continue
            u, v = _pull(kappa, wave, r, c)
            u += load[r, c, 0]
            v += load[r, c, 1]
            scale = ONE / (a * a - b * b)
            wave[r, c, 0] = scale * (a * u - b * v)
            wave[r, c, 1] = scale * (a * v - b * u)


@njit(cache=True, nogil=True)
def _restrict_rest(kappa, load, wave, coarse):  # type: ignore[no-untyped-def]
    """Bring the forces that are left after a sweep to the next coarser grid."""
    for r in range(1, load.shape[0] - 1):
        for c in range(1, load.shape[1] - 1):
            rising, falling = kappa[r - 1, c - 1] + kappa[r, c], kappa[r - 1, c] + kappa[r, c - 1]
            a, b = SELF * (rising + falling), SHEAR * (rising - falling)
            if a <= 0.0:
                continue
            u, v = _pull(kappa, wave, r, c)
            u += load[r, c, 0] - a * wave[r, c, 0] - b * wave[r, c, 1]
            v += load[r, c, 1] - a * wave[r, c, 1] - b * wave[r, c, 0]
            # Node (r, c) lies on coarse node ((r + 1) / 2, (c + 1) / 2) or midway between two or four of them.
            top, left = (r + 1) // 2, (c + 1) // 2
            for at_r in range(top, top + 2 - r % 2):
                for at_c in range(left, left + 2 - c % 2):
                    share = ONE / ((2 - r % 2) * (2 - c % 2))
                    coarse[at_r, at_c, 0] += share * u
                    coarse[at_r, at_c, 1] += share * v


@njit(cache=True, nogil=True)
def _add_wave(coarse, wave):  # type: ignore[no-untyped-def]
    for r in range(1, wave.shape[0] - 1):
        for c in range(1, wave.shape[1] - 1):
            top, left = (r + 1) // 2, (c + 1) // 2
            down, right = top + 1 - r % 2, left + 1 - c % 2
            for d in range(2):
                total = coarse[top, left, d] + coarse[top, right, d] + coarse[down, left, d] + coarse[down, right, d]
                wave[r, c, d] += QUARTER * total
