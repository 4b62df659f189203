import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planish.errors import InputError, UsageError
from planish.flattening import flatten, simulate_mass_spring
from planish.flattening.mass_spring import move, pull, weigh
from planish.flattening.quad_mesh import make_quad_mesh, quad_mesh_springs
from planish.gallery import sheet, sheet_mesh
from planish.mesh import area_vectors, topology
from planish.settings import FlattenSettings, MassSpringSettings
from planish.types import Mesh, Outcome
from reference import euler_step
from shapes import arch, grid, rigid_rms


def upright(uv):
    """An arch whose sides stay short of the vertical, so that all of it is seen from above."""
    return arch(uv, 90.0)


def net(count=120, bend=upright, lengths="unfolded"):
    uv, faces = grid(60, 45)
    lattice = make_quad_mesh(Mesh(bend(uv), faces), count)
    return lattice, lattice.coarse.mesh, quad_mesh_springs(lattice, lengths)


def flat_sheet(uv):
    return np.c_[uv, 0 * uv[:, :1]]


def step(x, v, pairs, rest, s):
    force = np.empty_like(x)
    pull(x, v, pairs, rest, s.stiffness, s.damping, force)
    weigh(v, s.mass, s.gravity, s.drag, force)
    return move(x, v, force, s.mass, s.time_step, s.restitution)


def alone(height, speed, **settings):
    """One mass after one step: (height, upward speed)."""
    x, v = np.array([[0.0, 0, height]]), np.array([[0.0, 0, speed]])
    settings = MassSpringSettings(**{"drag": 0.0, "gravity": 1e-12, **settings})
    step(x, v, np.zeros((0, 2), np.int32), np.zeros(0), settings)
    return x[0, 2], v[0, 2]


class TestKernels:
    def test_they_do_what_the_formulas_say(self):
        _, mesh, springs = net(30)
        rng = np.random.default_rng(0)
        x = mesh.points / 30 + rng.normal(scale=0.1, size=mesh.points.shape)
        v = rng.normal(scale=20, size=x.shape)  # some of the masses near the plane will hit it
        x[:, 2] = np.abs(x[:, 2]) * rng.random(len(x)) ** 4
        slow_x, slow_v, struck = x.copy(), v.copy(), 0
        settings = MassSpringSettings(stiffness=200.0, time_step=0.004, mass=1.5)
        for _ in range(10):
            struck += (slow_x[:, 2] + slow_v[:, 2] * settings.time_step < 0).sum()
            step(x, v, springs.pairs, springs.rest / 30, settings)
            slow_x, slow_v = euler_step(slow_x, slow_v, springs.pairs, springs.rest / 30, settings)
        assert struck >= 10
        np.testing.assert_allclose(x, slow_x, atol=1e-10)
        np.testing.assert_allclose(v, slow_v, atol=1e-8)

    @pytest.mark.slow
    def test_an_explicit_step_moves_before_it_speeds_up(self):
        assert alone(1.0, 0.0, gravity=9.81, time_step=0.1) == pytest.approx((1.0, -0.981))

    def test_a_mass_bounces_at_the_time_of_its_contact(self):
        # 10 down from 0.005: contact after half of the step of 0.001; the other half upwards at 0.4 of the speed.
        assert alone(0.005, -10.0, restitution=0.4, time_step=0.001) == pytest.approx((0.4 * 0.005, 4.0))

    def test_a_mass_on_the_plane_stays_there(self):
        assert alone(0.0, 0.0, gravity=9.81) == (0.0, 0.0)

    def test_without_damping_euler_steps_add_energy(self):
        """Two masses on a spring swing at w^2 = 2 k / m; each explicit step multiplies their energy by 1 + w^2 dt^2."""
        settings = MassSpringSettings(stiffness=50.0, damping=0.0, drag=0.0, gravity=1e-12, time_step=0.01)
        x, v = np.array([[0.0, 0, 5], [1.0, 0, 5]]), np.array([[-0.1, 0, 0], [0.1, 0, 0]])
        rest, pairs, steps = np.array([1.0]), np.array([[0, 1]], np.int32), 40

        def energy():
            return (v**2).sum() / 2 + 50.0 * (x[1, 0] - x[0, 0] - 1) ** 2 / 2

        before = energy()
        for _ in range(steps):
            step(x, v, pairs, rest, settings)
        assert energy() / before == pytest.approx((1 + 2 * 50.0 * 0.01**2) ** steps, rel=1e-9)


class TestDrop:
    def test_an_arched_net_comes_to_rest_at_its_size(self):
        _, mesh, springs = net()
        done = simulate_mass_spring(mesh, springs)
        assert done.outcome is Outcome.SETTLED
        assert done.heights[-1] == pytest.approx(0, abs=0.03)
        # Chords of 20 mm, and up to 40 on the slopes, over an arc of 90 mm are shorter than it by 0.2 to 0.8 %; the
        # outermost nodes lie 1.5 edges of the scan, 7 mm on the slope, within the sheet.
        assert 180 < np.ptp(done.points[:, 0]) < 200

    def test_steps_too_long_for_the_stiffness_burst_the_net_and_that_is_said(self):
        _, mesh, springs = net()
        for stiffness in (10.0, 1000.0):
            longest = 0.3 * stiffness**-0.5  # an undamped wave gains w^2 dt^2 of energy a step and loses d / k w^2 dt
            outcomes = [
                simulate_mass_spring(
                    mesh, springs, MassSpringSettings(stiffness=stiffness, time_step=share * longest, drag=0.1)
                )
                for share in (0.9, 1.3)
            ]
            assert outcomes[0].outcome is not Outcome.DIVERGED
            assert outcomes[1].outcome is Outcome.DIVERGED
            assert np.isfinite(outcomes[1].points).all()
            assert np.abs(outcomes[1].points).max() < 1e5  # mm: what is kept is from before the burst

    def test_a_step_beyond_all_numbers_ends_finite(self):
        _, mesh, springs = net()
        done = simulate_mass_spring(mesh, springs, MassSpringSettings(time_step=1e200))
        assert done.outcome is Outcome.DIVERGED
        assert np.isfinite(done.points).all()

    def test_running_out_of_steps_is_said(self):
        _, mesh, springs = net()
        assert simulate_mass_spring(mesh, springs, MassSpringSettings(max_steps=70)).outcome is Outcome.OUT_OF_STEPS

    def test_progress_is_told(self):
        _, mesh, springs = net(30)
        told = []
        simulate_mass_spring(mesh, springs, MassSpringSettings(max_steps=100), told.append)
        assert told == [0.5, 1.0]


@pytest.mark.parametrize(
    "bad", [{"time_step": 0.0}, {"stiffness": -1.0}, {"restitution": 1.1}, {"drag": -0.1}, {"tolerance": float("nan")}]
)
def test_settings_out_of_range_are_refused(bad):
    with pytest.raises(UsageError, match=next(iter(bad))):
        MassSpringSettings(**bad)


class TestLattice:
    @pytest.mark.parametrize("count", [50, 300, 1000])
    def test_it_has_about_the_nodes_asked_for_in_rows_and_columns(self, count):
        lattice, mesh, _ = net(count, flat_sheet)
        assert len(mesh.points) == pytest.approx(count, rel=0.08)  # whole rows and columns
        assert (lattice.node >= 0).all()
        assert len(mesh.faces) == 2 * (lattice.node.shape[0] - 1) * (lattice.node.shape[1] - 1)

    def test_springs_are_structural_shear_and_flexion(self):
        lattice, _, springs = net(100, flat_sheet)
        r, c = lattice.node.shape
        assert springs.edges == r * (c - 1) + (r - 1) * c + 2 * (r - 1) * (c - 1)
        assert len(springs.rest) == springs.edges + r * (c - 2) + (r - 2) * c
        along, flexion = springs.rest[: r * (c - 1) + (r - 1) * c], springs.rest[springs.edges :]
        assert (flexion.min(), flexion.max()) == pytest.approx((2 * along.min(), 2 * along.max()))

    def test_flexion_springs_are_as_long_as_the_paper_and_with_straight_lengths_too_short_across_a_fold(self):
        def fold(uv):
            across = uv[:, 0] - 100
            return np.c_[across * np.cos(0.5), uv[:, 1], (100 - np.abs(across)) * np.sin(0.5)]

        short = {}
        for lengths in ("unfolded", "straight"):
            lattice, mesh, springs = net(200, fold, lengths)
            thirds = [
                np.stack([n[:, :-2], n[:, 1:-1], n[:, 2:]], axis=-1).reshape(-1, 3)
                for n in (lattice.node, lattice.node.T)
            ]
            one, middle, other = mesh.points[np.concatenate(thirds)].transpose(1, 0, 2)
            over = np.linalg.norm(middle - one, axis=1) + np.linalg.norm(other - middle, axis=1)
            short[lengths] = (over - springs.rest[springs.edges :]).max() / over.mean()
        assert short["unfolded"] < 1e-9
        assert short["straight"] > 0.02  # 1 - cos(0.5) = 0.12 where a node stands on the fold

    def test_nothing_joins_across_a_hole(self):
        uv, faces = grid(60, 45)
        middle = np.array([100.0, 140.0])
        away = np.hypot(*(uv[faces].mean(axis=1) - middle).T) > 40
        lattice = make_quad_mesh(Mesh(flat_sheet(uv), faces[away]), 500)
        springs = quad_mesh_springs(lattice, "unfolded")
        one, other = lattice.coarse.mesh.points[springs.pairs, :2].transpose(1, 0, 2)
        for share in (0.25, 0.5, 0.75):
            assert np.hypot(*(one + share * (other - one) - middle).T).min() > 35  # faces of 5 mm

    def test_nothing_joins_across_a_jump_in_height(self):
        uv, faces = grid(60, 45, width=100.0)
        both = np.r_[flat_sheet(uv), flat_sheet(uv) + [101.0, 0, 50]]
        lattice = make_quad_mesh(Mesh(both, np.r_[faces, faces + len(uv)]), 500)
        pairs = quad_mesh_springs(lattice, "unfolded").pairs
        assert np.abs(np.diff(lattice.coarse.mesh.points[pairs][..., 2], axis=1)).max() < 1e-3  # weights are float32

    @pytest.mark.slow
    @settings(max_examples=40)
    @given(st.lists(st.booleans(), min_size=144, max_size=144), st.integers(4, 400))
    def test_whatever_is_missing_faces_lie_printed_side_up_and_no_node_is_lonely(self, kept, count):
        uv, faces = grid(13, 13)
        quads = np.tile(kept, 2)
        if not quads.any():
            return
        try:
            lattice = make_quad_mesh(Mesh(flat_sheet(uv), faces[quads]), count)
        except InputError:
            return
        mesh = lattice.coarse.mesh
        assert (area_vectors(mesh.points, mesh.faces)[:, 2] > 0).all()
        assert (np.unique(mesh.faces) == np.arange(len(mesh.points))).all()
        springs = quad_mesh_springs(lattice, "unfolded")
        assert np.isfinite(springs.rest).all()
        assert (springs.rest > 0).all()
        joined = {tuple(pair) for pair in np.sort(springs.pairs[: springs.edges], axis=1)}
        assert {tuple(edge) for edge in topology(mesh.faces, len(mesh.points)).edges} <= joined

    def test_a_sheet_narrower_than_the_cells_is_refused_in_a_sentence(self):
        corner = np.array([[0.0, 0, 0], [100, 0, 0], [100, 100, 0], [99, 1, 0]])  # slender, along two sides of a square
        with pytest.raises(InputError, match="narrower than the cells"):
            make_quad_mesh(Mesh(corner, np.array([[0, 1, 3], [1, 2, 3]])), 10)


class TestFlatten:
    @pytest.mark.parametrize("name", ["book", "letter", "miura"])
    def test_the_error_that_chords_make_is_expected_to_a_factor_of_two(self, name):
        mesh, truth = sheet_mesh(sheet(name), 20_000)
        done = flatten(mesh, topology(mesh.faces, len(mesh.points)), FlattenSettings(method="mass-spring"))
        expected = np.sqrt((done.error_mm**2).mean())
        assert 0.5 < expected / rigid_rms(done.page_xy, truth) < 2

    def test_what_faces_the_table_is_said_not_to_be_shown(self):
        for name, said in (("book", False), ("roll", True)):
            mesh, _ = sheet_mesh(sheet(name), 4000, layout="grid")
            settings = FlattenSettings(method="mass-spring", points=200)
            done = flatten(mesh, topology(mesh.faces, len(mesh.points)), settings)
            assert any("faces the table" in warning.sentence for warning in done.warnings) == said, name
            assert np.isfinite(done.page_xy).all()

    def test_a_book_page_is_nearly_as_true_as_the_papers_method_makes_it(self):
        mesh, truth = sheet_mesh(sheet("book"), 20_000, layout="grid")
        done = flatten(mesh, topology(mesh.faces, len(mesh.points)), FlattenSettings(method="mass-spring"))
        assert done.outcome is Outcome.SETTLED
        assert 900 < done.solved_points < 1100
        assert rigid_rms(done.page_xy, truth) < 0.05  # chords of 8 mm over the bend at the spine are 0.03 mm short
