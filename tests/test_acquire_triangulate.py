"""Rays of cameras and where they meet: truth from projecting known points."""

import numpy as np
import pytest

from planish.geometry import project
from planish.geometry.triangulation import meet_plane, rays
from planish.types import Camera

LENS = np.array([-0.22, -0.87, -0.0007, -0.0017, 3.1])  # of a real camera of 3450 px focal length


def camera_at(eye, turn_deg=0.0, distortion=LENS):
    """A camera that looks down on the table from `eye`."""
    a = np.radians(turn_deg)
    around = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])
    rotation = around @ np.diag([1.0, -1.0, -1.0])
    matrix = np.array([[3450.0, 0, 640], [0, 3440, 510], [0, 0, 1]])
    return Camera(matrix, rotation, -rotation @ np.asarray(eye, float), (1024, 1280), distortion)


@pytest.fixture
def spots():
    return np.random.default_rng(0).uniform([-100, -80, 0], [100, 80, 60], (400, 3))


@pytest.mark.parametrize(
    "distortion",
    [np.zeros(0), LENS, LENS[:4], np.array([-0.12, 0.1, 0.0006, -0.0004, 0, 0.02, 0.01, 0])],
    ids=["pinhole", "lens", "four numbers", "rational"],
)
def test_rays_run_through_the_points_that_were_projected(spots, distortion):
    camera = camera_at((5, -3, 650), 12, distortion)
    directions, eye = rays(camera, project(camera, spots))
    np.testing.assert_allclose(eye, (5, -3, 650), atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1, atol=1e-12)
    true = (spots - eye) / np.linalg.norm(spots - eye, axis=1, keepdims=True)
    np.testing.assert_allclose(directions, true, atol=1e-11)  # CLOSE_PX over the focal length


def test_pixels_that_are_not_known_have_no_ray_and_spoil_no_other(spots):
    camera = camera_at((0, 0, 650))
    xy = project(camera, spots)
    whole, _ = rays(camera, xy)
    xy[::3] = np.nan
    part, _ = rays(camera, xy)
    assert np.isnan(part[::3]).all()
    np.testing.assert_allclose(part[1::3], whole[1::3], atol=1e-11)


def test_rays_meet_the_plane_on_which_the_points_lay(spots):
    camera = camera_at((0, 0, 650), 30)
    spots[:, 2] = 20 + 0.3 * spots[:, 0] - 0.1 * spots[:, 1]
    directions, eye = rays(camera, project(camera, spots))
    np.testing.assert_allclose(meet_plane(eye, directions, np.array([0.3, -0.1, -1, 20])), spots, atol=1e-7)
    each = np.column_stack([np.zeros((len(spots), 2)), np.ones(len(spots)), -spots[:, 2]])  # z = its own height
    np.testing.assert_allclose(meet_plane(eye, directions, each), spots, atol=1e-7)


def test_a_plane_behind_the_camera_is_not_met():
    behind = meet_plane(np.zeros(3), np.array([[0.0, 0.0, 1.0]]), np.array([0.0, 0, 1, 5]))
    assert np.isnan(behind).all()
