"""A bent sheet fitted to what is seen of it: lines that are level on the page, sides and margins that are upright."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import least_squares

from planish.geometry.guards import TINY_PX, TINY_SHARE
from planish.photo.cylinder import Cylinder, seen_at
from planish.types import Bools, Floats, Ints

ROUNDS = 4
"""Of least squares, after each of which what does not fit counts less."""
DOUBT = 3.0
"""What is this many times farther off than is usual does not count (Tukey's biweight has its end at twice that)."""
TURNS = 9
"""Numbers that the profile's angle has: enough for a leaf that drops steeply into the spine."""
FIRST = 4.0
"""In the first round all is taken to be so many times farther off than it should be."""
INDEPENDENT = 6.0
"""A group's places count for so many at most."""
SMOOTH = 0.05
"""Usual second difference of those numbers [rad]."""
TILT = 0.6
"""Usual tilt of a camera in the hand [rad]; decides only what the lines leave open."""
RATIO = 0.0005
"""How exactly a known ratio of sides is met."""
LOST = 0.3
"""How far off a place counts that no ray meets, in distances of the camera."""
SQUARE = 0.03
"""Usual angle between lines of text and the bend of a bound page, or its square [rad]."""
ANY_WAY = 0.4
"""The same for loose sheets [rad], which bend any way."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """Places on the photo that are known to lie on one straight line of the page, in groups.

    Attributes
    ----------
    photo_xy : (n, 2) float64 [photo px]
    group : (n,) int32
        Places of one group have one place across the lines of text (level), or one along them (upright).
    upright : (groups,) bool
    doubt_px : (groups,) float64 [photo px]
        How far off its line a place usually is found.
    even : (k, 3) int32
        Groups that follow each other at even distances.
    sides : (4,) int32 or None
        Groups that are the sheet's top, right, bottom and left.
    ratio : float or None
        Width of the sheet against its height, where that is known.
    """

    photo_xy: Floats
    group: Ints
    upright: Bools
    doubt_px: Floats
    even: Ints = field(default_factory=lambda: np.zeros((0, 3), np.int32))
    sides: Ints | None = None
    ratio: float | None = None

    def and_also(self, photo_xy: Floats, *, upright: bool, doubt_px: float) -> Evidence:
        """The same with one group more."""
        new = np.full(len(photo_xy), len(self.upright), np.int32)
        return replace(
            self,
            photo_xy=np.concatenate([self.photo_xy, photo_xy]),
            group=np.concatenate([self.group, new]),
            upright=np.append(self.upright, upright),
            doubt_px=np.append(self.doubt_px, doubt_px),
        )


def nothing() -> Evidence:
    """No evidence yet."""
    return Evidence(np.zeros((0, 2)), np.zeros(0, np.int32), np.zeros(0, bool), np.zeros(0))


@dataclass(frozen=True, eq=False)
class Fitted:
    """A sheet and how well it fits.

    Attributes
    ----------
    sheet : Cylinder
    page : (n, 2) float64
        Where the evidence lies on the page, along and across its lines, in distances of the camera.
    off_px : (n,) float64 [photo px]
        How far every place is off its group's line.
    weight : (n,) float64
        0 for what was left out.
    place : (groups,) float64
        Of each group's line on the page, in distances of the camera.
    cost : float
        Sum of log(1 + (off / doubt)^2): to compare sheets by, as it does not depend on what was left out.
    """

    sheet: Cylinder
    page: Floats
    off_px: Floats
    weight: Floats
    place: Floats
    cost: float


def start(evidence: Evidence, angle: float, focal: float, centre: Floats, *, across: bool) -> Cylinder:
    """A flat sheet squarely before the camera, its text at an angle [rad], to be bent along its lines or across."""
    lean = np.pi / 2 if across else 0.0
    sheet = Cylinder(np.array([0, angle - lean]), lean, np.zeros(TURNS), (-1.0, 1.0), focal, centre)
    return replace(sheet, span=_span(sheet, evidence))


def _span(sheet: Cylinder, evidence: Evidence) -> tuple[float, float]:
    page, _ = seen_at(sheet, evidence.photo_xy)
    a = (page @ sheet.turned_lines())[:, 0]
    low, high = np.quantile(a, [0.005, 0.995])
    return float(low - 0.03 * (high - low)), float(high + 0.03 * (high - low))


def fit(sheet: Cylinder, evidence: Evidence, *, rounds: int = ROUNDS, square: float = SQUARE) -> Fitted:
    """Fit pose and profile by least squares in photo pixels.

    What is sought is that all places of a group have one place on the page: the groups' own places are their means,
    so that only the sheet's 12 numbers are unknown. Weights are Tukey's (Beaton and Tukey 1974), anew for every round.

    Parameters
    ----------
    sheet : Cylinder
        To start from.
    evidence : Evidence
    rounds : int
    square : float [rad]
        How far the bend usually is from the direction that `sheet` has.
    """
    rest, lean = sheet, sheet.lean
    weight, usual = np.ones(len(evidence.photo_xy)), FIRST
    alone = _independent(evidence)

    def made(numbers: Floats) -> Cylinder:
        return replace(
            rest,
            camera=numbers[:2],
            lean=lean + square * numbers[2],
            turns=numbers[3:],
        )

    def residuals(numbers: Floats) -> Floats:
        off, _, place = misfit(made(numbers), evidence, weight, sheet.focal)
        prior = np.concatenate([numbers[:1] / TILT, numbers[2:3], np.diff(numbers[3:], 2) / SMOOTH, numbers[3:]])
        uneven = (place[evidence.even] @ [1.0, -2.0, 1.0]) * sheet.focal / evidence.doubt_px[evidence.even[:, 1]]
        shape = [_out_of_ratio(place, evidence)] if evidence.ratio and evidence.sides is not None else []
        data = np.sqrt(weight * alone) * off / evidence.doubt_px[evidence.group]
        return np.concatenate([data / usual, uneven / usual, prior, shape])

    numbers = np.concatenate([sheet.camera, [0.0], sheet.turns])
    for k in range(rounds):
        numbers = least_squares(residuals, numbers, method="lm", x_scale=0.1, xtol=1e-6, ftol=1e-6, max_nfev=60).x
        off, page, place = misfit(made(numbers), evidence, weight, sheet.focal)
        if k < rounds - 1:
            weight, usual = _weights(off, evidence, weight)
            rest = replace(rest, span=_span(made(numbers), evidence))
    relative = off / evidence.doubt_px[evidence.group]
    cost = float((alone * np.log1p(relative**2)).sum())
    return Fitted(made(numbers), page, off, weight, place, cost)


def misfit(sheet: Cylinder, evidence: Evidence, weight: Floats, px_per_unit: float) -> tuple[Floats, Floats, Floats]:
    """How far every place is off its group's line [photo px], where it lies on the page, and the groups' places."""
    page, good = seen_at(sheet, evidence.photo_xy)
    group, count = evidence.group, len(evidence.upright)
    value = np.where(evidence.upright[group], page[:, 0], page[:, 1])
    w = weight * good + TINY_SHARE
    place = np.bincount(group, w * value, count) / np.bincount(group, w, count)
    return np.where(good, value - place[group], LOST) * px_per_unit, page, place


def _out_of_ratio(place: Floats, evidence: Evidence) -> float:
    """How far the sides' ratio is off the known one, in usual doubts."""
    assert evidence.sides is not None
    assert evidence.ratio is not None
    top, right, bottom, left = place[evidence.sides]
    height = bottom - top if abs(bottom - top) > TINY_PX else TINY_PX
    return float(np.clip((right - left) / height / evidence.ratio - 1, -9, 9)) / RATIO


def _independent(evidence: Evidence) -> Floats:
    """Weights by which a group counts for no more than a few places: neighbours are off together."""
    count = np.bincount(evidence.group, minlength=len(evidence.upright))
    return np.minimum(1.0, INDEPENDENT / np.maximum(count, 1))[evidence.group]


def _weights(off: Floats, evidence: Evidence, weight: Floats) -> tuple[Floats, float]:
    """Tukey's weights, and what is usual: what half of all have, but no less than what the evidence is good for."""
    relative = np.abs(off) / evidence.doubt_px[evidence.group]
    usual = max(1.0, 1.48 * float(np.median(relative[weight > 0.1])))
    return np.clip(1 - (relative / (2 * DOUBT * usual)) ** 2, 0, 1) ** 2, usual
