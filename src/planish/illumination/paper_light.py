"""The light on blank paper, from the page alone: shade is grey and smooth, print has edges and colour.

As in Retinex theory, steep or coloured steps of brightness are taken for print, and what remains is integrated to the
light (Horn 1974; as Poisson's equation: Morel, Petro and Sbert, IEEE TIP 2010). What is as bright as paper in that
light is paper: there the light is followed, and across print it is interpolated.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.ndimage import maximum_filter1d, median
from scipy.sparse.linalg import splu

from planish.color import LUMINANCE
from planish.illumination.cells import Cells, Field, filled
from planish.illumination.refine_on_paper import smoothed
from planish.types import Bools, Floats

CLOSING_MM = 6.0
"""What is darker than its surroundings and narrower than this is strokes on paper."""
STEP_MM = 1.5
"""Steps of brightness are taken over that distance; those of creases and of shadows are lower or wider."""
STEP, TINT = 0.2, 0.12
"""Step [log], and change of a channel relative to the greatest, from which on it is an edge of print."""
LEAST_PEAK, LEAST_SHARE = 0.02, 0.04
"""Shares of the page that the cells at the paper's level, and in the end all paper, must have."""
LEVEL_STEP, ALIKE = 0.02, 0.1
"""Classes of brightness [log] in which the paper's level is looked for, and how far cells of one level may lie off."""
SAME_PAPER = 0.4
"""Parts of the paper between which print lies may come out at levels as different as that [log]."""
DARKER = 0.2
"""Cells that are darker than paper in the light found by less than this [log] are paper; nothing is brighter."""
SHADED, SHADED_TINT = 1.8, 0.3
"""Smooth areas at the rim that are darker, but by less than this [log], and coloured by less, are paper in a shadow or
beyond a fold: print seldom is grey, even and at the rim."""
UNEVEN = 0.4
"""Nothing in it is brighter or darker than most of it by more than this [log], or it is print in the shadow."""
RIM_MM, CONTACT = 5.0, 0.25
"""Such an area touches the rim of so much, along this part of the square root of its area."""
LEAST_PART = 1e-3
"""Smaller parts of the page are not followed: white spots of a picture."""
GAP_MM = 4.0
"""Narrower lines between two parts of such an area do not part them."""
BESIDE_MM = 2.0
"""Paper so close to print is not followed: blur mixes both."""
NODE_MM, MOST_NODES = 2.0, 10_000
"""Spacing of the grid on which the light is interpolated across print, and the most points that it has."""
ACROSS = 1e-4
"""Weight of equal light on both sides of an edge, against equal slopes off edges."""
LOOSE = 1e-9
"""Pull towards 0, which fixes the level."""
STIFF_MM = 30.0
"""Farther from paper the light is taken to be even."""
FOLLOWED_MM = (10.0, 4.0, 1.6)
"""Widths over which the rest is smoothed, each adding what the wider ones left."""


def light_of_paper(cells: Cells) -> Field | None:
    """Estimate the light of blank paper everywhere.

    Parameters
    ----------
    cells : Cells

    Returns
    -------
    (rows, cols, 3) float32, or None
        Logarithm of the linear light of paper in each channel; None where less than LEAST_SHARE of the page is paper.
    """
    log = _between_strokes(cells)
    edge = _edges(log, cells.mm)
    light = _smooth_part(log, edge, cells.mm)
    level = _paper_level(log - light, cells.known & ~edge)
    if level is None:
        return None
    light += level
    paper = _paper(log, light, edge, cells)
    return _followed(log, paper, cells.mm) if paper.sum() > LEAST_SHARE * cells.known.sum() else None


def _between_strokes(cells: Cells) -> Field:
    """Logarithm of the light that a closing leaves: that of the paper between letters, or of wide print."""
    light = filled(cells.light, cells.known)
    closed = cv2.morphologyEx(light, cv2.MORPH_CLOSE, _disc(CLOSING_MM / cells.mm))
    return np.asarray(np.log(np.maximum(closed, 1e-4)))


def _edges(log: Field, mm: float) -> Bools:
    """Cells at steep or coloured steps."""
    smooth = cv2.GaussianBlur(log, (0, 0), 0.7)
    values = np.dstack([smooth @ LUMINANCE / STEP, _chroma(smooth) / TINT])
    step = np.zeros((1, max(2, round(STEP_MM / mm)) + 1), np.float32)
    step[0, 0], step[0, -1] = -1, 1
    steps = [cv2.filter2D(values, -1, kernel, borderType=cv2.BORDER_REPLICATE) for kernel in (step, step.T)]
    steep = np.maximum(*(np.abs(s).max(axis=2) for s in steps)) > 1
    return np.asarray(cv2.dilate(steep.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0)


def _chroma(log: Field) -> Field:
    """Light of each channel relative to the greatest."""
    return np.asarray(np.exp(log - log.max(axis=2, keepdims=True)))


def _smooth_part(log: Field, edge: Bools, mm: float) -> Field:
    """The surface whose slopes are, in least squares, those of `log` between nodes without an edge, elsewhere 0."""
    rows, cols = log.shape[:2]
    shape = _nodes(rows, cols, mm)
    mean = cv2.resize(log, shape[::-1], interpolation=cv2.INTER_AREA).astype(np.float64).reshape(-1, 3)
    flat = (cv2.resize(edge.astype(np.float32), shape[::-1], interpolation=cv2.INTER_AREA) == 0).ravel()
    normal, right = sparse.csc_array((len(flat), len(flat))), np.zeros((len(flat), 3))
    for slope in _slopes(shape):
        both = np.abs(slope) @ flat == 2
        weighted = slope.T @ sparse.diags_array(np.where(both, 1.0, ACROSS))
        normal, right = normal + weighted @ slope, right + weighted @ (both[:, None] * (slope @ mean))
    solved = splu((normal + LOOSE * sparse.eye_array(len(flat))).tocsc()).solve(right)
    return _between_nodes(solved, shape, (rows, cols))


def _nodes(rows: int, cols: int, mm: float) -> tuple[int, int]:
    """Size of the grid on which surfaces are solved for."""
    step = max(NODE_MM / mm, (rows * cols / MOST_NODES) ** 0.5)
    return max(2, round(rows / step)), max(2, round(cols / step))


def _slopes(shape: tuple[int, int]) -> list[sparse.csr_array]:
    """First differences of a grid, down and across."""
    down, across = (
        sparse.diags_array([-np.ones(n - 1), np.ones(n - 1)], offsets=[0, 1], shape=(n - 1, n)) for n in shape
    )
    return [
        sparse.kron(down, sparse.eye_array(shape[1]), "csr"),
        sparse.kron(sparse.eye_array(shape[0]), across, "csr"),
    ]


def _between_nodes(values: Floats, shape: tuple[int, int], cells: tuple[int, int]) -> Field:
    grid = np.ascontiguousarray(values.reshape(*shape, 3), np.float32)
    return np.asarray(cv2.resize(grid, cells[::-1], interpolation=cv2.INTER_LINEAR))


def _paper_level(log: Field, usable: Bools) -> Field | None:
    """Colour (3,) of the most cells about as bright as the brightest of which there are LEAST_PEAK."""
    values = log[usable]
    if not len(values):
        return None
    bright = values @ LUMINANCE
    classes = np.arange(bright.min() - 2 * ALIKE, bright.max() + 2 * ALIKE, LEVEL_STEP)
    near = round(2 * ALIKE / LEVEL_STEP) + 1
    count = np.convolve(np.histogram(bright, classes)[0], np.bartlett(near + 2)[1:-1], "same")
    peaks = np.flatnonzero((count == maximum_filter1d(count, near)) & (count >= LEAST_PEAK * len(values)))
    if not len(peaks):
        return None
    brightest = peaks[classes[peaks] > classes[peaks[-1]] - SAME_PAPER]
    level = classes[brightest[np.argmax(count[brightest])]] + LEVEL_STEP / 2
    alike = np.abs(bright - level) < ALIKE
    return np.asarray(np.median(values[alike], axis=0))


def _paper(log: Field, light: Field, edge: Bools, cells: Cells) -> Bools:
    """Cells of paper, none of them beside print."""
    relative = (log - light) @ LUMINANCE
    free = cells.known & ~edge
    tint = np.abs(_chroma(log) - _chroma(light)).max(axis=2)
    paper = free & (relative > -DARKER) & (tint < TINT)
    paper |= _in_shadow(free & ~paper, relative, tint, cells.mm)
    # thin edges far from print are creases and the rims of shadows
    wide = 2.5 * STEP_MM / cells.mm
    printed = _opened(free & ~paper, STEP_MM / cells.mm) | _opened(edge, wide)
    near = cv2.dilate(printed.astype(np.uint8), _disc(2 * BESIDE_MM / cells.mm)) > 0
    joined = cv2.morphologyEx(paper.astype(np.uint8), cv2.MORPH_CLOSE, _disc(wide)) > 0
    paper = _large(cells.known & joined & ~near)
    if paper.any():
        colour = _chroma(log)
        paper &= np.abs(colour - np.median(colour[paper], axis=0)).max(axis=2) < SHADED_TINT
    return paper


def _large(mask: Bools) -> Bools:
    """Without parts of less than LEAST_PART of the page."""
    _, label, size, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=4)
    return np.asarray(mask & (size[:, cv2.CC_STAT_AREA] > LEAST_PART * mask.size)[label])


def _in_shadow(rest: Bools, relative: Field, tint: Field, mm: float) -> Bools:
    """Which cells that are not as bright as paper are so in smooth, grey areas at the rim, or go on beyond a line."""
    rest = rest & (relative > -SHADED) & (relative < 0) & (tint < SHADED_TINT)
    count, label, size, _ = cv2.connectedComponentsWithStats(rest.astype(np.uint8), connectivity=4)
    area, width = size[:, cv2.CC_STAT_AREA], max(1, round(RIM_MM / mm))
    rim = np.ones(rest.shape, bool)
    rim[width:-width, width:-width] = False
    touching = np.bincount(label[rim], minlength=count)
    level = median(relative, label, np.arange(count))[label]
    shadow = ((area > LEAST_PART * rest.size) & (touching > CONTACT * width * area**0.5))[label] & rest
    beside = cv2.dilate(np.where(shadow, level, -np.inf).astype(np.float32), _disc(2 * GAP_MM / mm))
    goes_on = np.bincount(label[rest & (np.abs(level - beside) < ALIKE)], minlength=count) > 0
    return np.asarray((shadow | goes_on[label]) & rest & (np.abs(relative - level) < UNEVEN))


def _followed(log: Field, paper: Bools, mm: float) -> Field:
    """The light of paper: a smooth surface through it, and what it leaves over followed where there is paper."""
    light = _surface(log, paper, mm)
    for width_mm in FOLLOWED_MM:
        light = light + smoothed(log - light, paper.astype(np.float32), width_mm / mm)
    return light


def _surface(log: Field, paper: Bools, mm: float) -> Field:
    """Thin plate under tension through the paper of each channel: least sum of (u - log)^2 + a |grad u|^2 + (lap u)^2.

    On a coarser grid, in its steps. The tension a keeps the plate from running away far from any paper.
    """
    rows, cols = log.shape[:2]
    shape = _nodes(rows, cols, mm)
    weight = paper.astype(np.float32)[..., None]
    mean = cv2.resize(np.dstack([log * weight, weight]), shape[::-1], interpolation=cv2.INTER_AREA).astype(np.float64)
    laplacian = sum(slope.T @ slope for slope in _slopes(shape))
    tension = (mm * (rows * cols / np.prod(shape)) ** 0.5 / STIFF_MM) ** 2
    matrix = sparse.diags_array(mean[..., 3].ravel()) + tension * laplacian + laplacian @ laplacian
    return _between_nodes(splu(matrix.tocsc()).solve(mean[..., :3].reshape(-1, 3)), shape, (rows, cols))


def _opened(mask: Bools, width: float) -> Bools:
    return np.asarray(cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, _disc(width)) > 0)


def _disc(width: float) -> NDArray[np.uint8]:
    side = max(1, round(width)) | 1
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side)), np.uint8)
