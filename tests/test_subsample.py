import numpy as np
import pytest

from planish.mesh import area_vectors, border_loops, prolongate, subsample, topology
from planish.types import Mesh
from shapes import arch, grid, rigid_rms


def coarse_of(points, faces, count):
    mesh = Mesh(points, faces)
    return subsample(mesh, topology(mesh.faces, len(points)), count)


@pytest.mark.parametrize("count", [100, 400, 1500])
def test_the_coarse_sheet_is_a_sheet_of_about_the_asked_size_on_points_of_the_fine_one(count):
    uv, faces = grid(120, 90)
    points = arch(uv)
    coarse = coarse_of(points, faces, count)
    assert len(coarse.mesh.points) == pytest.approx(count, rel=0.1)
    assert {tuple(p) for p in coarse.mesh.points} <= {tuple(p) for p in points}
    topo = topology(coarse.mesh.faces, len(coarse.mesh.points))
    assert topo.edge_uses.max() == 2
    assert border_loops(topo) == 1
    assert len(coarse.mesh.points) - len(topo.edges) + len(coarse.mesh.faces) == 1  # Euler's number of a disk
    areas = np.linalg.norm(area_vectors(coarse.mesh.points, coarse.mesh.faces), axis=1)
    assert areas.sum() > 0.95 * 200 * 280  # the border is kept
    edges = np.linalg.norm(coarse.mesh.points[topo.edges[:, 0]] - coarse.mesh.points[topo.edges[:, 1]], axis=1)
    assert edges.max() < 4 * np.median(edges)


def test_winding_is_kept():
    uv, faces = grid(60, 60)
    coarse = coarse_of(np.c_[uv, 0 * uv[:, :1]], faces, 200)
    assert (area_vectors(coarse.mesh.points, coarse.mesh.faces)[:, 2] > 0).all()


def test_a_fold_is_sampled_along_its_line():
    uv, faces = grid(81, 81, 200, 200)
    right = uv[:, 0] > 100
    folded = np.c_[np.minimum(uv[:, 0], 100), uv[:, 1], np.where(right, uv[:, 0] - 100, 0)]
    coarse = coarse_of(folded, faces, 300)
    on_fold = (np.abs(coarse.mesh.points[:, 0] - 100) < 1e-9) & (coarse.mesh.points[:, 2] < 1e-9)
    apart = np.sqrt(200 * 200 / 300 / 0.866)
    assert on_fold.sum() > 0.7 * 200 / apart


@pytest.mark.slow
def test_carrying_a_bent_sheet_back_is_exact_at_the_coarse_points_and_close_between():
    uv, faces = grid(120, 90)
    points = arch(uv)
    coarse = coarse_of(points, faces, 400)
    at = np.array([np.flatnonzero((points == p).all(1))[0] for p in coarse.mesh.points])
    page = prolongate(coarse, points, uv[at])
    np.testing.assert_allclose(page[at], uv[at], atol=1e-9)
    # 12 mm triangles on a radius of 60 mm: facets would err by up to 12^2 / (8 * 60) = 0.3 mm of sag
    assert rigid_rms(page, uv) < 0.03


def test_carrying_repeats_a_linear_map_beyond_the_border_too():
    uv, faces = grid(50, 50)
    points = np.c_[uv, 0.3 * uv[:, :1]]  # a tilted plane
    coarse = coarse_of(points, faces, 60)
    flat = np.c_[uv[:, 0] * np.hypot(1, 0.3), uv[:, 1]]
    at = np.array([np.flatnonzero((points == p).all(1))[0] for p in coarse.mesh.points])
    np.testing.assert_allclose(prolongate(coarse, points, flat[at]), flat, atol=1e-9)
