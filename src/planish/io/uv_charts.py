"""Texture coordinates that lie a whole number beside 0 to 1: images repeat, so the chart is moved back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from planish.io.polygons import Polygons
from planish.types import Bools

OUTSIDE = 1e-4
"""How far texture coordinates may be outside 0 to 1 before that is said: rounding in the file. With half of it files
of four digits would be told to be wrong, with twice as much a border of 0.8 pixels of 4096 could be lost unsaid."""


def without_whole_shifts(polygons: Polygons, repeats: Bools) -> Polygons:
    """Move every chart (faces joined by their texture coordinates) into 0 to 1 where a whole number does that.

    Charts that lie over the border of two repeats stay as they are: what of them is outside cannot be told from a
    mistake.

    Parameters
    ----------
    polygons : Polygons
    repeats : (p,) bool
        Polygons whose image is repeated outside of 0 to 1.

    Examples
    --------
    >>> square = np.arange(4, dtype=np.int32)
    >>> uv = np.array([[0.0, -1.0], [1, -1], [1, 0], [0, 0]])
    >>> moved = without_whole_shifts(Polygons(np.array([4], np.int32), square, uv, square), np.array([True]))
    >>> moved.uv.tolist()
    [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
    """
    uv, corners = polygons.uv, polygons.uv_corners
    if uv is None or corners is None or not repeats.any():
        return polygons
    used = np.asarray((corners >= 0) & np.repeat(repeats, polygons.sizes))
    rows = corners[used]
    finite = np.asarray(np.isfinite(uv).all(axis=1))
    outside = finite[rows] & ((uv[rows] < -OUTSIDE) | (uv[rows] > 1 + OUTSIDE)).any(axis=1)
    if not outside.any():
        return polygons
    owner = np.repeat(np.arange(len(polygons.sizes)), polygons.sizes)[used]
    same_face = owner[1:] == owner[:-1]
    links = coo_matrix(
        (np.ones(int(same_face.sum()), bool), (rows[1:][same_face], rows[:-1][same_face])), (len(uv),) * 2
    )
    count, chart = connected_components(links, directed=False)
    low, high = np.full((count, 2), np.inf), np.full((count, 2), -np.inf)
    good = rows[finite[rows]]
    np.minimum.at(low, chart[good], uv[good])
    np.maximum.at(high, chart[good], uv[good])
    with np.errstate(invalid="ignore"):
        shift = np.floor((low + high) / 2)
        fits = ((low - shift >= -OUTSIDE) & (high - shift <= 1 + OUTSIDE)).all(axis=1, keepdims=True)
    shift = np.where(fits & np.isfinite(shift), shift, 0.0)
    moved = uv.copy()
    mine = np.unique(good)
    moved[mine] -= shift[chart[mine]]
    shared = np.zeros(len(uv), np.bool_)  # with faces whose image does not repeat: these keep their rows
    shared[corners[(corners >= 0) & ~np.repeat(repeats, polygons.sizes)]] = True
    if not (shared[mine] & (shift[chart[mine]] != 0).any(axis=1)).any():
        return replace(polygons, uv=moved)
    new_corners = corners.copy()
    new_corners[used] = rows + len(uv)
    return replace(polygons, uv=np.concatenate([uv, moved]), uv_corners=new_corners)
