"""Strain and distortion of every face, in the order of the faces that were given."""

import numpy as np
import pytest

import planish
from planish.gallery import sheet, sheet_mesh
from planish.sticks import face_distortion
from shapes import grid


def straight_strain(points, faces, page_xy):
    """Rms of |l / r - 1| of the edges of every face, by raw lengths."""
    sides = [
        np.linalg.norm(page_xy[faces[:, k]] - page_xy[faces[:, k - 1]], axis=1)
        / np.linalg.norm(points[faces[:, k]] - points[faces[:, k - 1]], axis=1)
        - 1
        for k in range(3)
    ]
    return np.sqrt(np.mean(np.square(sides), axis=0))


@pytest.fixture(scope="module")
def crumpled():
    return sheet_mesh(sheet("crumpled"), points=600)[0]


def assert_strain_is_of_its_own_face(points, faces, kept):
    flat = planish.flatten(points, faces, lengths="unfolded")  # whose edges have their raw lengths
    with np.errstate(invalid="ignore"):  # faces of no length
        want = straight_strain(points, faces, flat.page_xy)
    assert flat.face_strain.shape == (len(faces),)
    # Places are moved, turned and mirrored after the strain was taken: rounding of 500 mm in parts of 1 mm.
    np.testing.assert_allclose(flat.face_strain[kept], want[kept], atol=1e-9)
    assert np.isnan(flat.face_strain[~kept]).all()
    assert np.ptp(flat.face_strain[kept]) > 1e-4  # they differ, so that the order shows


def test_strain_of_faces_in_file_order(crumpled):
    assert_strain_is_of_its_own_face(crumpled.points, crumpled.faces, np.ones(len(crumpled.faces), bool))


def test_strain_of_faces_in_random_order(crumpled, monkeypatch):
    monkeypatch.setattr("planish.mesh.memory_order.SCATTERED", 0.0)
    rng = np.random.default_rng(1)
    place = rng.permutation(len(crumpled.points))
    points = np.empty_like(crumpled.points)
    points[place] = crumpled.points
    faces = place[rng.permutation(crumpled.faces)]
    assert_strain_is_of_its_own_face(points, faces, np.ones(len(faces), bool))


def test_faces_that_were_left_out_have_no_strain_and_windings_do_not_count(crumpled):
    faces = np.vstack([[0, 0, 1], crumpled.faces, [2, 3, 3]])
    faces[5] = faces[5, ::-1]
    kept = np.ones(len(faces), bool)
    kept[[0, -1]] = False
    assert_strain_is_of_its_own_face(crumpled.points, faces, kept)


def test_a_decimated_mesh_has_a_strain_for_every_face(crumpled):
    flat = planish.flatten(crumpled, settings=planish.FlattenSettings(points=200))
    assert flat.solved_points < len(crumpled.points)
    np.testing.assert_allclose(flat.face_strain**2, (flat.local_strain[crumpled.faces] ** 2).mean(axis=1))


@pytest.mark.parametrize("stretch", [(1.0, 1.0), (1.1, 1.0), (0.9, 1.05), (0.5, 0.5), (2.0, 0.25)])
@pytest.mark.parametrize("angle", [0.0, 0.7])
def test_distortion_of_a_page_stretched_by_known_factors(stretch, angle):
    uv, faces = grid(9, 7)
    c, s = np.cos(angle), np.sin(angle)
    page = uv @ [[c, s], [-s, c]] * stretch
    got = face_distortion(np.c_[uv, np.zeros(len(uv))], faces, page)
    large, small = max(stretch), min(stretch)
    length = large - 1 if large - 1 >= 1 - small else small - 1
    angle_change = np.degrees(2 * np.arcsin((large - small) / (large + small)))
    # 1e-6 degrees: near 0 the arc sine of a difference of rounded numbers
    np.testing.assert_allclose(got, np.tile([large * small - 1, angle_change, length], (len(faces), 1)), atol=1e-6)


def test_distortion_does_not_change_when_surface_page_or_faces_turn(crumpled):
    flat = planish.flatten(crumpled)
    want = face_distortion(crumpled.points, crumpled.faces, flat.page_xy)
    turn = np.array([[0, 0, 1.0], [1, 0, 0], [0, 1, 0]])
    for points, faces, page in (
        (crumpled.points @ turn + 5, crumpled.faces, flat.page_xy),
        (crumpled.points, crumpled.faces, flat.page_xy[:, ::-1] - 3),
        (crumpled.points, np.ascontiguousarray(crumpled.faces[:, [1, 0, 2]]), flat.page_xy),
    ):
        np.testing.assert_allclose(face_distortion(points, faces, page), want, atol=1e-6)
    assert np.isfinite(want).any()


def test_faces_without_area_have_no_distortion():
    points = np.array([[0.0, 0, 0], [4, 0, 0], [2, 0.01, 0], [0, 3, 0], [np.nan, 0, 0]])
    faces = np.array([[0, 1, 2], [0, 0, 1], [0, 1, 4], [0, 1, 3]], np.int32)
    got = face_distortion(points, faces, np.ascontiguousarray(points[:, :2]))
    assert np.isnan(got[:3]).all()
    np.testing.assert_allclose(got[3], 0, atol=1e-12)
