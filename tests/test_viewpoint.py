"""Where a scanner stood, told from its points and their places on the photo."""

from dataclasses import replace

import numpy as np
import pytest

from planish.gallery import sheet, virtual_scan
from planish.geometry.projection import project
from planish.geometry.viewpoint import viewpoint
from planish.mesh import topology
from planish.pipeline import restore
from planish.types import Mesh, Scan
from shapes import rigid_rms


def scanned(noise_mm=0.05, **kwargs):
    made = virtual_scan(sheet("letter"), points=20_000, noise_mm=noise_mm, photo_px=None, **kwargs)
    mesh, camera = made.scan.mesh, made.scan.camera
    edges = topology(mesh.faces, len(mesh.points)).edges
    return made, project(camera, mesh.points), edges, -camera.rotation.T @ camera.translation


@pytest.mark.slow
@pytest.mark.parametrize("noise_mm", [0.0, 0.05, 0.5])
def test_a_range_scan_tells_where_it_was_taken_from_whatever_its_noise(noise_mm):
    made, photo_xy, edges, truth = scanned(noise_mm, tilt_deg=12.0)
    np.testing.assert_allclose(viewpoint(made.scan.mesh, photo_xy, edges), truth, atol=0.01)


def test_places_as_rough_as_a_file_writes_them_still_tell():
    made, photo_xy, edges, truth = scanned()
    found = viewpoint(made.scan.mesh, np.round(photo_xy / 4000, 6) * 4000, edges)  # OBJ: six digits
    np.testing.assert_allclose(found, truth, atol=0.5)  # of 680 mm


def test_errors_across_the_rays_are_not_taken_for_errors_along_them():
    made, photo_xy, edges, _ = scanned(0.0)
    points = made.scan.mesh.points + np.random.default_rng(1).normal(0, 0.1, made.scan.mesh.points.shape)
    assert viewpoint(Mesh(points, made.scan.mesh.faces), photo_xy, edges) is None


def test_a_mesh_without_rows_of_pixels_tells_nothing_though_one_camera_sees_it():
    made, _, _, _ = scanned()
    some = np.random.default_rng(1).choice(len(made.truth_xy), 4000, replace=False)
    from scipy.spatial import Delaunay

    faces = Delaunay(made.truth_xy[some]).simplices.astype(np.int32)
    mesh = Mesh(made.scan.mesh.points[some], faces)
    photo_xy = project(made.scan.camera, mesh.points)
    assert viewpoint(mesh, photo_xy, topology(faces, len(some)).edges) is None


def test_nothing_is_told_without_places_on_a_photo_or_from_one_place():
    made, photo_xy, edges, _ = scanned()
    assert viewpoint(made.scan.mesh, None, edges) is None
    assert viewpoint(made.scan.mesh, np.zeros_like(photo_xy), edges) is None
    assert viewpoint(made.scan.mesh, np.zeros((len(made.scan.mesh.faces), 3, 2)), edges) is None


@pytest.mark.slow
def test_the_page_of_a_range_scan_is_truer_than_its_noise_along_the_sheet():
    made, photo_xy, _, _ = scanned(0.2)
    told = restore(replace(made.scan, photo_xy=photo_xy))
    order = np.random.default_rng(0).permutation(len(made.truth_xy))  # without its rows a mesh does not show its rays
    untold = restore(Scan(Mesh(made.scan.mesh.points[order], np.argsort(order)[made.scan.mesh.faces])))
    rms = [
        rigid_rms(told.flattening.page_xy, made.truth_xy),
        rigid_rms(untold.flattening.page_xy, made.truth_xy[order]),
    ]
    assert rms[0] < 0.6 * rms[1]
    assert told.report.flatten.expected_error_mm < 0.8 * untold.report.flatten.expected_error_mm
