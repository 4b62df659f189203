"""The contract that every flattening method keeps."""

import numpy as np
import pytest

from planish.flattening import flatten
from planish.mesh import repair
from planish.settings import FlattenSettings
from planish.types import Mesh, Outcome, Scan
from shapes import arch, grid, rigid_rms

METHODS = ["multigrid", "verlet", "mass-spring"]
UV, FACES = grid(24, 18)
RADIUS = 90.0  # bent by 64 degrees to either side; an arch past the vertical may fold its legs in when it falls
CHORDS = 2 * RADIUS * 17 * np.sin(200 / 17 / (2 * RADIUS)) / 200  # seventeen chords of the arc are all the mesh knows
POINTS = (
    arch(UV, RADIUS) + 6 * np.c_[np.zeros((len(UV), 2)), (UV[:, 1] - 140) ** 2 / 140**2]
)  # not developable to the last bit


def flat(xyz, faces=FACES, *, method, **settings):
    prepared = repair(Scan(Mesh(xyz, faces)))
    done = flatten(
        prepared.scan.mesh, prepared.topology, FlattenSettings(method=method, lengths="unfolded", **settings)
    )
    return done, done.page_xy[prepared.mesh_rows]


def rotation(seed):
    q = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    return q * np.sign(np.linalg.det(q))


# Solvers stop at a tolerance: what changes nothing in exact numbers may move the stop by so much of 200 x 280 mm.
SAME = 0.01

# The springs of mass-spring are chords of a mesh of its own, which cut the corners between the facets of the scan. A
# cell of c mm loses c turn^2 / 12 at a corner of `turn` rad: 17 corners of 0.13 rad, cells of 7 mm (10 over two sheets)
# and longer on the slopes make 0.2 mm (0.3) in 200, which is 0.06 mm (0.1) rms.
TRUE = {"multigrid": 2e-3, "verlet": 2e-3, "mass-spring": 0.13}


@pytest.mark.parametrize("method", METHODS)
class TestContract:
    @pytest.mark.slow
    def test_a_bent_sheet_comes_out_flat_and_true(self, method):
        done, page = flat(arch(UV, RADIUS), method=method)
        assert done.outcome is Outcome.SETTLED
        assert rigid_rms(page, UV * [CHORDS, -1]) < TRUE[method]
        assert page.min() == pytest.approx(0)
        assert done.strain[0] < 1e-4

    def test_flat_stays_flat(self, method):
        done, page = flat(np.c_[UV, 0 * UV[:, :1]], method=method)
        assert done.outcome is Outcome.SETTLED
        assert rigid_rms(page, UV * [1, -1]) < 1e-6

    @pytest.mark.parametrize("seed", range(3))
    def test_turning_and_moving_the_scan_changes_nothing(self, method, seed):
        _, page = flat(POINTS, method=method)
        _, moved = flat(POINTS @ rotation(seed).T + [40, -900, 7], method=method)
        assert rigid_rms(moved, page) < SAME

    def test_a_mirrored_scan_gives_the_mirrored_page(self, method):
        _, page = flat(POINTS, method=method)
        _, mirrored = flat(POINTS * [-1, 1, 1], FACES[:, ::-1], method=method)
        assert rigid_rms(mirrored, page * [-1, 1]) < SAME

    def test_renumbering_points_and_faces_changes_nothing(self, method):
        rng = np.random.default_rng(0)
        order, shuffled = rng.permutation(len(UV)), rng.permutation(FACES)
        where = np.argsort(order)
        _, page = flat(POINTS, method=method)
        _, renumbered = flat(POINTS[order], where[shuffled], method=method)
        assert rigid_rms(renumbered[where], page) < SAME

    def test_twice_in_is_twice_out(self, method):
        _, page = flat(POINTS, method=method)
        _, doubled = flat(2 * POINTS, method=method)
        assert rigid_rms(doubled, 2 * page) < 2 * SAME

    def test_the_page_is_not_a_mirror_image(self, method):
        _, page = flat(POINTS, method=method)
        ab, ac = (page[FACES[:, k]] - page[FACES[:, 0]] for k in (1, 2))
        assert (ab[:, 0] * ac[:, 1] < ab[:, 1] * ac[:, 0]).all()  # y runs down

    @pytest.mark.slow
    def test_reduced_to_fewer_points_every_point_still_has_its_place(self, method):
        uv, faces = grid(60, 45)
        done, page = flat(arch(uv, RADIUS), faces, method=method, points=300)
        assert done.solved_points < 350
        assert len(page) == len(uv)
        assert rigid_rms(page, uv * [1, -1]) < 0.15  # 300 points: chords of 14 mm on a radius of 90 are 0.1 % short

    def test_two_sheets_are_both_laid_flat(self, method):
        sheet = arch(UV, RADIUS)
        both = np.r_[sheet, sheet + np.array([500, 0, 0])]
        _, page = flat(both, np.r_[FACES, FACES + len(UV)], method=method)
        for half in (page[: len(UV)], page[len(UV) :]):
            assert rigid_rms(half, UV * [CHORDS, -1]) < TRUE[method]

    def test_one_triangle_is_a_sheet(self, method):
        points = np.array([[0.0, 0, 0], [30, 0, 10], [0, 40, 5]])
        done, page = flat(points, np.array([[0, 1, 2]]), method=method)
        assert done.outcome is Outcome.SETTLED
        lengths = [np.linalg.norm(p[1] - p[0]) for p in (points[[0, 1]], points[[1, 2]], points[[2, 0]])]
        got = [np.linalg.norm(p[1] - p[0]) for p in (page[[0, 1]], page[[1, 2]], page[[2, 0]])]
        assert got == pytest.approx(lengths, rel=1e-6)

    @pytest.mark.slow
    def test_a_ball_that_cannot_lie_flat_ends_with_finite_places_and_its_strain_told(self, method):
        u, v = np.pi * (UV[:, 0] / 200 - 0.5) * 0.8, np.pi * (UV[:, 1] / 280 - 0.5) * 0.8
        ball = 100 * np.c_[np.sin(u) * np.cos(v), np.sin(v), np.cos(u) * np.cos(v)]
        done, page = flat(ball, method=method)
        assert np.isfinite(page).all()
        assert done.strain[0] > 0.02
