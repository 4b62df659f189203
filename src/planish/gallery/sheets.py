"""Developable sheets with known flat shape: each is an exact isometry of the flat page.

Curved sheets are cylinders over a curve with exact arc length; folded ones are composed of exact rotations and
reflections.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from planish.errors import UsageError
from planish.gallery.profile import curve_of_angle
from planish.types import Floats

LETTER_MM = (215.9, 279.4)
"""Width and height of US letter paper."""

RISE_MM = 25.0
"""Distance from the gutter at which the slope of a book page has fallen to 1/e."""


@dataclass(frozen=True, eq=False)
class Sheet:
    """A curved sheet of paper.

    Attributes
    ----------
    name : str
    width_mm, height_mm : float
        Size of the flat page.
    bend : callable
        (k, 2) page position [mm], x right, y down, origin top left -> (k, 3) point in space [mm], z up from the table
        z = 0, printed side up. An isometry; also defined slightly beyond the page.
    """

    name: str
    width_mm: float
    height_mm: float
    bend: Callable[[Floats], Floats]


def sheet(name: str, **parameters: float | int | tuple[float, ...]) -> Sheet:
    """Make a sheet of the gallery.

    Parameters
    ----------
    name : str
        One of `SHEETS`.
    **parameters
        Parameters of its function (`book`, `letter`, ... in this module). All take width_mm and height_mm.

    Examples
    --------
    >>> book = sheet("book")
    >>> corners = np.array([[0, 0], [215.9, 0], [0, 279.4]])
    >>> book.bend(corners).round(1)
    array([[-102.5,  139.7,    5.1],
           [ 102.5,  139.7,    0. ],
           [-102.5, -139.7,    5.1]])
    """
    if name not in MAKERS:
        raise UsageError(f"there is no sheet {name!r} in the gallery; choose one of {', '.join(MAKERS)}")
    return MAKERS[name](**parameters)


def flat(width_mm: float = LETTER_MM[0], height_mm: float = LETTER_MM[1]) -> Sheet:
    """Make a flat sheet."""
    return _cylinder("flat", width_mm, height_mm, np.zeros_like)


def book(
    width_mm: float = LETTER_MM[0], height_mm: float = LETTER_MM[1], spine_deg: float = 65.0, dip_deg: float = 21.0
) -> Sheet:
    """Make the right page of a thick book: it rises at `spine_deg` from the gutter, then falls by `dip_deg`."""
    return _cylinder("book", width_mm, height_mm, lambda s: _book_slope(s, spine_deg, dip_deg, width_mm))


def spread(
    width_mm: float = 2 * 148.0, height_mm: float = 210.0, spine_deg: float = 118.0, dip_deg: float = 22.0
) -> Sheet:
    """Make both pages of an open book, with a sharp gutter where the normals turn by `spine_deg`."""
    middle = width_mm / 2

    def angle(s: Floats) -> Floats:
        return np.sign(s - middle) * _book_slope(np.abs(s - middle), spine_deg / 2, dip_deg, middle)

    return _cylinder("spread", width_mm, height_mm, angle, creases=(middle,))


def letter(
    width_mm: float = LETTER_MM[0],
    height_mm: float = LETTER_MM[1],
    slopes_deg: tuple[float, float, float] = (-4.0, 42.0, -14.0),
    radius_mm: float = 0.0,
) -> Sheet:
    """Make a letter folded in three and opened; its panels have `slopes_deg` from top to bottom.

    Folds are sharp, or arcs of `radius_mm`.
    """
    slopes = np.radians(slopes_deg)
    folds = height_mm * np.array([1, 2]) / 3

    def angle(s: Floats) -> Floats:
        if radius_mm == 0:
            return slopes[np.searchsorted(folds, s)]
        half = radius_mm * np.abs(np.diff(slopes)) / 2
        stops = np.stack([folds - half, folds + half], axis=1).ravel()
        return np.interp(s, stops, np.repeat(slopes, 2)[1:-1])

    half = radius_mm * np.abs(np.diff(slopes)) / 2
    return _cylinder("letter", width_mm, height_mm, angle, direction_deg=90, creases=(*(folds - half), *(folds + half)))


def curl(
    width_mm: float = LETTER_MM[0],
    height_mm: float = LETTER_MM[1],
    turn_deg: float = 110.0,
    length_mm: float = 110.0,
    direction_deg: float = 45.0,
) -> Sheet:
    """Make a sheet with a curled lower right corner, overhanging if `turn_deg` exceeds 90.

    The curl begins `length_mm` before the corner, along `direction_deg` (0 is right, 90 is down the page).
    """
    start = _extent(width_mm, height_mm, direction_deg)[1] - length_mm

    def angle(s: Floats) -> Floats:
        return np.radians(turn_deg) * np.clip((s - start) / length_mm, 0, None) ** 2

    return _cylinder("curl", width_mm, height_mm, angle, direction_deg, creases=(start,))


def wave(
    width_mm: float = LETTER_MM[0],
    height_mm: float = LETTER_MM[1],
    steepness_deg: float = 38.0,
    waves: float = 2.0,
    direction_deg: float = 12.0,
) -> Sheet:
    """Make a sheet with sinusoidal waves along `direction_deg` (0 is right, 90 is down the page)."""
    length = _extent(width_mm, height_mm, direction_deg)[1]

    def angle(s: Floats) -> Floats:
        return np.radians(steepness_deg) * np.cos(2 * np.pi * waves * s / length)

    return _cylinder("wave", width_mm, height_mm, angle, direction_deg)


def roll(
    width_mm: float = LETTER_MM[0], height_mm: float = LETTER_MM[1], turns: float = 2.0, pitch_mm: float = 6.0
) -> Sheet:
    """Make a sheet rolled up with the print outside, its head outermost: `turns` turns at a distance of `pitch_mm`.

    The profile is the involute of a circle: the radius decreases by pitch / 2 pi per radian, r(a) = r0 - pitch a / 2
    pi, so s(a) = r0 a - pitch a^2 / 4 pi.
    """
    whole, shrink = 2 * np.pi * turns, pitch_mm / (2 * np.pi)
    radius = height_mm / whole + shrink * whole / 2
    if radius <= shrink * whole:
        raise UsageError(f"{height_mm} mm of paper cannot make {turns} turns {pitch_mm} mm apart; ask for fewer turns")

    def angle(s: Floats) -> Floats:
        return (np.sqrt(radius**2 - 2 * shrink * s) - radius) / shrink

    return _cylinder("roll", width_mm, height_mm, angle, direction_deg=90)


def miura(
    width_mm: float = LETTER_MM[0],
    height_mm: float = LETTER_MM[1],
    cells: tuple[float, float] = (5.0, 6.0),
    acute_deg: float = 72.0,
    fold_deg: float = 34.0,
) -> Sheet:
    """Make a Miura fold of `cells` parallelograms across and down, with acute angle `acute_deg`.

    The parallelograms are tilted by `fold_deg`. Vertices as in Schenk & Guest, "Geometry
    of Miura-folded metamaterials", PNAS 110 (2013), eq. 1 to 4.
    """
    gamma, theta = np.radians(acute_deg), np.radians(fold_deg)
    a, b = height_mm / cells[1], width_mm / cells[0] / np.sin(gamma)
    root = np.sqrt(1 + np.cos(theta) ** 2 * np.tan(gamma) ** 2)
    rise = a * np.sin(theta) * np.sin(gamma)
    across, zigzag = b * np.cos(theta) * np.tan(gamma) / root, b / root
    along = a * np.sqrt(1 - np.sin(theta) ** 2 * np.sin(gamma) ** 2)

    def bend(xy: Floats) -> Floats:
        column = xy[:, 0] / (b * np.sin(gamma))
        swing = _triangle_wave(column)
        row = (xy[:, 1] - swing * b * np.cos(gamma)) / a
        return np.stack([across * column, -(along * row + zigzag * swing), rise * _triangle_wave(row)], axis=1)

    return _on_table("miura", width_mm, height_mm, bend)


def crumpled(
    width_mm: float = LETTER_MM[0],
    height_mm: float = LETTER_MM[1],
    folds: int = 12,
    tilt_deg: float = 9.0,
    steepest_deg: float = 50.0,
    seed: int = 2,
) -> Sheet:
    """Make a crumpled sheet: a gentle wave folded by `folds` random planes tilted by up to `tilt_deg`.

    Each plane reflects the part of the sheet on one side of it. Reflection is an isometry and the parts meet in the
    plane, so folds are exact; creases of curved parts are curved. Planes that would make the sheet steeper than
    `steepest_deg` are skipped, so that all of it is visible from above.
    """
    rng = np.random.default_rng(seed)
    base = wave(width_mm, height_mm, steepness_deg=12.0, waves=1.3, direction_deg=float(rng.uniform(0, 180)))
    grid_xy = np.stack(np.meshgrid(np.linspace(0, width_mm, 90), np.linspace(0, height_mm, 120)), axis=-1).reshape(
        -1, 2
    )
    positions, upward = base.bend(grid_xy), normals(base, grid_xy)
    planes: list[tuple[Floats, Floats]] = []
    for _ in range(50 * folds):
        tilt, azimuth = np.radians(tilt_deg) * np.sqrt(rng.uniform(0.2, 1)), rng.uniform(0, 2 * np.pi)
        normal = np.array([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)])
        normal *= (-1) ** len(planes)  # ridges and valleys alternate
        point = positions[rng.integers(len(positions))]
        beyond = (positions - point) @ normal > 0
        mirrored = np.where(beyond[:, None], 2 * np.outer(upward @ normal, normal) - upward, upward)
        if mirrored[:, 2].min() < np.cos(np.radians(steepest_deg)):
            continue
        positions, upward = _mirror(positions, normal, point), mirrored
        planes.append((normal, point))
        if len(planes) == folds:
            break

    def bend(xy: Floats) -> Floats:
        points = base.bend(xy)
        for normal, point in planes:
            points = _mirror(points, normal, point)
        return points

    return _on_table("crumpled", width_mm, height_mm, bend)


def normals(sheet: Sheet, page_xy: Floats) -> Floats:
    """Unit normals of the printed side at page positions, by finite differences over a micrometre.

    Parameters
    ----------
    sheet : Sheet
    page_xy : (k, 2) float64 [mm]

    Returns
    -------
    (k, 3) float64
    """
    here = sheet.bend(page_xy)
    across, down = (sheet.bend(page_xy + step) - here for step in (np.array([1e-3, 0]), np.array([0, 1e-3])))
    normal: Floats = np.cross(down, across)
    return normal / np.linalg.norm(normal, axis=1, keepdims=True)


MAKERS: dict[str, Callable[..., Sheet]] = {
    make.__name__: make for make in (flat, book, spread, letter, curl, wave, miura, roll, crumpled)
}

SHEETS = tuple(MAKERS)


def _book_slope(distance: Floats, spine_deg: float, dip_deg: float, width_mm: float) -> Floats:
    """Slope of a book page at a distance from the gutter."""
    rise = np.exp(-distance / RISE_MM)
    dip = np.exp(-(((distance / width_mm - 0.55) / 0.23) ** 2)) - np.exp(-((0.55 / 0.23) ** 2))  # zero at the gutter
    return np.radians(spine_deg * rise - dip_deg * dip)


def _extent(width_mm: float, height_mm: float, direction_deg: float) -> tuple[float, float]:
    """Minimum of the page along a direction, and its extent along it."""
    direction = np.array([np.cos(np.radians(direction_deg)), np.sin(np.radians(direction_deg))])
    at = np.array([[0, 0], [width_mm, 0], [0, height_mm], [width_mm, height_mm]]) @ direction
    return float(at.min()), float(at.max() - at.min())


def _cylinder(
    name: str,
    width_mm: float,
    height_mm: float,
    angle: Callable[[Floats], Floats],
    direction_deg: float = 0.0,
    creases: tuple[float, ...] = (),
) -> Sheet:
    """Bend a page along one direction; `angle` is the slope angle by arc length."""
    least, length = _extent(width_mm, height_mm, direction_deg)
    curve = curve_of_angle(angle, length, creases)
    cos, sin = np.cos(np.radians(direction_deg)), np.sin(np.radians(direction_deg))

    def bend(xy: Floats) -> Floats:
        along, beside = xy @ [cos, sin] - least, xy @ [-sin, cos]
        point = curve(along)
        return np.stack([point[:, 0] * cos - beside * sin, -point[:, 0] * sin - beside * cos, point[:, 1]], axis=1)

    return _on_table(name, width_mm, height_mm, bend)


def _mirror(points: Floats, normal: Floats, point: Floats) -> Floats:
    """Reflect the points beyond the plane through `point`."""
    beyond = np.clip((points - point) @ normal, 0, None)
    return points - 2 * beyond[:, None] * normal


def _triangle_wave(t: Floats) -> Floats:
    """Triangle wave: 0 at even integers, 1 at odd ones."""
    return 1 - np.abs(np.mod(t, 2) - 1)


def _on_table(name: str, width_mm: float, height_mm: float, bend: Callable[[Floats], Floats]) -> Sheet:
    """Centre a sheet over the origin, its lowest point on z = 0."""
    size = np.array([width_mm, height_mm])
    grid_xy = np.stack(np.meshgrid(*(np.linspace(0, n, 1 + int(n / 2)) for n in size)), axis=-1).reshape(-1, 2)
    points = bend(grid_xy)
    low, high = points.min(axis=0), points.max(axis=0)
    shift = -np.array([*(low[:2] + high[:2]) / 2, _lowest(bend, grid_xy[points[:, 2].argsort()[:40]], size)])
    return Sheet(name, width_mm, height_mm, lambda xy: bend(np.asarray(xy, np.float64)) + shift)


def _lowest(bend: Callable[[Floats], Floats], grid_xy: Floats, size: Floats) -> float:
    """Minimum height near the lowest points of a 2 mm grid, to a micrometre."""
    steps = np.stack(np.meshgrid(np.linspace(-1, 1, 9), np.linspace(-1, 1, 9)), axis=-1).reshape(1, -1, 2)
    reach = 2.0
    while reach > 1e-4:
        around = np.clip((grid_xy[:, None] + reach * steps).reshape(-1, 2), 0, size)
        heights = bend(around)[:, 2]
        grid_xy = around[heights.argsort()[:40]]
        reach /= 3
    return float(heights.min())
