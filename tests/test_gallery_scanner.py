import cv2
import numpy as np
import pytest

from planish.errors import UsageError
from planish.gallery import SHEETS, Light, sheet, virtual_scan
from planish.gallery.photograph import INK, PAPER
from planish.gallery.sheets import normals
from planish.types import Page


def white_page(width_mm=215.9, height_mm=279.4, dpi=50.0):
    shape = (round(height_mm * dpi / 25.4), round(width_mm * dpi / 25.4))
    return Page(np.full(shape, 255, np.uint8), np.ones(shape, bool), dpi), ""


def eye_of(camera):
    return -camera.rotation.T @ camera.translation


def opencv_xy(camera, points):
    turn = cv2.Rodrigues(np.asarray(camera.rotation))[0]
    return cv2.projectPoints(np.asarray(points), turn, np.asarray(camera.translation), np.asarray(camera.matrix), None)[
        0
    ][:, 0]


@pytest.mark.slow
@pytest.mark.parametrize("name", SHEETS)
def test_points_lie_on_the_sheet_and_photo_xy_is_their_place_in_the_photo(name):
    virtual = virtual_scan(
        sheet(name), points=8000, photo_px=(400, 300), printed=None if name == "spread" else white_page()
    )
    scan = virtual.scan
    assert len(scan.mesh.points) == pytest.approx(8000, rel=0.06)
    np.testing.assert_allclose(scan.mesh.points, virtual.sheet.bend(virtual.truth_xy), atol=1e-9)
    np.testing.assert_allclose(scan.photo_xy, opencv_xy(scan.camera, scan.mesh.points), atol=1e-8)
    rows, cols = scan.camera.shape_rc
    assert (rows, cols) == ((300, 400) if name == "spread" else (400, 300))
    assert scan.photo.shape == (rows, cols, 3)
    assert (scan.photo_xy > 0).all()
    assert (scan.photo_xy < [cols - 1, rows - 1]).all()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["book", "crumpled", "curl"])
def test_the_range_image_has_square_pixels(name):
    scan = virtual_scan(sheet(name), points=20_000, photo_px=(400, 300), printed=white_page()).scan
    corners = scan.photo_xy[scan.mesh.faces]
    legs = np.sort(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2), axis=1)[:, :2]
    pixel = np.median(legs)
    # Newton's method stops within 0.001 photo pixels; at a sharp crease it may stop short.
    assert (np.abs(legs - pixel) < 0.003).mean() > 0.995
    assert np.abs(legs - pixel).max() < 0.3 * pixel


@pytest.mark.parametrize("name", ["spread", "curl", "wave"])
def test_faces_show_the_printed_side_to_the_camera(name):
    virtual = virtual_scan(sheet(name), points=10_000, photo_px=None)
    mesh = virtual.scan.mesh
    a, b, c = (mesh.points[mesh.faces[:, k]] for k in range(3))
    way = eye_of(virtual.scan.camera) - a
    assert (np.einsum("ij,ij->i", np.cross(b - a, c - a), way) > 0).all()
    towards = np.einsum("ij,ij->i", normals(virtual.sheet, virtual.truth_xy), eye_of(virtual.scan.camera) - mesh.points)
    assert (towards > 0).mean() > 0.999  # a pixel on the very horizon may be seen through a flat face


@pytest.mark.slow
def test_hidden_parts_have_no_points_and_nothing_spans_the_gap():
    bent = sheet("curl", turn_deg=150.0, length_mm=140.0)
    virtual = virtual_scan(bent, points=30_000, photo_px=None)
    camera, mesh = virtual.scan.camera, virtual.scan.mesh
    # Nearest surface in cells of 1.3 mm from a million places, found without meshes.
    places = np.random.default_rng(0).uniform(0, 1, (1_000_000, 2)) * [bent.width_mm, bent.height_mm]

    def cells(points):
        depth = (points @ camera.rotation.T + camera.translation)[:, 2]
        return (opencv_xy(camera, points) / 5).astype(int), depth

    cell, depth = cells(bent.bend(places))
    nearest = np.full(cell.max(axis=0) + 2, np.inf)
    np.minimum.at(nearest, tuple(cell.T), depth)
    cell, depth = cells(mesh.points)
    behind = depth - nearest[tuple(cell.T)]
    assert np.quantile(behind, 0.995) < 4  # a cell on a slope of 70 degrees
    assert (behind > 10).mean() < 0.004  # cells that the edge of the overhang runs through

    cell, depth = cells(bent.bend(places))
    hidden = (depth - nearest[tuple(cell.T)] > 10).mean()
    assert hidden > 0.008  # there was something to hide
    steps = virtual.truth_xy[mesh.faces]
    assert np.linalg.norm(steps - np.roll(steps, 1, axis=1), axis=2).max() < 9  # 8 pixels of 1.4 mm is the steepest


@pytest.mark.parametrize("noise_mm", [0.1, (0.02, 0.3)])
def test_errors_run_along_the_ray(noise_mm):
    virtual = virtual_scan(sheet("letter"), points=20_000, photo_px=None, noise_mm=noise_mm, tilt_deg=20.0)
    truth = virtual.sheet.bend(virtual.truth_xy)
    ray = truth - eye_of(virtual.scan.camera)
    ray /= np.linalg.norm(ray, axis=1, keepdims=True)
    error = virtual.scan.mesh.points - truth
    along = (error * ray).sum(1)
    np.testing.assert_allclose(error, along[:, None] * ray, atol=1e-9)
    place = (virtual.truth_xy / [215.9, 279.4]).mean(axis=1)
    first, last = noise_mm if isinstance(noise_mm, tuple) else (noise_mm, noise_mm)
    assert (along / (first + (last - first) * place)).std() == pytest.approx(1, abs=0.03)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["book", "letter", "crumpled", "miura"])
def test_print_is_seen_where_geometry_says(name):
    bent = sheet(name)
    dots = np.stack(np.meshgrid(np.arange(12, 210, 14.3), np.arange(12, 270, 14.3)), axis=-1).reshape(-1, 2)
    px = 150 / 25.4
    y, x = np.mgrid[: round(279.4 * px), : round(215.9 * px)]
    pixels = np.full(x.shape, 255.0)
    for dot in dots:  # soft dots of 0.7 mm
        at = (
            np.s_[int(dot[1] * px) - 20 : int(dot[1] * px) + 21],
            np.s_[int(dot[0] * px) - 20 : int(dot[0] * px) + 21],
        )
        distance = np.hypot((x[at] + 0.5) / px - dot[0], (y[at] + 0.5) / px - dot[1])
        pixels[at] -= 255 * np.exp(-((distance / 0.7) ** 2))
    page = Page(np.rint(pixels).astype(np.uint8), np.ones(pixels.shape, bool), 150.0)
    scan = virtual_scan(
        bent, points=2000, photo_px=(2828, 2121), printed=(page, ""), light=Light(shadows=False), grain=0
    ).scan
    miss = []
    for centre in opencv_xy(scan.camera, bent.bend(dots)):
        col, row = np.rint(centre).astype(int)
        window = np.s_[row - 22 : row + 23, col - 22 : col + 23]
        dark = 1 - scan.photo[window][..., 1] / np.median(scan.photo[window][..., 1])
        dark = np.where(dark > 0.25, dark - 0.25, 0)  # shade and creases are weaker
        ys, xs = np.mgrid[window]
        miss.append(np.array([(xs * dark).sum(), (ys * dark).sum()]) / dark.sum() - centre)
    miss = np.array(miss)
    # 6 megapixels are 0.12 mm a pixel. Dots on a slope are seen in perspective, those on a crease are bent.
    assert np.abs(np.median(miss, axis=0)).max() < 0.02
    assert np.quantile(np.hypot(*miss.T), 0.8) < 0.1


def test_the_light_is_that_of_a_near_lamp():
    light = Light(position_mm=(100.0, 50.0, 300.0), ambient=0.2, exposure=0.9, shadows=False)
    virtual = virtual_scan(sheet("flat"), points=5000, photo_px=(640, 480), printed=white_page(), light=light, grain=0)
    scan = virtual.scan
    way = np.array(light.position_mm) - scan.mesh.points
    distance = np.linalg.norm(way, axis=1)
    falls = 0.2 + (300 / distance) ** 3  # facing = 300 / distance on a flat sheet
    wanted = 255 * (0.9 * falls[:, None] / falls.max() * PAPER) ** (1 / 2.2)
    col, row = np.rint(scan.photo_xy).astype(int).T
    inside = ((virtual.truth_xy > 2) & (virtual.truth_xy < [213, 277])).all(axis=1)
    np.testing.assert_allclose(scan.photo[row, col][inside], wanted[inside], atol=1.2)  # rounding, half a pixel aside


@pytest.mark.slow
def test_the_sheet_throws_a_shadow():
    bent = sheet("letter")
    options = {"points": 500, "photo_px": (640, 480), "printed": white_page(), "grain": 0}
    dark = [virtual_scan(bent, light=Light(shadows=s), **options).scan.photo < 36 for s in (True, False)]
    assert dark[0].mean() > dark[1].mean() + 0.02


@pytest.mark.slow
def test_print_finer_than_the_photo_is_averaged_in_linear_light():
    shape = (round(279.4 * 150 / 25.4), round(215.9 * 150 / 25.4))
    board = (255 * (np.indices(shape).sum(0) % 2)).astype(np.uint8)
    page = Page(board, np.ones(shape, bool), 150.0)
    options = {"points": 500, "photo_px": (516, 387), "light": Light(shadows=False), "grain": 0}
    fine = virtual_scan(sheet("flat"), printed=(page, ""), **options).scan.photo
    white = virtual_scan(sheet("flat"), printed=white_page(), **options).scan.photo
    middle = np.s_[100:400, 100:280]
    ratio = (fine[middle] / white[middle]) ** 2.2
    assert ratio.mean() == pytest.approx((1 + INK) / 2, rel=0.02)
    assert ratio.std() < 0.06  # no moire: a pixel holds a dozen squares


@pytest.mark.slow
def test_grain_is_the_noise_of_the_photo():
    options = {"points": 500, "photo_px": (516, 387), "printed": white_page()}
    clean = virtual_scan(sheet("flat"), grain=0, **options).scan.photo.astype(float)
    grainy = virtual_scan(sheet("flat"), grain=3, **options).scan.photo.astype(float)
    assert (grainy - clean).std() == pytest.approx(3, rel=0.03)


@pytest.mark.slow
def test_other_frames_and_windings_hold_the_same_scan():
    options = {"points": 3000, "photo_px": (400, 300), "printed": white_page(), "tilt_deg": 40.0}
    table = virtual_scan(sheet("book"), **options).scan
    camera = virtual_scan(sheet("book"), frame="camera", reverse_faces=True, **options).scan
    moved = table.mesh.points @ table.camera.rotation.T + table.camera.translation
    np.testing.assert_allclose(camera.mesh.points, moved, atol=1e-9)
    np.testing.assert_array_equal(camera.mesh.faces, table.mesh.faces[:, ::-1])
    np.testing.assert_allclose(opencv_xy(camera.camera, camera.mesh.points), table.photo_xy, atol=1e-8)
    np.testing.assert_array_equal(camera.photo, table.photo)
    up = table.camera.rotation[:, 2]
    assert np.degrees(np.arccos(-up[2])) == pytest.approx(40)  # the table's up against the camera's axis


def test_turn_is_clockwise_in_the_photo():
    virtual = virtual_scan(sheet("flat"), points=3000, photo_px=None, turn_deg=30.0)
    left, right = opencv_xy(virtual.scan.camera, virtual.sheet.bend(np.array([[0.0, 100], [200, 100]])))
    assert np.degrees(np.arctan2(*(right - left)[::-1])) == pytest.approx(30, abs=1e-6)  # y is down


def test_a_scan_can_do_without_a_photo():
    scan = virtual_scan(sheet("flat"), points=500, photo_px=None).scan
    assert scan.photo is None
    assert scan.photo_xy is None
    assert scan.camera is not None


@pytest.mark.slow
def test_the_same_seed_gives_the_same_scan():
    options = {"points": 1000, "photo_px": (400, 300), "printed": white_page(), "noise_mm": 0.1}
    a, b, other = (virtual_scan(sheet("wave"), rng=seed, **options).scan for seed in (5, 5, 6))
    np.testing.assert_array_equal(a.mesh.points, b.mesh.points)
    np.testing.assert_array_equal(a.photo, b.photo)
    assert (a.mesh.points != other.mesh.points).any()


def test_what_cannot_be_scanned_is_refused_in_a_sentence():
    with pytest.raises(UsageError, match=r"the print is 147.8 x 209.8 mm, the sheet 215.9 x 279.4 mm"):
        virtual_scan(sheet("book"), points=500, photo_px=(400, 300), printed=white_page(148, 210))
    with pytest.raises(UsageError, match="sees nothing of the printed side of the sheet 'flat'"):
        virtual_scan(sheet("flat"), points=500, photo_px=None, tilt_deg=180.0)
