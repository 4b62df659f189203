"""Where a flat page lies over itself.

A face that shows its printed side adds one layer to every place it covers. How many layers there are at a place is
the number of times that the border of the page winds around it, and the border is short: a few thousand edges where
the page has half a million faces. So layers are counted at the middles of a grid's cells by walking along the border
once; from there to the middle of a face one looks only at the border edges in the same cell.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from planish.mesh import Topology, bounds
from planish.types import Floats, Ints


def overlaps(faces: Ints, page_xy: Floats, topology: Topology) -> int:
    """How many faces of a flat page have their middle under or over another part of it.

    Layers that are turned over count against the others: a flap that is folded back hides one layer and is found by
    its flipped faces, not here.

    Parameters
    ----------
    faces : (m, 3) int32
    page_xy : (n, 2) float64 [mm]
        With x right and y up or down.
    topology : Topology
        Of the faces.

    Examples
    --------
    Two triangles apart, and one pushed halfway over the other.

    >>> from planish.mesh import topology
    >>> faces = np.array([[0, 1, 2], [3, 4, 5]], np.int32)
    >>> one = np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 4.0]])
    >>> [overlaps(faces, np.concatenate([one, one + shift]), topology(faces, 6)) for shift in (5.0, 0.5)]
    [0, 2]
    """
    return int(np.count_nonzero(np.abs(layers(faces, page_xy, topology)) > 1))


def layers(faces: Ints, page_xy: Floats, topology: Topology) -> Ints:
    """(m,) layers of the page at the middle of each face; negative where y runs down, as on a page."""
    border = _border(faces, topology.face_edges, topology.edges)
    if not len(border):
        return np.zeros(len(faces), np.int32)
    low, high = bounds(page_xy)
    size = high - low
    side = float(np.sqrt(max(size.prod() / len(faces), 0.0)) or size.max() / len(faces) or 1.0)
    side = max(side, float(size.max()) / len(faces))
    cols, rows = (size / side).astype(int) + 1
    xy = (page_xy - low) / side
    return np.asarray(
        _layers(faces, xy, _winding(xy, border, rows, cols), *_edges_in_cells(xy, border, rows, cols), border)
    )


@njit(cache=True, nogil=True)
def _border(faces, face_edges, edges):  # type: ignore[no-untyped-def]
    """Edges that more faces run along in one direction than in the other; in that direction, as often as that."""
    net = np.zeros(len(edges), np.int32)
    for f in range(len(faces)):
        for k in range(3):
            e = face_edges[f, k]
            net[e] += 1 if faces[f, k] == edges[e, 0] else -1
    border = np.empty((np.sum(np.abs(net)), 2), np.int32)
    at = 0
    for e in range(len(edges)):
        for _ in range(abs(net[e])):
            forward = net[e] > 0
            border[at, 0], border[at, 1] = edges[e, 0 if forward else 1], edges[e, 1 if forward else 0]
            at += 1
    return border


@njit(cache=True, nogil=True)
def _winding(xy, border, rows, cols):  # type: ignore[no-untyped-def]
    """How often the border winds around the middle of each cell: up- less downward edges to the left of it."""
    winding = np.zeros((rows, cols + 1), np.int32)
    for e in range(len(border)):
        ax, ay = xy[border[e, 0], 0], xy[border[e, 0], 1]
        bx, by = xy[border[e, 1], 0], xy[border[e, 1], 1]
        sign = -1 if by > ay else 1
        for r in range(max(0, int(np.ceil(min(ay, by) - 0.5))), min(rows, int(np.ceil(max(ay, by) - 0.5)))):
            x = ax + (bx - ax) * (r + 0.5 - ay) / (by - ay)
            winding[r, min(max(int(np.ceil(x - 0.5)), 0), cols)] += sign
    for r in range(rows):
        for c in range(1, cols):
            winding[r, c] += winding[r, c - 1]
    return winding


@njit(cache=True, nogil=True)
def _columns(ax, ay, bx, by, r, cols):  # type: ignore[no-untyped-def]
    """First and last cell of row r that an edge may pass through."""
    left, right = min(ax, bx), max(ax, bx)
    if ay != by:
        at_low = ax + (bx - ax) * min(max((r - ay) / (by - ay), 0.0), 1.0)
        at_high = ax + (bx - ax) * min(max((r + 1 - ay) / (by - ay), 0.0), 1.0)
        left, right = min(at_low, at_high), max(at_low, at_high)
    return max(int(left - 1e-9), 0), min(int(right + 1e-9), cols - 1)


@njit(cache=True, nogil=True)
def _edges_in_cells(xy, border, rows, cols):  # type: ignore[no-untyped-def]
    """Border edges that pass through each cell, as compressed rows."""
    start = np.zeros(rows * cols + 1, np.int64)
    edge = np.empty(0, np.int32)
    for turn in range(2):  # count, then fill
        for e in range(len(border)):
            ax, ay = xy[border[e, 0], 0], xy[border[e, 0], 1]
            bx, by = xy[border[e, 1], 0], xy[border[e, 1], 1]
            for r in range(max(int(min(ay, by) - 1e-9), 0), min(int(max(ay, by) + 1e-9), rows - 1) + 1):
                first, last = _columns(ax, ay, bx, by, r, cols)
                for c in range(first, last + 1):
                    if turn == 0:
                        start[r * cols + c + 1] += 1
                    else:
                        start[r * cols + c] -= 1
                        edge[start[r * cols + c]] = e
        if turn == 0:
            for k in range(1, len(start)):
                start[k] += start[k - 1]
            edge = np.empty(start[-1], np.int32)
            for k in range(len(start) - 1):  # filling counts down to where each row begins
                start[k] = start[k + 1]
    return start, edge


@njit(cache=True, nogil=True)
def _layers(faces, xy, winding, start, edge, border):  # type: ignore[no-untyped-def]
    """Layers at the middles of faces: those at the middle of the cell, and border edges crossed on the way."""
    rows, cols = winding.shape[0], winding.shape[1] - 1
    out = np.empty(len(faces), np.int32)
    for f in range(len(faces)):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        x, y = (xy[i, 0] + xy[j, 0] + xy[k, 0]) / 3.0, (xy[i, 1] + xy[j, 1] + xy[k, 1]) / 3.0
        c, r = min(int(x), cols - 1), min(int(y), rows - 1)
        px, py = c + 0.5, r + 0.5
        count = winding[r, c]
        for at in range(start[r * cols + c], start[r * cols + c + 1]):
            a, b = border[edge[at], 0], border[edge[at], 1]
            left_a = (x - px) * (xy[a, 1] - py) - (y - py) * (xy[a, 0] - px) > 0.0
            left_b = (x - px) * (xy[b, 1] - py) - (y - py) * (xy[b, 0] - px) > 0.0
            if left_a == left_b:
                continue
            ex, ey = xy[b, 0] - xy[a, 0], xy[b, 1] - xy[a, 1]
            from_left = ex * (py - xy[a, 1]) - ey * (px - xy[a, 0]) > 0.0
            to_left = ex * (y - xy[a, 1]) - ey * (x - xy[a, 0]) > 0.0
            if from_left != to_left:
                count += 1 if to_left else -1
        out[f] = count
    return out
