"""The profile of a page of uniform cross-section from the brightness of its blank paper.

Shape from shading under a near light (Wada, Ukida and Matsuyama 1997; Zhang, Tan and others 2004): paper that is bent
in one direction only, sends light back alike to all sides and has one colour is the brighter the more it faces the lamp
and the nearer it is,

    I = paper (ambient + (1 - ambient) max(n . l, 0) (d0 / d)^2),

so its brightness along the profile gives the profile's angle. They knew the lamp's place from their set-up; a photo
does not tell it, so it is fitted too: how brightness falls off along the straight rulings shows where the lamp stands.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from planish.color import LUMINANCE, linear_light
from planish.errors import InputError
from planish.geometry.guards import TINY_SHARE
from planish.illumination.lamp_model import Light
from planish.photo.bent import Bent
from planish.photo.borders import Borders
from planish.photo.cylinder import STEEPEST, Cylinder, in_space, seen_at
from planish.photo.fit import TILT, Evidence, Fitted, misfit, nothing, start
from planish.photo.free import no_shift
from planish.types import Floats, Pixels

CELLS = 48
"""Along the photo's long side: each shows some blank paper between lines of text."""
BRIGHTER_PART = 90
"""Percentile of a cell's brightness that is its paper's."""
GREY = 0.015
"""Usual unevenness of paper [log of brightness]."""
INDEPENDENT = 400.0
"""So many cells' worth all cells count."""
DARKER = (0.5, 0.2, 0.1, 0.06)
"""How far below the fit [log] a cell counts as print, from the first round on."""
SMOOTH = 0.12
"""Usual second difference of the profile's numbers [rad]."""
RULINGS = 40
"""That the brightest cells are looked for along, before all count."""
LEAST_PAPER = 0.3
"""Of the sheet's cells that must be blank paper by the fit."""
UNEVEN = 0.012
"""Rms misfit of those [log], from which on the sheet is not of uniform cross-section, or not evenly coloured."""
LAMPS = ((0.0, 0.0, -1.0), (0.4, 0.0, -0.8), (-0.4, 0.0, -0.8), (0.0, 0.4, -0.8), (0.0, -0.4, -0.8))
BOWS = (-0.4, 0.0, 0.4)
"""Lamps and profiles to start from: flat, hollow and bulging."""
RIM = 0.03
"""Part of the sheet along its borders that is left out."""


@dataclass(frozen=True, eq=False)
class Lit:
    """A sheet and the lamp over it.

    Attributes
    ----------
    sheet : Cylinder
    lamp : (3,) float64
        In the sheet's frame, in distances of the camera.
    ambient : float
        Share of the light that comes from all around.
    paper : float
        Log of the paper's brightness where the lamp is nearest the origin.
    """

    sheet: Cylinder
    lamp: Floats
    ambient: float
    paper: float

    def log_brightness(self, page: Floats) -> Floats:
        """Of blank paper at places (n, 2) along and across the sheet's lines."""
        along = (page @ self.sheet.turned_lines())[:, 0]
        turn = np.clip(self.sheet.turn(along), -STEEPEST, STEEPEST)
        normals = np.column_stack([np.sin(turn), np.zeros(len(turn)), -np.cos(turn)])
        logit = np.log(self.ambient / (1 - self.ambient))
        no_sky_no_vignetting = 0.0, 0.0, 0.0, -np.inf
        light = Light(np.zeros(3), 1.0, np.array([*self.lamp, self.paper, logit, *no_sky_no_vignetting]))
        return light.log_brightness(in_space(self.sheet, page), normals, np.zeros(len(turn)))


def from_shading(photo: Pixels, borders: Borders, focal: float, centre: Floats) -> Bent:
    """Find the profile of a sheet from its shade, and its place from its corners and straight sides.

    Raises
    ------
    InputError
        Where too little of the sheet is blank paper, or its brightness is not that of a sheet bent in one direction.
    """
    sides = _corners_and_sides(borders)
    xy, log = _paper(photo, borders)
    starts = [
        _lit(start(sides, borders.angle, focal, centre, across=False), lamp, bow) for lamp in LAMPS for bow in BOWS
    ]
    few = _brightest(seen_at(starts[0].sheet, xy)[0][:, 0], log)
    tries = sorted((_round(lit, sides, xy[few], log[few], DARKER[0], 20) for lit in starts), key=lambda one: one[1])
    best = [lit for lit, _ in tries[:3]]
    for darker in DARKER[1:]:
        rounds = sorted((_round(lit, sides, xy, log, darker, 20) for lit in best), key=lambda one: one[1])
        best = [lit for lit, _ in rounds[:2]]
    lit = best[0]
    off = log - lit.log_brightness(seen_at(lit.sheet, xy)[0])
    uneven = _checked(off)
    weight = np.ones(len(sides.photo_xy))
    off_px, page, place = misfit(lit.sheet, sides, weight, focal)
    assert sides.sides is not None
    top, right, bottom, left = place[sides.sides]
    fitted = Fitted(lit.sheet, page, off_px, weight, place, rounds[0][1])
    shift = no_shift(np.array([left, top]), np.array([right, bottom]))
    return Bent(lit.sheet, shift, fitted, sides, off_px, bordered=True, shade=uneven)


def _brightest(along: Floats, log: Floats) -> NDArray[np.intp]:
    """Of the cells on each ruling some of the brightest: blank paper, even where a picture fills half of the page."""
    ruling = np.floor((along - along.min()) / (np.ptp(along) + TINY_SHARE) * RULINGS).astype(int)
    order = np.lexsort((-log, ruling))
    first = np.searchsorted(ruling[order], ruling[order])
    count = np.bincount(ruling, minlength=RULINGS + 1)[ruling[order]]
    rank = (np.arange(len(log)) - first) / count
    return order[(rank > 0.03) & (rank < 0.2)]


def _lit(sheet: Cylinder, lamp: tuple[float, float, float], bow: float) -> Lit:
    return Lit(replace(sheet, turns=bow * np.linspace(-1, 1, len(sheet.turns))), np.array(lamp), 0.3, 0.0)


def _checked(off: Floats) -> float:
    """Rms misfit of the blank paper [log], where it is that of a sheet bent in one direction."""
    paper = np.abs(off) < DARKER[-1]
    if paper.mean() < LEAST_PAPER:
        raise InputError(
            f"only {100 * paper.mean():.0f} % of the sheet are blank paper as bright as a sheet bent in one direction "
            "would be; a folded or crumpled sheet, a shadow that falls on it, or print all over cannot be found from "
            "shade",
            "use {shape=auto}, or a 3D scan",
        )
    uneven = float(np.sqrt(np.mean(off[paper] ** 2)))
    if uneven > UNEVEN:
        raise InputError(
            f"the blank paper's brightness is {100 * uneven:.1f} % off that of a sheet bent in one direction (at most "
            f"{100 * UNEVEN:.1f} % is good enough): it may be folded, or lie in a shadow",
            "use {shape=auto}, or a 3D scan",
        )
    return uneven


def _corners_and_sides(borders: Borders) -> Evidence:
    """Left and right sides, which are straight rulings, and the ends of top and bottom."""
    evidence = nothing()
    ends = np.r_[0:3, -3:0]
    for k, side in enumerate(borders.sides):
        places = side if k % 2 else side[ends]
        evidence = evidence.and_also(places, upright=k % 2 == 1, doubt_px=borders.doubt_px)
    return replace(evidence, sides=np.arange(4, dtype=np.int32))


def _paper(photo: Pixels, borders: Borders) -> tuple[Floats, Floats]:
    """Middles of the sheet's cells on the photo (n, 2) [px], and the log of their paper's brightness."""
    side = max(1, max(photo.shape[:2]) // CELLS)
    step = max(1, side // 12)
    rows, cols = (n // side for n in photo.shape[:2])
    part = np.asarray(photo)[: rows * side : step, : cols * side : step]
    per = side // step
    rows, cols = part.shape[0] // per, part.shape[1] // per
    light = linear_light(np.iinfo(photo.dtype).max + 1)[part[: rows * per, : cols * per]] @ LUMINANCE
    cells = light.reshape(rows, per, cols, per).swapaxes(1, 2).reshape(rows, cols, -1)
    bright = np.percentile(cells, BRIGHTER_PART, axis=2)
    x, y = np.meshgrid(np.arange(cols), np.arange(rows))
    xy = (np.stack([x, y], axis=-1) + 0.5) * per * step - 0.5
    outline = np.concatenate(borders.sides)
    inner = outline.mean(axis=0) + (1 - 2 * RIM) * (outline - outline.mean(axis=0))
    mask = np.zeros((rows, cols), np.uint8)
    cv2.fillPoly(mask, [np.rint((inner + 0.5) / (per * step) - 0.5).astype(np.int32)], 1)
    inside = (mask > 0) & (bright > 1e-3)
    return xy[inside], np.log(bright[inside])


def _round(lit: Lit, sides: Evidence, xy: Floats, log: Floats, darker: float, steps: int) -> tuple[Lit, float]:
    """Fit with what is darker by more than so much counting less (Black and Rangarajan 1996)."""
    sheet = lit.sheet
    alone = np.sqrt(INDEPENDENT / len(xy)) / GREY

    def made(numbers: Floats) -> Lit:
        camera, turns = numbers[:2], numbers[7:]
        ambient = 1 / (1 + np.exp(-numbers[5]))
        lamp = np.array([numbers[2], numbers[3], -np.exp(numbers[4])])  # always on the camera's side
        return Lit(replace(sheet, camera=camera, turns=turns), lamp, float(ambient), float(numbers[6]))

    def residuals(numbers: Floats) -> Floats:
        now = made(numbers)
        page, good = seen_at(now.sheet, xy)
        off = np.where(good, log - now.log_brightness(page), 1.0)
        dark = off / np.sqrt(1 + (off / np.where(off < 0, darker, 2 * darker)) ** 2)
        at_sides, _, _ = misfit(now.sheet, sides, np.ones(len(sides.photo_xy)), sheet.focal)
        prior = np.concatenate(
            [numbers[:1] / TILT, numbers[2:4] / 2, numbers[4:5], (numbers[5:6] + 1) / 1.5, numbers[7:]]
        )
        bends = np.diff(numbers[7:], 2) / SMOOTH
        return np.concatenate([alone * dark, at_sides / sides.doubt_px[sides.group], prior, bends])

    ambient = np.log(lit.ambient / (1 - lit.ambient))
    level = float(np.quantile(log, 0.8)) if lit.paper == 0 else lit.paper
    begin = np.concatenate(
        [sheet.camera, lit.lamp[:2], [np.log(-lit.lamp[2] if lit.lamp[2] < 0 else 1.0)], [ambient, level], sheet.turns]
    )
    best = least_squares(residuals, begin, method="lm", max_nfev=steps)
    return made(best.x), float(best.cost)
