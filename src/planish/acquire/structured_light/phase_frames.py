"""Check phase captures for completeness and order; errors name the faulty photos.

The Gray code gives the column and row seen by each pixel, and so the expected value of every phase pattern.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planish.acquire.structured_light.frames import SAMPLED_SIDE, lit_pixels, unpaired
from planish.acquire.structured_light.gray_code import Grey, decode, frame_count
from planish.acquire.structured_light.phase import HALF_BITS, PERIOD, STEP_RANGE
from planish.errors import InputError

QUARTER_BITS = HALF_BITS - 1
"""Number of lowest code bits within a quarter period: the coarsest steps that still resolve the shift of a cosine."""

MIN_CONTRAST = 0.3
"""Least contrast of a phase pattern, relative to white minus black; quarter periods preserve 0.9 of it."""

MAX_STEP_ERROR = 0.4
"""Largest deviation of a phase shift, in steps."""

AXES = "columns", "rows"


def check_count(frames: Grey, shape_rc: tuple[int, int]) -> None:
    """Refuse an odd number of phase photos, naming the missing or duplicated one.

    Parameters
    ----------
    frames : (n, rows, cols) uint8 or uint16
        All photos.
    shape_rc : (int, int)
        Rows and columns of the projector.

    Raises
    ------
    InputError
    """
    bits, extra = frame_count(shape_rc) - 2, len(frames) - frame_count(shape_rc)
    if extra % 2 == 0 or not 2 * STEP_RANGE[0] - 1 <= extra < 2 * STEP_RANGE[1]:
        return
    message = f"there are {len(frames)} photos: {bits + 2} are for the Gray code, and waves come in even numbers"
    subsampling = max(1, min(frames.shape[1:]) // SAMPLED_SIDE)
    small = frames[:, ::subsampling, ::subsampling].astype(np.float32)
    lit = lit_pixels(small)
    for k in range(0, bits, 2):
        if unpaired(small, lit, k):
            raise InputError(f"{message}; photo {k + 1} or {k + 2} is missing")
    steps = (extra + 1) // 2
    seen = _wave_contrasts(np.concatenate([frames[:bits], frames[-2:]]), frames[bits:-2], shape_rc)
    axes = np.argmax(np.abs(seen), axis=1)
    cycles = np.angle(seen[np.arange(extra), axes]) / (2 * np.pi)
    for k in range(1, extra):
        if axes[k] == axes[k - 1] and abs((cycles[k] - cycles[k - 1] + 0.5) % 1 - 0.5) < MAX_STEP_ERROR / steps:
            raise InputError(
                f"{message}; photos {bits + k} and {bits + k + 1} show the same wave, take one of them away"
            )
    for k in range(extra):
        axis, step = divmod(k, steps)
        if axes[k] != axis or abs((cycles[k] - step / steps + 0.5) % 1 - 0.5) > MAX_STEP_ERROR / steps:
            raise InputError(f"{message}; wave {step + 1} of the {AXES[axis]} is missing before photo {bits + k + 1}")
    raise InputError(f"{message}; the last wave, white or black is missing")


def check_waves(frames: Grey, waves: Grey, shape_rc: tuple[int, int]) -> None:
    """Refuse phase photos that are duplicated, out of order or of something else.

    Parameters
    ----------
    frames : (n, rows, cols) uint8 or uint16
        Gray code only.
    waves : (2 steps, rows, cols), of the same kind
        In the order of `phase.patterns`.
    shape_rc : (int, int)
        Rows and columns of the projector.

    Raises
    ------
    InputError
        Naming the photo.
    """
    steps = len(waves) // 2
    before = len(frames) - 2  # all photos but white and black come before the waves
    last = None
    for k, seen in enumerate(_wave_contrasts(frames, waves, shape_rc)):
        axis = int(np.argmax(np.abs(seen)))
        if np.abs(seen[axis]) < MIN_CONTRAST:
            raise InputError(
                f"photo {before + k + 1} shows no wave; the {2 * steps} photos after the code and before white must be "
                f"those of {steps} steps of phase for the columns, then for the rows"
            )
        step = np.angle(seen[axis]) / (2 * np.pi) * steps
        measured = axis, round(step) % steps
        expected = divmod(k, steps)
        if measured == last:
            raise InputError(f"photos {before + k} and {before + k + 1} show the same wave, so another is missing")
        if measured != expected or abs(step - round(step)) > MAX_STEP_ERROR:
            raise InputError(
                f"photo {before + k + 1} shows wave {measured[1] + 1} of the {AXES[axis]}, where wave "
                f"{expected[1] + 1} of {steps} of the {AXES[expected[0]]} is wanted; put the photos in the order of "
                "the patterns"
            )
        last = measured


def _wave_contrasts(frames: Grey, waves: Grey, shape_rc: tuple[int, int]) -> NDArray[np.complex128]:
    """Complex amplitude of the cosine along columns and rows in each photo: (2 steps, 2).

    Correlation of the photo, minus its mean, with exp(2 pi i x / PERIOD), x the centre of the decoded quarter period.
    """
    subsampling = max(1, min(frames.shape[1:]) // SAMPLED_SIDE)
    some = frames[:, ::subsampling, ::subsampling].copy()
    codes = decode(some, shape_rc, skipped_bits=QUARTER_BITS)
    read = codes.column >= 0
    if not read.any():
        return np.zeros((len(waves), 2), np.complex128)
    middles = (np.stack([codes.column[read], codes.row[read]]) + 0.5) * 2**QUARTER_BITS - 0.5
    carrier = np.exp(2j * np.pi * middles / PERIOD)
    carrier -= carrier.mean(axis=1, keepdims=True)
    white, black = some[-2][read].astype(np.float64), some[-1][read].astype(np.float64)
    measured = (waves[:, ::subsampling, ::subsampling][:, read] - black) / (white - black)
    measured -= measured.mean(axis=1, keepdims=True)
    return np.asarray(4 * (measured @ carrier.T) / int(read.sum()))
