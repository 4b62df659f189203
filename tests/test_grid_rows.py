"""The viewpoint of a range image, from the rows and columns of a bare mesh."""

import numpy as np
import pytest

from planish.gallery import sheet, sheet_mesh, virtual_scan
from planish.geometry.grid_rows import LEAST_IN_ROWS, viewpoint_of_rows
from planish.mesh import grid_faces, local_order, renumbered, topology
from planish.types import Page

BLANK = Page(np.full((60, 50), 255, np.uint8), np.ones((60, 50), bool), 25.4), ""


@pytest.mark.parametrize("noise_mm", [0.0, 0.05, 0.5])
def test_a_range_scan_shows_where_it_was_taken_from(noise_mm):
    paper = sheet("wave", width_mm=50.0, height_mm=60.0)
    made = virtual_scan(paper, points=8000, photo_px=None, printed=BLANK, noise_mm=noise_mm, rng=1)
    camera = made.scan.camera
    edges = topology(made.scan.mesh.faces, len(made.truth_xy)).edges
    eye = viewpoint_of_rows(made.scan.mesh.points, edges)
    # The surface is shallow beside the distance: along the view the place is less sure, and matters less.
    np.testing.assert_allclose(eye, -camera.rotation.T @ camera.translation, atol=1.5)


def test_a_mesh_without_rows_or_with_errors_in_all_directions_shows_nothing():
    random, _ = sheet_mesh(sheet("wave"), 5000, layout="delaunay")
    assert viewpoint_of_rows(random.points, topology(random.faces, len(random.points)).edges) is None
    grid, _ = sheet_mesh(sheet("wave"), 5000, layout="grid")
    points = grid.points + np.random.default_rng(0).normal(0, 0.1, grid.points.shape)
    assert viewpoint_of_rows(points, topology(grid.faces, len(points)).edges) is None


def test_a_random_mesh_in_memory_order_is_no_range_image(monkeypatch):
    """Its consecutive points share edges as well; runs need not be laid out to see that they are no rows."""
    random, _ = sheet_mesh(sheet("wave"), 5000, layout="delaunay")
    mesh = renumbered(random, local_order(random, topology(random.faces, len(random.points))))
    edges = topology(mesh.faces, len(mesh.points)).edges
    assert (np.diff(edges, axis=1) == 1).mean() > LEAST_IN_ROWS
    monkeypatch.setattr("planish.geometry.grid_rows._aligned", lambda *_: pytest.fail("rows were laid out"))
    assert viewpoint_of_rows(mesh.points, edges) is None


def test_holes_in_the_image_do_not_matter():
    rng = np.random.default_rng(2)
    known = rng.random((40, 50)) > 0.03
    known[12:20, 25:33] = False
    index = np.where(known, np.cumsum(known).reshape(known.shape) - 1, -1).astype(np.int32)
    row, col = np.nonzero(known)
    depth = 400 + 4 * np.sin(col / 9) + 3 * np.cos(row / 7) + rng.normal(0, 0.1, len(row))
    points = np.stack([(col - 25) / 900, (row - 20) / 900, np.ones(len(row))], axis=1) * depth[:, None]
    eye = viewpoint_of_rows(points, topology(grid_faces(index, points), len(points)).edges)
    np.testing.assert_allclose(eye, 0, atol=0.5)
