"""A sheet bent about one direction and seen through a pinhole: the model of a page on a photo.

The camera stands at (0, 0, -1); the sheet passes through the origin, so lengths are in distances of the camera. Before
it is bent the sheet is the plane (a, b): a runs along the profile (X(a), Z(a)), where X' = cos turn(a) and
Z' = sin turn(a), so that a is a length of paper; b runs along the straight rulings, which are parallel to y. Lines of
text run at an angle to a: 0 for a bound book, 90 degrees for a letter folded in three.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.interpolate import BSpline

from planish.types import Bools, Floats

NODES = 257
"""Of the profile, over the sheet: straight between them, 1/250 of the page apart."""
REACH = 0.6
"""The profile goes on so far beyond its span, in parts of it."""
STEEPEST = np.radians(80)
"""The sheet turns no further from the first direction than so; beyond it would hide itself."""


@dataclass(frozen=True, eq=False)
class Cylinder:
    """A bent sheet and its camera.

    Attributes
    ----------
    camera : (2,) float64 [rad]
        How the camera is turned against the sheet's frame (x right, y down, z away): first about x, then about its own
        axis. It looks at the ruling through the origin, which is what makes that the origin.
    lean : float [rad]
        Direction of the lines of text on the sheet, from a towards b.
    turns : (k,) float64 [rad]
        Coefficients of the profile's angle, a cubic spline of a.
    span : (float, float)
        Of a, over which the spline bends; straight beyond.
    focal : float [px]
    centre : (2,) float64 [px]
        Of the photo.
    """

    camera: Floats
    lean: float
    turns: Floats
    span: tuple[float, float]
    focal: float
    centre: Floats

    @property
    def rotation(self) -> Floats:
        """(3, 3), sheet to camera."""
        (cp, cr), (sp, sr) = np.cos(self.camera), np.sin(self.camera)
        about_x = np.array([[1, 0, 0], [0, cp, -sp], [0, sp, cp]])
        return np.array([[cr, -sr, 0], [sr, cr, 0], [0, 0, 1]]) @ about_x

    @property
    def profile(self) -> tuple[Floats, Floats, Floats]:
        """Nodes: a, X(a), Z(a), a little beyond the span."""
        low, high = self.span
        place, basis = _nodes(len(self.turns))
        a = low + place * (high - low)
        turn = np.clip(basis @ self.turns, -STEEPEST, STEEPEST)
        middle, step = (turn[1:] + turn[:-1]) / 2, a[1] - a[0]
        x, z = (np.concatenate([[0], np.cumsum(part * step)]) for part in (np.cos(middle), np.sin(middle)))
        return a, x - np.interp(0, a, x), z - np.interp(0, a, z)

    def turn(self, a: Floats) -> Floats:
        """Angle of the profile [rad] at places a."""
        place, basis = _nodes(len(self.turns))
        return np.interp((a - self.span[0]) / (self.span[1] - self.span[0]), place, basis @ self.turns)

    def turned_lines(self) -> Floats:
        """(2, 2): (along, across) of the lines of text = matrix @ (a, b)."""
        c, s = np.cos(self.lean), np.sin(self.lean)
        return np.array([[c, s], [-s, c]])


@lru_cache
def _nodes(count: int) -> tuple[Floats, Floats]:
    """Places of the profile's nodes, 0 and 1 at the ends of its span, and the splines there: (nodes, count)."""
    place = np.linspace(-REACH, 1 + REACH, int((1 + 2 * REACH) * NODES))
    return place, _basis(place, count)


def _basis(place: Floats, count: int) -> Floats:
    """Cubic B-splines on even knots from 0 to 1, constant beyond: (n, count)."""
    knots = np.concatenate([[0, 0, 0], np.linspace(0, 1, count - 2), [1, 1, 1]])
    return np.asarray(BSpline(knots, np.eye(count), 3)(np.clip(place, 0, 1)))


def seen_at(sheet: Cylinder, photo_xy: Floats) -> tuple[Floats, Bools]:
    """Find the places of the sheet that are seen at places of the photo.

    Parameters
    ----------
    sheet : Cylinder
    photo_xy : (n, 2) float64 [photo px]

    Returns
    -------
    page : (n, 2) float64
        Along and across the lines of text, in distances of the camera.
    good : (n,) bool
        Where the ray meets the sheet.
    """
    rays = np.c_[(photo_xy - sheet.centre) / sheet.focal, np.ones(len(photo_xy))] @ sheet.rotation
    a, x, z = sheet.profile
    forward = z > -0.9
    sight = np.maximum.accumulate(np.where(forward, x / np.where(forward, z + 1, 1), -np.inf))
    toward = rays[:, 2] > 1e-6
    slope = rays[:, 0] / np.where(toward, rays[:, 2], 1)
    found = np.interp(slope, sight, a)
    depth = np.interp(found, a, z) + 1
    b = depth * rays[:, 1] / np.where(toward, rays[:, 2], 1)
    good = toward & (slope > sight[0]) & (slope < sight[-1])
    return np.stack([found, b], axis=1) @ sheet.turned_lines().T, good


def in_space(sheet: Cylinder, page: Floats) -> Floats:
    """Places of the sheet, along and across the lines of text, in the sheet's frame: (n, 3)."""
    ab = page @ sheet.turned_lines()
    a, x, z = sheet.profile
    along = np.clip(ab[:, 0], a[0], a[-1])
    beyond, turn = ab[:, 0] - along, np.interp(along, a[[0, -1]], np.clip(sheet.turn(a[[0, -1]]), -STEEPEST, STEEPEST))
    return np.stack(
        [np.interp(along, a, x) + beyond * np.cos(turn), ab[:, 1], np.interp(along, a, z) + beyond * np.sin(turn)],
        axis=1,
    )


def on_photo(sheet: Cylinder, points: Floats) -> Floats:
    """Where points (n, 3) of the sheet's frame are seen: (n, 2) [photo px]."""
    seen = (points + [0, 0, 1]) @ sheet.rotation.T
    return np.asarray(sheet.centre + sheet.focal * seen[:, :2] / seen[:, 2:])
