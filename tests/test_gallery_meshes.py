import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import sparse

from planish.errors import UsageError
from planish.gallery import OUTLINES, NoiseSpec, sheet, sheet_mesh
from planish.gallery.meshes import SCANNER_MM
from planish.gallery.noise import noise_at
from planish.mesh import grid_faces, topology, without_small_components

LAYOUTS = ("range", "grid", "delaunay")


def page_area(mesh, truth_xy):
    """Signed area of each face on the page; negative where it is counter-clockwise as printed, since y is down."""
    a, b, c = (truth_xy[mesh.faces[:, k]] for k in range(3))
    return ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2


def euler(mesh):
    """Points - edges + faces: 1 for a disc, one less for every hole."""
    return len(mesh.points) - len(topology(mesh.faces, len(mesh.points)).edges) + len(mesh.faces)


def pieces(mesh):
    pairs = topology(mesh.faces, len(mesh.points)).edges.T
    links = sparse.coo_matrix((np.ones(pairs.shape[1]), tuple(pairs)), shape=(len(mesh.points),) * 2)
    return sparse.csgraph.connected_components(links, directed=False)[0]


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("name", ["book", "roll"])
def test_every_layout_covers_the_sheet_once_and_knows_the_truth(layout, name):
    bent = sheet(name)
    mesh, truth_xy = sheet_mesh(bent, 8000, layout=layout)
    assert len(mesh.points) == pytest.approx(8000, rel=0.02)
    np.testing.assert_allclose(mesh.points, bent.bend(truth_xy), atol=1e-9)
    area = page_area(mesh, truth_xy)
    assert (area < 0).all()
    # The range layout ends in steps, half a 2.7 mm pixel inside the border on average.
    covered = -area.sum() / (215.9 * 279.4)
    assert covered == pytest.approx(1, abs=0.025 if layout == "range" else 1e-9)
    assert euler(mesh) == 1


@pytest.mark.parametrize("layout", ["range", "grid"])
def test_a_range_scanner_errs_along_the_ray(layout):
    bent = sheet("wave")
    mesh, truth_xy = sheet_mesh(bent, 20_000, layout=layout, noise_mm=0.2)
    truth = bent.bend(truth_xy)
    error, ray = mesh.points - truth, truth - SCANNER_MM
    ray /= np.linalg.norm(ray, axis=1, keepdims=True)
    along = (error * ray).sum(1)
    np.testing.assert_allclose(error, along[:, None] * ray, atol=1e-9)
    assert along.std() == pytest.approx(0.2, rel=0.02)  # four times the error of a standard deviation of 20,000


def test_a_mesh_of_any_origin_errs_in_all_directions():
    bent = sheet("wave")
    mesh, truth_xy = sheet_mesh(bent, 20_000, layout="delaunay", noise_mm=0.2)
    np.testing.assert_allclose(np.cov((mesh.points - bent.bend(truth_xy)).T), 0.04 * np.eye(3), atol=0.0016)


@pytest.mark.parametrize("correlation_px", [1.0, 3.0])
def test_correlated_noise_has_the_correlation_of_a_blur_and_the_size_asked_for(correlation_px):
    mesh, _ = sheet_mesh(sheet("flat"), 90_000, layout="grid", noise_mm=0.05, noise_correlation_px=correlation_px)
    cols = round(np.sqrt(90_000 * 215.9 / 279.4))
    height = mesh.points[:, 2].reshape(-1, cols)
    # The blur with a Gaussian of width s correlates neighbours at distance d by exp(-d^2 / 4 s^2).
    got = np.corrcoef(height[:, :-2].ravel(), height[:, 2:].ravel())[0, 1]
    assert got == pytest.approx(np.exp(-1 / correlation_px**2), abs=0.03)
    assert height.std() == pytest.approx(0.05, rel=0.03)  # less the cosine of the ray


def test_noise_can_grow_over_the_sheet():
    mesh, truth_xy = sheet_mesh(sheet("flat"), 40_000, noise_mm=(0.02, 0.15))
    place = (truth_xy / [215.9, 279.4]).mean(axis=1)
    for low in (0.1, 0.5, 0.8):
        here = (place > low) & (place < low + 0.1)
        assert mesh.points[here, 2].std() == pytest.approx(0.02 + 0.13 * (low + 0.05), rel=0.1)


def test_the_same_seed_gives_the_same_mesh():
    meshes = [
        sheet_mesh(sheet("book"), 1000, layout="delaunay", holes=3, noise_mm=0.1, rng=seed)[0] for seed in (1, 1, 2)
    ]
    np.testing.assert_array_equal(meshes[0].points, meshes[1].points)
    assert meshes[0].points.shape != meshes[2].points.shape or (meshes[0].points != meshes[2].points).any()


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("outline", OUTLINES)
def test_slender_outlines_are_one_piece_without_a_hole(layout, outline):
    mesh, truth_xy = sheet_mesh(sheet("book"), 20_000, layout=layout, outline=outline)
    assert pieces(mesh) == 1
    assert euler(mesh) == 1  # the ring is cut open
    assert 0.3 < -page_area(mesh, truth_xy).sum() / (215.9 * 279.4) < 0.7


def test_an_outline_of_ones_own():
    mesh, truth_xy = sheet_mesh(sheet("flat"), 5000, outline=lambda at: at[:, 0] < 0.5)
    assert truth_xy[:, 0].max() < 215.9 / 2
    assert -page_area(mesh, truth_xy).sum() == pytest.approx(215.9 * 279.4 / 2, rel=0.06)  # steps of 3.5 mm pixels


def test_holes_are_holes():
    mesh, _ = sheet_mesh(sheet("book"), 40_000, holes=4, rng=3)
    assert euler(mesh) == 1 - 4


@pytest.mark.parametrize("layout", LAYOUTS)
def test_cuts_part_the_sheet_where_they_run_and_no_farther(layout):
    whole = ((100.0, -1.0), (110.0, 281.0))
    half = ((100.0, -1.0), (110.0, 140.0))
    apart, truth_xy = sheet_mesh(sheet("book"), 10_000, layout=layout, cuts=[whole])
    assert pieces(apart) == 2
    slit, _ = sheet_mesh(sheet("book"), 10_000, layout=layout, cuts=[half])
    assert pieces(slit) == 1
    assert len(slit.faces) > len(apart.faces)
    assert -page_area(apart, truth_xy).sum() > 0.95 * 215.9 * 279.4


def test_an_unknown_outline_is_refused():
    with pytest.raises(UsageError, match="no outline 'star'; choose one of c, ring, comb"):
        sheet_mesh(sheet("flat"), 100, outline="star")


@given(st.integers(0, 10_000))
def test_pixels_are_joined_once_and_facing_the_viewer(seed):
    rng = np.random.default_rng(seed)
    there = rng.random((6, 7)) < 0.8
    index = np.where(there, np.cumsum(there).reshape(there.shape) - 1, -1).astype(np.int32)
    rows, cols = np.nonzero(there)
    points = np.stack([cols, -rows, rng.uniform(0, 0.1, len(rows))], axis=1)
    faces = grid_faces(index, points)
    a, b, c = (points[faces[:, k]] for k in range(3))
    area = np.cross(b - a, c - a)[:, 2] / 2
    assert (area > 0).all()
    corners = sum(there[r : r + 5, c : c + 6].astype(int) for r in (0, 1) for c in (0, 1))
    assert area.sum() == pytest.approx((corners == 4).sum() + (corners == 3).sum() / 2)
    assert topology(faces, len(points)).edge_uses.max(initial=0) <= 2


def test_a_depth_jump_is_not_joined():
    index = np.arange(12, dtype=np.int32).reshape(3, 4)
    cols, rows = np.meshgrid(np.arange(4.0), np.arange(3.0))
    points = np.stack([cols, -rows, 10.0 * (cols >= 2)], axis=-1).reshape(-1, 3)
    assert len(grid_faces(index, points, 5.0)) == 8
    assert len(grid_faces(index, points, 15.0)) == 12


def test_crumbs_go_and_large_pieces_stay():
    index = np.arange(400, dtype=np.int32).reshape(20, 20)
    points = np.argwhere(index >= 0).astype(float)
    large = grid_faces(index, points)
    two = np.concatenate([large, large + 400, np.array([[800, 801, 802], [0, 803, 804]], np.int32)])
    used, faces = without_small_components(two, 810)
    np.testing.assert_array_equal(used, np.arange(800))
    np.testing.assert_array_equal(faces, two[:-2])


def test_nothing_of_a_sheet_has_no_noise():
    none = np.zeros((0, 2))
    noise = NoiseSpec(white_mm=0.1, correlated_mm=0.1, ripple_mm=0.1, spikes=0.1)
    assert noise_at(none.astype(np.int64), none, noise, np.random.default_rng(0), 3).shape == (0, 3)
