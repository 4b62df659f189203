"""Refine the illumination from residuals on paper."""

from __future__ import annotations

import cv2
import numpy as np

from planish.color import LUMINANCE
from planish.illumination.cells import Cells, Field
from planish.types import Bools, Floats

WIDE = ((16.0, 0.10), (8.0, 0.06), (4.0, 0.05))
"""Widths [mm] over which the rest is smoothed, each with the misfit [log] up to which a cell counts as paper."""
FINE = ((2.0, 0.05), (1.0, 0.05), (0.5, 0.05))
"""The same where the light may be wrong by more than MAX_CERTAIN: at creases and the edges of shadows."""
MAX_CERTAIN = 0.02
AGREES = 0.02
"""The misfit for patches of less than LONE of all the paper, that may be part of a picture."""
LONE = 0.05
CANDIDATE = 0.15
SCATTER = 3.0
"""How many standard deviations of the paper's scatter around the model, among cells within CANDIDATE [log] of it, are
added to every misfit: little where the light is as simple as the model."""
MOST_SCATTER = 0.06
"""More than that [log] is not the paper's: it is the pale greys of a map or a picture."""
BESIDE_MM = 2.0
ENOUGH = 0.3
"""Share of certain paper within BESIDE_MM of a place where the light is uncertain, from which on (half of it: not at
all) that place is taken for paper too. Across a picture a crease stays as it is."""
LITTLE = 0.02
"""Share of paper around a cell that outweighs no correction at all."""
SHARP = 0.1
"""By so much [log] the light changes within millimetres at a sharp crease, whose two sides share a cell."""
PRINT, GRAIN = 0.2, 0.06
"""What is darker than a crease explains by more than that [log] is print; by less than this, the paper's grain."""


def refine_illumination(cells: Cells, log_model: Floats, crease: Floats, shadow: Floats) -> tuple[Field, Field]:
    """Add to the light's model what paper shows beside it.

    Rounds of normalised convolution (Knutsson and Westin 1993): the misfit of cells that count as paper, smoothed over
    ever smaller widths. A grey picture is no paper in any round, unless the light itself is uncertain there.

    Parameters
    ----------
    cells : Cells
    log_model : (rows, cols) float64
        Logarithm of the brightness of paper under the light found.
    crease, shadow : (rows, cols) float64
        By how much [log] the model may be wrong for want of exact shape, at creases and at the edges of shadows.

    Returns
    -------
    light : (rows, cols, 3) float32
        Logarithm of the linear light of paper in each channel.
    seam : (rows, cols) float32
        How much darker [log] the darker side of a sharp crease is, in cells that show both sides.
    """
    log = np.log(np.maximum(cells.light, 1e-4))
    trust = np.where(cells.known & (cells.clipped < 0.1), cells.share**2, 0).astype(np.float32)
    misfits = log @ LUMINANCE - log_model.astype(np.float32)
    tint, scatter = _paper(log, log_model, misfits, trust)
    sure = trust * _likeness(misfits, WIDE[0][1] + scatter)
    beside = np.clip(2 * _blur(sure, BESIDE_MM / cells.mm) / ENOUGH - 1, 0, 1)
    crease = crease.astype(np.float32) * beside
    sigma = np.maximum(crease, shadow.astype(np.float32) * beside) + scatter
    lone = _lone(cells, misfits, sigma)
    field: Field = log_model[..., None].astype(np.float32) + tint
    for rounds, strength in ((WIDE, np.float32(1)), (FINE, np.clip(sigma / MAX_CERTAIN - 1, 0, 1)[..., None])):
        for width_mm, misfit in rounds:
            within = np.where(lone, AGREES, misfit) + sigma
            weight = trust * _likeness(log @ LUMINANCE - field @ LUMINANCE, within)
            field = field + strength * smoothed(log - field, weight, width_mm / cells.mm)
    return field, _seam(cells, field @ LUMINANCE, crease)


def _seam(cells: Cells, field: Field, crease: Field) -> Field:
    """How much darker the darker side is, in the cell or the next; no more than the crease explains, or it is print."""
    around = np.ones((3, 3), np.uint8)
    inside = np.where(cells.darker < crease + PRINT, np.maximum(cells.darker - GRAIN, 0), 0)
    beside = field - cv2.erode(field, around)
    return np.asarray(np.maximum(cv2.dilate(inside, around), beside) * np.clip(crease / SHARP - 1, 0, 1))


def _paper(log: Field, log_model: Floats, misfits: Field, trust: Field) -> tuple[Field, float]:
    """Logarithm of the paper's colour against the model, and what its scatter around the model adds to misfits."""
    paper = (trust > 0.5) & (np.abs(misfits) < CANDIDATE)
    if not paper.any():
        return np.zeros(3, np.float32), 0.0
    tint = np.median(log[paper] - log_model[paper][:, None], axis=0).astype(np.float32)
    deviation = 1.48 * float(np.median(np.abs(misfits[paper] - np.median(misfits[paper]))))
    return tint, min(SCATTER * deviation, MOST_SCATTER)


def _lone(cells: Cells, misfits: Field, sigma: Field) -> Bools:
    """Cells that would count as paper but hang together with little of it, as bright spots of pictures do."""
    alike = cells.known & (cells.share > 0.5) & (np.abs(misfits) < WIDE[0][1] + sigma)
    _, patch, size, _ = cv2.connectedComponentsWithStats(alike.astype(np.uint8), connectivity=8)
    large = size[:, cv2.CC_STAT_AREA] > LONE * max(alike.sum(), 1)
    return np.asarray(alike & ~large[patch])


def _likeness(residual: Field, misfit: Field | float) -> Field:
    """How far a cell counts as paper: 1 without residual, 0 from `misfit` on (Tukey's biweight)."""
    return np.asarray(np.maximum(1 - (residual / misfit) ** 2, 0) ** 2)


def smoothed(values: Field, weight: Field, sigma: float) -> Field:
    """Weighted mean around each cell, drawn to 0 where there is next to no weight."""
    total = _blur(np.concatenate([values * weight[..., None], weight[..., None]], axis=2), sigma)
    return total[..., :3] / (total[..., 3:] + LITTLE)


def _blur(field: Field, sigma: float) -> Field:
    """Gaussian blur; wide ones on a smaller copy."""
    rows, cols = field.shape[:2]
    coarser = int(min(max(1, sigma / 3), rows, cols))
    small = cv2.resize(field, (-(-cols // coarser), -(-rows // coarser)), interpolation=cv2.INTER_AREA)
    small = cv2.GaussianBlur(small, (0, 0), max(sigma / coarser, 0.3), borderType=cv2.BORDER_CONSTANT)
    return cv2.resize(small, (cols, rows), interpolation=cv2.INTER_LINEAR)


def nearby_range(field: Floats, reach: int) -> Floats:
    """Greatest less least value within a square of 2 reach + 1 cells."""
    square = np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)
    return np.asarray(cv2.dilate(field, square) - cv2.erode(field, square))
