"""The unit that a mesh file's numbers are in: most formats do not say."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np

from planish.errors import InputError, UsageError
from planish.settings import MM_PER_UNIT, mm_per_unit
from planish.types import Diagnostic, Floats, check_place

Unit = str
"""One of "mm", "cm", "m", "in", or a length such as "7.91um": so long is a step of 1 in the file's numbers."""

PAGE_MM = (50.0, 1500.0)
"""Diagonal of a page that is taken for one: from a bus ticket to a newspaper spread."""

HUGE_MM = 100_000.0
TINY_MM = 1.0
"""Diagonals that no sheet has: the longest scrolls are of some 50 m, and a pixel is 0.1 mm."""

STRAYS, FAR = 0.002, 3.0
"""If all but these parts of the points at either end of x, y and z fill a box so many times smaller than all of them,
the rest are strays. Points spread over a sheet fill 0.996 of it, so from 1.1 to 10 the second number changes nothing
for sheets; with fewer strays let pass a single one among 500 points would count."""

A4_MM = 364.0
"""Diagonal of the usual page."""

_IF_WRONG = "set {units} if that is wrong"

_HINT = re.compile(
    r"\bunits?\s*(?:[:=]\s*|\s(?:is|are|in)\s+)((?:[\d.]+(?:e-?\d+)?\s?)?(?:[nuµμ]m|km|ft)|[\d.]+\s?(?:mm|cm|m|in)|mm|millimet(?:er|re)s?|cm|centimet(?:er|re)s?|m|met(?:er|re)s?|in|inch(?:es)?)\b",
    re.IGNORECASE,
)
_FULL_NAMES: dict[str, Unit] = {"millimet": "mm", "centimet": "cm", "met": "m", "inch": "in"}


def is_unit(text: str) -> bool:
    """Whether `mm_per_unit` takes it."""
    try:
        return mm_per_unit(text) > 0
    except UsageError:
        return False


def unit_named_in(comments: str) -> Unit | None:
    """Find a unit that the comments of a file name, such as ``# units: mm``.

    Examples
    --------
    >>> unit_named_in("made by a scanner; Units = millimetres")
    'mm'
    >>> unit_named_in("a unit of paper") is None
    True
    """
    found = _HINT.search(comments)
    if not found:
        return None
    word = found[1].lower()
    return next((unit for name, unit in _FULL_NAMES.items() if word.startswith(name)), word)


def decide_unit(points: Floats, asked: str, named: Unit | None) -> tuple[Unit, list[Diagnostic]]:
    """Decide in which unit the numbers of a file are, and say so where that is not plain.

    What the user asked for holds; else what the file names, but not metres where only millimetres make a page, as
    programs without units write their numbers into formats that are in metres; else millimetres if they make a page of
    50 to 1500 mm from corner to corner; else whichever of cm, m and inches brings it nearest to an A4 page (364 mm).

    Parameters
    ----------
    points : (n, 3) float64
        In the file's unit, of the sheet alone; points that are not finite, and a few that lie far from all others,
        are left out.
    asked : {"auto", "mm", "cm", "m", "in"} or a length, see `mm_per_unit`
    named : str or None
        What the file itself says.

    Returns
    -------
    unit : str
    warnings : list of Diagnostic

    Raises
    ------
    UsageError
        Where the unit that was asked for is none.
    InputError
        Where the unit makes the sheet larger or smaller than any.

    Examples
    --------
    >>> sheet = np.array([[0.0, 0.0, 0.0], [8.5, 11.0, 0.0]])
    >>> decide_unit(sheet, "auto", None)
    ('in', [Diagnostic(code='unit-guessed', sentence='the file names no unit; its numbers were taken as in, ...')])
    >>> decide_unit(sheet, "mm", None)
    ('mm', [Diagnostic(code='size-unusual', sentence='the sheet is 13.9 mm from corner to corner ...)])
    """
    if asked != "auto":
        mm_per_unit(asked)
    diagonal = sheet_diagonal(points)
    if not np.isfinite(diagonal):
        raise InputError(
            "some points lie so far from the others that no number holds the distance; is the file damaged?"
        )
    if asked == "auto" and named == "m" and _is_page(diagonal):
        sentence = (
            f"the file says that its numbers are metres, but no sheet is {diagonal:.0f} m from corner to corner; they"
            " were taken as mm"
        )
        return "mm", [Diagnostic("unit-overruled", sentence, _IF_WRONG)]
    if asked != "auto" or named:
        unit = named if asked == "auto" and named else asked
        return unit, _doubt(diagonal * mm_per_unit(unit), unit)
    if not diagonal > 0 or _is_page(diagonal):
        return "mm", []
    unit = min(MM_PER_UNIT, key=lambda u: abs(np.log(diagonal * MM_PER_UNIT[u] / A4_MM)))
    size = diagonal * MM_PER_UNIT[unit]
    if A4_MM / 4 < size < A4_MM * 4:
        sentence = f"its numbers were taken as {unit}, which makes it {size:.3g} mm from corner to corner"
        return unit, [Diagnostic("unit-guessed", f"the file names no unit; {sentence}", _IF_WRONG)]
    sentence = (
        f"the file names no unit, and none of mm, cm, m, in makes a usual page of it; its numbers were taken as"
        f" {unit}: {size:.3g} mm from corner to corner, so sizes and dpi are right only up to a factor"
    )
    return unit, [Diagnostic("unit-guessed", sentence, "set {units}, or give a known length as {scale_bar}")]


def unit_of_mm(mm: float) -> Unit:
    """The unit that is so many mm long.

    Examples
    --------
    >>> unit_of_mm(0.25)
    '0.25mm'
    """
    return f"{mm:.9g}mm"


def scale_bar(start: Any, end: Any, length_mm: float) -> Unit:
    """The unit of a file's numbers from a known length in the scan: a scale bar or a ruler beside the sheet.

    Parameters
    ----------
    start, end : (3,) array_like
        Both ends, in the file's numbers.
    length_mm : float
        How far they are apart in space, in a straight line.

    Returns
    -------
    str
        Such as "0.25mm", to be given as `units`.

    Raises
    ------
    UsageError
        If both ends are one place, or the length is not above 0.
    InputError
        If an end is anything but three finite numbers.

    Examples
    --------
    >>> scale_bar((1, 1, 0), (1, 401, 300), length_mm=100)
    '0.2mm'
    """
    ends = np.array([check_place(start, "the start of the scale bar"), check_place(end, "the end of the scale bar")])
    if not 0 < length_mm < np.inf:  # NaN too
        raise UsageError(f"the scale bar is {length_mm} mm long; a length above 0 is wanted")
    apart = math.dist(*ends)
    if not 0 < apart < np.inf:
        raise UsageError(f"the ends of the scale bar are {apart:g} apart; two places apart from each other are wanted")
    return unit_of_mm(length_mm / apart)


def sheet_diagonal(points: Floats) -> float:
    """From corner to corner of the box around the points, without the few that lie far outside of it."""
    finite = points[np.isfinite(points).all(1)]
    if not len(finite):
        return 0.0
    with np.errstate(over="ignore"):  # then it is infinite
        whole = float(np.linalg.norm(np.ptp(finite, axis=0)))
        low, high = np.quantile(finite, [STRAYS, 1 - STRAYS], axis=0)
        most = float(np.linalg.norm(high - low))
    return most if np.isfinite(most) and 0 < most * FAR < whole else whole


def _is_page(diagonal_mm: float) -> bool:
    return PAGE_MM[0] <= diagonal_mm <= PAGE_MM[1]


def _doubt(diagonal_mm: float, unit: Unit) -> list[Diagnostic]:
    if diagonal_mm > HUGE_MM or 0 < diagonal_mm < TINY_MM:
        raise InputError(
            f"the sheet is {diagonal_mm:.3g} mm from corner to corner when its numbers are taken as {unit}, and no"
            f" sheet is so {'large' if diagonal_mm > HUGE_MM else 'small'}",
            "set {units} to another unit",
        )
    if not diagonal_mm > 0 or _is_page(diagonal_mm):
        return []
    sentence = f"the sheet is {diagonal_mm:.3g} mm from corner to corner when its numbers are taken as {unit}"
    return [Diagnostic("size-unusual", sentence, _IF_WRONG)]
