import numpy as np
import pytest

from planish.mesh import topology
from planish.sticks import make_sticks
from planish.types import Mesh
from shapes import arch, grid


def sticks_of(points, faces, lengths="unfolded"):
    mesh = Mesh(points, faces)
    return make_sticks(mesh, topology(mesh.faces, len(points)), lengths)


@pytest.mark.parametrize("lengths", ["straight", "unfolded"])
def test_a_flat_sheet_fulfils_its_own_sticks(lengths):
    uv, faces = grid(5, 7)
    sticks = sticks_of(np.c_[uv, 0 * uv[:, :1]], faces, lengths)
    flat = np.linalg.norm(uv[sticks.pairs[:, 1]] - uv[sticks.pairs[:, 0]], axis=1)
    np.testing.assert_allclose(sticks.rest, flat, rtol=1e-12)


def test_there_is_one_bending_stick_for_every_inner_edge():
    uv, faces = grid(5, 7)
    sticks = sticks_of(np.c_[uv, 0 * uv[:, :1]], faces)
    inner = 3 * len(faces) - sticks.edges  # every edge is counted once, inner ones twice
    assert len(sticks.rest) - sticks.edges == inner


def test_unfolded_is_true_across_a_sharp_fold_where_straight_is_too_short():
    uv, faces = grid(2, 3, width=20, height=10)  # two squares, folded by a right angle along x = 10
    right = uv[:, 0] > 10
    folded = np.c_[np.minimum(uv[:, 0], 10), uv[:, 1], np.where(right, uv[:, 0] - 10, 0)]
    flat = np.c_[uv, 0 * uv[:, :1]]
    np.testing.assert_allclose(sticks_of(folded, faces).rest, sticks_of(flat, faces).rest, rtol=1e-12)
    assert (sticks_of(folded, faces, "straight").rest < sticks_of(flat, faces).rest - 1).any()


def test_the_two_agree_on_a_smooth_sheet_to_second_order():
    gaps = []
    for n in (20, 40):
        uv, faces = grid(n, n)
        bent = arch(uv)
        gaps.append(np.abs(sticks_of(bent, faces).rest / sticks_of(bent, faces, "straight").rest - 1).max())
    assert gaps[1] < 0.3 * gaps[0]  # half the spacing, about a quarter of the gap
