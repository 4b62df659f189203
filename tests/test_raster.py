import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planish.mesh import rasterize
from shapes import grid


@given(st.integers(0, 10_000))
def test_agrees_with_asking_every_pixel_of_every_triangle(seed):
    rng = np.random.default_rng(seed)
    xy, faces = rng.uniform(-5, 25, (9, 2)), rng.integers(0, 9, (6, 3)).astype(np.int32)
    near = rng.uniform(1, 2, 9)
    face, weights = rasterize(xy, faces, (18, 22), nearness=near)
    best = np.full((18, 22), -np.inf)
    cols, rows = np.meshgrid(np.arange(22), np.arange(18))
    for corners in faces:
        solve = np.array([[*xy[i], 1] for i in corners]).T
        if abs(np.linalg.det(solve)) < 1e-6:
            continue
        w = np.einsum("ij,jrc->irc", np.linalg.inv(solve), np.array([cols, rows, 0 * rows + 1]))
        here = np.einsum("irc,i->rc", w, near[corners])
        best = np.where((w.min(0) >= 0) & (here > best), here, best)
    covered = face >= 0
    assert (covered != np.isfinite(best)).mean() < 0.01  # a pixel centre on an edge may count or not
    both = covered & np.isfinite(best)
    w = np.concatenate([1 - weights.sum(2, keepdims=True), weights], axis=2)[both]
    assert (w >= -1e-6).all()
    found = np.einsum("pk,pk->p", w, near[faces[face[both]]])
    assert (np.abs(found - best[both]) > 1e-4).sum() <= 0.01 * face.size


def test_a_sheet_has_no_seams_and_weights_give_back_the_place():
    uv, faces = grid(7, 5, width=31, height=47)
    turn = np.array([[0.8, -0.6], [0.6, 0.8]])
    xy = uv @ turn.T + [33.3, 5.5]
    face, w = rasterize(xy, faces, (64, 64))
    w = np.concatenate([1 - w.sum(2, keepdims=True), w], axis=2)
    rows, cols = np.nonzero(face >= 0)
    place = np.einsum("pk,pkd->pd", w[rows, cols], xy[faces[face[rows, cols]]])
    np.testing.assert_allclose(place, np.c_[cols, rows], atol=1e-4)  # float32 weights over 50 px
    assert len(rows) == pytest.approx(31 * 47, abs=80)  # the area, give or take half the outline
    inside = ((np.argwhere(face < 0)[:, ::-1] - [33.3, 5.5]) @ turn > 0.01) & (
        (np.argwhere(face < 0)[:, ::-1] - [33.3, 5.5]) @ turn < np.array([31, 47]) - 0.01
    )
    assert not inside.all(1).any()


def test_perspective_weights_are_linear_in_space():
    points = np.array([[0.0, 0, 1], [4, 0, 2], [0, 4, 4]])
    xy = 20 * points[:, :2] / points[:, 2:]
    face, w = rasterize(xy, np.array([[0, 1, 2]], np.int32), (30, 45), nearness=1 / points[:, 2], perspective=True)
    w = np.concatenate([1 - w.sum(2, keepdims=True), w], axis=2)[face >= 0]
    there = w @ points
    rows, cols = np.nonzero(face >= 0)
    np.testing.assert_allclose(20 * there[:, :2] / there[:, 2:], np.c_[cols, rows], atol=1e-4)


def test_bands_join_to_the_whole_and_points_that_are_not_finite_are_left_out():
    uv, faces = grid(4, 4, width=20, height=20)
    uv[5] = np.nan
    whole, _ = rasterize(uv, faces, (21, 21))
    bands = [rasterize(uv, faces, (7, 21), top=top)[0] for top in (0, 7, 14)]
    np.testing.assert_array_equal(np.concatenate(bands), whole)
    assert (whole >= 0).any()
    assert not np.isin(whole, np.flatnonzero((faces == 5).any(1))).any()
