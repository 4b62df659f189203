"""Joined scripts: words cut into slices, each with its heaviest stroke, which the script writes on its line."""

from __future__ import annotations

import cv2
import numpy as np

from planish.photo.letters import Letters
from planish.types import Bools, Floats, Ints

SLICE = 0.7
"""Width of a slice, in usual letter heights."""


def cut_into_slices(ink: Bools, letters: Letters, chains: list[Ints]) -> tuple[Letters, list[Ints]]:
    """Cut the letters of some chains into slices of about equal width.

    The heaviest stroke of a slice is the baseline in Arabic and the head line in Devanagari.

    Parameters
    ----------
    ink : (rows, cols) bool
    letters : Letters
    chains : list of (k,) int32

    Returns
    -------
    slices : Letters
        `base` is the middle of the heaviest three rows of ink.
    chains : list of (k,) int32
        The same chains, of slices.
    """
    which = np.concatenate(chains)
    chain = np.repeat(np.arange(len(chains)), [len(one) for one in chains])
    width = (letters.right - letters.left)[which]
    count = np.maximum(1, np.rint(width / (SLICE * np.median(letters.height[which])))).astype(int)
    first = np.cumsum(count) - count
    part = np.arange(count.sum()) - np.repeat(first, count)
    of, step = np.repeat(which, count), np.repeat(width / count, count)
    left = np.rint(letters.left[of] + part * step)
    right = np.rint(letters.left[of] + (part + 1) * step)
    top, bottom = letters.top[of], letters.bottom[of]
    slices = Letters(left, top, right, bottom, _heaviest_row(ink, left, right, top, bottom))
    return slices, np.split(np.arange(len(of), dtype=np.int32), np.flatnonzero(np.diff(np.repeat(chain, count))) + 1)


def _heaviest_row(ink: Bools, left: Floats, right: Floats, top: Floats, bottom: Floats) -> Floats:
    """Middle of the three rows of each box that have most ink: (n,) [px]."""
    before = np.zeros((ink.shape[0], ink.shape[1] + 1), np.int32)
    np.cumsum(ink, axis=1, out=before[:, 1:])
    row = np.arange(int((bottom - top).max()))
    y = np.minimum(top[:, None] + row, ink.shape[0] - 1).astype(int)
    count = before[y, right.astype(int)[:, None]] - before[y, left.astype(int)[:, None]]
    count = np.where(row < (bottom - top)[:, None], count, 0).astype(np.float32)
    heaviest = cv2.blur(count, (3, 1), borderType=cv2.BORDER_CONSTANT).argmax(axis=1)
    near = count * (np.abs(row - heaviest[:, None]) <= 1)
    return np.asarray(top + (near @ (row + 0.5)) / np.maximum(near.sum(axis=1), 1), np.float64)
