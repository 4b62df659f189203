"""A hand or a holder on a sheet: of another colour than the paper, raised above it, and reaching it from outside."""

from __future__ import annotations

import cv2
import numpy as np
from scipy import ndimage

from planish.color import to_uint8
from planish.document.rim import at_places, body
from planish.mesh import area_vectors
from planish.types import Bools, Floats, Mesh, Pixels

WORKING_PX = 800
"""Long side of the small picture on which hands are sought."""

OTHER_COLOUR = 0.12
"""Difference of the logarithms of two channels' code values from those of the paper; skin of many tones has 0.16 to
0.6. Doubled, a pale finger (215, 190, 180) is not found, but told; halved, nothing changes."""

SMALLEST = 0.002
"""Part of the sheet: 120 mm2 of a letter, half of a finger's tip. Halved or doubled, nothing changes."""

SMOOTH = 0.006
"""Of the picture's long side: print narrower than that is closed over, as coloured letters are. Doubled, 1 % of the
sheet goes with the finger, as its rim is blurred by as much."""

NEAR = 0.03
"""Of the picture's long side, 15 mm: how far around it the sheet is compared with what lies on it. Halved or doubled,
nothing changes."""

RAISED = 0.15
"""Median height above the paper around it, in roots of its area there: a thumb has 0.2, flat print has none. Halved or
doubled, nothing changes."""

SMALL = 0.015
"""Part of the sheet up to which a thing need not stick out of it, 9 cm2 of a letter: a finger's tip whose hand is too
dark to be taken for paper. A coloured panel of a folded leaflet, which may stand up, is larger and does not stick out.
Halved or doubled, nothing changes."""


def without_hands(pixels: Pixels, mask: Bools, places: Floats, mesh: Mesh) -> tuple[Bools, float]:
    """Take what holds a sheet out of its mask.

    A thing counts as a hand only if all of this holds: its colour is not the paper's (skin is ruddy in any light that
    leaves paper white), it reaches the outline of the sheet, its points stand above the paper around it, and it is
    small or sticks out of the sheet. Print is as flat as its paper, and a tongue of the sheet has its colour.

    Parameters
    ----------
    pixels : (rows, cols, 3) uint8 or uint16
    mask : (rows, cols) bool
        Of the sheet together with what is as bright.
    places : (n, 2) float64 [px]
        Of the mesh's points.
    mesh : Mesh

    Returns
    -------
    mask : (rows, cols) bool
        The sheet alone.
    share : float
        Part of the mask that was taken out.
    """
    scale = min(1.0, WORKING_PX / max(mask.shape))
    size = max(2, round(mask.shape[1] * scale)), max(2, round(mask.shape[0] * scale))
    small = cv2.resize(to_uint8(pixels), size, interpolation=cv2.INTER_AREA)
    inside = cv2.resize(mask.astype(np.uint8) * 255, size, interpolation=cv2.INTER_AREA) > 127
    other = _of_another_colour(small, inside)
    _, label, stats, _ = cv2.connectedComponentsWithStats(other.astype(np.uint8))
    rim = inside & ~ndimage.binary_erosion(inside, iterations=2)
    narrow = inside & ~body(inside)
    hands = np.zeros_like(inside)
    for k in range(1, len(stats)):
        thing = np.asarray(label == k)
        area = stats[k, cv2.CC_STAT_AREA]
        if area < SMALLEST * inside.sum() or not (thing & rim).any():
            continue
        if area > SMALL * inside.sum() and (thing & narrow).sum() < 0.5 * area:
            continue
        if _height(thing, inside & ~other, places, scale, mesh) > RAISED:
            hands |= thing
    if not hands.any():
        return mask, 0.0
    hands = _dilated(hands, SMOOTH)  # the blur beside a hand is neither skin nor paper
    kept = cv2.resize((~hands).astype(np.uint8) * 255, mask.shape[::-1], interpolation=cv2.INTER_LINEAR) > 127
    _, label, stats, _ = cv2.connectedComponentsWithStats((mask & kept).astype(np.uint8))
    alone = np.asarray(label == 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA])))
    return alone, float(1 - alone.sum() / mask.sum())


def _of_another_colour(pixels: Pixels, inside: Bools) -> Bools:
    side = 2 * round(0.5 * SMOOTH * max(inside.shape)) + 1
    light = np.log1p(cv2.medianBlur(np.ascontiguousarray(pixels), max(3, side)).astype(np.float32))
    chroma = light[..., :2] - light[..., 2:]
    away = np.abs(chroma - np.median(chroma[inside], axis=0)).max(axis=2)
    found = (inside & (away > OTHER_COLOUR)).astype(np.uint8)
    return cv2.morphologyEx(found, cv2.MORPH_OPEN, _disc(side)) > 0


def _height(thing: Bools, paper: Bools, places: Floats, scale: float, mesh: Mesh) -> float:
    """Median height of the points of a thing above the plane of the paper around it, in roots of its area there."""
    reach = _dilated(paper, NEAR)
    on_it = at_places(thing & reach, places, scale) & np.isfinite(mesh.points).all(axis=1)
    beside = at_places(paper & _dilated(thing, NEAR), places, scale) & np.isfinite(mesh.points).all(axis=1)
    if on_it.sum() < 10 or beside.sum() < 10:
        return 0.0
    faces = mesh.faces[beside[mesh.faces].all(axis=1)]
    up = area_vectors(mesh.points, faces).sum(axis=0)
    middle = mesh.points[beside].mean(axis=0)
    normal = np.linalg.svd(mesh.points[beside] - middle, full_matrices=False)[2][2]
    normal *= np.sign(normal @ up)
    covered = mesh.faces[on_it[mesh.faces].all(axis=1)]
    area = np.abs(area_vectors(mesh.points, covered) @ normal).sum()
    height = np.median((mesh.points[on_it] - middle) @ normal)
    return float(height / max(np.sqrt(area), np.finfo(float).tiny))


def _dilated(region: Bools, part: float) -> Bools:
    """A region grown by so much of the picture's long side."""
    return np.asarray(cv2.dilate(region.astype(np.uint8), _disc(2 * round(part * max(region.shape)) + 1)) > 0)


def _disc(side: int) -> np.ndarray:
    return cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
