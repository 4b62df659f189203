import numpy as np
import pytest

import planish
from planish.gallery import sheet, sheet_mesh
from planish.mesh import topology
from planish.report import flipped_faces
from planish.sticks import strain, stretch
from shapes import arch, grid

UV, FACES = grid(12, 9)
PAGE = UV * [1, -1]  # y runs down on the page
POINTS = np.c_[UV, 0 * UV[:, :1]]


@pytest.mark.slow
def test_a_perfect_page_has_no_strain_no_stretch_and_no_flips():
    edges = topology(FACES, len(UV)).edges
    rest = np.linalg.norm(POINTS[edges[:, 1]] - POINTS[edges[:, 0]], axis=1)
    assert strain(PAGE, edges, rest) == pytest.approx((0, 0), abs=1e-14)
    assert stretch(POINTS, FACES, PAGE) == pytest.approx((1, 1), abs=1e-12)
    assert flipped_faces(FACES, PAGE) == 0


def test_a_page_that_is_wider_by_a_tenth_shows_it():
    edges = topology(FACES, len(UV)).edges
    rest = np.linalg.norm(POINTS[edges[:, 1]] - POINTS[edges[:, 0]], axis=1)
    wide = PAGE * [1.1, 1]
    assert strain(wide, edges, rest)[1] == pytest.approx(0.1)
    l2, linf = stretch(POINTS, FACES, wide)  # singular values 1 / 1.1 and 1
    assert l2 == pytest.approx(np.sqrt((1 / 1.1**2 + 1) / 2))
    assert linf == pytest.approx(1)


def test_a_shrunk_page_stretches_by_the_same_factor_everywhere_in_any_frame():
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    assert stretch(POINTS, FACES, PAGE @ turn / 2) == pytest.approx((2, 2))


def test_flips_are_counted_face_by_face():
    page = PAGE.copy()
    inner = 5 * 9 + 4
    page[inner] = page[inner + 2] + [3, 0]  # pulled over its right neighbour and beyond: some faces turn over
    ab, ac = page[FACES[:, 1]] - page[FACES[:, 0]], page[FACES[:, 2]] - page[FACES[:, 0]]
    wanted = sum(1 for p, q in zip(ab, ac, strict=True) if p[0] * q[1] - p[1] * q[0] >= 0)
    assert flipped_faces(FACES, page) == wanted > 0
    assert flipped_faces(FACES, UV) == len(FACES)


def test_a_bent_sheet_unrolled_has_stretch_one():
    uv, faces = grid(120, 90)
    l2, linf = stretch(arch(uv), faces, uv * [1, -1])
    assert (l2, linf) == pytest.approx((1, 1), abs=1e-4)  # chords of 2.2 mm on a radius of 60: 6e-5


def test_faces_thinner_than_noise_may_lie_either_way_up():
    """A grid of noisy needles: what noise turns over is told only where noise is not known."""
    mesh, _ = sheet_mesh(sheet("book"), 8000, layout="delaunay", noise_mm=0.15, rng=1)
    laid = planish.flatten(mesh)
    flips = flipped_faces(mesh.faces, laid.page_xy, mesh.points)
    assert flips > 10
    assert flipped_faces(mesh.faces, laid.page_xy, mesh.points, 4 * 0.15) < flips / 10


def test_noise_is_no_stretch():
    """Strain and stretch are of the same surface: against raw noise the one would be 0.1 %, the other 300 %."""
    mesh, _ = sheet_mesh(sheet("book"), 8000, layout="grid", noise_mm=0.15, rng=1)
    laid = planish.flatten(mesh)
    mean, greatest = laid.stretch
    assert abs(mean - 1) <= laid.strain[0] < 0.01
    assert greatest - 1 < 10 * laid.strain[1]  # a triangle of 11 degrees stretches five times as much as its edges
    assert stretch(mesh.points, mesh.faces, laid.page_xy)[0] - 1 > 10 * abs(mean - 1)
