import numpy as np
import pytest

from planish import gallery
from planish.errors import UsageError
from planish.flattening import flatten, simulate_verlet
from planish.flattening.verlet import fall, project, satisfy_constraints
from planish.mesh import topology
from planish.settings import FlattenSettings, VerletSettings
from planish.sticks import make_sticks
from planish.types import Mesh, Outcome
from reference import verlet_step
from shapes import arch, grid, rigid_rms


def sheet(rows=12, cols=12, bend=arch):
    uv, faces = grid(rows, cols)
    mesh = Mesh(bend(uv), faces)
    return uv, mesh, make_sticks(mesh, topology(faces, len(uv)), "unfolded")


@pytest.mark.slow
def test_the_kernels_do_what_the_formulas_say():
    _, mesh, sticks = sheet(4, 5)
    x, before = mesh.points.copy(), mesh.points + 0.01
    slow_x, slow_before = x.copy(), before.copy()
    for _ in range(3):
        fall(x, before, 0.1, 9.81)
        for turn in range(4):
            satisfy_constraints(x, sticks.pairs, sticks.rest, sticks.weight, turn % 2 == 1)
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
    uv, mesh, sticks = sheet()
    done = simulate_verlet(mesh, sticks)
    assert done.outcome is Outcome.SETTLED
    assert done.heights[-1] == 0
    assert done.residuals[-1] < 1e-6
    assert not done.passed.any()
    chords = 2 * 60 * 11 * np.sin(200 / 11 / 120)  # eleven chords of the arc are all the mesh knows
    assert rigid_rms(done.points[:, :2], uv * [chords / 200, 1]) < 1e-3


def test_flat_stays_flat():
    uv, mesh, sticks = sheet(bend=lambda uv: np.c_[uv, 0 * uv[:, :1]])
    done = simulate_verlet(mesh, sticks)
    assert done.outcome is Outcome.SETTLED
    assert np.abs(done.points[:, :2] - uv).max() < 1e-6


def test_the_unit_of_length_does_not_matter():
    _, mesh, sticks = sheet()
    _, doubled, sticks_doubled = sheet(bend=lambda uv: 2 * arch(uv))
    np.testing.assert_allclose(
        simulate_verlet(doubled, sticks_doubled).points, 2 * simulate_verlet(mesh, sticks).points, atol=1e-9
    )


def test_running_out_of_steps_is_said():
    _, mesh, sticks = sheet()
    assert simulate_verlet(mesh, sticks, VerletSettings(max_steps=3)).outcome is Outcome.OUT_OF_STEPS


def test_a_step_beyond_all_numbers_ends_finite_and_is_said():
    _, mesh, sticks = sheet()
    done = simulate_verlet(mesh, sticks, VerletSettings(time_step=1e200))
    assert done.outcome is Outcome.DIVERGED
    assert np.isfinite(done.points).all()


@pytest.mark.parametrize("bad", [{"time_step": 0.0}, {"rounds": 0}, {"gravity": -1.0}, {"tolerance": float("nan")}])
def test_settings_out_of_range_are_refused(bad):
    with pytest.raises(UsageError, match=next(iter(bad))):
        VerletSettings(**bad)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["book", "letter", "spread", "miura"])
def test_it_settles_where_the_least_energy_lies(name):
    """The same 1,000 points and sticks by both methods; 0.01 to 0.02 mm apart where folds are cut short."""
    mesh, _ = gallery.sheet_mesh(gallery.sheet(name), 20_000, noise_mm=0.05)
    found = topology(mesh.faces, len(mesh.points))
    settled, least = (
        flatten(mesh, found, FlattenSettings(method=method, points=1000)) for method in ("verlet", "multigrid")
    )
    assert settled.outcome is Outcome.SETTLED
    assert rigid_rms(settled.page_xy, least.page_xy) < 0.05
