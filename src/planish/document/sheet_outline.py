"""The outline of the sheet in a photo: bright paper on darker ground."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from planish.color import to_uint8
from planish.document.refine_outline import refine_outline
from planish.document.rim import at_places, largest_region, rim_drops, share_around, with_margin
from planish.errors import InputError
from planish.types import Bools, Diagnostic, Floats, Pixels

WORKING_PX = 800
"""Long side of the small picture on which the sheet is sought."""

CLOSING = 0.03
"""Print up to this part of the picture's side is closed over before paper is separated from ground."""

NARROW = 0.006
"""The same where two sheets may lie beside each other: the gap between them is wider than that, a rule is not."""

MIN_SECOND = 0.1
"""Part of the sheet's area from which on a region apart from it is a second sheet, and no heading above a dark bar."""

DARKER, MOST_DARKER = 0.65, 0.15
"""Part of a sheet that may be darker than so much of its median: deep shade along a spine covers a tenth of a page."""
STRICTLY = 0.75, 0.1
"""The same where the region reaches the border of the scan, as a lit table beside a sheet does."""

MIN_CONTRAST = 1.5
"""Paper must be so many times as bright, as code values, as what lies around it."""

MAYBE_CONTRAST = 1.25
"""From this on, shape may show that it is ground all the same, which is told: light wood is 1.4 to 1.5 times as dark as
paper. Nearer to 1, a white table passes for paper; at 1.5 light wood stays untold."""

AREA_SHARE = (0.02, 0.97)
"""Of the photo, that a sheet may fill; one that fills more shows no ground around it."""

EDGE = 0.5
"""Least part of the contrast by which the brightness must fall within the rim of a sheet, in the median along it. At
edges of paper on a table it is 0.8 to 1, in the shade beside a spine 0.1 to 0.4."""

MIN_AROUND = 0.4
"""Part of all directions in which ground must follow the sheet: a sheet alone with one dark side, shade or print, has
0.25 to 0.35; a sheet that reaches two borders of the view has 0.5."""

MIN_NOTED = 0.02
"""Part of what was scanned that is left out with a note; less is the ragged rim."""

MIN_SOFT = 0.2
"""Part of the rim that may be as soft as shade without a note: a long side of a page is 0.28. At half of it blurred
corners of a range image are told too."""


def sheet_mask(
    photo: Pixels, mask: Bools | str | None, places: Floats | None = None, *, whole: bool = False
) -> tuple[Bools | None, list[Diagnostic]]:
    """The mask of the sheet that a user asked for, and warnings.

    A sheet that is found by its brightness is trusted only if it ends in an edge with ground on more than one side:
    deep shade beside a spine, and dark print, are dark on one side of a sheet too.

    Parameters
    ----------
    photo : (rows, cols, 3) uint8 or uint16
    mask : (rows, cols) bool, "auto" or None
        auto: as `find_sheet` finds it. None: everywhere.
    places : (k, 2) float64 [px], optional
        Of all that was scanned, on the photo. By default all of the photo was.
    whole : bool
        Up to the outline itself, as the photo shows it. By default a rim is left out; see `find_sheet`.

    Raises
    ------
    InputError
        If the mask is not of the photo's size, or empty.
    """
    if mask is None:
        return None, []
    if isinstance(mask, str):
        found, warnings = _trusted(photo, find_sheet(photo, whole=whole), places)
        return (refined_sheet(photo) if whole and found is not None else found), warnings
    if mask.shape != photo.shape[:2]:
        raise InputError(
            f"the mask is {mask.shape[1]} x {mask.shape[0]} pixels, the photo {photo.shape[1]} x {photo.shape[0]}; "
            "give a mask of the photo's size"
        )
    if not mask.any():
        raise InputError("the mask is black all over; paint it white where the sheet is")
    return mask, []


def _trusted(photo: Pixels, mask: Bools | None, places: Floats | None) -> tuple[Bools | None, list[Diagnostic]]:
    """The mask, or None where what lies outside of it may belong to the sheet; with what to tell the user."""
    if mask is None:
        sentence = "no sheet stands out from its ground on the photo, so all that was seen was kept"
        return None, [Diagnostic("sheet-not-found", sentence)]
    seen = _every_fourth(mask.shape) if places is None else places[np.isfinite(places).all(axis=1)]
    near = with_margin(mask)
    scale = near.shape[1] / mask.shape[1]
    outside = ~at_places(near, seen, scale)
    share = float((~at_places(mask, seen)).mean()) if outside.any() else 0.0
    if share < MIN_NOTED:
        return mask, []
    drops = _drops(photo, seen)
    around = share_around(near, seen[outside], scale)
    if len(drops) and (np.median(drops) < EDGE or around < MIN_AROUND):
        sentence = (
            f"{100 * share:.0f} % of what was scanned is darker than the rest of the sheet, as ground, shade or print "
            "would be, and was kept"
        )
        return None, [Diagnostic("sheet-outline-doubtful", sentence, "give {mask} as an image if it is ground")]
    sentence = f"{100 * share:.0f} % of what was scanned lies outside the sheet on the photo and was left out"
    soft = float((drops < EDGE).mean()) if len(drops) else 0.0
    if soft > MIN_SOFT:
        sentence += f"; {100 * soft:.0f} % of the sheet's outline is as soft as shade, so part of the sheet may be lost"
    return mask, [Diagnostic("surroundings-left-out", sentence, "set {mask=none} to keep it, or give an image")]


def _every_fourth(shape_rc: tuple[int, ...]) -> Floats:
    """(k, 2) places of every fourth pixel both ways."""
    col, row = np.meshgrid(np.arange(0.0, shape_rc[1], 4), np.arange(0.0, shape_rc[0], 4))
    return np.stack([col.ravel(), row.ravel()], axis=1)


def is_even(photo: Pixels, *, strictly: bool = False) -> bool:
    """Whether what `find_sheet` finds is of one brightness, and not paper together with the lit part of its table."""
    bright, inside, _ = _bright_region(photo)
    levels = bright[inside].astype(np.float64)
    darker, most = STRICTLY if strictly else (DARKER, MOST_DARKER)
    return len(levels) > 0 and float((levels < darker * np.median(levels)).mean()) < most


def ends_in_an_edge(photo: Pixels, places: Floats) -> bool:
    """Whether the sheet that `find_sheet` finds ends in an edge, and not in the fall of a shade; see `sheet_mask`."""
    drops = _drops(photo, places)
    return len(drops) > 0 and float(np.median(drops)) >= EDGE


def _drops(photo: Pixels, places: Floats) -> Floats:
    """`rim_drops` of the sheet on the small picture on which it is sought."""
    bright, inside, scale = _bright_region(photo)
    seen = np.zeros(inside.shape, np.uint8)
    rows, cols = bright.shape[:2]
    at = np.floor((places + 0.5) * scale).astype(int)
    col, row = at[:, 0], at[:, 1]
    on_photo = (row >= 0) & (row < rows) & (col >= 0) & (col < cols)
    seen[row[on_photo], col[on_photo]] = 1
    spacing = int(np.ceil(np.sqrt(seen.size / max(int(seen.sum()), 1))))
    side = 2 * min(spacing, max(rows, cols) // 20) + 1  # places may be pixels apart
    seen = cv2.morphologyEx(seen, cv2.MORPH_CLOSE, np.ones((side, side), np.uint8))
    return rim_drops(np.log1p(bright.astype(np.float64)), inside, seen > 0)


def find_sheet(photo: Pixels, *, whole: bool = False, contrast: float = MIN_CONTRAST) -> Bools | None:
    """Find the sheet in a photo: the largest bright region, with the dark things in it.

    The threshold between paper and ground is Otsu's, on the logarithm of the brightness, so that paper in half shade
    still counts as paper.

    Parameters
    ----------
    photo : (rows, cols, 3) uint8 or uint16
    whole : bool
        Up to the outline itself. By default a rim is left out, as wide as the outline may be off, so that nothing of
        the ground comes along.
    contrast : float
        How many times as bright as its ground the sheet must be, as code values.

    Returns
    -------
    (rows, cols) bool, or None
        None where nothing stands out as a sheet.

    Examples
    --------
    >>> photo = np.full((200, 300, 3), 40, np.uint8)
    >>> photo[50:150, 60:240] = 220
    >>> photo[80:90, 100:110] = 30  # print
    >>> mask = find_sheet(photo)
    >>> bool(mask[85, 105]), bool(mask[20, 20]), 0.9 < float(mask.sum()) / (100 * 180) <= 1
    (True, False, True)
    """
    rows, cols = photo.shape[:2]
    bright, inside, scale = _bright_region(photo)
    if not AREA_SHARE[0] <= inside.mean() <= AREA_SHARE[1]:
        return None
    if np.median(bright[inside]) < contrast * max(float(np.median(bright[~inside])), 1.0):
        return None
    mask = cv2.resize(inside.astype(np.uint8) * 255, (cols, rows), interpolation=cv2.INTER_LINEAR)
    if whole:
        return np.asarray(mask > 127)
    border = 1 + 2 * int(np.ceil(0.5 / scale))  # half a small pixel is how far the outline may be off
    return np.asarray(cv2.erode(mask, np.ones((border, border), np.uint8)) > 127)


def refined_sheet(photo: Pixels) -> Bools:
    """The sheet that `find_sheet` finds, (rows, cols) bool, its outline put where the photo itself shows it."""
    bright, inside, _ = _bright_region(photo)
    return refine_outline(to_uint8(photo), inside, bright)


def whiteness(photo: Pixels) -> NDArray[np.uint8]:
    """A picture (rows, cols, 3) of how white a photo is, min(R, G, B) / max(R, G, B), whatever light falls where."""
    red, green, blue = cv2.split(to_uint8(photo))
    low, high = cv2.min(cv2.min(red, green), blue), cv2.max(cv2.max(red, green), blue)
    return np.asarray(np.repeat(cv2.divide(low, high, scale=255)[..., None], 3, axis=2), np.uint8)


def _bright_region(photo: Pixels) -> tuple[NDArray[np.uint8], Bools, float]:
    """On a small picture: the brightness without print, its largest bright region, and the picture's scale."""
    rows, cols = photo.shape[:2]
    eight = to_uint8(photo)
    scale = min(1.0, WORKING_PX / max(rows, cols))
    small = cv2.resize(eight, (max(2, round(cols * scale)), max(2, round(rows * scale))), interpolation=cv2.INTER_AREA)
    raw = small.max(axis=2)
    bright = _without_print(raw, CLOSING)
    above, _ = cv2.threshold(_log_levels(bright), 0, 255, cv2.THRESH_BINARY | cv2.THRESH_OTSU)
    inside = largest_region(_log_levels(bright) > above)
    narrow = _without_print(raw, NARROW)
    several = _several_sheets(inside & (_log_levels(narrow) > above))
    return (bright, inside, scale) if several is None else (narrow, several, scale)


def count_sheets(photo: Pixels, mask: Bools, left_out: Bools) -> int:
    """How many regions of a photo are as bright as the sheet and no smaller than a tenth of it.

    Parameters
    ----------
    photo : (rows, cols, 3) uint8 or uint16
    mask : (rows, cols) bool
        Of the sheet.
    left_out : (rows, cols) bool
        What is as bright, but no sheet.
    """
    bright, _, _ = _bright_region(photo)
    sheet, other = (
        cv2.resize(m.astype(np.uint8) * 255, bright.shape[::-1], interpolation=cv2.INTER_AREA) > 127
        for m in (mask, left_out)
    )
    if not sheet.any():
        return 0
    levels = _log_levels(bright)
    as_bright = (levels >= np.quantile(levels[sheet], 0.02)) & ~other
    _, _, stats, _ = cv2.connectedComponentsWithStats(as_bright.astype(np.uint8))
    areas = stats[1:, cv2.CC_STAT_AREA]
    return int((areas > MIN_SECOND * areas.max()).sum()) if len(areas) else 0


def _several_sheets(bright: Bools) -> Bools | None:
    """The largest of several large regions, which a gap of ground divides; None where there is one."""
    _, _, stats, _ = cv2.connectedComponentsWithStats(bright.astype(np.uint8))
    areas = np.sort(stats[1:, cv2.CC_STAT_AREA])[::-1]
    return largest_region(bright) if len(areas) > 1 and areas[1] > MIN_SECOND * areas[0] else None


def _without_print(grey: NDArray[np.uint8], part: float) -> NDArray[np.uint8]:
    side = 2 * int(part * max(grey.shape) / 2) + 1
    return np.asarray(cv2.morphologyEx(grey, cv2.MORPH_CLOSE, np.ones((side, side), np.uint8)), np.uint8)


def _log_levels(grey: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return (np.log1p(grey.astype(np.float32)) * (255 / np.log(256))).astype(np.uint8)
