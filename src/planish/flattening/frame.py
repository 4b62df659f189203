"""The page's own frame: sides along x and y, origin at the top left corner, the right way up."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planish.mesh import bounds
from planish.types import Floats

NEARLY_SQUARE = 1.02
"""Below this ratio of its sides a page has no long side that could stand upright."""


def to_page_frame(page_xy: Floats, up: Floats, *, long_side_upright: bool = True) -> tuple[Floats, tuple[float, float]]:
    """Turn and shift a flat sheet into the frame of its page, without mirroring or scaling it.

    The sheet's sides are those of the least rectangle around it, its angle refined by all straight parts of the
    outline. Of the four ways round those remain in which the long side is upright, and of these the one in which
    `up` points up most.

    Parameters
    ----------
    page_xy : (n, 2) float64 [mm]
        y down, in any place and turn.
    up : (2,) float64
        A direction on the sheet that should point to the top of the page; zero where nothing is known.
    long_side_upright : bool
        Whether only the two ways round with the long side upright are looked at.

    Returns
    -------
    page_xy : (n, 2) float64 [mm]
    size_mm : (float, float)
        Width and height of the page.

    Examples
    --------
    >>> sheet = np.array([[0.0, 0.0], [30.0, 0.0], [30.0, 20.0], [0.0, 20.0]])
    >>> to_page_frame(sheet, np.array([1.0, 0.0]))[1]
    (20.0, 30.0)
    """
    outline = page_xy[_hull(page_xy)]
    angle = _side_angle(outline)
    best, best_score = np.eye(2), -np.inf
    for quarter in range(4):
        turn = _rotation(-angle + quarter * np.pi / 2)
        width, height = np.ptp(outline @ turn.T, axis=0)
        lying = long_side_upright and width > NEARLY_SQUARE * height
        score = -np.inf if lying else -(turn @ up)[1]
        if score > best_score:
            best, best_score = turn, score
    return place_on_page(page_xy @ best.T)


def place_on_page(page_xy: Floats) -> tuple[Floats, tuple[float, float]]:
    """Shift the top left corner to the origin; also the width and height in mm."""
    low, high = bounds(page_xy)
    return page_xy - low, (float(high[0] - low[0]), float(high[1] - low[1]))


def direction_of_growth(page_xy: Floats, value: Floats) -> Floats:
    """(2,) unit vector along which a value at the points grows fastest over the whole sheet; zero where it does not."""
    good = np.isfinite(value)
    arm = page_xy[good] - page_xy[good].mean(axis=0)
    gradient = np.linalg.lstsq(arm, value[good] - value[good].mean(), rcond=None)[0]
    length = np.linalg.norm(gradient)
    return gradient / length if length > 0 else np.zeros(2)


def turned(page_xy: Floats, degrees: float) -> tuple[Floats, tuple[float, float]]:
    """The page turned clockwise, in its new frame."""
    return place_on_page(page_xy @ _rotation(np.radians(degrees)).T)


def _rotation(angle: float) -> Floats:
    """With y down a positive angle turns clockwise."""
    c, s = np.cos(angle), np.sin(angle)
    if abs(angle / (np.pi / 2) - round(angle / (np.pi / 2))) < 1e-12:
        c, s = round(c), round(s)  # quarter turns keep every digit
    return np.array([[c, -s], [s, c]])


def _hull(page_xy: Floats) -> NDArray[np.intp]:
    """Rows of the points on the convex hull, in order."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        return np.asarray(ConvexHull(page_xy).vertices)
    except QhullError:  # all on one line
        return np.arange(len(page_xy))


def _side_angle(outline: Floats) -> float:
    """Angle [rad] of the sheet's sides, up to quarter turns."""
    edges = np.roll(outline, -1, axis=0) - outline
    length = np.linalg.norm(edges, axis=1)
    angles = np.arctan2(edges[:, 1], edges[:, 0])[length > 0]
    length = length[length > 0]
    area = [np.prod(np.ptp(outline @ _rotation(-a).T, axis=0)) for a in angles]
    rough = angles[int(np.argmin(area))]
    off = (angles - rough + np.pi / 4) % (np.pi / 2) - np.pi / 4
    near = np.abs(off) < np.radians(2)  # the sides themselves; corners cut off or dog-eared lie elsewhere
    return float(rough + np.average(off[near], weights=length[near] ** 2))
