"""Noise as large as the distance of the points, as real scanners of a wall leave it."""

import numpy as np
import pytest
from scipy import ndimage

from planish import flatten
from planish.mesh import grid_faces


def plane(rows, cols, spacing, noise, tilt=0.1, step=0.0):
    """A tilted plane seen by parallel rays: points, faces, and its true size."""
    x, y = np.meshgrid(np.arange(cols) * spacing, np.arange(rows) * spacing)
    z = tilt * x + noise
    z = np.rint(z / step) * step if step else z
    points = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
    faces = grid_faces(np.arange(rows * cols, dtype=np.int32).reshape(rows, cols), points)
    return points, faces, sorted([(rows - 1) * spacing, (cols - 1) * spacing * np.hypot(1, tilt)])


def blurred(shape, sigma, rng):
    field = ndimage.gaussian_filter(rng.standard_normal(shape), sigma, mode="wrap")
    return field / field.std()


# Before: 41.3 x 44.8 mm instead of 38.9 x 39.1, 42 x 63 instead of 39 x 59, 20 % too large.
@pytest.mark.parametrize(
    ("shape", "spacing", "sigma", "height", "step"),
    [((60, 60), 0.66, 0.0, 0.3, 1.0), ((60, 40), 1.0, 1.0, 0.5, 0.0), ((70, 50), 0.3, 1.5, 0.3, 0.0)],
)
def test_a_plane_under_strong_noise_has_its_size(shape, spacing, sigma, height, step):
    rng = np.random.default_rng(12)
    noise = height * (blurred(shape, sigma, rng) if sigma else rng.standard_normal(shape))
    points, faces, true = plane(*shape, spacing, noise, step=step)
    flat = flatten(points, faces)
    assert flat.outcome.name == "SETTLED"
    np.testing.assert_allclose(sorted(flat.size_mm), true, rtol=0.01)  # points at the border stay off by 0.1 mm
    expected = np.hypot(height, step / 12**0.5)
    assert expected / 2 < flat.noise_mm < 2 * expected


def test_rounding_alone_is_noise_of_a_step_over_the_root_of_twelve():
    points, faces, _ = plane(60, 60, 1.0, 0.0, tilt=0.37, step=0.5)
    flat = flatten(points, faces)
    assert flat.noise_mm > 0.5 * 0.5 / 12**0.5


def test_noise_that_is_white_nearby_and_shared_at_length_is_followed():
    """As of a depth camera before the two faces of a box, folded by a right angle, points 2 mm apart."""
    rng = np.random.default_rng(0)
    noise = 0.6 * rng.standard_normal((90, 70)) + 1.2 * blurred((90, 70), 1.5, rng)
    points, faces, true = plane(90, 70, 2.0, noise, tilt=0.0)
    along = (points[:, 1] - 89) / 2**0.5
    points[:, 1], points[:, 2] = along, points[:, 2] - np.abs(along)
    flat = flatten(points, faces)
    np.testing.assert_allclose(sorted(flat.size_mm)[::-1], sorted(true)[::-1], rtol=0.015)  # 3.5 % too long before
    assert 0.6 < flat.noise_mm < 2.7  # 1.34 in truth
