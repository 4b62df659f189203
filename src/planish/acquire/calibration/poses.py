"""Figure of a calibration: corners in the photos, and poses of the board."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from planish.acquire.calibration.boards import Board
from planish.acquire.calibration.camera import Calibration
from planish.types import Floats

SIDE = 640
GAP = 20
GROUND, LINE, TEXT = (252, 252, 250), (170, 170, 165), (70, 70, 70)


def draw_poses(calibration: Calibration, board: Board) -> NDArray[np.uint8]:
    """Draw all corners in the image, and the boards from above and from the side, the device at the bottom.

    Returns
    -------
    (rows, cols, 3) uint8
    """
    colours = [tuple(int(v) for v in colour) for colour in _colours(len(calibration.poses))]
    size = np.array([board.columns, board.rows]) * board.square_mm
    outline = np.array([[0, 0, 0], [size[0], 0, 0], [*size, 0], [0, size[1], 0]])
    boards = [outline @ rotation.T + shift for rotation, shift in calibration.poses]
    panels = [
        _draw_corners(calibration, colours),
        _draw_boards(boards, colours, (0, 2), "from above"),
        _draw_boards(boards, colours, (1, 2), "from the side"),
    ]
    margin = np.full((SIDE, GAP, 3), 255, np.uint8)
    return np.hstack([part for panel in panels for part in (panel, margin)][:-1])


def _colours(count: int) -> NDArray[np.uint8]:
    steps = np.linspace(0, 230, max(count, 1)).astype(np.uint8)
    return np.asarray(cv2.applyColorMap(steps[:, None], cv2.COLORMAP_VIRIDIS)[:, 0, ::-1], np.uint8)


def _draw_corners(calibration: Calibration, colours: list[tuple[int, ...]]) -> NDArray[np.uint8]:
    """Image plane of the device, corners coloured by photo."""
    rows, cols = calibration.camera.shape_rc
    scale = (SIDE - 2 * GAP) / max(rows, cols)
    panel = _panel(f"corners in {len(calibration.corners)} photos, {calibration.rms_px:.2f} px rms")
    low, high = np.array([GAP, 2 * GAP]), np.array([GAP + cols * scale, 2 * GAP + rows * scale])
    cv2.rectangle(panel, tuple(low), tuple(int(v) for v in high), LINE, 1, cv2.LINE_AA)
    for xy, colour in zip(calibration.corners, colours, strict=True):
        for x, y in low + xy * scale:
            cv2.circle(panel, (round(x), round(y)), 2, colour, -1, cv2.LINE_AA)
    return panel


def _draw_boards(
    boards: list[Floats], colours: list[tuple[int, ...]], axes: tuple[int, int], title: str
) -> NDArray[np.uint8]:
    """Outlines of the boards in two axes of the device, which is at the bottom and looks up."""
    corners = np.concatenate([*boards, np.zeros((1, 3))])[:, axes]
    scale = (SIDE - 4 * GAP) / max(float(np.ptp(corners, axis=0).max()), 1.0)
    middle = (corners[:, 0].max() + corners[:, 0].min()) / 2
    panel = _panel(f"the boards {title}, {np.ptp(corners[:, 1]):.0f} mm deep")
    for outline, colour in zip([np.zeros((1, 3)), *boards], [TEXT, *colours], strict=True):
        x, y = (outline[:, axes] - [middle, 0]).T * scale
        line = np.rint(np.stack([SIDE / 2 + x, SIDE - GAP - y], axis=1)).astype(np.int32)
        if len(line) == 1:
            cv2.circle(panel, tuple(int(v) for v in line[0]), 7, colour, -1, cv2.LINE_AA)
        else:
            cv2.polylines(panel, [line], True, colour, 2, cv2.LINE_AA)
    return panel


def _panel(title: str) -> NDArray[np.uint8]:
    panel = np.full((SIDE, SIDE, 3), GROUND, np.uint8)
    cv2.putText(panel, title, (GAP, GAP + 4), cv2.FONT_HERSHEY_SIMPLEX, 0.5, TEXT, 1, cv2.LINE_AA)
    return panel
