"""Depths along the axis or along the rays: the table around the sheet tells when they are read the wrong way."""

import numpy as np
import pytest

from planish.acquire.range_image.depth import along_axis, from_depth
from planish.acquire.range_image.ray_check import depth_direction_warnings
from planish.gallery import sheet
from planish.gallery.devices import depth_capture

MADE = depth_capture(sheet("book"), frames=4, shape_rc=(240, 320), photo_px=(800, 600))
COSINE = along_axis(np.ones((240, 320)), MADE.camera)


def codes(frames, along):
    acquired = from_depth(frames, MADE.camera, MADE.photo, MADE.photo_camera, depth_along=along)
    return [(w.code, w.hint) for w in acquired.warnings if w.code == "depth-direction"]


def test_depths_that_are_read_right_are_not_doubted():
    assert codes(MADE.frames, "z") == []
    assert codes([frame / COSINE for frame in MADE.frames], "ray") == []


def test_distances_along_rays_are_noticed_and_so_is_the_reverse():
    assert codes([frame / COSINE for frame in MADE.frames], "z") == [("depth-direction", "set {depth_along=ray}")]
    assert codes(MADE.frames, "ray") == [("depth-direction", "set {depth_along=z}")]


@pytest.mark.parametrize("along", ["z", "ray"])
def test_without_ground_nothing_is_said(along):
    assert depth_direction_warnings(MADE.frames[0], MADE.camera, np.zeros((240, 320), bool), along) == []
