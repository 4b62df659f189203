import numpy as np
import pytest

from planish.errors import UsageError
from planish.flatten import settle
from planish.flatten.verlet import fall, project, relax
from planish.mesh import topology
from planish.settings import VerletSettings
from planish.sticks import make_sticks
from planish.types import Mesh, Outcome
from reference import verlet_step
from shapes import arch, grid, rigid_rms


def sheet(rows=12, cols=12, bend=arch):
    uv, faces = grid(rows, cols)
    points = bend(uv)
    return uv, points, make_sticks(Mesh(points, faces), topology(faces, len(uv)))


def test_the_kernels_do_what_the_formulas_say():
    _, points, sticks = sheet(4, 5)
    x, before = points.copy(), points + 0.01
    slow_x, slow_before = x.copy(), before.copy()
    for _ in range(3):
        fall(x, before, 0.1, 9.81)
        for turn in range(4):
            relax(x, sticks.pairs, sticks.rest, sticks.weight, turn % 2 == 1)
            project(x)
        slow_x, slow_before = verlet_step(slow_x, slow_before, sticks.pairs, sticks.rest, 0.1, 9.81, 4)
    np.testing.assert_allclose(x, slow_x, atol=1e-10)
    np.testing.assert_allclose(before, slow_before, atol=1e-10)


def test_a_free_particle_falls_as_galileo_says():
    x, before = np.array([[0.0, 0.0, 100.0]]), np.array([[0.0, 0.0, 100.0]])
    for _ in range(10):
        fall(x, before, 0.1, 9.81)
    assert x[0, 2] == pytest.approx(100 - 9.81 * 0.01 * 55, abs=1e-9)  # 1 + 2 + ... + 10 = 55


def test_an_arched_sheet_comes_to_rest_at_its_true_size():
    uv, points, sticks = sheet()
    flat, outcome, _, residuals, heights = settle(points, sticks)
    assert outcome is Outcome.SETTLED
    assert heights[-1] == 0
    assert residuals[-1] < 1e-6
    chords = 2 * 60 * 11 * np.sin(200 / 11 / 120)  # eleven chords of the arc are all the mesh knows
    assert rigid_rms(flat[:, :2], uv * [chords / 200, 1]) < 1e-3


def test_flat_stays_flat():
    uv, points, sticks = sheet(bend=lambda uv: np.c_[uv, 0 * uv[:, :1]])
    flat, outcome, *_ = settle(points, sticks)
    assert outcome is Outcome.SETTLED
    assert np.abs(flat[:, :2] - uv).max() < 1e-6


def test_the_unit_of_length_does_not_matter():
    _, points, sticks = sheet()
    _, doubled, sticks_doubled = sheet(bend=lambda uv: 2 * arch(uv))
    np.testing.assert_allclose(settle(doubled, sticks_doubled)[0], 2 * settle(points, sticks)[0], atol=1e-9)


def test_running_out_of_steps_is_said():
    _, points, sticks = sheet()
    assert settle(points, sticks, VerletSettings(max_steps=3))[1] is Outcome.OUT_OF_STEPS


def test_a_step_beyond_all_numbers_ends_finite_and_is_said():
    _, points, sticks = sheet()
    flat, outcome, *_ = settle(points, sticks, VerletSettings(time_step=1e200))
    assert outcome is Outcome.DIVERGED
    assert np.isfinite(flat).all()


@pytest.mark.parametrize("bad", [{"time_step": 0.0}, {"rounds": 0}, {"gravity": -1.0}, {"tolerance": float("nan")}])
def test_settings_out_of_range_are_refused(bad):
    with pytest.raises(UsageError, match=next(iter(bad))):
        VerletSettings(**bad)
