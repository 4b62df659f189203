"""Gray code: generate projector patterns and decode camera photos.

The order is OpenCV's: for every bit of the projector's column, highest first, the pattern and its inverse; the same
for the rows; then white and black.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planish.parallel import thread_pool
from planish.types import Bools, Floats, Ints, freeze

Grey = NDArray[np.uint8] | NDArray[np.uint16]

MIN_CONFIDENCE = 0.05
"""Least difference of pattern and inverse, relative to white minus black, for a reliable bit. One bit per code may be
less reliable: that of a stripe edge at the pixel."""

MIN_LIT = 0.02
"""Least difference of white and black, relative to the highest value, of a lit pixel."""


@dataclass(frozen=True, eq=False)
class Codes:
    """Projector pixel seen by each camera pixel.

    Attributes
    ----------
    column, row : (rows, cols) int32
        -1 where decoding failed.
    confidence : (rows, cols) float64
        0 to 1: difference of pattern and inverse, relative to white minus black, of the weakest reliable bit.
    """

    column: Ints
    row: Ints
    confidence: Floats

    def __post_init__(self) -> None:
        freeze(self)


def bits_for(count: int) -> int:
    """Number of bits for so many columns or rows.

    Examples
    --------
    >>> [bits_for(n) for n in (2, 768, 1024, 1025)]
    [1, 10, 10, 11]
    """
    return max(1, int(count - 1).bit_length())


def frame_count(shape_rc: tuple[int, int]) -> int:
    """Number of images of the code of a projector with so many rows and columns.

    Examples
    --------
    >>> frame_count((800, 1280))
    44
    """
    return 2 * (bits_for(shape_rc[1]) + bits_for(shape_rc[0])) + 2


def patterns(shape_rc: tuple[int, int]) -> Iterator[NDArray[np.uint8]]:
    """Generate the patterns of a projector with so many rows and columns: (rows, cols) uint8, 0 or 255.

    Examples
    --------
    >>> [int(image[0, 2]) for image in patterns((2, 4))]
    [255, 0, 255, 0, 0, 255, 255, 0]
    """
    rows, cols = shape_rc
    for count, across in ((cols, True), (rows, False)):
        number = np.arange(count)
        gray = number ^ (number >> 1)
        for bit in reversed(range(bits_for(count))):
            line = (255 * (gray >> bit & 1)).astype(np.uint8)
            stripes = np.broadcast_to(line if across else line[:, None], (rows, cols))
            yield np.ascontiguousarray(stripes)
            yield 255 - stripes
    yield np.full((rows, cols), 255, np.uint8)
    yield np.zeros((rows, cols), np.uint8)


def decode(frames: Grey, shape_rc: tuple[int, int], *, skipped_bits: int | tuple[int, int] = 0) -> Codes:
    """Decode the Gray code at every camera pixel.

    Parameters
    ----------
    frames : (n, rows, cols) uint8 or uint16
        Grey, in the order of `patterns`.
    shape_rc : (int, int)
        Rows and columns of the projector.
    skipped_bits : int or (int, int)
        Number of the lowest bits that are ignored, of columns and of rows: these then count 2^skipped_bits pixels each.

    Examples
    --------
    >>> codes = decode(np.stack(list(patterns((6, 8)))), (6, 8))
    >>> codes.column[2, 5], codes.row[2, 5], codes.confidence[2, 5]
    (np.int32(5), np.int32(2), np.float64(1.0))
    """
    rows, cols = frames.shape[1:]
    flat = frames.reshape(len(frames), -1)
    number = np.empty((2, rows * cols), np.int32)
    confidence = np.empty(rows * cols)
    of_column, of_row = (skipped_bits, skipped_bits) if isinstance(skipped_bits, int) else skipped_bits
    bits = bits_for(shape_rc[1]), bits_for(shape_rc[0])
    min_contrast = MIN_LIT * white_level(frames)
    with thread_pool() as parallel_for:
        sizes = bits[0], bits[1], of_column, of_row, shape_rc[1], shape_rc[0]
        parallel_for(_decode, rows * cols, flat, *sizes, min_contrast, number, confidence, block=1 << 12)
    return Codes(number[0].reshape(rows, cols), number[1].reshape(rows, cols), confidence.reshape(rows, cols))


def white_level(frames: Grey) -> float:
    """White level of the frames: 255, or the maximum for 16 bits."""
    return 255.0 if frames.dtype == np.uint8 else float(frames.max())


@njit(cache=True, nogil=True)
def _decode(  # type: ignore[no-untyped-def]
    first, last, frames, column_bits, row_bits, of_column, of_row, columns, rows, min_contrast, number, confidence
):
    count = last - first
    contrast, sure_column, sure_row = (
        np.empty(count, np.float32),
        np.empty(count, np.float32),
        np.empty(count, np.float32),
    )
    for i in range(count):
        contrast[i] = np.float32(frames[-2, first + i]) - np.float32(frames[-1, first + i])
    _number(first, count, frames, 0, column_bits - of_column, contrast, number[0], sure_column)
    _number(first, count, frames, 2 * column_bits, row_bits - of_row, contrast, number[1], sure_row)
    columns, rows = ((columns - 1) >> of_column) + 1, ((rows - 1) >> of_row) + 1
    for i in range(count):
        confidence_of_bit = min(sure_column[i], sure_row[i])
        read = (
            contrast[i] >= min_contrast
            and confidence_of_bit >= MIN_CONFIDENCE
            and number[0, first + i] < columns
            and number[1, first + i] < rows
        )
        confidence[first + i] = confidence_of_bit if read else 0.0
        if not read:
            number[0, first + i], number[1, first + i] = -1, -1


@njit(cache=True, nogil=True)
def _number(first, count, frames, start, bits, contrast, number, confidence_of_bit):  # type: ignore[no-untyped-def]
    """Decode one code; also return the reliability of its second weakest bit."""
    bit, weakest = np.zeros(count, np.int32), np.full(count, np.float32(1.0))
    number[first : first + count], confidence_of_bit[:] = 0, 1.0
    for k in range(bits):  # frame by frame: memory order
        for i in range(count):
            difference = np.float32(frames[start + 2 * k, first + i]) - np.float32(frames[start + 2 * k + 1, first + i])
            bit[i] ^= np.int32(difference > 0)  # binary bit k is the parity of the Gray bits from the highest to k
            number[first + i] = 2 * number[first + i] + bit[i]
            here = abs(difference) / max(contrast[i], np.float32(1.0))
            confidence_of_bit[i] = min(confidence_of_bit[i], max(weakest[i], here))
            weakest[i] = min(weakest[i], here)


def lit_mask(frames: Grey) -> Bools:
    """Mask (rows, cols) of camera pixels lit by the projector."""
    return np.asarray(frames[-2].astype(np.float32) - frames[-1] >= MIN_LIT * white_level(frames))
