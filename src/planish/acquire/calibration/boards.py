"""Calibration boards: drawing for print at true size, and corner detection in photos."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from planish.dpi import MM_PER_INCH
from planish.errors import UsageError
from planish.types import Floats, Page

Kind = Literal["charuco", "chessboard"]

PX_PER_MM = 20
"""Resolution of the drawn board: edges fall on whole pixels if squares are multiples of a fifth of a millimetre."""

MARKER_SHARE = 0.75
"""Side of a marker relative to its square."""

PAPER_MM = {"a4": (210.0, 297.0), "letter": (215.9, 279.4)}

MIN_CORNERS = 8
"""Least number of detected corners: a pose has six parameters."""

MARGIN_MM = 8.0
"""Margin that printers leave white."""


@dataclass(frozen=True)
class Board:
    """A chessboard pattern, with markers in the white squares (ChArUco) or without (chessboard).

    Attributes
    ----------
    columns, rows : int
        Squares across and down; inner corners are one fewer in each direction.
    square_mm : float
        Side of a square, as measured on the print.
    kind : {"charuco", "chessboard"}
        A ChArUco board may be partly visible; a chessboard must be wholly visible, but needs less light.
    """

    columns: int = 7
    rows: int = 10
    square_mm: float = 25.0
    kind: Kind = "charuco"

    def __post_init__(self) -> None:
        if not (3 <= self.columns <= 40 and 3 <= self.rows <= 40):
            raise UsageError(
                f"a board of {self.columns} x {self.rows} squares was asked for; 3 to 40 each way are wanted"
            )
        if not 0.1 <= self.square_mm <= 1000:
            raise UsageError(f"squares of {self.square_mm:g} mm were asked for; 0.1 to 1000 mm are wanted")
        if self.kind not in get_args(Kind):
            raise UsageError(f"there is no board {self.kind!r}; choose one of {', '.join(get_args(Kind))}")


def corner_points(board: Board) -> Floats:
    """Inner corners of a board in its own frame, (k, 3) float64 [mm]: x along its rows, y down, z = 0.

    Examples
    --------
    >>> corner_points(Board(4, 3, 10.0))[:4].tolist()
    [[10.0, 10.0, 0.0], [20.0, 10.0, 0.0], [30.0, 10.0, 0.0], [10.0, 20.0, 0.0]]
    """
    x, y = np.meshgrid(np.arange(1, board.columns), np.arange(1, board.rows))
    return np.asarray(np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1) * board.square_mm, np.float64)


def board_pixels(board: Board, square_px: int) -> NDArray[np.uint8]:
    """Draw the pattern without margin: (rows, cols) uint8, squares `square_px` wide."""
    if board.kind == "chessboard":
        row, col = np.mgrid[: board.rows, : board.columns]
        return np.kron(255 * ((row + col) % 2), np.ones((square_px, square_px))).astype(np.uint8)
    size = board.columns * square_px, board.rows * square_px
    return np.asarray(_charuco(board).generateImage(size, marginSize=0, borderBits=1), np.uint8)


def board_page(board: Board, paper: str = "a4") -> Page:
    """Draw a board on a sheet of paper, with a 100 mm scale bar to verify the print.

    Raises
    ------
    UsageError
        If it does not fit the paper.
    """
    width, height = PAPER_MM[paper]
    across, down = board.columns * board.square_mm, board.rows * board.square_mm
    if (across > down) != (width > height):
        width, height = height, width
    if across > width - 2 * MARGIN_MM or down > height - 2 * MARGIN_MM - 8:
        raise UsageError(
            f"a board of {across:g} x {down:g} mm does not fit on {paper} ({width:g} x {height:g} mm, {MARGIN_MM:g} mm "
            "of them white at each side); ask for smaller or fewer squares, or print it in parts on your own paper"
        )
    drawn = Image.fromarray(board_pixels(board, round(board.square_mm * PX_PER_MM)))
    sheet = Image.new("L", (round(width * PX_PER_MM), round(height * PX_PER_MM)), 255)
    sheet.paste(drawn, ((sheet.width - drawn.width) // 2, (sheet.height - drawn.height) // 2 - 3 * PX_PER_MM))
    draw_scale_bar(
        sheet, f"{board.columns} x {board.rows} squares of {board.square_mm:g} mm, {board.kind}; print at 100 %"
    )
    pixels = np.asarray(sheet) > 127
    return Page(pixels, np.ones_like(pixels), PX_PER_MM * MM_PER_INCH)


SEARCH_PX, EXHAUSTIVE_PX = 2000, 800
"""Long sides of the photo on which corners are looked for, before they are refined on the photo itself. Squares of 30
pixels and more are found; with half of it boards far away are missed, with twice as much a photo without a board takes
four times as long."""


def find_corners(board: Board, grey: NDArray[np.uint8]) -> tuple[NDArray[np.intp], Floats] | None:
    """Detect the corners of a board in a photo.

    Parameters
    ----------
    board : Board
    grey : (rows, cols) uint8

    Returns
    -------
    rows_of : (k,) int
        Index of each in `corner_points`.
    xy : (k, 2) float64 [px]
        x right, y down, pixel centres at integers.
    Or None if fewer than eight are detected.
    """
    stretched = cv2.normalize(grey, np.empty_like(grey), 0, 255, cv2.NORM_MINMAX)
    if board.kind == "charuco":
        corners, numbers, _, _ = cv2.aruco.CharucoDetector(_charuco(board)).detectBoard(stretched)
        if corners is None or numbers is None or len(numbers) < MIN_CORNERS:
            return None
        return np.ravel(numbers).astype(np.intp), np.asarray(corners, np.float64).reshape(-1, 2)
    size = board.columns - 1, board.rows - 1
    corners = _chessboard(stretched, size)
    return None if corners is None else (np.arange(size[0] * size[1]), _refine_corners(stretched, corners, size[0]))


def _chessboard(grey: NDArray[np.uint8], size: tuple[int, int]) -> NDArray[np.float32] | None:
    """Corners (k, 2) [px], unrefined, by the first detector that sees all of them.

    The sector-based detector stands blur and noise, the classic one light squares on grey and boards without a white
    rim; each misses boards that the other sees. The exhaustive search takes seconds where there is none, so it has a
    small photo, and only one with squares on it.
    """
    half, small = _shrunk(grey, SEARCH_PX), _shrunk(grey, EXHAUSTIVE_PX)
    accurate = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_ACCURACY
    classic = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_FAST_CHECK
    tries = (
        (half, lambda photo: cv2.findChessboardCorners(photo, size, flags=classic)),
        (half, lambda photo: cv2.findChessboardCornersSB(photo, size, flags=accurate)),
        (small, lambda photo: cv2.findChessboardCornersSB(photo, size, flags=accurate | cv2.CALIB_CB_EXHAUSTIVE)),
    )
    for photo, detect in tries[: 3 if cv2.checkChessboard(small, size) else 2]:
        found, corners = detect(photo)
        if found:
            factor = np.array(grey.shape[::-1]) / photo.shape[::-1]
            places = (np.asarray(corners, np.float64).reshape(-1, 2) + 0.5) * factor - 0.5
            return places.astype(np.float32)
    return None


def _shrunk(grey: NDArray[np.uint8], most_px: int) -> NDArray[np.uint8]:
    factor = most_px / max(grey.shape)
    if factor >= 1:
        return grey
    return np.asarray(cv2.resize(grey, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA), np.uint8)


def _refine_corners(grey: NDArray[np.uint8], corners: NDArray[np.float32], columns: int) -> Floats:
    """Refine corners by the gradient: OpenCV's sector-based detector is off by up to a pixel."""
    side = float(np.median(np.linalg.norm(np.diff(corners.reshape(-1, columns, 2), axis=1), axis=2)))
    window = int(np.clip(side / 4, 2, 11))
    stop = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 50, 1e-3)
    refined = cv2.cornerSubPix(grey, corners[:, None].copy(), (window, window), (-1, -1), stop)
    return np.asarray(refined, np.float64).reshape(-1, 2)


def _charuco(board: Board) -> cv2.aruco.CharucoBoard:
    squares = board.columns * board.rows // 2
    kinds = {250: cv2.aruco.DICT_5X5_250, 1000: cv2.aruco.DICT_5X5_1000}
    dictionary = cv2.aruco.getPredefinedDictionary(kinds[250 if squares <= 250 else 1000])
    size = (board.columns, board.rows)
    return cv2.aruco.CharucoBoard(size, board.square_mm, MARKER_SHARE * board.square_mm, dictionary)


def draw_scale_bar(sheet: Image.Image, text: str) -> None:
    """Draw a 100 mm scale bar at the bottom of the sheet, and a line of text."""
    draw = ImageDraw.Draw(sheet)
    left, base = MARGIN_MM * PX_PER_MM, sheet.height - (MARGIN_MM + 1) * PX_PER_MM
    draw.line([(left, base), (left + 100 * PX_PER_MM, base)], 0, 4)
    for mm in range(0, 101, 10):
        x = left + mm * PX_PER_MM
        draw.line([(x, base), (x, base - (3 if mm % 50 == 0 else 1.5) * PX_PER_MM)], 0, 4)
    draw.text(
        (left + 103 * PX_PER_MM, base), f"100 mm;  {text}", 0, ImageFont.load_default(2.4 * PX_PER_MM), anchor="ls"
    )
