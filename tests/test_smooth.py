"""Smooth rest lengths against the lengths of sheets whose flat truth is known.

Noise is put on along the surface's normal: then the noisy points stand over their true places on the page, and the
true length of an edge is the distance of its ends on the page.
"""

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import get_num_threads, set_num_threads
from scipy.ndimage import gaussian_filter

from captures import DATA
from planish.flattening import flatten
from planish.gallery import sheet, sheet_mesh
from planish.gallery.meshes import SCANNER_MM
from planish.gallery.sheets import normals
from planish.geometry.distances import distances
from planish.io import read_scan
from planish.mesh import repair, topology
from planish.sticks import make_sticks
from planish.surface import Smoothing, smooth_lengths, smooth_normals
from planish.surface.normals import SAMPLE, sample
from planish.types import Mesh
from shapes import arch, grid, rigid_rms

SHEETS = {
    "flat": sheet("flat", width_mm=70.0, height_mm=70.0),
    "book": sheet("book", width_mm=100.0, height_mm=50.0),
    "wave": sheet("wave", width_mm=70.0, height_mm=70.0, waves=1.0),
    "letter": sheet("letter", width_mm=60.0, height_mm=90.0),
    "spread": sheet("spread", width_mm=100.0, height_mm=50.0),
    "miura": sheet("miura", width_mm=72.0, height_mm=70.0, cells=(2.0, 2.0)),
    "curl": sheet("curl", width_mm=70.0, height_mm=70.0, length_mm=60.0),
    "roll": sheet("roll", width_mm=30.0, height_mm=150.0, turns=1.5),
}
SMOOTH = ("flat", "book", "wave", "curl", "roll")
FOLDED = ("letter", "spread", "miura")


@cache
def scanned(name, layout="range"):
    """Mesh without noise, 0.5 mm from point to point; place on the page and true normal of every point."""
    paper = SHEETS[name]
    mesh, truth_xy = sheet_mesh(paper, int(paper.width_mm * paper.height_mm / 0.25), layout=layout)
    return mesh, truth_xy, normals(paper, truth_xy), topology(mesh.faces, len(truth_xy))


def white(truth_xy, seed=3):
    return np.random.default_rng(seed).standard_normal(len(truth_xy))


def correlated(truth_xy, pixels):
    """Noise of standard deviation 1, alike over so many pixels of 0.5 mm."""
    at = (truth_xy / 0.25).astype(int)
    field = gaussian_filter(np.random.default_rng(5).standard_normal(at.max(axis=0) + 1), 2 * pixels, mode="wrap")
    return (field / field.std())[tuple(at.T)]


def with_noise(name, sigma, unit, layout="range"):
    mesh, truth_xy, normal, topo = scanned(name, layout)
    return Mesh(mesh.points + (sigma * unit(truth_xy))[:, None] * normal, mesh.faces), truth_xy, topo


def lengths(mesh, topo):
    return smooth_lengths(mesh.points, mesh.faces, topo)


def worst_bias(rest, truth_xy, topo):
    """Greatest relative error of the sum of lengths, over the edges near each of six directions on the page.

    Directions in which there are hardly any edges but some at the border are left out.
    """
    d = truth_xy[topo.edges[:, 1]] - truth_xy[topo.edges[:, 0]]
    true = np.linalg.norm(d, axis=1)
    worst = 0.0
    for angle in np.radians(np.arange(0, 180, 30)):
        near = np.abs(d @ [np.cos(angle), np.sin(angle)]) > np.cos(np.radians(20)) * true
        if near.sum() > 0.05 * len(d):
            worst = max(worst, abs(rest[near].sum() / true[near].sum() - 1))
    return worst


# ------------------------------------------------------------------ without noise


@pytest.mark.parametrize("name", SMOOTH)
def test_a_clean_smooth_sheet_keeps_its_lengths(name):
    mesh, truth_xy, _, topo = scanned(name)
    got = lengths(mesh, topo)
    assert got.smoothing is Smoothing.CLEAN
    # 0.5 mm chords of a bend of 12 mm radius or more are 7e-5 short; the rule puts most of that right.
    assert worst_bias(got.rest, truth_xy, topo) < 1e-5
    assert np.abs(got.rest / distances(truth_xy, topo.edges) - 1).max() < 2e-3
    assert got.typical_noise_mm < 1e-3


@pytest.mark.parametrize("name", FOLDED)
def test_edges_across_a_clean_fold_go_over_the_paper_not_through_the_air(name):
    mesh, truth_xy, _, topo = scanned(name)
    raw = distances(mesh.points, topo.edges)
    # Few edges cross a fold, so the sheet's size is out by little even raw; a quarter of that is the rule's doing.
    assert worst_bias(lengths(mesh, topo).rest, truth_xy, topo) < worst_bias(raw, truth_xy, topo) / 4


def test_a_sample_has_edges_of_every_direction_and_all_phases_of_a_ripple():
    """In a range image every third edge runs the same way: equal steps of 126 would take one way and one phase of 7."""
    rows = sample(126 * SAMPLE)
    assert len(np.unique(rows)) == SAMPLE
    for period in (3, 7, 9, 21, 126):
        counts = np.bincount(rows % period, minlength=period)
        assert counts.min() > 0.7 * SAMPLE / period
    assert sample(10).tolist() == list(range(10))


@pytest.mark.parametrize("sigma", [0.0, 0.05])
def test_no_way_over_a_crumpled_sheet_is_shorter_than_the_straight_one(sigma):
    """Where several facets meet, two planes tell lengths up to a half too short; the chord is a bound."""
    mesh, truth_xy = sheet_mesh(sheet("crumpled"), points=60_000)
    topo = topology(mesh.faces, len(mesh.points))
    ray = mesh.points - SCANNER_MM
    ray /= np.linalg.norm(ray, axis=1, keepdims=True)
    noisy = mesh.points + sigma * np.random.default_rng(5).normal(size=(len(ray), 1)) * ray
    rest = smooth_lengths(noisy, mesh.faces, topo, eye=SCANNER_MM).rest
    assert (rest / distances(truth_xy, topo.edges)).min() > 0.65  # without the bound 0.55


@pytest.mark.slow
def test_a_folded_sheet_with_points_on_its_folds_is_left_alone():
    uv, faces = grid(31, 21, width=100.0, height=150.0)
    x, ridge = uv[:, 0], np.abs((uv[:, 0] / 10) % 2 - 1)  # pleats 10 mm wide; every other column lies on a fold
    pleated = np.c_[0.8 * x, uv[:, 1], 6 * ridge]
    topo = topology(faces, len(uv))
    got = smooth_lengths(pleated, faces, topo)
    # Raw lengths are exact here; nothing may be gained or lost beyond rounding.
    np.testing.assert_allclose(got.rest, distances(uv, topo.edges), rtol=2e-6)


def test_a_coarse_mesh_of_a_smooth_sheet_gets_better_not_worse():
    uv, faces = grid(9, 7)
    topo = topology(faces, len(uv))
    mesh = arch(uv, radius=120.0)  # 33 mm chords of a 120 mm bend: 0.3 % short
    true = distances(uv, topo.edges)
    got = smooth_lengths(mesh, faces, topo)
    assert np.abs(got.rest - true).mean() <= np.abs(distances(mesh, topo.edges) - true).mean()


# ------------------------------------------------------------------ with noise


@pytest.mark.parametrize("name", SHEETS)
def test_white_noise_goes_out_of_the_lengths(name):
    mesh, truth_xy, topo = with_noise(name, 0.07, white)
    got = lengths(mesh, topo)
    raw = distances(mesh.points, topo.edges)
    assert got.smoothing is Smoothing.SMOOTHED
    assert worst_bias(raw, truth_xy, topo) > 0.01  # what is to be undone: each edge is some 2 % too long
    # The issue wants the size within 2e-4; across folds, which make up to 1/50 of these small sheets, twice that.
    assert worst_bias(got.rest, truth_xy, topo) < (2e-4 if name in SMOOTH else 4e-4)


@pytest.mark.parametrize(("sigma", "limit"), [(0.02, 1e-4), (0.2, 5e-4)])  # raw: 0.2 % and 14 %
def test_faint_and_strong_noise(sigma, limit):
    mesh, truth_xy, topo = with_noise("wave", sigma, white)
    assert worst_bias(lengths(mesh, topo).rest, truth_xy, topo) < limit


@pytest.mark.parametrize("pixels", [1, 3])
def test_noise_that_is_alike_over_neighbouring_pixels(pixels):
    # On a flat sheet, as where the sheet is bent errors of one sign over several mm are a change of its radius.
    mesh, truth_xy, topo = with_noise("flat", 0.07, lambda xy: correlated(xy, pixels))
    got = lengths(mesh, topo)
    assert got.smoothing is Smoothing.SMOOTHED
    assert worst_bias(got.rest, truth_xy, topo) < 2e-4  # raw: 4e-3 and 6e-4


def test_noise_that_grows_over_the_sheet_is_found_where_it_is():
    mesh, truth_xy, topo = with_noise("book", 1.0, lambda xy: (0.02 + 0.13 * xy[:, 0] / 100) * white(xy))
    got = lengths(mesh, topo)
    assert worst_bias(got.rest, truth_xy, topo) < 2e-4
    here = 0.02 + 0.13 * truth_xy[:, 0] / 100
    middle = (truth_xy[:, 0] > 10) & (truth_xy[:, 0] < 90)
    # Some 150 points tell the noise of a place: 1 / sqrt(150) = 8 %, and medians scatter a little more.
    assert np.median(np.abs(got.noise_mm / here - 1)[middle]) < 0.12


@pytest.mark.parametrize("sigma", [0.02, 0.07, 0.2])
def test_the_noise_is_measured(sigma):
    mesh, _, topo = with_noise("wave", sigma, white)
    assert lengths(mesh, topo).typical_noise_mm == pytest.approx(sigma, rel=0.1)  # from 20,000 points: 1 %, and bending


def test_an_irregular_mesh_with_slivers():
    mesh, truth_xy, topo = with_noise("wave", 0.05, white, layout="delaunay")
    got = lengths(mesh, topo)
    assert np.isfinite(got.rest).all()
    assert (got.rest >= 0).all()
    assert worst_bias(distances(mesh.points, topo.edges), truth_xy, topo) > 0.01
    assert worst_bias(got.rest, truth_xy, topo) < 3e-4  # short edges weigh most in noise, and they abound here


@pytest.mark.parametrize("name", ["wave", "letter"])
def test_noise_along_known_rays_goes_out_of_the_points_too(name):
    paper = SHEETS[name]
    mesh, truth_xy = sheet_mesh(paper, int(paper.width_mm * paper.height_mm / 0.25), noise_mm=0.07)
    topo = topology(mesh.faces, len(truth_xy))
    true = distances(truth_xy, topo.edges)
    blind, told = (smooth_lengths(mesh.points, mesh.faces, topo, eye=eye).rest - true for eye in (None, SCANNER_MM))
    # Noise along rays shifts points along a steep sheet, by which their distances change: that is undone. What is left
    # are the errors of the normals, 0.005 of 0.5 mm.
    assert np.sqrt(np.mean(told**2)) < 0.2 * np.sqrt(np.mean(blind**2))
    assert abs(told.sum()) < 3e-4 * true.sum()


def test_rays_are_not_followed_where_there_is_no_noise():
    mesh, _, _, topo = scanned("wave")
    told = smooth_lengths(mesh.points, mesh.faces, topo, eye=SCANNER_MM)
    np.testing.assert_array_equal(told.rest, lengths(mesh, topo).rest)


def test_a_coarse_bent_sheet_is_not_smoothed_for_its_bends():
    paper = sheet("wave", width_mm=108.0, height_mm=140.0, waves=1.5)
    for layout in ("range", "delaunay"):
        mesh, _ = sheet_mesh(paper, 1000, layout=layout)  # 4 mm and 4 degrees from point to point
        assert lengths(mesh, topology(mesh.faces, len(mesh.points))).smoothing is not Smoothing.SMOOTHED


# ------------------------------------------------------------------ normals


@pytest.mark.parametrize("jitter", [0.0, 0.2])
def test_a_dome_without_noise_is_not_taken_for_noise(jitter):
    """It buckles everywhere, as under white noise; what smoothing would take away is alike over 36 edges."""
    uv, faces = grid(60, 80)
    uv = uv + jitter * np.random.default_rng(1).uniform(-1, 1, uv.shape) * (uv[1, 0] - uv[0, 0])
    x, y = uv[:, 0] / 200 - 0.5, uv[:, 1] / 280 - 0.5
    points = np.c_[uv, -100 * (x**2 + y**2)]
    smooth = smooth_lengths(points, faces, topology(faces, len(points)))
    assert smooth.smoothing is not Smoothing.SMOOTHED
    assert smooth.typical_noise_mm < 0.01  # 3.8 mm of noise were told


@pytest.mark.parametrize("layout", ["grid", "delaunay"])
def test_a_coarse_crumpled_sheet_is_no_strong_noise(layout):
    """Its facets are as large as the largest patches, where its folds seem to stop growing."""
    mesh, _ = sheet_mesh(sheet("crumpled"), 20_000, noise_mm=0.05, layout=layout, rng=7)
    smooth = smooth_lengths(mesh.points, mesh.faces, topology(mesh.faces, len(mesh.points)))
    assert smooth.typical_noise_mm < 0.15  # 0.58 mm were told of the random mesh, and its page was 3.2 mm out


@pytest.mark.parametrize("name", ["book", "letter"])
def test_smooth_normals_are_true_and_stay_sharp_at_folds(name):
    mesh, _, topo = with_noise(name, 0.07, white)
    true = scanned(name)[2]
    got = smooth_normals(mesh, topo)
    angle = np.degrees(np.arccos(np.clip(np.einsum("ij,ij->i", got, true), -1, 1)))
    # Raw normals are some 10 degrees out. A plainly smoothed fold of 46 degrees would leave 5 % of the points of this
    # small letter out by more than 5.
    assert np.median(angle) < 0.6
    assert np.percentile(angle, 95) < 3.0
    np.testing.assert_allclose(np.linalg.norm(got, axis=1), 1, rtol=1e-5)


# ------------------------------------------------------------------ invariance


@pytest.mark.slow
@settings(max_examples=4)
@given(turn=st.floats(0, 6.3), shift=st.floats(-1e4, 1e4), scale=st.sampled_from([0.25, 1.0, 3.0]))
def test_where_the_scanner_stood_and_its_unit_do_not_matter(turn, shift, scale):
    mesh, _, topo = with_noise("letter", 0.07, white)
    around = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1.0]])
    tilt = np.array([[1, 0, 0], [0, 0.6, -0.8], [0, 0.8, 0.6]])
    moved = Mesh(scale * (mesh.points @ (around @ tilt).T + shift), mesh.faces)
    here, there = lengths(mesh, topo), lengths(moved, topo)
    # Rows are float32, and a choice between two equal neighbours may fall the other way: a thirtieth of what is left
    # of the noise in the lengths, 0.003 mm.
    assert np.abs(there.rest / scale - here.rest).mean() < 1e-4
    assert there.rest.sum() == pytest.approx(scale * here.rest.sum(), rel=5e-5)
    assert there.typical_noise_mm == pytest.approx(scale * here.typical_noise_mm, rel=0.01)


@pytest.mark.slow
def test_neither_the_points_order_nor_the_faces_side_matters():
    mesh, _, topo = with_noise("letter", 0.07, white)
    rng = np.random.default_rng(1)
    new = rng.permutation(len(mesh.points)).astype(np.int32)  # new[i] is the new number of point i
    points = np.empty_like(mesh.points)
    points[new] = mesh.points
    faces = new[mesh.faces][:, ::-1]
    shuffled = topology(faces, len(points))
    key = np.sort(new[topo.edges], axis=1)
    order = np.lexsort(key.T[::-1])
    np.testing.assert_array_equal(key[order], shuffled.edges)
    here, there = lengths(mesh, topo).rest[order], smooth_lengths(points, faces, shuffled).rest
    # Medians are of other samples, too: lengths move by a little of their noise.
    assert np.abs(there - here).mean() < 1e-4
    assert there.sum() == pytest.approx(here.sum(), rel=5e-5)


def test_the_number_of_threads_does_not_matter():
    mesh, _, topo = with_noise("letter", 0.07, white)
    threads = get_num_threads()
    try:
        set_num_threads(1)
        alone = lengths(mesh, topo)
    finally:
        set_num_threads(threads)
    together = lengths(mesh, topo)
    np.testing.assert_array_equal(alone.rest, together.rest)
    np.testing.assert_array_equal(alone.normals, together.normals)


# ------------------------------------------------------------------ odd meshes


@pytest.mark.parametrize(
    ("points", "faces"),
    [
        (np.zeros((3, 3)), [[0, 1, 2]]),  # all in one place
        ([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]]),  # no area
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [9, 9, 9]], [[0, 1, 2]]),  # a point without a face
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 1, 0]], [[0, 1, 2], [1, 3, 2]]),  # the same place twice
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.2, 0.2, 0]], [[0, 1, 2], [1, 0, 3]]),  # folded flat onto itself
        (np.zeros((0, 3)), np.zeros((0, 3))),
    ],
)
def test_degenerate_meshes_give_finite_lengths(points, faces):
    mesh = Mesh(np.asarray(points, float), np.asarray(faces, np.int32))
    sticks = make_sticks(mesh, topology(mesh.faces, len(mesh.points)), "smooth")
    for values in (sticks.rest, sticks.weight, sticks.noise_mm):
        assert np.isfinite(values).all()
    assert (sticks.rest >= 0).all()


@settings(max_examples=25)
@given(seed=st.integers(0, 10_000), squeeze=st.sampled_from([1.0, 1e-3, 0.0]))
def test_any_heap_of_triangles_gives_finite_lengths(seed, squeeze):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(30, 3)) * [1, 1, squeeze]
    points[rng.integers(30, size=5)] = points[0]
    faces = np.array([rng.choice(30, 3, replace=False) for _ in range(50)], np.int32)
    mesh = Mesh(points, faces)
    sticks = make_sticks(mesh, topology(mesh.faces, 30), "smooth")
    assert np.isfinite(sticks.rest).all()
    assert np.isfinite(sticks.weight).all()


# ------------------------------------------------------------------ real scans, where they are at hand


def obj(path):
    rows = [line.split() for line in path.read_text().splitlines()]
    points = np.array([row[1:4] for row in rows if row and row[0] == "v"], float)
    texture = np.array([row[1:3] for row in rows if row and row[0] == "vt"], float)
    corners = [[c.split("/") for c in row[1:4]] for row in rows if row and row[0] == "f"]
    faces = np.array([[int(c[0]) - 1 for c in face] for face in corners], np.int32)
    uses = np.array([[int(c[1]) - 1 for c in face] for face in corners]) if texture.size else None
    return points, faces, texture, uses


@pytest.mark.shared("folded_sheet")
def test_a_crumpled_mesh_without_noise_keeps_its_raw_lengths():
    points, faces, _, _ = obj(DATA / "folded_sheet" / "crumpled_developable.obj")
    topo = topology(faces, len(points))
    got = smooth_lengths(points, faces, topo)
    np.testing.assert_allclose(got.rest, distances(points, topo.edges), rtol=2e-6)


@pytest.mark.shared("handheld_sheet")
@pytest.mark.parametrize("shape", ["033", "065", "097", "145"])
def test_a_coarse_real_scan_gets_no_worse(shape):
    points, faces, _, _ = obj(DATA / "handheld_sheet" / f"{shape}.obj")
    flat = np.loadtxt(DATA / "handheld_sheet" / "flat_truth_mm.csv", delimiter=",", skiprows=1)[:, -2:]
    topo = topology(faces, len(points))
    true = distances(flat, topo.edges)
    raw = np.abs(distances(points, topo.edges) - true).mean()
    # Points are 18 mm apart and known to 1 mm: nothing to gain, and at most 2 % may be lost by chance.
    assert np.abs(smooth_lengths(points, faces, topo).rest - true).mean() <= 1.02 * raw


@pytest.mark.shared("handheld_sheet")
def test_real_coarse_sheets_lie_as_true_as_their_points_were_measured():
    """301 points 18 mm apart, true to about a millimetre themselves; 1.20 mm with one round of smoothing for bends."""
    truth_mm = np.loadtxt(DATA / "handheld_sheet" / "flat_truth_mm.csv", delimiter=",", comments="#")
    scans = [repair(read_scan(path).scan) for path in sorted((DATA / "handheld_sheet").glob("*.obj"))]
    flats = [flatten(scan.scan.mesh, scan.topology).page_xy for scan in scans]
    rms = [rigid_rms(flat, truth_mm[np.argsort(scan.mesh_rows)]) for flat, scan in zip(flats, scans, strict=True)]
    assert len(rms) == 4
    assert np.mean(rms) < 1.1


@pytest.mark.parametrize("points", [1000, 3000, 6000])
def test_the_folds_of_a_coarse_crumpled_sheet_are_no_noise(points):
    """They look like strong noise that neighbours share, but the raw lengths lie flat nearly without strain."""
    mesh, truth_xy = sheet_mesh(sheet("crumpled"), points, noise_mm=0.2, layout="range", rng=3)
    flat = flatten(mesh, topology(mesh.faces, len(mesh.points)))
    assert flat.lengths == "unfolded"
    assert rigid_rms(flat.page_xy, truth_xy) < 3.0  # 1.0 to 2.4; without its folds 4.4 to 4.8
