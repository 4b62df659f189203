"""The page's own frame: sides along x and y, origin at the top left corner, the right way up."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planish.mesh import bounds
from planish.types import Bools, Floats

NEARLY_SQUARE = 1.02
"""Below this ratio of its sides a page has no long side that could stand upright."""
STRAY = 0.02
"""What stands out from a straight side along less than this part of its length, or less than three pieces, is not
paper. A scan's border runs in steps and trembles; its outermost 2 % lie within 0.03 mm of where the gallery's sheets
end, while the farthest single point may lie 0.07 mm outside, or anywhere."""
STRAIGHT = 0.5
"""A side is straight where this part of it reaches its line to within two of the scan's points or 1 mm; sheets torn,
round or with three corners keep all they have."""
PIECE = 3.0
"""Sides are looked at in pieces as long as so many distances between the scan's points, and 1 mm or more."""
PEELS = 6
"""So many hulls are taken off, one inside the other, to come to a straight sheet beneath stray points."""


def to_page_frame(page_xy: Floats, up: Floats, *, long_side_upright: bool = True) -> tuple[Floats, tuple[float, float]]:
    """Turn and shift a flat sheet into the frame of its page, without mirroring or scaling it.

    The sheet's sides are those of the least rectangle around it, its angle refined by all straight parts of the
    outline; stray points beyond a straight side do not count. Of the four ways round those remain in which the long
    side is upright, and of these the one in which `up` points up most.

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
    outline = _outline(page_xy)
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
    """Shift the top left corner to the origin; also the width and height in mm.

    Stray points may lie outside of the page; paper does not, but for the last 2 % of the length of a ragged side.

    Examples
    --------
    >>> sheet = np.stack(np.meshgrid(np.arange(201.0), np.arange(151.0)), axis=-1).reshape(-1, 2)
    >>> place_on_page(np.append(sheet, [[30.0, -4.0]], axis=0))[1]
    (200.0, 150.0)
    """
    sides = _sides(page_xy)
    low, high = -sides.end[::2], sides.end[1::2]
    return page_xy - low, (float(high[0] - low[0]), float(high[1] - low[1]))


@dataclass(frozen=True, eq=False)
class _Sides:
    """The left, right, upper and lower side of a sheet.

    Attributes
    ----------
    end : (4,) float64 [mm]
        How far the paper reaches, left and up counted as positive.
    straight : (4,) bool
    rim : (k,) int
        Points that reach farthest in each piece of a side, without those beyond any side's end.
    """

    end: Floats
    straight: Bools
    rim: NDArray[np.intp]


def _sides(page_xy: Floats) -> _Sides:
    """Find the ends of a sheet whose sides lie along x and y."""
    low, high = bounds(page_xy)
    length = high - low
    spacing = float(np.sqrt(length.prod() / len(page_xy)))
    count = np.maximum(length / max(1.0, PIECE * spacing), 1).astype(int)
    farthest = _farthest(np.ascontiguousarray(page_xy), low, length, count)
    ends, straight, rims = [], [], []
    for side, (axis, sign) in enumerate([(0, -1), (0, 1), (1, -1), (1, 1)]):
        rim = farthest[side, : count[1 - axis]]
        rim = rim[rim >= 0]
        reach = sign * page_xy[rim, axis]
        most = int(STRAY * len(reach))
        paper = reach[~_spikes(reach, max(3, most + 1))] if most else reach
        end = np.sort(paper)[::-1][most]
        straight.append(np.mean(paper >= end - max(1.0, 2 * spacing)) >= STRAIGHT)
        ends.append(end if straight[-1] else reach.max())
        rims.append(rim)
    end, rim = np.array(ends), np.concatenate(rims)
    within = (page_xy[rim] >= -end[::2]) & (page_xy[rim] <= end[1::2])
    return _Sides(end, np.array(straight), rim[within.all(axis=1)])


def _spikes(reach: Floats, narrow: int) -> Bools:
    """Pieces that stand out along fewer than so many of them: by 1 mm, and by twice what nine in ten do.

    Where a sheet rises steeply at its border, as beside a spine, the scan's steps are higher than its points are apart.
    """
    from scipy.ndimage import grey_opening

    height = reach - grey_opening(reach, narrow)
    return np.asarray(height > max(1.0, 2 * float(np.quantile(height, 0.9))))


@njit(cache=True, nogil=True)
def _farthest(page_xy, low, length, count):  # type: ignore[no-untyped-def]
    """Row of the point that reaches farthest left, right, up and down in each piece of the side: (4, pieces), or -1."""
    far = np.full((4, max(count[0], count[1])), -1, np.int64)
    for i in range(len(page_xy)):
        for axis in range(2):
            other = 1 - axis
            where = (page_xy[i, other] - low[other]) / max(length[other], 1e-9) * count[other]
            piece = min(int(where), count[other] - 1)
            first, last = far[2 * axis, piece], far[2 * axis + 1, piece]
            if first < 0 or page_xy[i, axis] < page_xy[first, axis]:
                far[2 * axis, piece] = i
            if last < 0 or page_xy[i, axis] > page_xy[last, axis]:
                far[2 * axis + 1, piece] = i
    return far


def _outline(page_xy: Floats) -> Floats:
    """Corners of the convex hull, without stray points where the sheet beneath them has straight sides."""
    hull = page_xy[_hull(page_xy)]
    peeled, outline = page_xy, hull
    for _ in range(PEELS):
        sides = _sides_at(page_xy, _side_angle(outline))
        if len(sides.rim) < 1 / STRAY:
            return hull  # too few for any to be stray
        if sides.straight.sum() >= 3:
            return _without_strays(page_xy, sides)
        peeled = np.delete(peeled, _hull(peeled), axis=0)
        if len(peeled) < 3:
            return hull
        outline = peeled[_hull(peeled)]
    return hull


def _without_strays(page_xy: Floats, sides: _Sides) -> Floats:
    """Corners of the hull of what lies within straight sides, sought once more where their angle is known better."""
    rim = page_xy[sides.rim]
    rim = page_xy[_sides_at(page_xy, _side_angle(rim[_hull(rim)])).rim]
    return rim[_hull(rim)]


def _sides_at(page_xy: Floats, angle: float) -> _Sides:
    return _sides(page_xy @ _rotation(-angle).T)


def direction_of_growth(page_xy: Floats, value: Floats) -> Floats:
    """(2,) unit vector along which a value at the points grows fastest over the whole sheet; zero where it does not."""
    good = np.isfinite(value)
    arm = page_xy[good] - page_xy[good].mean(axis=0)
    gradient = np.linalg.lstsq(arm, value[good] - value[good].mean(), rcond=None)[0]
    length = np.linalg.norm(gradient)
    return gradient / length if length > 0 else np.zeros(2)


def turned(page_xy: Floats, degrees: float) -> tuple[Floats, tuple[float, float], Floats, Floats]:
    """Turn a page clockwise and put it into its new frame.

    Returns
    -------
    page_xy : (n, 2) float64 [mm]
    size_mm : (float, float)
    turn : (2, 2) float64
    shift : (2,) float64 [mm]
        The same for any other place on the page: `place @ turn.T + shift`.
    """
    turn = _rotation(np.radians(degrees))
    rotated = page_xy @ turn.T
    placed, size = place_on_page(rotated)
    return placed, size, turn, placed[0] - rotated[0]


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
