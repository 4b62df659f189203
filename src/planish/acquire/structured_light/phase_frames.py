"""Whether the photos of waves are those that follow on the Gray code's, and in order; and if not, which are to blame.

The Gray code says which column and row each pixel sees, and so what every photo of a wave must show there.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planish.acquire.structured_light.frames import LOOK, unpaired, varied
from planish.acquire.structured_light.gray_code import Grey, decode, frame_count
from planish.acquire.structured_light.phase import HALF_BITS, PERIOD, STEPS
from planish.errors import InputError

QUARTER_BITS = HALF_BITS - 1
"""Lowest bits of the code that lie within a quarter of a period: the coarsest steps that still tell a wave's shift."""

FAINTEST = 0.3
"""Contrast of a wave against white and black, from which it is one: quarter periods tell 0.9 of it."""

OFF = 0.4
"""Of a step: a wave that stands farther from its place is another one."""

AXES = "columns", "rows"


def check_count(frames: Grey, shape_rc: tuple[int, int]) -> None:
    """Refuse an odd number of photos beside the Gray code's, and say which is missing or doubled.

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
    bits, beside = frame_count(shape_rc) - 2, len(frames) - frame_count(shape_rc)
    if beside % 2 == 0 or not 2 * STEPS[0] - 1 <= beside < 2 * STEPS[1]:
        return
    said = f"there are {len(frames)} photos: {bits + 2} are for the Gray code, and waves come in even numbers"
    thin = max(1, min(frames.shape[1:]) // LOOK)
    small = frames[:, ::thin, ::thin].astype(np.float32)
    lit = varied(small)
    for k in range(0, bits, 2):
        if unpaired(small, lit, k):
            raise InputError(f"{said}; photo {k + 1} or {k + 2} is missing")
    steps = (beside + 1) // 2
    seen = _waves(np.concatenate([frames[:bits], frames[-2:]]), frames[bits:-2], shape_rc)
    axes = np.argmax(np.abs(seen), axis=1)
    turns = np.angle(seen[np.arange(beside), axes]) / (2 * np.pi)
    for k in range(1, beside):
        if axes[k] == axes[k - 1] and abs((turns[k] - turns[k - 1] + 0.5) % 1 - 0.5) < OFF / steps:
            raise InputError(f"{said}; photos {bits + k} and {bits + k + 1} show the same wave, take one of them away")
    for k in range(beside):
        axis, step = divmod(k, steps)
        if axes[k] != axis or abs((turns[k] - step / steps + 0.5) % 1 - 0.5) > OFF / steps:
            raise InputError(f"{said}; wave {step + 1} of the {AXES[axis]} is missing before photo {bits + k + 1}")
    raise InputError(f"{said}; the last wave, white or black is missing")


def check_waves(frames: Grey, waves: Grey, shape_rc: tuple[int, int]) -> None:
    """Refuse photos of waves that are doubled, out of order or of something else.

    Parameters
    ----------
    frames : (n, rows, cols) uint8 or uint16
        Of the Gray code alone.
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
    for k, seen in enumerate(_waves(frames, waves, shape_rc)):
        axis = int(np.argmax(np.abs(seen)))
        if np.abs(seen[axis]) < FAINTEST:
            raise InputError(
                f"photo {before + k + 1} shows no wave; the {2 * steps} photos after the code and before white must be "
                f"those of {steps} steps of phase for the columns, then for the rows"
            )
        step = np.angle(seen[axis]) / (2 * np.pi) * steps
        shown = axis, round(step) % steps
        wanted = divmod(k, steps)
        if shown == last:
            raise InputError(f"photos {before + k} and {before + k + 1} show the same wave, so another is missing")
        if shown != wanted or abs(step - round(step)) > OFF:
            raise InputError(
                f"photo {before + k + 1} shows wave {shown[1] + 1} of the {AXES[axis]}, where wave {wanted[1] + 1} of "
                f"{steps} of the {AXES[wanted[0]]} is wanted; put the photos in the order of the patterns"
            )
        last = shown


def _waves(frames: Grey, waves: Grey, shape_rc: tuple[int, int]) -> NDArray[np.complex128]:
    """Contrast and place of the wave along the columns and along the rows in each photo, (2 steps, 2) complex.

    The photo, less its mean, times exp(2 pi i x / PERIOD), x the middle of the quarter period that the code tells.
    """
    thin = max(1, min(frames.shape[1:]) // LOOK)
    some = frames[:, ::thin, ::thin].copy()
    codes = decode(some, shape_rc, unread=QUARTER_BITS)
    read = codes.column >= 0
    if not read.any():
        return np.zeros((len(waves), 2), np.complex128)
    middles = (np.stack([codes.column[read], codes.row[read]]) + 0.5) * 2**QUARTER_BITS - 0.5
    turn = np.exp(2j * np.pi * middles / PERIOD)
    turn -= turn.mean(axis=1, keepdims=True)
    white, black = some[-2][read].astype(np.float64), some[-1][read].astype(np.float64)
    shown = (waves[:, ::thin, ::thin][:, read] - black) / (white - black)
    shown -= shown.mean(axis=1, keepdims=True)
    return np.asarray(4 * (shown @ turn.T) / int(read.sum()))
