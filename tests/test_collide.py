import numpy as np
import pytest

from planish.flattening import simulate_verlet
from planish.flattening.collide import REACH, keep_apart, near_pairs, over_face
from planish.mesh import neighbours, topology
from planish.settings import VerletSettings
from planish.sticks import make_sticks
from planish.types import Mesh, Outcome
from shapes import grid


def hairpin(gap):
    """A strip laid back over itself: lower layer on the table, half a turn, upper layer `gap` above, running back."""
    uv, faces = grid(9, 41, 200.0, 40.0)
    r, s = gap / 2, uv[:, 0]
    bend = np.pi * r
    t = np.clip((s - 100) / r, 0, np.pi)
    x = np.where(s < 100, s, np.where(s < 100 + bend, 100 + r * np.sin(t), 100 - (s - 100 - bend)))
    z = np.where(s < 100, 0, np.where(s < 100 + bend, r - r * np.cos(t), gap))
    return uv, Mesh(np.c_[x, uv[:, 1], z], faces)


@pytest.mark.slow
def test_near_pairs_are_those_that_asking_everybody_finds():
    rng = np.random.default_rng(4)
    x = rng.uniform(0, 4, (60, 3))
    faces = np.array([rng.choice(60, 3, replace=False) for _ in range(40)], np.int32)
    start, around = neighbours(topology(faces, 60).edges, 60)
    pairs, side = near_pairs(x, faces, start, around)
    wanted = {}
    for f, corners in enumerate(faces):
        for i in range(60):
            height, *w = over_face(x, i, faces, f)
            inside_box = all(
                abs(np.clip(x[i, k], x[corners, k].min(), x[corners, k].max()) - x[i, k]) <= REACH for k in range(3)
            )
            ring = set(around[start[i] : start[i + 1]]) | {i}
            if inside_box and abs(height) <= REACH and min(w) >= -0.5 and not ring & set(corners):
                wanted[i, f] = np.sign(height)
    found = {(int(i), int(f)): s for (i, f), s in zip(pairs, side, strict=True)}
    assert wanted
    assert wanted.items() <= found.items()  # cells reach farther than the box, so more may be watched


def test_over_face_gives_height_and_foot():
    x = np.array([[0.0, 0, 0], [2, 0, 0], [0, 2, 0], [0.5, 0.25, 3]])
    faces = np.array([[0, 1, 2]], np.int32)
    assert over_face(x, 3, faces, 0) == pytest.approx((3, 1 - 0.25 - 0.125, 0.25, 0.125))


@pytest.mark.slow
def test_a_point_too_near_is_pushed_to_its_side_and_no_momentum_is_made():
    x = np.array([[0.0, 0, 0], [2, 0, 0], [0, 2, 0], [0.5, 0.5, -0.1]])
    was = x.copy()
    faces, pair = np.array([[0, 1, 2]], np.int32), np.array([[3, 0]], np.int32)
    keep_apart(x, faces, pair, np.array([1.0]), 0.2)
    height, *_ = over_face(x, 3, faces, 0)
    assert height == pytest.approx(0.2, abs=0.02)  # the face turns a little while it yields
    np.testing.assert_allclose(x.mean(0), was.mean(0), atol=1e-12)


@pytest.mark.slow
def test_layers_that_lie_over_each_other_are_kept_apart_or_the_report_says_so():
    uv, mesh = hairpin(12.0)
    sticks = make_sticks(mesh, topology(mesh.faces, len(uv)), "unfolded")
    heavy = {"gravity": 40.0, "max_steps": 400}
    free = simulate_verlet(mesh, sticks, VerletSettings(**heavy))
    apart = simulate_verlet(mesh, sticks, VerletSettings(self_collision=True, thickness_mm=1.0, **heavy))
    assert free.passed.sum() > 10
    assert apart.passed.sum() == 0
    assert apart.outcome is not Outcome.DIVERGED
