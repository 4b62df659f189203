"""Folds and crumples, told by the shade of blank paper: it changes abruptly at a crease, and nowhere on a curl."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from planish.color import to_grey, to_uint8
from planish.photo.bent import Bent
from planish.photo.cylinder import in_space, on_photo
from planish.photo.free import grid
from planish.photo.look import ink
from planish.types import Bools, Floats, Pixels

CELLS = 300
"""Of the page's long side: a millimetre of A4. Creases are sharper than one, shadows of hands and phones are not."""
BETWEEN = 5
"""The bent sheet is asked for every fifth of them."""
RIM = 0.04
"""Of the page, in parts of its long side, where the ground beyond it and the sheet's own thickness may show."""
FAINT = 0.04
"""So much darker than the paper around it, as a part of it, is the faintest print; it is left out."""
DIRECTIONS = 12
HALF = 8
"""Of the stretches that are looked at [cells]: an inch and a half is straight on crumpled paper too."""
NEAR, FAR = (1, 2), (4, 6)
"""How far from a crease the paper beside it begins and ends [cells]."""
SHARP = 0.5
"""Of the step from far to far that must be there from near to near: a blurred edge 6 mm wide has as much."""
STEP = 0.02
"""Least change of brightness at a crease, as a part of it. Means of so many cells are good to a few thousandths, and a
fold of 2 degrees in light from the side changes as much."""
LIKE = 0.5
"""Shade dims red and blue alike, printed tints do not: the lesser change is so much of the greater one."""
BLANK = (0.45, 0.6)
"""Part of the paper near and far that must be blank."""
LINE, NEXT = np.ones((9, 1), np.uint8), np.ones((5, 1), np.uint8)
"""How near a step the other way belongs to it, and how near steps are one [cells]."""
LEAST = 0.04
"""Shortest piece of a crease, in parts of the page's long side: a short one may be anything."""

Picture = NDArray[np.float32]


def crease_length(photo: Pixels, bent: Bent) -> float:
    """Find creases in the paper and add up their lengths, in lengths of the page's shorter side.

    Parameters
    ----------
    photo : (rows, cols, 3) uint8 or uint16
    bent : Bent

    Returns
    -------
    float
        1 for one fold from side to side. Sheets without creases have 0 to 0.2, most of it from sharp shadows. A fold
        that light meets equally on both sides is not seen.
    """
    page, seen = _on_page(photo, bent)
    blank = _blank(page) & seen
    step = np.where(_inner(blank.shape), _steps(_without_print(page, blank), blank), 0)
    return _length(step > STEP) / min(step.shape)


def _on_page(photo: Pixels, bent: Bent) -> tuple[Pixels, Bools]:
    """The page straightened, small: (rows, cols, 3) uint8, and which of it the photo shows."""
    low, high = bent.shift.low, bent.shift.high
    cell = float((high - low).max()) / CELLS
    places, shape_rc = grid(low, high, BETWEEN * cell)
    xy = on_photo(bent.sheet, in_space(bent.sheet, bent.shift.undone(places)))
    end = np.array(photo.shape[1::-1])
    first, last = (np.clip(f(xy, axis=0), 0, end).astype(int) for f in (np.min, np.max))
    part = np.asarray(photo)[first[1] : last[1] + 1, first[0] : last[0] + 1]
    step = max(1, int(np.ptp(xy, axis=0).max() / CELLS))  # cells of the page are about as large as the pixels then
    rows, cols = (max(n // step, 1) for n in part.shape[:2])
    small = cv2.resize(part[: rows * step, : cols * step], (cols, rows), interpolation=cv2.INTER_AREA)
    small = to_uint8(small)
    coarse = ((xy - first + 0.5) / step - 0.5).astype(np.float32).reshape(*shape_rc, 2)
    size = [BETWEEN * (n - 1) + 1 for n in shape_rc[::-1]]
    where = cv2.warpAffine(coarse, np.eye(2, 3) * BETWEEN, size, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    seen = ((where >= 0) & (where <= [cols - 1, rows - 1])).all(axis=2)
    return np.asarray(cv2.remap(small, where, None, cv2.INTER_LINEAR), np.uint8), seen


def _inner(shape_rc: tuple[int, ...]) -> Bools:
    """What is not on the page's rim."""
    rim = round(RIM * max(shape_rc))
    inner = np.zeros(shape_rc, bool)
    inner[rim:-rim, rim:-rim] = True
    return inner


def _blank(page: Pixels) -> Bools:
    """What is not print, nor next to it."""
    grey = to_grey(page)
    paper = cv2.morphologyEx(grey, cv2.MORPH_CLOSE, np.ones((7, 7), np.uint8))
    printed = ink(grey) | (grey < (1 - FAINT) * paper)
    return np.asarray(cv2.dilate(printed.astype(np.uint8), np.ones((3, 3), np.uint8)) == 0)


def _without_print(page: Pixels, blank: Bools) -> Picture:
    """Logarithm of red and blue (rows, cols, 2), print filled with the paper around it."""
    level = np.log(np.maximum(page[..., ::2].astype(np.float32), 4))
    weight = blank.astype(np.float32)[..., None]
    around = cv2.GaussianBlur(level * weight, (0, 0), FAR[0])
    share = cv2.GaussianBlur(weight, (0, 0), FAR[0])[..., None]
    return np.where(blank[..., None], level, around / np.maximum(share, 1e-3))


def _steps(level: Picture, blank: Bools) -> Picture:
    """How much the brightness changes at a crease through each place, 0 where there is none: (rows, cols)."""
    rows, cols = blank.shape
    side = int(np.ceil(np.hypot(rows, cols)))
    both = np.dstack([level, blank.astype(np.float32)])
    most = np.zeros((rows, cols), np.float32)
    for k in range(DIRECTIONS):
        turn = cv2.getRotationMatrix2D((cols / 2, rows / 2), 180 * k / DIRECTIONS, 1.0)
        turn[:, 2] += (side - np.array([cols, rows])) / 2
        level_step = _level_steps(cv2.warpAffine(both, turn, (side, side)))
        back = cv2.warpAffine(level_step, turn, (cols, rows), flags=cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP)
        most = np.maximum(most, back)
    return most


def _level_steps(both: Picture) -> Picture:
    """The same for creases that are level, of a picture of two colours and blankness."""
    red, blue, blank = cv2.split(both)
    good = np.ones(blank.shape, bool)
    for span, least in zip((NEAR, FAR), BLANK, strict=True):
        good &= np.minimum(_beside(blank, span), _beside(blank, span, below=True)) > least
    sign = np.sign(_change(red, NEAR))
    near, far = ([sign * _change(colour, span) for colour in (red, blue)] for span in (NEAR, FAR))
    start = np.mean(NEAR) / (np.mean(FAR) - np.mean(NEAR))
    at = [one - start * (other - one) for one, other in zip(near, far, strict=True)]  # on the crease itself
    least = np.minimum.reduce([*at, *near])
    good &= (least > LIKE * np.maximum(*at)) & (np.minimum(*near) > SHARP * np.maximum(*far))
    step = np.where(good, least, 0).clip(0)
    up, down = np.where(sign > 0, step, 0), np.where(sign > 0, 0, step)
    other = np.where(sign > 0, cv2.dilate(down, LINE), cv2.dilate(up, LINE))
    step[step <= 2 * other] = 0  # a printed line steps down and up again
    return np.where(step >= cv2.dilate(step, NEXT), step, 0)


def _change(colour: Picture, span: tuple[int, int]) -> Picture:
    """From above a place to below it."""
    return _beside(colour, span, below=True) - _beside(colour, span)


def _beside(colour: Picture, span: tuple[int, int], *, below: bool = False) -> Picture:
    """Mean over a stretch that runs above or below each place, so many rows off."""
    first, last = span
    across = np.zeros(2 * last + 1, np.float32)
    across[last + first :] = 1 / (last + 1 - first)
    along = np.full(2 * HALF + 1, 1 / (2 * HALF + 1), np.float32)
    return cv2.sepFilter2D(colour, -1, along, across if below else across[::-1], borderType=cv2.BORDER_CONSTANT)


def _length(crease: Bools) -> float:
    """Sum of the lengths of pieces that are not too short [cells]."""
    joined = cv2.dilate(crease.astype(np.uint8), np.ones((3, 3), np.uint8))
    _, _, stats, _ = cv2.connectedComponentsWithStats(joined)
    length: Floats = np.hypot(stats[1:, cv2.CC_STAT_WIDTH], stats[1:, cv2.CC_STAT_HEIGHT])
    return float(length[length >= LEAST * max(crease.shape)].sum())
