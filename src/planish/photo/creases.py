"""Crease detection from the shading of blank paper: it is discontinuous at creases and smooth on curls."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from planish.color import to_grey, to_uint8
from planish.photo.cylinder import page_to_space, space_to_photo
from planish.photo.fitted_sheet import FittedSheet
from planish.photo.lines import TextLines
from planish.photo.residual_warp import grid
from planish.photo.working_image import ink_mask
from planish.types import Bools, Floats, Ints, Pixels

CELLS = 300
"""Cells along the page's long side: 1 mm of A4. Creases are sharper, shadows of hands and phones are not."""
BETWEEN = 5
"""Grid step of the map from page to photo [cells]; interpolated between."""
RIM = 0.04
"""Width of the ignored rim of the page, as a share of its long side: background and paper edges may show there."""
FAINT = 0.04
"""Least relative contrast of faint print, which is masked."""
DIRECTIONS = 12
HALF = 8
"""Half length of the filter along the crease [cells]: creases are straight over an inch and a half."""
NEAR, FAR = (1, 2), (4, 6)
"""Distance range of the filter's two sides from the crease [cells]."""
SHARP = 0.5
"""Least ratio of the near to the far step: that of a blurred edge 6 mm wide."""
STEP = 0.02
"""Least relative step of brightness at a crease. Filter means are accurate to a few thousandths; a fold of 2 degrees in
oblique light gives this step."""
LIKE = 0.5
"""Least ratio of the red and blue steps: shading changes both alike, printed tints do not."""
BLANK = (0.45, 0.6)
"""Least share of blank paper in the near and far windows."""
LINE, NEXT = np.ones((9, 1), np.uint8), np.ones((5, 1), np.uint8)
"""Windows that pair a step with one of opposite sign, and for non-maximum suppression [cells]."""
PICTURE, DARKER = 41, 0.5
"""Width of the neighbourhood [cells] whose brightest paper is the measure, and the share of it below which a place is a
dark picture, no blank paper."""
LEAF_EDGE = 0.2
"""Width along the sides, relative to the page, in which an edge beyond the text may be that of a leaf: letters are
folded at thirds and halves."""
ELONGATED = 3.0
"""Least ratio of the length along the side to the width across it of such an edge."""
LEAST = 0.04
"""Shortest piece of a crease, as a share of the page's long side."""

Picture = NDArray[np.float32]


def crease_length(photo: Pixels, sheet: FittedSheet, lines: TextLines | None = None) -> float:
    """Detect creases in the paper and sum their lengths, in shorter sides of the page.

    The step from a leaf to those below it runs along a side of the page, beyond its text: it is an edge, no crease.

    Parameters
    ----------
    photo : (rows, cols, 3) uint8 or uint16
    sheet : FittedSheet
    lines : TextLines, optional
        Those that the sheet was fitted to.

    Returns
    -------
    float
        1 for one fold from side to side. Sheets without creases have 0 to 0.2, mostly from sharp shadows. A fold lit
        equally on both sides is not detected.
    """
    page, seen = _straightened(photo, sheet)
    blank = _blank(page) & seen
    step = np.where(_inner(blank.shape), _crease_contrast(_without_print(page, blank), blank), 0)
    return _length(step > STEP, _text_cells(sheet, lines)) / min(step.shape)


def _straightened(photo: Pixels, sheet: FittedSheet) -> tuple[Pixels, Bools]:
    """Rectified small page (rows, cols, 3) uint8, and the mask of what the photo shows."""
    low, high = sheet.warp.low, sheet.warp.high
    cell = float((high - low).max()) / CELLS
    positions, shape_rc = grid(low, high, BETWEEN * cell)
    xy = space_to_photo(sheet.cylinder, page_to_space(sheet.cylinder, sheet.warp.inverse(positions)))
    end = np.array(photo.shape[1::-1])
    first, last = (np.clip(f(xy, axis=0), 0, end).astype(int) for f in (np.min, np.max))
    part = np.asarray(photo)[first[1] : last[1] + 1, first[0] : last[0] + 1]
    step = max(1, int(np.ptp(xy, axis=0).max() / CELLS))  # so that pixels are about as large as cells
    rows, cols = (max(n // step, 1) for n in part.shape[:2])
    small = cv2.resize(part[: rows * step, : cols * step], (cols, rows), interpolation=cv2.INTER_AREA)
    small = to_uint8(small)
    coarse = ((xy - first + 0.5) / step - 0.5).astype(np.float32).reshape(*shape_rc, 2)
    size = [BETWEEN * (n - 1) + 1 for n in shape_rc[::-1]]
    where = cv2.warpAffine(coarse, np.eye(2, 3) * BETWEEN, size, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    seen = ((where >= 0) & (where <= [cols - 1, rows - 1])).all(axis=2)
    return np.asarray(cv2.remap(small, where, None, cv2.INTER_LINEAR), np.uint8), seen


def _inner(shape_rc: tuple[int, ...]) -> Bools:
    """Mask of the page without its rim."""
    rim = round(RIM * max(shape_rc))
    inner = np.zeros(shape_rc, bool)
    inner[rim:-rim, rim:-rim] = True
    return inner


def _blank(page: Pixels) -> Bools:
    """Mask of blank paper, away from print."""
    grey = to_grey(page)
    paper_level = cv2.morphologyEx(grey, cv2.MORPH_CLOSE, np.ones((7, 7), np.uint8))
    around = cv2.blur(cv2.dilate(paper_level, np.ones((PICTURE,) * 2, np.uint8)), (PICTURE, PICTURE))
    printed = ink_mask(grey) | (grey < (1 - FAINT) * paper_level) | (grey < DARKER * around)
    return np.asarray(cv2.dilate(printed.astype(np.uint8), np.ones((3, 3), np.uint8)) == 0)


def _without_print(page: Pixels, blank: Bools) -> Picture:
    """Log of red and blue (rows, cols, 2), print inpainted from the paper around it."""
    level = np.log(np.maximum(page[..., ::2].astype(np.float32), 4))
    weight = blank.astype(np.float32)[..., None]
    around = cv2.GaussianBlur(level * weight, (0, 0), FAR[0])
    share = cv2.GaussianBlur(weight, (0, 0), FAR[0])[..., None]
    return np.where(blank[..., None], level, around / np.maximum(share, 1e-3))


def _crease_contrast(level: Picture, blank: Bools) -> Picture:
    """Brightness step at each crease pixel, 0 elsewhere: (rows, cols)."""
    rows, cols = blank.shape
    side = int(np.ceil(np.hypot(rows, cols)))
    both = np.dstack([level, blank.astype(np.float32)])
    most = np.zeros((rows, cols), np.float32)
    for k in range(DIRECTIONS):
        rotation = cv2.getRotationMatrix2D((cols / 2, rows / 2), 180 * k / DIRECTIONS, 1.0)
        rotation[:, 2] += (side - np.array([cols, rows])) / 2
        level_step = _horizontal_crease_contrast(cv2.warpAffine(both, rotation, (side, side)))
        aligned = cv2.warpAffine(level_step, rotation, (cols, rows), flags=cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP)
        most = np.maximum(most, aligned)
    return most


def _horizontal_crease_contrast(both: Picture) -> Picture:
    """The same for horizontal creases, from an image of red, blue and blankness."""
    red, blue, blank = cv2.split(both)
    good = np.ones(blank.shape, bool)
    for span, least in zip((NEAR, FAR), BLANK, strict=True):
        good &= np.minimum(_beside(blank, span), _beside(blank, span, below=True)) > least
    sign = np.sign(_change(red, NEAR))
    near, far = ([sign * _change(colour, span) for colour in (red, blue)] for span in (NEAR, FAR))
    start = np.mean(NEAR) / (np.mean(FAR) - np.mean(NEAR))
    at = [one - start * (other - one) for one, other in zip(near, far, strict=True)]  # extrapolated to the crease
    least = np.minimum.reduce([*at, *near])
    good &= (least > LIKE * np.maximum(*at)) & (np.minimum(*near) > SHARP * np.maximum(*far))
    step = np.where(good, least, 0).clip(0)
    up, down = np.where(sign > 0, step, 0), np.where(sign > 0, 0, step)
    other = np.where(sign > 0, cv2.dilate(down, LINE), cv2.dilate(up, LINE))
    step[step <= 2 * other] = 0  # a printed line has two opposite steps
    return np.where(step >= cv2.dilate(step, NEXT), step, 0)


def _change(colour: Picture, span: tuple[int, int]) -> Picture:
    """Difference between the means below and above each pixel."""
    return _beside(colour, span, below=True) - _beside(colour, span)


def _beside(colour: Picture, span: tuple[int, int], *, below: bool = False) -> Picture:
    """Mean over a window above or below each pixel, `span` rows away."""
    first, last = span
    across = np.zeros(2 * last + 1, np.float32)
    across[last + first :] = 1 / (last + 1 - first)
    along = np.full(2 * HALF + 1, 1 / (2 * HALF + 1), np.float32)
    return cv2.sepFilter2D(colour, -1, along, across if below else across[::-1], borderType=cv2.BORDER_CONSTANT)


def _text_cells(sheet: FittedSheet, lines: TextLines | None) -> tuple[Floats, Floats] | None:
    """First and last cell of the text, x and y; None without text."""
    if lines is None:
        return None
    low, high = sheet.warp.low, sheet.warp.high
    letters = (sheet.cylinder_fit.page[: len(lines.line)] - low) * CELLS / float((high - low).max())
    first, last = np.quantile(letters, [0.01, 0.99], axis=0)
    return first, last


def _length(crease: Bools, text: tuple[Floats, Floats] | None) -> float:
    """Total length of crease pieces that are long enough, and no edges of leaves [cells]."""
    joined = cv2.dilate(crease.astype(np.uint8), np.ones((3, 3), np.uint8))
    _, _, stats, _ = cv2.connectedComponentsWithStats(joined)
    first, size = stats[1:, :2].astype(float), stats[1:, 2:4].astype(float)
    length: Floats = np.hypot(size[:, 0], size[:, 1])
    counted = length >= LEAST * max(crease.shape)
    if text is not None:
        counted &= ~_leaf_edges(first, size, np.array(crease.shape[::-1]), text)
    return float(length[counted].sum())


def _leaf_edges(first: Floats, size: Floats, page_size: Ints, text: tuple[Floats, Floats]) -> Bools:
    """Which pieces, by their boxes, run along a side of the page near it and beyond the text."""
    last = first + size
    before = (last < text[0]) & (last < LEAF_EDGE * page_size)
    after = (first > text[1]) & (first > (1 - LEAF_EDGE) * page_size)
    along = size[:, ::-1] > ELONGATED * size
    return np.asarray(((before | after) & along).any(axis=1))
