"""From photos with known cameras to a surface: patches, rim, outline, heights; each against exact geometry."""

import cv2
import numpy as np
import pytest

from planish.acquire.photos.height_field import Grid, fit_heights, interpolation
from planish.acquire.photos.outline import clip_mesh, distance_inside
from planish.acquire.photos.paper import Paper, find_paper
from planish.acquire.photos.patch_matching import match_patches, stack_photos
from planish.acquire.photos.rim import rim_points
from planish.acquire.photos.surface import Level
from planish.acquire.photos.surface import _match as match_surface
from planish.gallery.scene_view import aim_camera
from planish.geometry import project
from planish.mesh import area_vectors, grid_faces

SHAPE_RC = (300, 400)
EYES = [(120.0, 0.0, 400.0), (-120.0, 20.0, 400.0), (0.0, 130.0, 400.0), (20.0, -130.0, 400.0)]
CAMERAS = [aim_camera(eye, (0, 0, 0), 200.0, SHAPE_RC, (0.05, -0.06, 0.0, 0.0)) for eye in EYES]


def print_at(x, y):
    """A pattern without a period."""
    return 128 + 40 * np.sin(0.9 * x) + 35 * np.sin(1.3 * y + 0.4 * x) + 30 * np.sin(0.31 * x * y / 10 + 0.2 * y)


def photo_of_plane(camera, height):
    """What a camera sees of the printed plane z = height, by intersecting every pixel's ray with it."""
    pixels = np.stack(np.meshgrid(np.arange(400.0), np.arange(300.0)), axis=-1).reshape(-1, 1, 2)
    flat = cv2.undistortPoints(pixels, camera.matrix, camera.distortion).reshape(-1, 2)
    rays = np.column_stack([flat, np.ones(len(flat))]) @ camera.rotation
    eye = -camera.rotation.T @ camera.translation
    hit = eye + rays * ((height - eye[2]) / rays[:, 2:])
    return print_at(hit[:, 0], hit[:, 1]).reshape(SHAPE_RC).astype(np.float32)


@pytest.mark.parametrize("height", [0.0, 0.7, -1.1])
def test_patches_find_how_far_the_surface_must_move(height):
    photos = [photo_of_plane(camera, height) for camera in CAMERAS]
    points = np.array([[x, y, 0.0] for x in (-40, -10, 25) for y in (-30, 5, 33)])
    normals = np.tile([0.0, 0, 1], (len(points), 1))
    seen = np.ones((len(points), len(CAMERAS)), bool)
    stack = stack_photos(photos, CAMERAS, [1.0] * len(photos))
    found = match_patches(stack, points, normals, seen, 0.5, 0.25, 8)
    # A pixel is 0.5 mm; a bilinear sample of this print is right to a twentieth of one.
    assert np.abs(found.offset - height).max() < 0.03
    assert found.agreement.min() > 0.95
    assert found.agrees.all()


def test_a_photo_of_something_else_is_left_out_of_a_match():
    photos = [photo_of_plane(camera, 0.5) for camera in CAMERAS]
    photos[2] = np.random.default_rng(0).uniform(0, 255, SHAPE_RC).astype(np.float32)
    points, normals = np.zeros((1, 3)), np.array([[0.0, 0, 1]])
    stack = stack_photos(photos, CAMERAS, [1.0] * len(photos))
    found = match_patches(stack, points, normals, np.ones((1, 4), bool), 0.5, 0.25, 6)
    assert found.agrees[0].tolist() == [True, True, False, True]
    assert found.offset[0] == pytest.approx(0.5, abs=0.03)


def test_a_photo_of_another_sheet_is_unlike_the_others():
    photos = [photo_of_plane(camera, 0.0) for camera in CAMERAS]
    photos[1] = np.roll(photos[1], 40, axis=1)  # the same print elsewhere
    grid = Grid(np.array([-40.0, -30.0, 0.0]), np.eye(3), 2.0, (31, 41))
    stack = stack_photos(photos, CAMERAS, [1.0] * len(photos))
    seen = np.ones((31 * 41, len(CAMERAS)), bool)
    level = Level(300, 40, 3, 1)
    _, likeness = match_surface(grid, np.zeros((31, 41)), CAMERAS, stack, seen, 0.5, level)
    assert likeness[[0, 2, 3]].min() > 0.95
    assert likeness[1] < 0.2


def test_blank_paper_has_no_match():
    photos = [np.full(SHAPE_RC, 200, np.float32)] * 4
    stack = stack_photos(photos, CAMERAS, [1.0] * 4)
    found = match_patches(stack, np.zeros((1, 3)), np.array([[0.0, 0, 1]]), np.ones((1, 4), bool), 0.5, 0.25, 6)
    assert np.isnan(found.offset[0])


def roof(x):
    return 0.6 * np.abs(x - 50)


def test_heights_keep_a_crease_sharp_and_pass_over_false_points():
    grid = Grid(np.zeros(3), np.eye(3), 2.0, (41, 51))
    rng = np.random.default_rng(1)
    places = rng.uniform(0, 1, (1500, 2)) * [50, 40]
    measured = roof(2 * places[:, 0]) + 0.05 * rng.standard_normal(len(places))
    measured[:20] += 15  # false matches
    heights, weight = fit_heights(grid, interpolation(grid, places), measured, np.full(len(places), 0.05), 300.0)
    truth = roof(2 * np.arange(51.0))[None]
    # The crease lies on a node, so that the roof itself can be met; 12 rounds of reweighting leave it 0.31 mm round,
    # 8 rounds 0.54.
    assert np.abs(heights - truth).max() < 0.4
    assert weight[:20].max() < 0.05


def test_the_weight_of_a_grid_reaches_only_its_active_nodes():
    grid = Grid(np.zeros(3), np.eye(3), 1.0, (20, 20))
    places = np.array([[x, y] for x in range(3, 9) for y in range(3, 9)], float)
    active = np.zeros((20, 20), bool)
    active[2:10, 2:10] = True
    heights, _ = fit_heights(
        grid, interpolation(grid, places), 0.5 * places[:, 0], np.full(36, 0.1), 10.0, np.zeros((20, 20)), active
    )
    assert heights[5, 2:10] == pytest.approx(0.5 * np.arange(2, 10), abs=1e-3)  # goes on straight beyond the data
    assert heights[5, 19] == heights[5, 9]


def test_a_fold_goes_on_straight_through_blank_paper():
    """A gutter like a book's, measured at its two ends and on the printed parts beside it."""
    grid = Grid(np.zeros(3), np.eye(3), 1.0, (60, 50))
    u, v = np.meshgrid(np.arange(50.0), np.arange(60.0))
    depth = np.where(np.abs(u - 24.5) < 20, (1 - np.abs(u - 24.5) / 20) ** 2, 0) * -20
    known = (np.abs(u - 24.5) > 12) | (v < 2) | (v > 57)
    places = np.stack([u[known], v[known]], axis=1)
    noise = np.random.default_rng(0).normal(0, 0.05, known.sum())
    at = interpolation(grid, places)
    heights, _ = fit_heights(grid, at, depth[known] + noise, np.full(known.sum(), 0.1), 30.0)
    for _ in range(2):
        heights, _ = fit_heights(grid, at, depth[known] + noise, np.full(known.sum(), 0.1), 30.0, heights)
    # The flanks come out straight where they are curved; with a round bottom 13 of the 19 mm would be missing.
    assert np.abs(heights - depth)[~known].max() < 3.0


SQUARE = np.array([[-60.0, -45, 5], [60, -45, 5], [60, 45, 5], [-60, 45, 5]])


def papers_of_square():
    papers = []
    for camera in CAMERAS:
        sides = zip(SQUARE, np.roll(SQUARE, -1, axis=0), strict=True)
        dense = np.concatenate([np.linspace(a, b, 100, endpoint=False) for a, b in sides])
        mask = np.zeros(SHAPE_RC, np.uint8)
        cv2.fillPoly(mask, [np.rint(project(camera, dense)).astype(np.int32)], 1)
        inside = cv2.distanceTransform(mask, cv2.DIST_L2, 5) - cv2.distanceTransform(1 - mask, cv2.DIST_L2, 5)
        papers.append(Paper(255 * mask, inside.astype(np.float16)))
    return papers


def test_points_of_the_rim_lie_on_the_rim():
    found = rim_points(papers_of_square(), CAMERAS, SQUARE)
    assert len(found) > 400
    # Masks of whole pixels of 0.5 mm, seen from 17 degrees off the vertical: a height is right to 1.5 mm.
    assert np.quantile(np.abs(found[:, 2] - 5), 0.9) < 1.5
    away = np.minimum(np.abs(np.abs(found[:, 0]) - 60), np.abs(np.abs(found[:, 1]) - 45))
    assert np.quantile(away, 0.9) < 0.5


def test_distance_from_the_outline_is_in_mm():
    points = np.array([[50.0, 0, 5], [59, 0, 5], [62, 0, 5], [0, 43, 5]])
    found = distance_inside(points, np.ones((4, 4), bool), CAMERAS, papers_of_square())
    assert found == pytest.approx([10, 1, -2, 2], abs=0.5)  # a pixel


def test_a_mesh_cut_at_its_outline_has_the_area_within():
    row, col = np.mgrid[:21, :21]
    points = np.column_stack([col.ravel(), row.ravel(), 0 * row.ravel()]).astype(float)
    index = np.arange(441, dtype=np.int32).reshape(21, 21)
    faces = grid_faces(index, points, 10.0)
    inside = 7.3 - np.hypot(points[:, 0] - 10, points[:, 1] - 10)
    cut, new_faces, ends, share = clip_mesh(points, faces, inside)
    area = np.linalg.norm(area_vectors(cut, new_faces), axis=1).sum()
    # Chords of a circle of radius 7.3 with cells of 1: short by under a hundredth; snapping moves it by a tenth cell.
    assert area == pytest.approx(np.pi * 7.3**2, rel=0.02)
    assert np.allclose(cut, points[ends[:, 0]] + share[:, None] * (points[ends[:, 1]] - points[ends[:, 0]]))


def test_paper_on_wood_that_is_as_bright_in_red():
    rng = np.random.default_rng(2)
    photo = np.empty((600, 800, 3), np.uint8)
    photo[:] = np.clip(np.array([200, 140, 90]) + rng.normal(0, 12, (600, 800, 1)), 0, 255)
    photo[150:450, 200:600] = [222, 220, 214]
    found = find_paper(photo)
    assert found is not None
    assert found.share.sum(dtype=float) / 255 == pytest.approx(300 * 400, rel=0.01)
    assert found.inside_px[300, 210] == pytest.approx(10, abs=1.5)
    assert found.inside_px[300, 190] == pytest.approx(-10, abs=1.5)


WOOD = np.array([120, 85, 55])


def on_table(table, seed=3):
    """Paper (222) of 400 x 300 pixels on a table, with a notch in its lower side and a card that nearly touches it."""
    rng = np.random.default_rng(seed)
    photo = np.empty((600, 800, 3), np.uint8)
    photo[:] = np.clip(table + rng.normal(0, 6, (600, 800, 1)), 0, 255)
    photo[150:450, 200:600] = 222
    photo[250:330, 610:690] = 222
    notch = np.array([[394, 451], [400, 420], [406, 451]])
    cv2.fillPoly(photo, [notch], (0.7 * table).astype(int).tolist())  # the table in the sheet's shade
    return photo


@pytest.mark.parametrize("table", [WOOD, np.array([90, 90, 90])])
def test_notches_of_the_outline_are_ground_and_print_at_the_rim_is_not(table):
    photo = on_table(table)
    photo[150:158, 300:314] = 25  # a bar of black print up to the rim
    found = find_paper(photo)
    assert found.inside_px[446, 400] < 0
    assert found.inside_px[410, 400] > 5
    assert found.inside_px[154, 307] > 0
    assert found.inside_px[290, 650] < 0  # the card is no part of the sheet
    assert found.inside_px[290, 598] > 0
