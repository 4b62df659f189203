"""Viewpoint of a range image that came as a bare mesh, from the rows and columns of pixels in its point order."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from planish.geometry.guards import TINY
from planish.geometry.resection import resect
from planish.geometry.viewpoint import MAX_MISFIT_PX, MIN_REGULAR, SAMPLE
from planish.types import Bools, Floats, Ints

LEAST_IN_ROWS = 0.2
"""Share of the edges that must join consecutive points: a third in a range image, next to none in any other mesh."""

LEAST_PARALLEL = 0.4
"""Share of the edges between two rows whose next points are joined, too: 0.63 where three tenths of the pixels are
missing, 0.7 and more in whole range images, 0.17 in a random mesh in the order of a Morton curve."""

FAR = 1e5
"""Distance, in extents of the mesh, at which the viewpoint of parallel rays is placed."""

ROUNDS, OUTLIER, LEAST_KEPT = 8, 4.0, 0.85
"""Fits at most, each without points that are off by more than OUTLIER medians, and the share of points that must be
left: short runs between holes may be a pixel off, one point in ten where a tenth of the pixels is missing at random."""

DEGREE = 5
"""Of the polynomials that stand for a lens: 0.0014 pixels are left of a real one, 0.09 with degree 3."""

PLAIN = 0.1
"""A simpler camera is taken if its misfit is below this part of MAX_MISFIT_PX, though another has still less."""

Pixels = NDArray[np.int64]


def viewpoint_of_rows(points: Floats, edges: Ints) -> Floats | None:
    """(3,) place [mm] that the rays of a range image come from, or None where the mesh is no range image.

    Range images are written row by row, so consecutive points that share an edge are neighbours in a row. Rows are
    aligned by the edges between them. The pixels found this way must then be the image of the points under one camera
    to 1/50 of a pixel: parallel rays, a pinhole anywhere, or a pinhole at the origin behind a distorting lens. Errors
    along the rays leave that exact, whatever their size; any other error or mesh does not.

    Parameters
    ----------
    points : (n, 3) float64 [mm]
    edges : (e, 2) int32
        Ascending, as `Topology.edges` are.

    Examples
    --------
    Parallel rays along z, as of a height map:

    >>> from planish.mesh import grid_faces, topology
    >>> x, y = np.meshgrid(np.arange(20.0), np.arange(30.0))
    >>> points = np.c_[x.ravel(), y.ravel(), np.random.default_rng(0).normal(0, 0.5, 600)]
    >>> faces = grid_faces(np.arange(600, dtype=np.int32).reshape(30, 20), points)
    >>> eye = viewpoint_of_rows(points, topology(faces, 600).edges)
    >>> bool((np.abs(eye[:2] / eye[2]) < 1e-4).all())  # far above the middle of the map
    True
    """
    found = _pixels(points, edges)
    if found is None:
        return None
    pixels, run = found
    every = len(points) // SAMPLE + 1
    return _common_point(points[::every], pixels[::every].astype(np.float64), run[::every])


def _pixels(points: Floats, edges: Ints) -> tuple[Pixels, Pixels] | None:
    """(n, 2) column and row of every point and (n,) its run of pixels, or None where the mesh has no rows."""
    in_row = edges[:, 1] - edges[:, 0] == 1
    if len(edges) == 0 or in_row.mean() < LEAST_IN_ROWS or _parallel(edges, ~in_row, len(points)) < LEAST_PARALLEL:
        return None
    starts = np.ones(len(points), bool)
    starts[edges[in_row, 1]] = False
    run = np.cumsum(starts) - 1
    column = np.arange(len(points)) - np.flatnonzero(starts)[run]
    pixels = _aligned(points, edges[~in_row], run, column)
    if pixels is None:
        return None
    some = edges[:: len(edges) // SAMPLE + 1]
    step = np.abs(pixels[some[:, 1]] - pixels[some[:, 0]])
    return (pixels, run) if (step.max(axis=1) <= 1).mean() >= MIN_REGULAR else None


def _parallel(edges: Ints, some: Bools, count: int) -> float:
    """Share of some edges (i, j), over a sample, for which (i + 1, j + 1) is an edge as well."""
    number = edges[:, 0].astype(np.int64) * count + edges[:, 1]
    wanted = number[some][:: len(edges) // SAMPLE + 1] + count + 1
    found = number[np.minimum(np.searchsorted(number, wanted), len(number) - 1)] == wanted
    return float(found.mean()) if len(found) else 0.0


def _aligned(points: Floats, edges: Ints, run: Pixels, column: Pixels) -> Pixels | None:
    """Shift the runs of consecutive points against each other so that pixels above each other share a column.

    An edge between two rows leads straight down or along a diagonal. Of all shifts that edges between two runs ask
    for, the one with the shortest edges leads straight down.
    """
    count = int(run[-1]) + 1
    above, below = run[edges[:, 0]], run[edges[:, 1]]
    shift = column[edges[:, 1]] - column[edges[:, 0]]
    across = np.linalg.eigh(np.cov(points.T))[1][:, 1:]  # noise is along the rays, the sheet roughly across them
    squared = (((points[edges[:, 1]] - points[edges[:, 0]]) @ across) ** 2).sum(axis=1)
    order = _in_order(above, below, shift, count)
    above, below, shift, squared = above[order], below[order], shift[order], squared[order]
    if not len(order):
        return None
    first = np.flatnonzero(np.r_[True, (np.diff(above) != 0) | (np.diff(below) != 0) | (np.diff(shift) != 0)])
    size = np.diff(np.r_[first, len(order)])
    mean = np.add.reduceat(squared, first) / size
    above, below, shift = above[first], below[first], shift[first]
    few = size < 0.2 * _largest_of_pair(size, above * count + below)
    order = np.lexsort((np.where(few, np.inf, mean), below, above))
    above, below, shift, size = above[order], below[order], shift[order], size[order]
    first = np.flatnonzero(np.r_[True, (np.diff(above) != 0) | (np.diff(below) != 0)])
    return _laid_out(above[first], below[first], shift[first], size[first], run, column, count)


def _in_order(above: Pixels, below: Pixels, shift: Pixels, count: int) -> Pixels:
    """As np.lexsort((shift, below, above)), but in no certain order where all are equal, and five times as fast."""
    low, high = (int(shift.min()), int(shift.max())) if len(shift) else (0, 0)
    span = high - low + 1
    if count**2 * span > 2**62:
        return np.lexsort((shift, below, above))
    return np.argsort((above * count + below) * span + (shift - low))


def _largest_of_pair(size: Pixels, pair: Pixels) -> Pixels:
    first = np.flatnonzero(np.r_[True, np.diff(pair) != 0])
    return np.repeat(np.maximum.reduceat(size, first), np.diff(np.r_[first, len(pair)]))


def _laid_out(
    above: Pixels, below: Pixels, shift: Pixels, edges: Pixels, run: Pixels, column: Pixels, count: int
) -> Pixels | None:
    """Row and shift of every run, from pairs of runs that lie below each other, those with the most edges first."""
    link = sparse.coo_matrix((1 / edges, (above, below)), shape=(count, count)).tocsr()
    tree = sparse.csgraph.minimum_spanning_tree(link)
    order, parent = sparse.csgraph.breadth_first_order(tree, int(np.bincount(run).argmax()), directed=False)
    down = {(int(a), int(b)): int(s) for a, b, s in zip(above, below, shift, strict=True)}
    row, start = np.zeros(count, np.int64), np.zeros(count, np.int64)
    for r in map(int, order[1:]):
        p = int(parent[r])
        if (p, r) in down:
            row[r], start[r] = row[p] + 1, start[p] - down[p, r]
        else:
            row[r], start[r] = row[p] - 1, start[p] + down[r, p]
    return np.stack([start[run] + column, row[run]], axis=1) if len(order) > 1 else None


def _common_point(points: Floats, pixels: Floats, run: Pixels) -> Floats | None:
    """(3,) place whose rays through the points keep to the pixels, or None where there is none.

    Between fits, runs that were aligned a pixel or more off are moved to where the camera sees them.
    """
    kept = np.ones(len(points), bool)
    for _ in range(ROUNDS):
        found = list(_candidates(points, pixels, kept))
        off = [np.linalg.norm(seen - pixels, axis=1) for seen, _ in found]
        best = np.array([np.median(misfit[kept]) for misfit in off])
        chosen = int(np.argmax(best <= max(PLAIN * MAX_MISFIT_PX, best.min())))
        seen, eye = found[chosen]
        moves = _moves_of_runs(seen - pixels, run)
        if moves.any():
            pixels = pixels + moves
            continue
        near = off[chosen] <= max(OUTLIER * float(best[chosen]), MAX_MISFIT_PX)
        if near.mean() < LEAST_KEPT:
            return None
        if np.array_equal(kept, near):
            break
        kept = near
    misfit = np.linalg.norm(seen - pixels, axis=1)[kept]
    return eye if float(np.sqrt((misfit**2).mean())) < MAX_MISFIT_PX else None


def _moves_of_runs(off: Floats, run: Pixels) -> Floats:
    """(n, 2) whole pixels that each run is off by on average."""
    first = np.flatnonzero(np.r_[True, np.diff(run) != 0])
    size = np.diff(np.r_[first, len(run)])
    return np.asarray(np.repeat(np.rint(np.add.reduceat(off, first) / size[:, None]), size, axis=0))


def _candidates(points: Floats, pixels: Floats, kept: Bools) -> Iterator[tuple[Floats, Floats]]:
    """Where [px] every point is seen, and the viewpoint, by each kind of camera, fitted to the points that are kept."""
    middle = points.mean(axis=0)
    extent = float(np.abs(points - middle).max())
    affine, seen = _fitted(np.c_[points - middle, np.ones(len(points))], pixels, kept)
    along = np.cross(*affine[:3].T)
    yield seen, middle + FAR * extent * along / max(float(np.linalg.norm(along)), TINY)
    if (camera := resect(points[kept], pixels[kept])) is not None:
        seen = points @ camera[:, :3].T + camera[:, 3]
        eye: Floats = -np.linalg.lstsq(camera[:, :3], camera[:, 3], rcond=None)[0].astype(np.float64)
        yield seen[:, :2] / seen[:, 2:], eye
    if (np.sign(points[:, 2]) == np.sign(points[0, 2])).all() and np.abs(points[:, 2]).min() > 1e-3 * extent:
        slope = points[:, :2] / points[:, 2:]
        slope = slope - slope.mean(axis=0)
        x, y = slope.T / max(float(np.abs(slope).max()), TINY)
        terms = np.stack([x**i * y**j for i in range(DEGREE + 1) for j in range(DEGREE + 1 - i)], axis=1)
        if len(points) > 5 * terms.shape[1]:
            yield _fitted(terms, pixels, kept)[1], np.zeros(3)


def _fitted(terms: Floats, pixels: Floats, kept: Bools) -> tuple[Floats, Floats]:
    solution: Floats = np.linalg.lstsq(terms[kept], pixels[kept], rcond=None)[0].astype(np.float64)
    return solution, terms @ solution
