"""Generalised cylinder seen by a pinhole camera: the model of a page on a photo.

The camera centre is (0, 0, -1) and the sheet passes through the origin: the unit of length is the camera distance. The
flat sheet has coordinates (a, b). a is arc length along the profile (X(a), Z(a)) with X' = cos angle(a) and
Z' = sin angle(a); b runs along the straight rulings, parallel to y. Text lines run at an angle to a: 0 in a bound book,
90 degrees in a letter folded in three.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.interpolate import BSpline

from planish.types import Bools, Floats

NODES = 257
"""Nodes of the polygonal profile over the sheet, 1/250 of the page apart."""
REACH = 0.6
"""Length of the profile beyond each end of its span, as a share of the span."""
STEEPEST = np.radians(80)
"""Largest profile angle; a steeper sheet would occlude itself."""


@dataclass(frozen=True, eq=False)
class Cylinder:
    """A curved sheet and its camera.

    Attributes
    ----------
    camera : (2,) float64 [rad]
        Camera rotation in the sheet's frame (x right, y down, z away): about x, then about the optical axis, which
        meets the ruling through the origin.
    text_angle : float [rad]
        Direction of the lines of text on the sheet, from a towards b.
    angle_coefficients : (k,) float64 [rad]
        Coefficients of the profile's angle, a cubic spline of a.
    span : (float, float)
        Range of a covered by the spline; the profile is straight beyond.
    focal : float [px]
    centre : (2,) float64 [px]
        Principal point of the photo.
    """

    camera: Floats
    text_angle: float
    angle_coefficients: Floats
    span: tuple[float, float]
    focal: float
    centre: Floats

    @property
    def rotation(self) -> Floats:
        """Rotation from the sheet's frame to the camera's: (3, 3)."""
        return _rotations(self.camera[None])[0]

    @property
    def profile(self) -> tuple[Floats, Floats, Floats]:
        """Nodes of the profile: a, X(a), Z(a), extended beyond the span."""
        a, x, z = _profiles(self.span, self.angle_coefficients[None])
        return a, x[0], z[0]

    def angle(self, a: Floats) -> Floats:
        """Angle of the profile [rad] at arc lengths a."""
        position, basis = _nodes(len(self.angle_coefficients))
        return np.interp((a - self.span[0]) / (self.span[1] - self.span[0]), position, basis @ self.angle_coefficients)

    def text_axes(self) -> Floats:
        """Matrix (2, 2) from (a, b) to (along, across) the text lines."""
        c, s = np.cos(self.text_angle), np.sin(self.text_angle)
        return np.array([[c, s], [-s, c]])


@lru_cache
def _nodes(count: int) -> tuple[Floats, Floats]:
    """Node positions, 0 and 1 at the ends of the span, and the B-spline basis there: (nodes, count)."""
    position = np.linspace(-REACH, 1 + REACH, int((1 + 2 * REACH) * NODES))
    return position, _basis(position, count)


def _basis(position: Floats, count: int) -> Floats:
    """Cubic B-spline basis with uniform knots on 0 to 1, constant beyond: (n, count)."""
    knots = np.concatenate([[0, 0, 0], np.linspace(0, 1, count - 2), [1, 1, 1]])
    return np.asarray(BSpline(knots, np.eye(count), 3)(np.clip(position, 0, 1)))


def _rotations(camera: Floats) -> Floats:
    """Rotations (k, 3, 3) of cameras (k, 2)."""
    (cp, cr), (sp, sr) = np.cos(camera).T, np.sin(camera).T
    zero = np.zeros_like(cp)
    return np.stack([cr, -sr * cp, sr * sp, sr, cr * cp, -cr * sp, zero, sp, cp], axis=1).reshape(-1, 3, 3)


def _profiles(span: tuple[float, float], angle_coefficients: Floats) -> tuple[Floats, Floats, Floats]:
    """Nodes of profiles over one span, from their coefficients (k, count): a (nodes,), X and Z (k, nodes)."""
    low, high = span
    position, basis = _nodes(angle_coefficients.shape[1])
    a = low + position * (high - low)
    angle = np.clip(angle_coefficients @ basis.T, -STEEPEST, STEEPEST)
    middle, step = (angle[:, 1:] + angle[:, :-1]) / 2, a[1] - a[0]
    sums = np.zeros((2, *angle.shape))
    np.cumsum(np.cos(middle) * step, axis=1, out=sums[0, :, 1:])
    np.cumsum(np.sin(middle) * step, axis=1, out=sums[1, :, 1:])
    node = float(np.interp(0.0, a, np.arange(len(a))))
    at = min(int(node), len(a) - 2)
    share = node - at
    x, z = sums - ((1 - share) * sums[:, :, at] + share * sums[:, :, at + 1])[..., None]
    return a, x, z


def photo_to_page(cylinder: Cylinder, photo_xy: Floats) -> tuple[Floats, Bools]:
    """Intersect the rays of photo positions with the sheet.

    Parameters
    ----------
    cylinder : Cylinder
    photo_xy : (n, 2) float64 [photo px]

    Returns
    -------
    page : (n, 2) float64
        Along and across the text lines, in camera distances.
    good : (n,) bool
        Whether the ray meets the sheet.
    """
    page, good = photo_to_pages([cylinder], photo_xy)
    return page[0], good[0]


def photo_to_pages(cylinders: Sequence[Cylinder], photo_xy: Floats) -> tuple[Floats, Bools]:
    """`photo_to_page` of k cylinders with one span, focal length and centre: (k, n, 2) and (k, n)."""
    one = cylinders[0]
    rotations = _rotations(np.array([cylinder.camera for cylinder in cylinders]))
    rays = np.moveaxis(((photo_xy - one.centre) / one.focal) @ rotations[:, :2] + rotations[:, 2:], 2, 0)
    a, x, z = _profiles(one.span, np.array([cylinder.angle_coefficients for cylinder in cylinders]))
    forward = z > -0.9
    slope_of_node = np.maximum.accumulate(np.where(forward, x / np.where(forward, z + 1, 1), -np.inf), axis=1)
    toward = rays[2] > 1e-6
    ahead = np.where(toward, rays[2], 1)
    slope = rays[0] / ahead
    found = np.stack([np.interp(at, node, a) for at, node in zip(slope, slope_of_node, strict=True)])
    depth = np.stack([np.interp(at, a, node) for at, node in zip(found, z, strict=True)]) + 1
    b = depth * rays[1] / ahead
    good = toward & (slope > slope_of_node[:, :1]) & (slope < slope_of_node[:, -1:])
    axes = np.array([cylinder.text_axes() for cylinder in cylinders])
    return np.stack([found, b], axis=2) @ axes.transpose(0, 2, 1), good


def page_to_space(cylinder: Cylinder, page: Floats) -> Floats:
    """Map page positions, along and across the text lines, to points (n, 3) in the sheet's frame."""
    ab = page @ cylinder.text_axes()
    a, x, z = cylinder.profile
    along = np.clip(ab[:, 0], a[0], a[-1])
    beyond, angle = (
        ab[:, 0] - along,
        np.interp(along, a[[0, -1]], np.clip(cylinder.angle(a[[0, -1]]), -STEEPEST, STEEPEST)),
    )
    return np.stack(
        [
            np.interp(along, a, x) + beyond * np.cos(angle),
            ab[:, 1],
            np.interp(along, a, z) + beyond * np.sin(angle),
        ],
        axis=1,
    )


def space_to_photo(cylinder: Cylinder, points: Floats) -> Floats:
    """Project points (n, 3) of the sheet's frame onto the photo: (n, 2) [photo px]."""
    seen = (points + [0, 0, 1]) @ cylinder.rotation.T
    return np.asarray(cylinder.centre + cylinder.focal * seen[:, :2] / seen[:, 2:])
