"""Rows of a PLY that hold lists: the start of a row is known only when the row before it has been read."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True)
def walk_rows(
    body: NDArray, start: int, rows: int, sizes: NDArray[np.int64], count_sizes: NDArray[np.int64], little: bool
) -> tuple[NDArray[np.int64], NDArray[np.int64], int]:
    """Find where every property of every row lies.

    Parameters
    ----------
    body : (k,) uint8, or float64
        The bytes of a binary file, or the numbers of an ascii file; sizes and places count its items.
    start, rows : int
    sizes : (p,) int64
        Items of one value of each property.
    count_sizes : (p,) int64
        Items of a list's length; 0 for a property that is no list.
    little : bool
        The least byte of a length comes first.

    Returns
    -------
    counts, starts : (rows, p) int64
        Values of each property, and where they start.
    stop : int
        Where the next element starts; -1 if the body ended before.
    """
    counts = np.ones((rows, len(sizes)), np.int64)
    starts = np.empty((rows, len(sizes)), np.int64)
    at = start
    for row in range(rows):
        for k in range(len(sizes)):
            size = count_sizes[k]
            if size > 0:
                if at + size > len(body):
                    return counts, starts, -1
                length = 0.0
                for byte in range(size):
                    length = length * 256.0 + body[at + (size - 1 - byte if little else byte)]
                at += size
                if not 0 <= length <= len(body):
                    return counts, starts, -1
                counts[row, k] = int(length)
            starts[row, k] = at
            at += counts[row, k] * sizes[k]
            if at > len(body):
                return counts, starts, -1
    return counts, starts, at


@njit(cache=True)
def copy_items(body: NDArray, starts: NDArray[np.int64], lengths: NDArray[np.int64]) -> NDArray:
    """The items of all runs (start, length), one after the other."""
    out = np.empty(lengths.sum(), body.dtype)
    at = 0
    for run in range(len(starts)):
        for k in range(lengths[run]):
            out[at + k] = body[starts[run] + k]
        at += lengths[run]
    return out
