"""A sheet on a photo, found from its lines of text, its borders, or both."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from planish.errors import InputError
from planish.geometry.guards import TINY_SHARE
from planish.photo.borders import Borders
from planish.photo.cylinder import Cylinder, seen_at
from planish.photo.fit import ANY_WAY, SQUARE, Evidence, Fitted, fit, nothing, start
from planish.photo.free import AnyShift, fit_shift, no_shift
from planish.photo.lines import TextLines
from planish.photo.rows import evidence_of, with_rows_and_margins
from planish.photo.surface import on_page
from planish.types import Floats

AROUND = 3.0
"""Paper drawn around the text where the borders of the sheet are not known, in heights of its letters."""
BESIDE = 5.0
"""So near to the text, in heights of its letters, scraps of text are drawn too, and those beside them."""
SCRAPS = 3
MOST = 0.5
"""Of the lines' ends a sheet must show, or it was not found."""
LEVEL = 0.5
"""A scrap is level to so much of the letters' height."""
PAGE_OF_TEXT = 150
"""Letters on a page that may be a book's."""
STIFFNESS = 3.0
"""Of the free shift, against how well the evidence is met: a bend of the splines by the evidence's usual doubt weighs
as much as so many letters by the same."""


@dataclass(frozen=True, eq=False)
class Bent:
    """A sheet, what it was found from, and how well it fits.

    Attributes
    ----------
    sheet : Cylinder
    shift : Shift
        Its corners are those of the page, along and across the lines, in distances of the camera.
    fitted : Fitted
    evidence : Evidence
    left_px : (n,) float64 [photo px]
        How far the evidence is off its lines when shifted too.
    bordered : bool
        Whether the page's corners are those of the sheet.
    shade : float or None
        Rms misfit of the blank paper's brightness, as a part of it, where the shape was found from that.
    """

    sheet: Cylinder
    shift: AnyShift
    fitted: Fitted
    evidence: Evidence
    left_px: Floats
    bordered: bool
    shade: float | None = None


def from_lines(lines: TextLines, focal: float, centre: Floats) -> Bent:
    """Find the sheet from its lines of text alone."""
    evidence = evidence_of(lines)
    first = fit(start(evidence, lines.angle, focal, centre, across=False), evidence, rounds=3)
    evidence = with_rows_and_margins(lines, first)
    second = fit(first.sheet, evidence)
    low, high = _around(lines, second.sheet)
    return with_shift(second, evidence, low, high, bordered=False)


def from_borders(
    borders: Borders,
    lines: TextLines | None,
    focal: float,
    centre: Floats,
    *,
    ratio: float | None = None,
) -> Bent:
    """Find the sheet from its borders and, where there are some, its lines of text.

    It is tried bent along its lines, across them, and like a page of a book; what fits best stays.

    Parameters
    ----------
    borders : Borders
    lines : TextLines or None
    focal : float [px]
    centre : (2,) float64 [px]
    ratio : float, optional
        Width of the sheet against its height.
    """
    evidence = _evidence_of(borders, lines, ratio)
    tries = [_loose(borders, evidence, focal, centre, across=across) for across in (False, True)]
    if lines is not None and len(lines.line) >= PAGE_OF_TEXT:
        bound = from_lines(lines, focal, centre).sheet
        tries.append((fit(bound, evidence, rounds=2), SQUARE))
    best, square = min(tries, key=lambda one: one[0].cost)
    if lines is not None:
        evidence = _with_sides(with_rows_and_margins(lines, best), borders, ratio)
        best = fit(best.sheet, evidence, square=square)
    assert evidence.sides is not None
    top, right, bottom, left = best.place[evidence.sides]
    if not (left < right and top < bottom):
        raise InputError(
            "the outline on the photo does not fit any sheet of paper",
            "photograph it from the front, or try {shape=text-lines}",
        )
    return with_shift(best, evidence, np.array([left, top]), np.array([right, bottom]), bordered=True)


def _loose(borders: Borders, evidence: Evidence, focal: float, centre: Floats, *, across: bool) -> tuple[Fitted, float]:
    """A sheet that may be bent any way, first fitted to its borders alone; and how freely it may turn."""
    sides = _evidence_of(borders, None, evidence.ratio)
    flat = start(sides, borders.angle, focal, centre, across=across)
    first = fit(flat, sides, rounds=2, square=ANY_WAY)
    return fit(first.sheet, evidence, rounds=2, square=ANY_WAY), ANY_WAY


def _evidence_of(borders: Borders, lines: TextLines | None, ratio: float | None) -> Evidence:
    text = evidence_of(lines) if lines is not None else nothing()
    return _with_sides(text, borders, ratio)


def _with_sides(evidence: Evidence, borders: Borders, ratio: float | None) -> Evidence:
    first = len(evidence.upright)
    for k, side in enumerate(borders.sides):
        evidence = evidence.and_also(side, upright=k % 2 == 1, doubt_px=borders.doubt_px)
    return replace(evidence, sides=np.arange(first, first + 4, dtype=np.int32), ratio=ratio)


def with_shift(found: Fitted, evidence: Evidence, low: Floats, high: Floats, *, bordered: bool) -> Bent:
    """Add the shift that a sheet bent one way leaves."""
    upright = evidence.upright[evidence.group]
    value = np.where(upright, found.page[:, 0], found.page[:, 1])
    wanted = found.place[evidence.group] - value
    doubt = evidence.doubt_px[evidence.group] / found.sheet.focal
    usual = float(np.median(doubt))
    weight = _trusted(found, evidence) * (usual / doubt) ** 2
    shift = fit_shift(no_shift(low, high), found.page, wanted, weight, np.where(upright, 0, 1), STIFFNESS)
    moved = shift(found.page)
    left = (wanted - np.where(upright, moved[:, 0], moved[:, 1])) * found.sheet.focal
    return Bent(found.sheet, shift, found, evidence, left, bordered)


def _trusted(found: Fitted, evidence: Evidence) -> Floats:
    """Weights of the evidence for the shift: a sheet's sides are where they are, however badly they fit a bend."""
    if evidence.sides is None:
        return found.weight
    return np.where(np.isin(evidence.group, evidence.sides), 1.0, found.weight)


def _around(lines: TextLines, sheet: Cylinder) -> tuple[Floats, Floats]:
    """Corners of the page: the text, scraps of text beside it, and a little paper around."""
    ends, good = seen_at(sheet, lines.ends.reshape(-1, 2))
    if good.mean() < MOST:
        raise InputError(
            "the lines of text do not fit any sheet of paper bent in one direction; is it text, seen from the front?"
        )
    height = float(np.median(lines.height)) / sheet.focal
    low, high = ends[good].min(axis=0), ends[good].max(axis=0)
    scraps, good = seen_at(sheet, lines.scraps.reshape(-1, 2))
    scraps = scraps.reshape(-1, 2, 2)
    level = good[::2] & good[1::2] & (np.abs(scraps[:, 1, 1] - scraps[:, 0, 1]) < LEVEL * height)
    for _ in range(SCRAPS):
        near = (scraps.max(axis=1) > low - BESIDE * height) & (scraps.min(axis=1) < high + BESIDE * height)
        beside = scraps[level & near.all(axis=1)].reshape(-1, 2)
        low = np.minimum(low, beside.min(axis=0, initial=np.inf))
        high = np.maximum(high, beside.max(axis=0, initial=-np.inf))
    return low - [AROUND * height, (AROUND + 1) * height], high + AROUND * height


def extrapolated_share(bent: Bent, slack: float) -> float:
    """Part of the page that lies outside of the evidence by more than `slack`, in distances of the camera."""
    spots = on_page((50, 50), bent.shift.low, bent.shift.high)
    known = bent.fitted.page[bent.fitted.weight > 0.1]
    try:
        hull = ConvexHull(known)
    except (QhullError, ValueError):
        return 1.0
    beyond = (spots @ hull.equations[:, :2].T + hull.equations[:, 2]).max(axis=1)
    return float((beyond > slack).mean())


def rms(off: Floats, weight: Floats) -> float:
    """Root mean square, weighted."""
    return float(np.sqrt(np.average(off**2, weights=weight + TINY_SHARE)))
