"""Phase shifting in addition to the Gray code: the projector position at every single pixel.

For the projector's columns, then for its rows, a cosine is shown `steps` times, shifted by equal parts of its period;
the photos come between those of the code and white. At each pixel I_k = A + B cos(phi - 2 pi k / steps), whose phase
phi is the position within a period, independent of reflectance A and contrast B. The period is unwrapped by the Gray
code bits down to half a period: the centre of a half period is at most a quarter period from the true position. So
errors of one step at stripe edges do no harm, and stripes too fine to be resolved are not needed.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planish.acquire.structured_light import gray_code
from planish.acquire.structured_light.gray_code import MIN_LIT, Codes, Grey, decode, frame_count, white_level
from planish.errors import InputError, UsageError
from planish.parallel import thread_pool
from planish.types import Floats

PERIOD = 16
"""Period in projector pixels: four times the finest stripe pair that the camera must resolve otherwise."""

HALF_BITS = 3
"""Number of lowest code bits within half a period."""

MEAN_LEVEL, AMPLITUDE = 127, 126
"""Grey values of the cosines. With an even amplitude no value is exactly halfway between two levels."""

STEP_RANGE = 3, 16
"""Fewest and most steps. They cancel all harmonics below steps - 1, for instance of the projector's gamma."""

MAX_PHASE_ERROR = 3 / 8
"""Largest distance from the centre of the half period, in periods; a quarter is normal."""


class PhaseMap(NamedTuple):
    """Result of phase decoding at each camera pixel.

    Attributes
    ----------
    projector_xy : (rows, cols, 2) float32 [projector px]
        x right, y down; NaN where unknown.
    weight : (rows, cols, 2) float32
        Inverse variance for noise of one grey level; 0 where unknown.
    confidence : (rows, cols) float64
        0 to 1: contrast of the weaker of both cosines, relative to white minus black.
    """

    projector_xy: NDArray[np.float32]
    weight: NDArray[np.float32]
    confidence: Floats


def patterns(shape_rc: tuple[int, int], steps: int) -> Iterator[NDArray[np.uint8]]:
    """Generate the phase patterns of a projector with so many rows and columns: 2 `steps` images (rows, cols) uint8.

    Examples
    --------
    >>> [int(image[0, 0]) for image in patterns((20, 40), 4)]
    [253, 127, 1, 127, 253, 127, 1, 127]

    Raises
    ------
    UsageError
        If there are fewer than 3 or more than 16 steps.
    """
    if not STEP_RANGE[0] <= steps <= STEP_RANGE[1]:
        raise UsageError(f"{steps} steps of phase were asked for; {STEP_RANGE[0]} to {STEP_RANGE[1]} are wanted")
    rows, cols = shape_rc
    for count, across in ((cols, True), (rows, False)):
        for k in range(steps):
            wave = np.cos(2 * np.pi * (np.arange(count) / PERIOD - k / steps))
            line = np.rint(MEAN_LEVEL + AMPLITUDE * wave).astype(np.uint8)
            yield np.ascontiguousarray(np.broadcast_to(line if across else line[:, None], (rows, cols)))


def all_patterns(shape_rc: tuple[int, int], steps: int) -> Iterator[NDArray[np.uint8]]:
    """Generate all patterns of a capture: Gray code, phase patterns unless `steps` is 0, white, black.

    Examples
    --------
    >>> len(list(all_patterns((16, 16), 4))) - len(list(gray_code.patterns((16, 16))))
    8
    """
    *code, white, black = gray_code.patterns(shape_rc)
    yield from code
    if steps:
        yield from patterns(shape_rc, steps)
    yield white
    yield black


def phase_steps(count: int, shape_rc: tuple[int, int]) -> int:
    """Number of phase steps among so many photos; 0 if there are only those of the Gray code.

    Raises
    ------
    InputError
        If the number of phase photos differs between rows and columns.

    Examples
    --------
    >>> phase_steps(44, (800, 1280)), phase_steps(60, (800, 1280))
    (0, 8)
    """
    extra = count - frame_count(shape_rc)
    if extra < 2 * STEP_RANGE[0] - 1:
        return 0
    if extra % 2 or extra > 2 * STEP_RANGE[1]:
        raise InputError(
            f"there are {count} photos: {frame_count(shape_rc)} for the Gray code of {shape_rc[1]} x {shape_rc[0]} "
            f"pixels, and {extra} beside it; waves come in equal numbers, {STEP_RANGE[0]} to {STEP_RANGE[1]}, for "
            "columns and for rows. Was the projector's resolution another?"
        )
    return extra // 2


def decode_phase(frames: Grey, waves: Grey, shape_rc: tuple[int, int]) -> PhaseMap:
    """Decode the projector position of each camera pixel from the phase.

    Parameters
    ----------
    frames : (n, rows, cols) uint8 or uint16
        Gray code only, as for `gray_code.decode`.
    waves : (2 steps, rows, cols), of the same kind
        In the order of `patterns`.
    shape_rc : (int, int)
        Rows and columns of the projector.

    Examples
    --------
    >>> code = np.stack(list(gray_code.patterns((24, 40))))
    >>> found = decode_phase(code, np.stack(list(patterns((24, 40), 4))), (24, 40))
    >>> bool(np.abs(found.projector_xy[12, 20] - [20, 12]).max() < 0.01), found.confidence[12, 20].round(2)
    (True, np.float64(0.99))
    """
    coarse: Codes = decode(frames, shape_rc, skipped_bits=HALF_BITS)
    contrast = frames[-2].astype(np.float32) - frames[-1]
    shape = coarse.column.shape
    projector_xy, weight = np.full((*shape, 2), np.nan, np.float32), np.zeros((*shape, 2), np.float32)
    confidence = np.zeros(shape)
    codes = np.stack([coarse.column, coarse.row])
    limits = np.array([shape_rc[1], shape_rc[0]]) - 0.5
    min_amplitude = 0.5 * MIN_LIT * white_level(frames)
    with thread_pool() as parallel_for:
        parallel_for(
            _phase, shape[0], waves, codes, contrast, limits, min_amplitude, projector_xy, weight, confidence, block=16
        )
    return PhaseMap(projector_xy, weight, confidence)


@njit(cache=True, nogil=True)
def _phase(first, last, waves, codes, contrast, limits, min_amplitude, projector_xy, weight, confidence):  # type: ignore[no-untyped-def]
    steps = len(waves) // 2
    cosine, sine = np.cos(2 * np.pi * np.arange(steps) / steps), np.sin(2 * np.pi * np.arange(steps) / steps)
    half = 1 << HALF_BITS
    for r in range(first, last):
        for q in range(projector_xy.shape[1]):
            if codes[0, r, q] < 0:
                continue
            relative_contrast, valid = 1.0, True
            for axis in range(2):
                c, s = 0.0, 0.0
                for k in range(steps):
                    level = float(waves[axis * steps + k, r, q])
                    c += cosine[k] * level
                    s += sine[k] * level
                amplitude = 2.0 * np.sqrt(c * c + s * s) / steps  # B
                middle = codes[axis, r, q] * half + 0.5 * (half - 1)
                cycles = np.arctan2(s, c) / (2.0 * np.pi)
                x = PERIOD * (cycles + np.rint(middle / PERIOD - cycles))
                valid &= (
                    amplitude >= min_amplitude
                    and abs(x - middle) <= MAX_PHASE_ERROR * PERIOD
                    and -0.5 <= x <= limits[axis]
                )
                projector_xy[r, q, axis] = x
                weight[r, q, axis] = 0.5 * steps * (amplitude * 2.0 * np.pi / PERIOD) ** 2
                relative_contrast = min(relative_contrast, 2.0 * amplitude / max(contrast[r, q], np.float32(1.0)))
            if valid:
                confidence[r, q] = relative_contrast
            else:
                projector_xy[r, q] = np.nan
                weight[r, q] = 0.0
