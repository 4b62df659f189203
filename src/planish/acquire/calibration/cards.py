"""Cards with ArUco markers to lie beside a sheet, drawn for print at true size."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from planish.acquire.calibration.boards import MARGIN_MM, PAPER_MM, PX_PER_MM, draw_scale_bar
from planish.acquire.photos.markers import CELLS, DICTIONARY
from planish.dpi import MM_PER_INCH
from planish.errors import UsageError
from planish.types import Page

QUIET = 0.25
"""White around a marker, relative to its side: a cell and a half."""

GAP_MM = 8.0
"""Between cards, for the cut marks."""

MARKER_MM = (10.0, 140.0)
"""Sides that can be asked for: smaller ones are too small for photos from half a metre, larger ones for the paper."""

MOST_CARDS = 12


def card_page(marker_mm: float = 40.0, cards: int = 4, paper: str = "a4") -> Page:
    """Draw cards on a sheet of paper, each with a marker of its own number, cut marks, and its size in words.

    Parameters
    ----------
    marker_mm : float
        Side of the black squares.
    cards : int
        How many; numbers from 0.
    paper : {"a4", "letter"}

    Returns
    -------
    Page
        One bit, 20 pixels a millimetre.

    Raises
    ------
    UsageError
        If they do not fit the paper.

    Examples
    --------
    >>> card_page(60.0, cards=2)
    Page(4200 x 5940 px of bool, 508 dpi, 210.0 x 297.0 mm)
    """
    if not MARKER_MM[0] <= marker_mm <= MARKER_MM[1]:
        raise UsageError(
            f"a marker of {marker_mm:g} mm was asked for; {MARKER_MM[0]:g} to {MARKER_MM[1]:g} mm are wanted"
        )
    if not 1 <= cards <= MOST_CARDS:
        raise UsageError(f"{cards} cards were asked for; 1 to {MOST_CARDS} are wanted")
    width, height = PAPER_MM[paper]
    side = (1 + 2 * QUIET) * marker_mm
    columns = int((width - 2 * MARGIN_MM + GAP_MM) // (side + GAP_MM))
    rows = int((height - 2 * MARGIN_MM - 8 + GAP_MM) // (side + GAP_MM))  # the scale bar has eight millimetres
    if cards > columns * rows:
        raise UsageError(
            f"{cards} cards of {side:g} mm do not fit on {paper}, {columns * rows} do", "ask for fewer or smaller ones"
        )
    sheet = Image.new("L", (round(width * PX_PER_MM), round(height * PX_PER_MM)), 255)
    for number in range(cards):
        row, column = divmod(number, columns)
        corner = (MARGIN_MM + column * (side + GAP_MM), MARGIN_MM + row * (side + GAP_MM))
        _draw_card(sheet, number, marker_mm, corner)
    draw_scale_bar(sheet, f"markers of {marker_mm:g} mm; print at 100 %, then measure")
    pixels = np.asarray(sheet) > 127
    return Page(pixels, np.ones_like(pixels), PX_PER_MM * MM_PER_INCH)


def _draw_card(sheet: Image.Image, number: int, marker_mm: float, corner_mm: tuple[float, float]) -> None:
    quiet = QUIET * marker_mm
    side = (1 + 2 * QUIET) * marker_mm
    left, top = corner_mm
    marker = Image.fromarray(_marker(number, round(marker_mm * PX_PER_MM)))
    sheet.paste(marker, (round((left + quiet) * PX_PER_MM), round((top + quiet) * PX_PER_MM)))
    draw = ImageDraw.Draw(sheet)
    size = min(2.4, 0.3 * quiet)
    place = ((left + side / 2) * PX_PER_MM, (top + side - 0.25 * size) * PX_PER_MM)
    text = f"black square {marker_mm:g} mm, DICT_4X4_50 no. {number}"
    draw.text(place, text, 0, ImageFont.load_default(size * PX_PER_MM), anchor="mb")
    for x in (left, left + side):
        for y in (top, top + side):
            right, down = (1 if x > left else -1), (1 if y > top else -1)
            a, b = x * PX_PER_MM, y * PX_PER_MM
            draw.line([(a + right * PX_PER_MM, b), (a + right * 0.4 * GAP_MM * PX_PER_MM, b)], 0, 2)
            draw.line([(a, b + down * PX_PER_MM), (a, b + down * 0.4 * GAP_MM * PX_PER_MM)], 0, 2)


def _marker(number: int, side_px: int) -> NDArray[np.uint8]:
    cells = cv2.aruco.generateImageMarker(cv2.aruco.getPredefinedDictionary(DICTIONARY), number, CELLS)
    return np.asarray(cv2.resize(cells, (side_px, side_px), interpolation=cv2.INTER_NEAREST), np.uint8)
