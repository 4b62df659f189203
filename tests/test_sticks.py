import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planish.geometry.distances import distances
from planish.mesh import topology
from planish.parallel import thread_pool
from planish.sticks import bending_pairs, make_sticks, unfolded_distance
from planish.surface.flipped_faces import flipped_by_noise
from planish.types import Mesh
from shapes import arch, grid


def sticks_of(points, faces, lengths="unfolded"):
    mesh = Mesh(points, faces)
    return make_sticks(mesh, topology(mesh.faces, len(points)), lengths)


def upright(uv):
    return np.c_[uv, 0 * uv[:, :1]]


@pytest.mark.parametrize("lengths", ["straight", "unfolded", "smooth"])
def test_a_flat_sheet_fulfils_its_own_sticks(lengths):
    uv, faces = grid(5, 7)
    sticks = sticks_of(upright(uv), faces, lengths)
    np.testing.assert_allclose(sticks.rest, distances(uv, sticks.pairs), rtol=1e-12)


def test_edges_come_first_then_one_bending_stick_for_every_inner_edge():
    uv, faces = grid(5, 7)
    sticks = sticks_of(upright(uv), faces)
    inner = 3 * len(faces) - sticks.edges  # every edge is counted once, inner ones twice
    assert len(sticks.rest) - sticks.edges == inner
    np.testing.assert_array_equal(sticks.pairs[: sticks.edges], topology(faces, len(uv)).edges)


def test_bending_sticks_join_the_corners_opposite_to_their_edge():
    faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 4]], np.int32)
    topo = topology(faces, 5)
    corners, edge = bending_pairs(faces, topo)
    assert {tuple(topo.edges[e]): set(c.tolist()) for e, c in zip(edge, corners, strict=True)} == {
        (0, 1): {2, 3},
        (1, 2): {0, 4},
    }


def test_unfolded_is_true_across_a_sharp_fold_where_straight_is_too_short():
    uv, faces = grid(2, 3, width=20, height=10)  # two squares, folded by a right angle along x = 10
    right = uv[:, 0] > 10
    folded = np.c_[np.minimum(uv[:, 0], 10), uv[:, 1], np.where(right, uv[:, 0] - 10, 0)]
    np.testing.assert_allclose(sticks_of(folded, faces).rest, sticks_of(upright(uv), faces).rest, rtol=1e-12)
    assert (sticks_of(folded, faces, "straight").rest < sticks_of(upright(uv), faces).rest - 1).any()


def test_the_two_agree_on_a_smooth_sheet_to_second_order():
    gaps = []
    for n in (20, 40):
        uv, faces = grid(n, n)
        bent = arch(uv)
        gaps.append(np.abs(sticks_of(bent, faces).rest / sticks_of(bent, faces, "straight").rest - 1).max())
    assert gaps[1] < 0.3 * gaps[0]  # half the spacing, about a quarter of the gap


def unfolded_in_space(points, edges, corners):
    """The same from the points: x along the edge from its first end, h across it."""
    origin = points[edges[:, 0]]
    along = points[edges[:, 1]] - origin
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    arms = points[corners] - origin[:, None]
    x = np.einsum("bij,bj->bi", arms, along)
    h = np.linalg.norm(arms - x[..., None] * along[:, None], axis=2)
    return np.hypot(x[:, 0] - x[:, 1], h.sum(axis=1))


@pytest.mark.slow
@given(seed=st.integers(0, 10_000))
def test_unfolding_from_lengths_is_unfolding_in_space(seed):
    rng = np.random.default_rng(seed)
    uv, faces = grid(4, 5)
    points = upright(uv) + 15 * rng.standard_normal((len(uv), 3))
    topo = topology(faces, len(uv))
    corners, edge = bending_pairs(faces, topo)
    got = unfolded_distance(distances(points, topo.edges), edge, faces, topo)
    # A corner's height comes from Heron's formula: of 1e-16 of the area squared, so 1e-8 where a triangle is flat.
    np.testing.assert_allclose(got, unfolded_in_space(points, topo.edges[edge], corners), rtol=1e-7)


def test_lengths_that_close_to_no_triangle_count_as_one_without_height():
    faces = np.array([[0, 1, 2], [1, 0, 3]], np.int32)
    topo = topology(faces, 4)  # edges 01 02 03 12 13
    _, edge = bending_pairs(faces, topo)
    for rest, apart in (
        ([1.0, 0.2, 0.2, 0.3, 0.3], 0.0),
        ([0.0, 2.0, 3.0, 2.0, 3.0], 5.0),
        ([4.0, 1.0, 1.0, 5.0, 3.0], 2.0),
    ):
        got = unfolded_distance(np.array(rest), edge, faces, topo)
        assert got == pytest.approx(apart, abs=1e-12)


def test_clean_sticks_all_count_alike_and_raw_ones_know_no_noise():
    uv, faces = grid(12, 9)
    smooth = sticks_of(upright(uv), faces, "smooth")
    np.testing.assert_array_equal(smooth.weight, 1)
    assert smooth.noise_mm.max() < 1e-6
    assert sticks_of(upright(uv), faces).noise_mm is None


def moved_within_the_plane():
    """A flat sheet some of whose faces were turned over, as noise along the sheet does it; and which."""
    uv, faces = grid(12, 9)
    rng = np.random.default_rng(4)
    xy = uv + 0.35 * (uv[1] - uv[0]).max() * rng.standard_normal(uv.shape)
    a, b, c = (xy[faces[:, k]] for k in range(3))
    return xy, faces, (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0] < 0


def test_bending_sticks_across_faces_that_noise_turned_over_are_as_long_as_on_the_sheet():
    xy, faces, turned = moved_within_the_plane()
    assert turned.sum() > 3
    topo = topology(faces, len(xy))
    corners, edge = bending_pairs(faces, topo)
    got = unfolded_distance(distances(xy, topo.edges), edge, faces, topo, turned)
    np.testing.assert_allclose(got, distances(xy, corners), atol=1e-6)  # heights from Heron's formula: see above


def test_faces_that_noise_turned_over_are_told_by_the_normals_of_all_three_corners():
    xy, faces, turned = moved_within_the_plane()
    normals = np.tile(np.float32([0, 0, 1]), (len(xy), 1))
    with thread_pool() as parallel_for:
        np.testing.assert_array_equal(flipped_by_noise(upright(xy), faces, normals, parallel_for), turned)
        normals[faces[turned][0, 1]] = [0, 0, -1]
        assert not flipped_by_noise(upright(xy), faces, normals, parallel_for)[turned][0]
