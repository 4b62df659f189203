"""The outline of the sheet in a photo: bright paper on darker ground."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from planish.color import to_uint8
from planish.errors import InputError
from planish.types import Bools, Diagnostic, Pixels

WORKING_PX = 800
"""Long side of the small picture on which the sheet is sought."""

CLOSING = 0.03
"""Print up to this part of the picture's side is closed over before paper is told from ground."""

MIN_CONTRAST = 1.5
"""Paper must be so many times as bright, as code values, as what lies around it."""

AREA_SHARE = (0.02, 0.97)
"""Of the photo, that a sheet may fill; one that fills more shows no ground around it."""


def sheet_mask(photo: Pixels, mask: Bools | str | None) -> tuple[Bools | None, list[Diagnostic]]:
    """The mask of the sheet that a user asked for, and warnings.

    Parameters
    ----------
    photo : (rows, cols, 3) uint8 or uint16
    mask : (rows, cols) bool, "auto" or None
        auto: as `find_sheet` finds it. None: everywhere.

    Raises
    ------
    InputError
        If the mask is not of the photo's size, or empty.
    """
    if mask is None:
        return None, []
    if isinstance(mask, str):
        detected = find_sheet(photo)
        sentence = "no sheet stands out from its ground on the photo, so all that was seen was kept"
        return detected, [Diagnostic("sheet-not-found", sentence)] if detected is None else []
    if mask.shape != photo.shape[:2]:
        raise InputError(
            f"the mask is {mask.shape[1]} x {mask.shape[0]} pixels, the photo {photo.shape[1]} x {photo.shape[0]}; "
            "give a mask of the photo's size"
        )
    if not mask.any():
        raise InputError("the mask is black all over; paint it white where the sheet is")
    return mask, []


def find_sheet(photo: Pixels, *, whole: bool = False) -> Bools | None:
    """Find the sheet in a photo: the largest bright region, with the dark things in it.

    The threshold between paper and ground is Otsu's, on the logarithm of the brightness, so that paper in half shade
    still counts as paper.

    Parameters
    ----------
    photo : (rows, cols, 3) uint8 or uint16
    whole : bool
        Up to the outline itself. By default a rim is left out, as wide as the outline may be off, so that nothing of
        the ground comes along.

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
    eight = to_uint8(photo)
    scale = min(1.0, WORKING_PX / max(rows, cols))
    small = cv2.resize(eight, (max(2, round(cols * scale)), max(2, round(rows * scale))), interpolation=cv2.INTER_AREA)
    bright = _without_print(small.max(axis=2))
    above, _ = cv2.threshold(_log_levels(bright), 0, 255, cv2.THRESH_BINARY | cv2.THRESH_OTSU)
    inside = _largest(_log_levels(bright) > above)
    if not AREA_SHARE[0] <= inside.mean() <= AREA_SHARE[1]:
        return None
    if np.median(bright[inside]) < MIN_CONTRAST * max(float(np.median(bright[~inside])), 1.0):
        return None
    mask = cv2.resize(inside.astype(np.uint8) * 255, (cols, rows), interpolation=cv2.INTER_LINEAR)
    if whole:
        return np.asarray(mask > 127)
    border = 1 + 2 * int(np.ceil(0.5 / scale))  # half a small pixel is how far the outline may be off
    return np.asarray(cv2.erode(mask, np.ones((border, border), np.uint8)) > 127)


def _without_print(grey: NDArray[np.uint8]) -> NDArray[np.uint8]:
    side = 2 * int(CLOSING * max(grey.shape) / 2) + 1
    return np.asarray(cv2.morphologyEx(grey, cv2.MORPH_CLOSE, np.ones((side, side), np.uint8)), np.uint8)


def _log_levels(grey: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return (np.log1p(grey.astype(np.float32)) * (255 / np.log(256))).astype(np.uint8)


def _largest(mask: Bools) -> Bools:
    """The largest connected region, holes filled."""
    _, label, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8))
    if len(stats) < 2:
        return np.zeros_like(mask)
    region = (label == 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))).astype(np.uint8)
    outlines = cv2.findContours(region, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[0]
    return np.asarray(cv2.drawContours(region, outlines, -1, 1, cv2.FILLED).astype(bool))
