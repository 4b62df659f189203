"""Check Gray code captures for completeness, order and exposure; errors name the faulty photos."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planish.acquire.structured_light.gray_code import Grey, bits_for, frame_count, lit_mask, white_level
from planish.errors import InputError
from planish.types import Bools, Diagnostic

MIN_LIT_SHARE = 0.01
"""Least share of the photo lit by the projector."""

CLIPPED, NEARLY = 0.25, 0.985
"""Largest share of lit pixels at or above this share of the highest value under white."""

PAIRED = 0.06
"""Pattern and inverse together are at least white and black together, to this part of their difference (mean). They may
be more: where fine stripes blur, a camera that brightens dark tones (sRGB) shows both brighter than half."""

DUPLICATE_DIFFERENCE = 0.1
"""Mean difference of duplicates, relative to white minus black, at most."""

MIN_CONTRAST = 0.3
"""Least contrast, relative to the brightest, of pixels in the test of the order."""

MIN_AGREEMENT = 0.45
"""Least share of stripe edges at which each lower bit agrees with the code."""

MIN_RESOLVED = 0.2
"""Least mean difference of pattern and inverse, relative to white minus black, of a resolved bit."""

MIN_EDGES = 50
"""Least number of stripe edges of a bit in the test of lower bits."""

MAX_UNRESOLVED = 2
"""Most finest bits that may be unresolved. On a book page the median error is 0.003, 0.016 and 0.013 px with none, one
and two; phase shifting is for more."""

EDGE_STEP = 4
"""Subsampling of rows and columns in the search for edges."""

SAMPLED_SIDE = 160
"""Approximate rows and columns of the subsampled photos used for all checks."""


def check_frames(frames: Grey, shape_rc: tuple[int, int]) -> list[Diagnostic]:
    """Refuse photos that cannot be decoded, naming the faulty ones.

    Parameters
    ----------
    frames : (n, rows, cols) uint8 or uint16
    shape_rc : (int, int)
        Rows and columns of the projector.

    Returns
    -------
    list of Diagnostic

    Raises
    ------
    InputError
    """
    bits = bits_for(shape_rc[1]) + bits_for(shape_rc[0])
    wanted = frame_count(shape_rc)
    if len(frames) < 4:
        raise InputError(
            f"there are {len(frames)} photos; a code for {shape_rc[1]} x {shape_rc[0]} pixels has {wanted}"
        )
    step = max(1, min(frames.shape[1:]) // SAMPLED_SIDE)
    small = frames[:, ::step, ::step].astype(np.float32)
    warnings = [] if len(frames) != wanted else _check_light(frames)
    lit = lit_pixels(small)
    _check_count(small, lit, wanted, shape_rc)
    _check_pairs(small, lit, bits)
    bounds = ((0, bits_for(shape_rc[1])), (bits_for(shape_rc[1]), bits))
    for name, (first, last) in zip(("column", "row"), bounds, strict=True):
        first_unresolved = next((k for k in range(first, last) if not _resolved(small, lit, k)), last)
        _check_order(frames, first, first_unresolved, name)
    return warnings


def _check_light(frames: Grey) -> list[Diagnostic]:
    lit = lit_mask(frames)
    share = float(lit.mean())
    if share < MIN_LIT_SHARE:
        swapped = float(lit_mask(frames[[*range(len(frames) - 2), -1, -2]]).mean()) if len(frames) > 1 else 0.0
        hint = (
            "the last two are exchanged: white comes before black"
            if swapped >= MIN_LIT_SHARE
            else "is the projector in the camera's view, on, and bright enough?"
        )
        raise InputError(
            f"white (the last photo but one) lights {100 * share:.1f} % of the view more than black: {hint}"
        )
    clipped = float((frames[-2][lit] >= NEARLY * white_level(frames)).mean())
    if frames.dtype == np.uint8 and clipped > CLIPPED:
        raise InputError(
            f"{100 * clipped:.0f} % of what the projector lights is overexposed under white (the last photo but "
            "one); expose for less, until no part of the sheet is clipped"
        )
    if frames.dtype == np.uint8 and clipped > 0.02:
        sentence = f"{100 * clipped:.0f} % of what the projector lights is overexposed; points there are less exact"
        return [Diagnostic("projector-overexposed", sentence)]
    return []


def unresolved_bits(frames: Grey, shape_rc: tuple[int, int]) -> tuple[int, int]:
    """Number of the finest bits, of columns and of rows, whose stripes the camera does not resolve; 0 for too many.

    Such a bit is noise: read with the others, it puts a pixel's code off by one, and pixels between two stripes of the
    next bit would have no bit that is sure.

    Parameters
    ----------
    frames : (n, rows, cols) uint8 or uint16
        In the order of `gray_code.patterns`.
    shape_rc : (int, int)
        Rows and columns of the projector.
    """
    step = max(1, min(frames.shape[1:]) // SAMPLED_SIDE)
    small = frames[:, ::step, ::step].astype(np.float32)
    lit = lit_pixels(small)
    columns, rows = bits_for(shape_rc[1]), bits_for(shape_rc[0])
    unresolved = []
    for first, count in ((0, columns), (columns, rows)):
        resolved = [_resolved(small, lit, first + k) for k in range(count)]
        finest = max((k for k in range(count) if resolved[k]), default=count - 1)
        missing = count - 1 - finest
        unresolved.append(missing if missing <= MAX_UNRESOLVED else 0)
    return unresolved[0], unresolved[1]


def lit_pixels(small: NDArray[np.float32]) -> Bools:
    """Mask of pixels lit by the projector: those that vary most; works with missing photos."""
    spread = np.ptp(small, axis=0)
    return np.asarray(spread > 0.5 * np.quantile(spread, 0.98))


def _check_count(small: NDArray[np.float32], lit: Bools, wanted: int, shape_rc: tuple[int, int]) -> None:
    found = len(small)
    if found == wanted:
        return
    message = f"there are {found} photos; a code for {shape_rc[1]} x {shape_rc[0]} pixels of the projector has {wanted}"
    duplicate = _find_duplicate(small, lit)
    if found > wanted and duplicate:
        raise InputError(
            f"{message}: photos {duplicate} and {duplicate + 1} show the same pattern; take one of them away"
        )
    if found == wanted - 1:
        first = next((k for k in range(0, found - 2, 2) if unpaired(small, lit, k)), None)
        if first is None:
            raise InputError(f"{message}: white or black at the end is missing")
        raise InputError(f"{message}: photo {first + 1} or {first + 2} of the {wanted} is missing")
    raise InputError(f"{message}; are some missing, or was the projector's resolution another?")


def _find_duplicate(small: NDArray[np.float32], lit: Bools) -> int | None:
    """Number, from 1, of the first photo with the same stripes as its successor.

    Photos that are all bright or all dark are ignored: partial views of wide stripes may look alike.
    """
    seen = small[:, lit]
    low, high = seen.min(axis=0), seen.max(axis=0)
    share = (seen - low) / (high - low)
    for k in range(len(small) - 1):
        striped = 0.1 < (share[k] > 0.5).mean() < 0.9 and np.abs(share[k] - 0.5).mean() > MIN_RESOLVED
        if striped and np.abs(share[k] - share[k + 1]).mean() < DUPLICATE_DIFFERENCE:
            return k + 1
    return None


def unpaired(small: NDArray[np.float32], lit: Bools, k: int) -> bool:
    """Whether photos k and k + 1 are not a pattern and its inverse."""
    a, b = small[k, lit], small[k + 1, lit]
    high, low = small[:, lit].max(axis=0), small[:, lit].min(axis=0)
    return bool(np.mean(np.maximum(high + low - a - b, 0) / (high - low)) > PAIRED)


def _resolved(small: NDArray[np.float32], lit: Bools, bit: int) -> bool:
    """Whether the stripes of a bit are resolved."""
    contrast = np.abs(small[-2, lit] - small[-1, lit])
    return bool(np.mean(np.abs(small[2 * bit, lit] - small[2 * bit + 1, lit]) / contrast) > MIN_RESOLVED)


def _check_pairs(small: NDArray[np.float32], lit: Bools, bits: int) -> None:
    duplicate = _find_duplicate(small[: 2 * bits], lit)
    broken = [k for k in range(0, 2 * bits, 2) if unpaired(small, lit, k)]
    if duplicate:
        raise InputError(
            f"photos {duplicate} and {duplicate + 1} show the same pattern, so another is missing; take the photos "
            "again"
        )
    if broken:
        named = ", ".join(f"{k + 1} and {k + 2}" for k in broken[:4])
        raise InputError(
            f"photos {named} are not a pattern and its inverse; are the photos in the order in which they were taken, "
            "and did nothing move?"
        )


def _check_order(frames: Grey, first: int, last: int, name: str) -> None:
    """Refuse bits in the wrong order.

    At the edge of a stripe of one bit, the next lower bit is 1 and all those below it are 0.
    """
    bits_here, bits_there = _neighbours(frames, first, last)
    stripes = (bits_here != bits_there).sum(axis=0) == 1  # at edges of the scene more bits change
    for k in range(1, last - first):
        agreement = []
        for j in range(k):
            edge = (bits_here[j] != bits_there[j]) & stripes
            if edge.sum() >= MIN_EDGES:
                agreement.append(float((bits_here[k][edge] == (j == k - 1)).mean()))
        if agreement and min(agreement) < MIN_AGREEMENT:
            exchanged = max(agreement) < 1 - MIN_AGREEMENT
            pair = f"photos {2 * (first + k) + 1} and {2 * (first + k) + 2}"
            raise InputError(
                f"{pair} are exchanged, or some before them are out of order; put them in the order of the patterns"
                if exchanged
                else f"{pair} do not follow in the {name} code from those before them; put the photos in the order of "
                "the patterns, and check that none is of another scene"
            )


def _neighbours(frames: Grey, first: int, last: int) -> tuple[Bools, Bools]:
    """Bits first to last at lit pixels and at their lit right or lower neighbours: two of (bits, k)."""
    pattern, inverse = frames[2 * first : 2 * last : 2], frames[2 * first + 1 : 2 * last : 2]
    contrast = frames[-2].astype(np.float32) - frames[-1]
    lit = contrast > MIN_CONTRAST * np.quantile(contrast, 0.98)
    pairs = []
    for subsampling in ((slice(None, None, EDGE_STEP), slice(None)), (slice(None), slice(None, None, EDGE_STEP))):
        bits = pattern[:, *subsampling] > inverse[:, *subsampling]
        light = lit[subsampling]
        if subsampling[0] == slice(None):
            bits, light = bits.swapaxes(1, 2), light.T
        both = light[:, :-1] & light[:, 1:]
        pairs.append((bits[:, :, :-1][:, both], bits[:, :, 1:][:, both]))
    (a, b), (c, d) = pairs
    return np.hstack([a, c]), np.hstack([b, d])
