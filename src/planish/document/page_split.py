"""Page split: the gutter of an open book, and the cut along it.

In the surface the gutter is one straight, sharp valley from head to foot, in the middle of the sheet; in print, an
upright gap that no line of text crosses.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from planish.document.ink import Ink, ink_of
from planish.dpi import mm_to_px, px_to_mm
from planish.geometry.guards import normalize
from planish.types import Floats, Mesh, Page, Spine

BAND_MM = 10.0
"""Height of the bands in which the valley is measured, and which must agree."""
CELL_MM = 1.0
STRIP_MM = 8.0
"""How wide the paper beside the valley is whose slope is taken: narrower than a leaf's first rise of some 25 mm."""
MIDDLE = (0.35, 0.65)
"""Where a spine may be, in parts of the width: pages are as wide as each other, up to what the scan cut off."""
MIN_TURN_DEG = 20.0
"""Degrees by which the paper's normal turns at a spine: waves of damp paper reach 13, thick books 100."""
MIN_AGREEMENT = 0.8
"""Part of the bands that must show at least half of that turn."""
MAX_STRAY_MM = 1.5
"""Typical distance of the bands' valleys from one straight line."""
MAX_ASIDE = 0.5
"""Part of its turn that a valley may still have a strip and a half aside: a spine is sharp, a wave is not."""
MAX_ELSEWHERE = 0.6
"""Part of its turn that valleys and ridges elsewhere may have: folds and waves come in numbers."""
PAGE_RATIO = (0.45, 1.1)
"""Width by height of a book's page; other halves are not taken for pages unasked."""
GUTTER_MM = 4.0
"""Letters this near on both sides of the spine belong to a line that runs across it."""
DARK = 0.3
"""Ink that is a letter's: faint shade along the spine has less."""
LETTER_MM = 1.0
"""Ink that is shorter than this along the spine is a shadow's or a speck's."""
MAX_CROSSED = 0.005
"""Part of the page's height at which print may stand so; one line of text has 0.01."""


def gutter_of_surface(mesh: Mesh, page_xy: Floats, size_mm: tuple[float, float]) -> Spine | None:
    """Find the gutter as a straight, sharp valley down the middle of a flattened sheet.

    The normals of the paper left and right of every upright line are compared, band by band; a sum of the faces'
    area vectors has little noise, since it depends on the strip's border alone.

    Parameters
    ----------
    mesh : Mesh
        Of the bent sheet.
    page_xy : (n, 2) float64 [mm]
        Its points on the page.
    size_mm : (float, float)

    Returns
    -------
    Spine or None
        None where there is no such valley, or where what lies beside it has not the shape of pages.

    Examples
    --------
    >>> from planish.gallery import sheet, sheet_mesh
    >>> book = sheet("spread")
    >>> mesh, page_xy = sheet_mesh(book, points=20_000, layout="grid")
    >>> found = gutter_of_surface(mesh, page_xy, (book.width_mm, book.height_mm))
    >>> round(found.x_mm), found.turn_deg > 60
    (148, True)
    """
    width, height = size_mm
    cell = max(CELL_MM, float(np.sqrt(2 * width * height / len(mesh.faces))))
    strip = max(3, round(STRIP_MM / cell))
    turns = _valley_turns(mesh, page_xy, size_mm, cell, strip)
    if turns is None:
        return None
    usual, aside = np.median(turns, axis=0), 3 * strip // 2
    at = aside + int(np.argmax(usual[aside:-aside]))
    near = slice(at - strip, at + strip + 1)
    weight = np.clip(turns[:, near], 0, None) + 1e-9
    places = (weight * np.arange(near.start, near.stop)).sum(axis=1) / weight.sum(axis=1) * cell
    x_mm = float(np.median(places))
    elsewhere = np.abs(np.concatenate([usual[: at - aside], usual[at + aside + 1 :]]))
    plain = (
        usual[at] >= MIN_TURN_DEG
        and np.mean(turns[:, at] >= MIN_TURN_DEG / 2) >= MIN_AGREEMENT
        and np.median(np.abs(places - x_mm)) <= max(MAX_STRAY_MM, cell)
        and max(usual[at - aside], usual[at + aside]) <= MAX_ASIDE * usual[at]
        and elsewhere.max(initial=0.0) <= MAX_ELSEWHERE * usual[at]
        and MIDDLE[0] <= x_mm / width <= MIDDLE[1]
        and all(PAGE_RATIO[0] <= part / height <= PAGE_RATIO[1] for part in (x_mm, width - x_mm))
    )
    return Spine(x_mm, float(usual[at]), "surface") if plain else None


def find_gutter(mesh: Mesh, page_xy: Floats, page: Page, *, always: bool) -> Spine | None:
    """Find the gutter of a rendered sheet, where it is two pages of a book.

    Parameters
    ----------
    mesh : Mesh
        Of the bent sheet.
    page_xy : (n, 2) float64 [mm]
        Its points on the page.
    page : Page
        The sheet as drawn, upright.
    always : bool
        The sheet is known to be two pages: if the surface shows no gutter, the widest gap in the print is taken, or
        else the middle, and print that crosses it changes nothing.

    Returns
    -------
    Spine or None
        Moved by a little where letters touch it, so that a cut along it goes through none if that can be.
    """
    width, height = (px_to_mm(n, page.dpi) for n in page.known.shape[::-1])
    gutter = gutter_of_surface(mesh, page_xy, (width, height))
    if gutter is None and not always:
        return None
    ink = ink_of(page)
    if gutter is None:
        gutter = _by_print(ink, width)
    crossed = _text_crosses(ink, gutter.x_mm)
    if crossed and not always:
        return None
    return replace(gutter, x_mm=_beside_letters(ink, gutter.x_mm), crossed=crossed)


def _text_crosses(ink: Ink, x_mm: float) -> bool:
    """Whether lines of print run across an upright line: letters stand close by on both sides of it."""
    near, far = 0.2 * GUTTER_MM, GUTTER_MM
    sides = [(x_mm - far, x_mm - near), (x_mm + near, x_mm + far)]
    left, right = ((_columns(ink, *side) > DARK).any(axis=1) for side in sides)
    return bool((left & right).mean() > MAX_CROSSED)


def _by_print(ink: Ink, width_mm: float) -> Spine:
    """The middle of the widest upright gap in the print around the middle of the sheet, or that middle itself."""
    first, last = (share * width_mm for share in MIDDLE)
    free = (_columns(ink, first, last) > DARK).mean(axis=0) < MAX_CROSSED
    ends = np.flatnonzero(np.diff(np.concatenate([[False], free, [False]]).astype(np.int8)))
    if not len(ends):
        return Spine(width_mm / 2, 0.0, "middle")
    widest = int(np.argmax(ends[1::2] - ends[::2]))
    return Spine(first + float(ends[2 * widest : 2 * widest + 2].mean()) / ink.px_per_mm, 0.0, "gutter")


def _beside_letters(ink: Ink, x_mm: float) -> float:
    """The nearest place within the gutter's width at which an upright cut touches fewest letters."""
    inked = (ink.amount > DARK).sum(axis=0)
    touched = np.convolve(inked, np.ones(3, int), mode="same")  # the page's own pixels are finer
    at, reach = round(x_mm * ink.px_per_mm), round(GUTTER_MM * ink.px_per_mm)
    places = np.arange(max(1, at - reach), min(len(inked) - 1, at + reach + 1))
    best = min(places, key=lambda place: (touched[place], abs(place - at)))
    a_letter = touched[at] - touched[best] > LETTER_MM * ink.px_per_mm
    return float(best / ink.px_per_mm) if a_letter else x_mm


def split_pages(page: Page, spine: Spine) -> tuple[Page, Page]:
    """Cut a page along its spine: the left part and the right part, with every pixel in one of them.

    Examples
    --------
    >>> page = Page(np.zeros((20, 30), np.uint8), np.ones((20, 30), bool), dpi=25.4)
    >>> [part.pixels.shape for part in split_pages(page, Spine(14.0, 90.0, "surface"))]
    [(20, 14), (20, 16)]
    """
    cols = page.known.shape[1]
    at = int(np.clip(round(mm_to_px(spine.x_mm, page.dpi)), 1, cols - 1))
    parts = (slice(0, at), slice(at, cols))
    left, right = (replace(page, pixels=page.pixels[:, part], known=page.known[:, part]) for part in parts)
    return left, right


def _valley_turns(mesh: Mesh, page_xy: Floats, size_mm: tuple[float, float], cell: float, strip: int) -> Floats | None:
    """By how many degrees the paper's normal turns into a valley: (bands, cells across + 1).

    Between strips of so many cells left and right of every line between cells. 0 where too little is seen; None where
    the sheet is too small for it.
    """
    width, height = size_mm
    across, bands = int(np.ceil(width / cell)), max(1, round(height / max(BAND_MM, 2 * cell)))
    if across < 6 * strip or bands < 5:
        return None
    corners, middle = mesh.points[mesh.faces], page_xy[mesh.faces].mean(axis=1)
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    column = np.clip((middle[:, 0] / cell).astype(int), 0, across - 1)
    row = np.clip((middle[:, 1] * bands / height).astype(int), 0, bands - 1)
    cells = np.stack([np.bincount(row * across + column, a, bands * across) for a in area.T], axis=-1)
    sums = np.zeros((bands, across + 1, 3))
    np.cumsum(cells.reshape(bands, across, 3), axis=1, out=sums[:, 1:])

    line = np.arange(across + 1)
    lines = [np.clip(line + k, 0, across) for k in (-1 - strip, -1, 1, 1 + strip)]
    left, right = sums[:, lines[1]] - sums[:, lines[0]], sums[:, lines[3]] - sums[:, lines[2]]
    sine = np.cross(left, right) @ _down_the_page(mesh.points, page_xy)
    turn = np.degrees(np.arctan2(sine, (left * right).sum(axis=-1)))
    full = strip * cell * height / bands
    seen = np.minimum(np.linalg.norm(left, axis=-1), np.linalg.norm(right, axis=-1)) > 0.25 * full
    return np.where(seen, turn, 0.0)


def _down_the_page(points: Floats, page_xy: Floats) -> Floats:
    """(3,) unit vector in space along which the page's y grows: the direction of a spine."""
    arm = page_xy - page_xy.mean(axis=0)
    down = np.linalg.lstsq(arm, points - points.mean(axis=0), rcond=None)[0][1]
    return normalize(down)


def _columns(ink: Ink, left_mm: float, right_mm: float) -> NDArray[np.float32]:
    """The ink between two upright lines, one column at the least."""
    left = max(0, round(left_mm * ink.px_per_mm))
    return ink.amount[:, left : max(left + 1, round(right_mm * ink.px_per_mm))]
