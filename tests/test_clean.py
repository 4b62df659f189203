import numpy as np
import pytest

from planish.errors import InputError
from planish.mesh import onto_support_plane, repair, topology
from planish.types import Mesh, Scan
from shapes import arch, grid


def scan_of(points, faces, **kw):
    return Scan(Mesh(points, faces), **kw)


def sheet(rows=8, cols=6):
    uv, faces = grid(rows, cols)
    return arch(uv), faces


def looks_consistent(faces, count):
    topo = topology(faces, count)
    half = np.concatenate([faces[:, [k, (k + 1) % 3]] for k in range(3)])
    return topo.edge_uses.max() <= 2 and len(np.unique(half, axis=0)) == len(half)


def test_a_good_sheet_passes_unchanged_and_without_a_word():
    points, faces = sheet()
    c = repair(scan_of(points, faces))
    np.testing.assert_array_equal(c.scan.mesh.points, points)
    np.testing.assert_array_equal(c.scan.mesh.faces, faces)
    np.testing.assert_array_equal(c.mesh_rows, np.arange(len(points)))
    assert (c.pieces, c.holes, c.warnings) == (1, 0, ())


@pytest.mark.slow
def test_a_hole_is_counted():
    points, faces = sheet()
    gone = (faces == 3 * 6 + 3).any(axis=1)
    c = repair(scan_of(points, faces[~gone]))
    assert c.holes == 1
    assert c.mesh_rows[3 * 6 + 3] == -1
    assert any("1 points belong to no face" in w.sentence for w in c.warnings)


def test_points_that_are_not_finite_are_left_out_with_their_faces():
    points, faces = sheet()
    points[7] = np.nan
    points[20, 1] = np.inf
    c = repair(scan_of(points, faces))
    assert c.mesh_rows[7] == c.mesh_rows[20] == -1
    assert np.isfinite(c.scan.mesh.points).all()
    assert c.warnings[0].sentence.startswith("2 points are not finite numbers")


def test_faces_used_twice_or_with_a_point_twice_are_left_out():
    points, faces = sheet()
    bad = np.concatenate([faces, faces[:3], [[0, 0, 1]]])
    c = repair(scan_of(points, bad))
    assert len(c.scan.mesh.faces) == len(faces)
    assert len(c.warnings) == 2


def test_a_small_flap_at_an_edge_with_three_faces_is_left_out():
    points, faces = sheet(30, 30)
    points = np.r_[points, points[[200]] + [0, 0, 1]]
    c = repair(scan_of(points, np.r_[faces, [[faces[300][0], faces[300][1], len(points) - 1]]]))
    assert len(c.scan.mesh.faces) == len(faces)
    assert "flap" in c.warnings[0].sentence


def test_a_book_with_three_leaves_at_one_spine_is_refused():
    uv, faces = grid(8, 6)
    leaves = [np.c_[uv[:, 0] * np.cos(a), uv[:, 1], uv[:, 0] * np.sin(a)] for a in (0.2, 1.5, 2.5)]
    points = np.concatenate(leaves)
    spine = np.flatnonzero(uv[:, 0] == 0)
    for leaf in (1, 2):  # all leaves use the spine points of the first
        faces = np.r_[faces, grid(8, 6)[1] + leaf * len(uv)]
        faces[np.isin(faces, spine + leaf * len(uv))] -= leaf * len(uv)
    with pytest.raises(InputError, match="more than two faces, the first between points"):
        repair(scan_of(points, faces))


def test_faces_that_run_the_wrong_way_are_turned():
    points, faces = sheet()
    faces[5:9] = faces[5:9, ::-1]
    c = repair(scan_of(points, faces))
    assert looks_consistent(c.scan.mesh.faces, len(points))
    assert "4 faces ran the other way round" in c.warnings[0].sentence
    assert (
        np.cross(
            *(c.scan.mesh.points[c.scan.mesh.faces[:, k]] - c.scan.mesh.points[c.scan.mesh.faces[:, 0]] for k in (1, 2))
        )[:, 2]
        > 0
    ).all()


@pytest.mark.parametrize("per_corner", [False, True])
def test_the_photo_tells_which_side_is_printed(per_corner):
    points, faces = sheet()
    photo_xy = points[:, :2] * [1, -1]  # seen from above, y down
    photo_xy = photo_xy[faces] if per_corner else photo_xy
    right = repair(scan_of(points, faces, photo_xy=photo_xy))
    backwards = faces[:, ::-1]
    wrong = repair(scan_of(points, backwards, photo_xy=photo_xy[:, ::-1] if per_corner else photo_xy))
    assert right.warnings == ()
    assert "clockwise seen from the side of the photo" in wrong.warnings[0].sentence
    up = [
        np.cross(*(m.points[m.faces[:, k]] - m.points[m.faces[:, 0]] for k in (1, 2)))[:, 2] > 0
        for m in (right.scan.mesh, wrong.scan.mesh)
    ]
    assert up[0].all()
    assert up[1].all()
    if per_corner:  # every corner kept its own place in the photo
        np.testing.assert_allclose(wrong.scan.photo_xy, points[wrong.scan.mesh.faces][..., :2] * [1, -1])


def test_a_seam_is_welded_and_keeps_both_photo_places():
    points, faces = sheet()
    left = points[faces].mean(1)[:, 0] < 0
    split = np.r_[points, points]
    faces = np.where(left[:, None], faces, faces + len(points))
    photo_xy = split[:, :2] * [1, -1] + np.repeat([[0, 0], [500, 0]], len(points), axis=0)
    c = repair(scan_of(split, faces, photo_xy=photo_xy))
    assert c.pieces == 1
    assert len(c.scan.mesh.points) == len(points)
    assert c.scan.photo_xy.shape == (len(faces), 3, 2)
    assert {tuple(p) for p in c.scan.photo_xy.reshape(-1, 2)} <= {tuple(p) for p in photo_xy}
    assert "welded" in c.warnings[0].sentence


def test_a_triangle_soup_becomes_one_sheet():
    points, faces = sheet()
    c = repair(scan_of(points[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3)))
    assert (c.pieces, len(c.scan.mesh.points)) == (1, len(points))


@pytest.mark.parametrize("slope", [0.0, 1.0], ids=["tube", "cone"])
def test_a_seam_that_was_cut_on_purpose_stays_open(slope):
    uv, faces = grid(9, 25, 2 * np.pi, 30.0)
    radius = 10 + slope * uv[:, 1]
    points = np.c_[radius * np.cos(uv[:, 0]), radius * np.sin(uv[:, 0]), uv[:, 1]].round(9)
    assert np.allclose(points[0], points[24])
    points[24::25] = points[::25]  # the same place to the last bit
    c = repair(scan_of(points, faces))
    assert len(c.scan.mesh.points) == len(points)
    assert c.holes == 0


def test_dust_is_left_out_and_a_second_sheet_is_kept():
    points, faces = sheet()
    speck = np.array([[900.0, 0, 0], [901, 0, 0], [900, 1, 0]])
    c = repair(scan_of(np.r_[points, speck], np.r_[faces, [len(points) + np.arange(3)]]))
    assert c.pieces == 1
    assert "1 small loose pieces" in c.warnings[0].sentence
    c = repair(scan_of(np.r_[points, points + [400, 0, 0]], np.r_[faces, faces + len(points)]))
    assert c.pieces == 2
    assert "in 2 pieces" in c.warnings[0].sentence


def test_the_topology_is_that_of_the_cleaned_mesh_however_points_were_renumbered():
    points, faces = sheet()
    order = np.random.default_rng(0).permutation(2 * len(points))  # two sheets, their points all mixed up
    both, mixed = np.r_[points, points + np.array([400, 0, 0])], np.r_[faces, faces + len(points)]
    c = repair(scan_of(both[order], np.argsort(order)[mixed]))
    fresh = topology(c.scan.mesh.faces, len(c.scan.mesh.points))
    np.testing.assert_array_equal(c.topology.edges, fresh.edges)
    np.testing.assert_array_equal(c.topology.edge_faces, fresh.edge_faces)
    np.testing.assert_allclose(c.scan.mesh.points[c.mesh_rows], both[order])


def box():
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return 100 * corners, np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])


def moebius():
    uv, faces = grid(5, 41, 2 * np.pi, 2.0)
    u, w = uv[:, 0], uv[:, 1] - 1
    points = np.c_[(5 + w * np.cos(u / 2)) * np.cos(u), (5 + w * np.cos(u / 2)) * np.sin(u), w * np.sin(u / 2)]
    at = np.arange(len(uv)).reshape(5, 41)
    swap = np.arange(len(uv))
    swap[at[:, 40]] = at[::-1, 0]  # the end is glued to the start upside down
    return points, swap[faces]


@pytest.mark.parametrize(
    ("shape", "sentence"),
    [
        (lambda: (np.zeros((0, 3)), np.zeros((0, 3))), "no points"),
        (lambda: (np.zeros((4, 3)), np.zeros((0, 3))), "4 points but no faces"),
        (lambda: (sheet()[0][:40], sheet()[1]), "uses point 4., but there are 40 points"),
        (lambda: (sheet()[0], sheet()[1] - 1), "uses point -1"),
        (lambda: (np.full((48, 3), np.nan), sheet()[1]), "no face of the scan has three different, finite points"),
        (lambda: (sheet()[0] * [0, 1, 0], sheet()[1]), "on one line"),
        (lambda: (sheet()[0] * 0, sheet()[1]), "on one line"),
        (box, "closed"),
        (moebius, "one side only"),
    ],
)
def test_what_cannot_be_a_sheet_is_refused_in_a_sentence(shape, sentence):
    with pytest.raises(InputError, match=sentence):
        repair(scan_of(*shape()))


def test_a_hundred_thousand_random_faces_end_with_a_sentence():
    rng = np.random.default_rng(1)
    with pytest.raises(InputError):
        repair(scan_of(rng.normal(size=(100_000, 3)), rng.integers(0, 100_000, (200_000, 3))))


def rotation(rng):
    q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return q * np.sign(np.linalg.det(q))


@pytest.mark.parametrize("seed", range(5))
def test_the_table_is_found_in_any_frame(seed):
    """Tilted 40 degrees, in camera frame, upside down: the sheet comes to stand as it stood."""
    points, faces = sheet(20, 20)
    turn = rotation(np.random.default_rng(seed))
    found, rot, shift = onto_support_plane(Mesh(points @ turn.T + [7, -90, 600], faces))
    np.testing.assert_allclose(found[:, 2], points[:, 2], atol=1e-6)  # the arch stands on its two long sides
    np.testing.assert_allclose((points @ turn.T + [7, -90, 600]) @ rot.T + shift, found, atol=1e-9)
    assert np.linalg.det(rot) == pytest.approx(1)


def test_a_tilted_sheet_that_is_not_symmetric_rests_on_three_points():
    uv, faces = grid(30, 20)
    points = np.c_[uv, 20 + 15 * np.sin(uv[:, 0] / 40) + 10 * np.cos(uv[:, 1] / 30)]
    found, _, _ = onto_support_plane(Mesh(points, faces))
    assert found[:, 2].min() == pytest.approx(0, abs=1e-9)
    assert (found[:, 2] < 0.5).sum() >= 3
    assert np.ptp(found[found[:, 2] < 0.5][:, :2], axis=0).min() > 20  # and not on one bump alone
