"""Two laser lines across a book of known shape, the lasers found again from squared paper and from boards."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from captures import DATA
from planish.acquire.calibration.boards import Board, board_pixels
from planish.acquire.laser.axis import calibrate_laser_axis, rotate_plane
from planish.acquire.laser.board import calibrate_laser_planes
from planish.acquire.laser.lines import find_two_lines, fit_cylinder, from_laser_lines, intersect_cylinder, line_points
from planish.acquire.laser.rig import calibrate_laser_rig
from planish.acquire.laser.squares import find_squares
from planish.cli.main import run
from planish.errors import InputError
from planish.gallery import sheet
from planish.gallery.devices import board_poses, posed_board
from planish.gallery.laser import (
    MIRROR_MM,
    ground_truth,
    laser_on_sheet,
    mirror_angle_deg,
    plane_through,
    squared_paper,
    virtual_lines,
)
from planish.gallery.scanner import overhead_camera
from planish.gallery.sheets import Sheet
from planish.geometry.triangulation import rays
from planish.io import read_photo, read_scan, write_page
from planish.io.cameras import camera_as_json
from planish.io.lasers import read_motion, read_rig, read_sweep, write_rig
from planish.types import Camera, Page

pytestmark = pytest.mark.usefixtures("corners_found_once")

PHOTO_PX = (900, 700)
REAL = DATA / "laser_lines_book"


@pytest.fixture(scope="module")
def book():
    made = virtual_lines(sheet("book"), photo_px=PHOTO_PX, line_mm=0.8)
    return made, made.frame(0)


@pytest.fixture(scope="module")
def paper():
    of = sheet("spread")
    made = virtual_lines(of, photo_px=PHOTO_PX, line_mm=0.8, printed=squared_paper(of))
    return made, made.frame(0)


@pytest.mark.slow
def test_a_book_page_comes_out_of_two_lines(book):
    made, lit = book
    acquired = from_laser_lines(lit, made.photo, made.camera, made.planes[0])
    _, true = ground_truth(made, acquired.scan.photo_xy)
    off = np.linalg.norm(acquired.scan.mesh.points - true, axis=1)
    # pixels of 0.33 mm, lines placed to 0.1 of one, seen at 33 degrees: 0.05 mm; at the spine the paper turns quickly
    assert np.sqrt(np.nanmean(off**2)) < 0.15
    assert np.nanmedian(off) < 0.06
    assert np.array_equal(acquired.scan.photo, made.photo)


@pytest.mark.slow
def test_without_a_laser_off_photo_the_lines_are_told_by_their_colour(book):
    made, lit = book
    acquired = from_laser_lines(lit, None, made.camera, made.planes[0], mask=None)
    assert "the laser lines stay on the page" in acquired.warnings[0].sentence
    both = np.isfinite(find_two_lines(lit)[:, 0]) & np.isfinite(find_two_lines(lit, made.photo)[:, 0])
    assert both.mean() > 0.7
    assert np.median(np.abs(find_two_lines(lit)[both] - find_two_lines(lit, made.photo)[both])) < 0.1


@pytest.mark.slow
def test_the_direction_of_the_rulings_is_found_where_the_camera_is_askew(book):
    made, _ = book
    camera = overhead_camera(made.sheet, PHOTO_PX, turn_deg=6.0, tilt_deg=5.0)
    askew = virtual_lines(made.sheet, photo_px=PHOTO_PX, line_mm=0.8, camera=camera)
    upper, lower = line_points(find_two_lines(askew.frame(0), askew.photo), camera, askew.planes[0])
    along = fit_cylinder(upper, lower, camera).axes[2]
    assert np.degrees(np.arccos(abs(along[1]))) < 0.5  # the book's rulings are the y axis of the table


@pytest.mark.slow
def test_unrolled_places_keep_their_distances(paper):
    made, lit = paper
    upper, lower = line_points(find_two_lines(lit, made.photo), made.camera, made.planes[0])
    cylinder = fit_cylinder(upper, lower, made.camera)
    for squares in find_squares(made.photo):
        _, flat = intersect_cylinder(cylinder, rays(made.camera, squares.xy)[0])
        true, _ = ground_truth(made, squares.xy)
        known = np.isfinite(flat).all(axis=1) & np.isfinite(true).all(axis=1)
        got, want = (np.linalg.norm(np.diff(v[known], axis=0), axis=1) for v in (flat, true))
        assert np.median(np.abs(got - want)) < 0.1


@pytest.mark.slow
def test_the_lasers_are_found_again_from_squared_paper(paper):
    made, lit = paper
    rig = calibrate_laser_rig(lit, made.photo, made.camera, 8.0)
    assert rig.rms_squares < 0.03  # corners are found to 0.1 of 0.33 mm; at the spine they are crowded
    for found, true in zip(rig.planes, made.planes[0], strict=True):
        x, z = (v.ravel() for v in np.meshgrid(np.linspace(-120, 120, 9), np.linspace(0, 25, 5)))
        points = np.column_stack([x, -(true[0] * x + true[2] * z + true[3]) / true[1], z])
        assert np.abs(points @ found[:3] + found[3]).max() < 0.5  # mm, within the height of the book


@pytest.mark.slow
def test_the_lens_is_found_with_them(paper):
    made, lit = paper
    rig = calibrate_laser_rig(lit, made.photo, made.camera, 8.0, lens=True)
    assert abs(rig.camera.distortion[0]) < 0.06  # the virtual lens has none: 0.06 is 0.6 % of place at the border
    middle = made.camera.matrix.copy()
    middle[:2, 2] += [12, -15]  # as of a camera that is known by its focal length alone
    rig = calibrate_laser_rig(lit, made.photo, replace(made.camera, matrix=middle), 8.0, lens=True)
    off = rig.camera.matrix[:2, 2] - made.camera.matrix[:2, 2]
    assert abs(off[1]) < 2  # px, of 15 before, along the spine
    assert abs(off[0]) < 10  # of 12: across it a shift is almost a turn of the book


@pytest.mark.slow
def test_squares_are_numbered_as_they_lie(paper):
    made, _ = paper
    lattices = find_squares(made.photo)
    assert sum(len(squares.xy) for squares in lattices) > 600
    for squares in lattices:
        true, _ = ground_truth(made, squares.xy)
        cells = true / 8.0 - squares.ij
        known = np.isfinite(cells).all(axis=1)
        assert np.abs(cells[known] - np.median(cells[known], axis=0)).max() < 0.3


@pytest.fixture(scope="module")
def boards():
    """Photos of a chessboard in four poses under one laser of `virtual_lines`."""
    board = Board(8, 11, 18.0, "chessboard")
    size = np.array([170.0, 225.0])
    pixels = np.full((2250, 1700), 255, np.uint8)
    drawn = board_pixels(board, 180)
    pixels[135 : 135 + len(drawn), 130 : 130 + drawn.shape[1]] = drawn
    printed = Page(pixels, np.ones_like(pixels, bool), 254.0), ""
    camera = overhead_camera(sheet("flat", width_mm=200.0, height_mm=270.0), (1000, 800))
    photos, planes = [], None
    for tilt, turn, up in ((0, 0, 0.0), (12, 5, 30.0), (-14, 0, 45.0), (5, -9, 20.0)):
        rotation = Rotation.from_euler("xy", [tilt, turn], degrees=True).as_matrix()

        def bend(xy, rotation=rotation, up=up):
            flat = np.column_stack([xy[:, 0] - size[0] / 2, size[1] / 2 - xy[:, 1], 0 * xy[:, 0]])
            return flat @ rotation.T + [0, 0, up]

        made = virtual_lines(
            Sheet("board", *size, bend), photo_px=(1000, 800), line_mm=0.6, printed=printed, camera=camera
        )
        photos.append(made.frame(0))
        planes = made.planes[0]
    return board, camera, photos, planes


@pytest.mark.slow
def test_laser_planes_from_boards(boards):
    board, camera, photos, planes = boards
    found = calibrate_laser_planes(photos, list("abcd"), camera, board, lines=2)
    assert found.planes.shape == (2, 4)
    assert (found.rms_mm < 0.1).all()
    for plane, true in zip(found.planes, planes, strict=True):
        plane = plane * np.sign(plane[:3] @ true[:3])
        assert np.degrees(np.arccos(min(plane[:3] @ true[:3], 1.0))) < 0.2
        assert abs(plane[3] - true[3]) < 1.0  # mm, 500 mm from the board


@pytest.mark.slow
def test_boards_that_do_not_do_are_named(boards):
    board, camera, photos, _ = boards
    with pytest.raises(InputError, match="almost one line in space"):
        calibrate_laser_planes(photos[:1] * 2, ["a", "b"], camera, board, lines=2)
    with pytest.raises(InputError, match=r"b shows no chessboard of 8 x 11 squares"):
        calibrate_laser_planes([photos[0], np.full_like(photos[0], 200)], ["a", "b"], camera, board, lines=2)
    with pytest.raises(InputError, match=r"a is 800 x 1000 pixels, but the camera's numbers are for 700 x 900"):
        calibrate_laser_planes(photos[:1], ["a"], replace(camera, shape_rc=(900, 700)), board)
    with pytest.raises(InputError, match=r"in a 5 laser lines are seen on the board in \d rows"):
        calibrate_laser_planes(photos[:1], ["a"], camera, board, lines=5)


@pytest.fixture(scope="module")
def mirror():
    """Photos of a chessboard, twice at each of three angles of the mirror of `virtual_sweep`."""
    board = Board(7, 9, 18.0, "chessboard")
    camera = overhead_camera(sheet("book"), (640, 480))
    photos, planes = [], []
    for foot, (turn, middle) in zip(np.repeat([0.0, 45, 90], 2), board_poses(6), strict=True):
        middle[:] = [-30 + foot / 2, middle[1], 30 + middle[2] / 4]  # where the light is, at that height
        stiff, page = posed_board(np.pad(board_pixels(board, 90), 45, constant_values=255), 90, 18.0, turn, middle)
        plane = plane_through(MIRROR_MM, (foot, 0.0, 0.0))
        photos.append(laser_on_sheet(stiff, plane[None, None], printed=(page, ""), camera=camera, line_mm=0.8).frame(0))
        planes.append(plane)
    return board, camera, photos, np.array(planes)


@pytest.mark.slow
def test_the_axis_of_a_mirror_is_found(mirror):
    board, camera, photos, planes = mirror
    found = calibrate_laser_axis(photos, list("abcdef"), camera, board, mirror_angle_deg(planes))
    assert found.rms_mm < 0.15  # pixels are 0.45 mm, lines are placed to a tenth of one
    for foot in (-20.0, 30.0, 110.0):  # also beyond the angles that were shown
        true = plane_through(MIRROR_MM, (foot, 0.0, 0.0))
        at = rotate_plane(found.plane, found.point, found.direction, np.radians(mirror_angle_deg(true[None])[0]))
        y, z = (v.ravel() for v in np.meshgrid(np.linspace(-80, 80, 5), np.linspace(0, 80, 5)))
        lit = np.column_stack([-(true[1] * y + true[2] * z + true[3]) / true[0], y, z])
        assert np.abs(lit @ at[:3] + at[3]).max() < 1.0  # mm, at 1/2 of the shown range beyond it; within 0.3


@pytest.mark.slow
def test_angles_that_do_not_do_are_named(mirror):
    board, camera, photos, planes = mirror
    names, angles = list("abcdef"), mirror_angle_deg(planes)
    with pytest.raises(InputError, match="from 3 to 3 degrees; at least 2"):
        calibrate_laser_axis(photos, names, camera, board, np.full(6, 3.0))
    with pytest.raises(InputError, match="on 1 photos of the board are almost one line"):
        calibrate_laser_axis(photos, names, camera, board, np.arange(6.0))
    with pytest.raises(InputError, match="mm rms off a plane that turns about an axis"):
        calibrate_laser_axis(photos, names, camera, board, np.array([0.0, 0, 5, 5, -5, -5]))
    stray = np.repeat(photos[0][..., :1], 3, axis=2)  # the line's colour taken off
    for row, col in enumerate(np.random.default_rng(0).integers(120, 360, len(stray))):
        stray[row, col : col + 4, 1] = 250
    with pytest.raises(InputError, match="laser line is seen on the board"):
        calibrate_laser_axis([stray, *photos[1:]], names, camera, board, angles)


@pytest.mark.slow
def test_lasers_of_another_camera_are_refused(book, tmp_path):
    made, _ = book
    write_rig(tmp_path / "rig.json", made.planes[0], made.camera, axis=(np.zeros(3), np.array([0.0, 1, 0])))
    (tmp_path / "motion.csv").write_text("angle_deg\n1\n2\n")
    planes = read_sweep(tmp_path / "rig.json", ["a", "b"], tmp_path / "motion.csv", made.camera)
    assert planes.shape == (2, 2, 4)
    matrix = made.camera.matrix * [[1.1, 1, 1], [1, 1.1, 1], [1, 1, 1]]
    with pytest.raises(InputError, match="give the camera that the lasers belong to"):
        read_sweep(tmp_path / "rig.json", ["a", "b"], tmp_path / "motion.csv", replace(made.camera, matrix=matrix))
    (tmp_path / "motion.csv").write_text("position_mm\n1\n2\n")
    with pytest.raises(InputError, match="has no “direction”"):
        read_sweep(tmp_path / "rig.json", ["a", "b"], tmp_path / "motion.csv")
    (tmp_path / "motion.csv").write_text("degrees\n1\n2\n")
    with pytest.raises(InputError, match="no column “angle_deg” or “position_mm”"):
        read_motion(tmp_path / "motion.csv", ["a", "b"])


@pytest.mark.slow
def test_bad_input_is_a_sentence(book, paper):
    made, lit = book
    planes = made.planes[0]
    with pytest.raises(InputError, match="two laser lines are seen in 0 % of the photo's columns"):
        from_laser_lines(made.photo, made.photo, made.camera, planes)
    with pytest.raises(InputError, match="the laser-off photo 700 x 800"):
        from_laser_lines(lit, made.photo[:800], made.camera, planes)
    with pytest.raises(InputError, match="numbers are for 900 x 700"):
        from_laser_lines(lit, made.photo, replace(made.camera, shape_rc=(700, 900)), planes)
    with pytest.raises(InputError, match="behind the camera"):
        from_laser_lines(lit, made.photo, replace(made.camera, translation=-made.camera.translation), planes)
    waves = virtual_lines(sheet("wave", direction_deg=70.0), photo_px=PHOTO_PX, line_mm=0.8)
    with pytest.raises(InputError, match="mm apart"):
        from_laser_lines(waves.frame(0), waves.photo, waves.camera, waves.planes[0])
    with pytest.raises(InputError, match="no squares are seen"):
        calibrate_laser_rig(lit, made.photo, made.camera, 8.0)
    page, shot = paper
    with pytest.raises(InputError, match="numbers are for 700 x 900"):
        calibrate_laser_rig(shot, page.photo, replace(page.camera, shape_rc=(900, 700)), 8.0)


@pytest.mark.slow
def test_commands_from_squared_paper_to_scan(book, paper, tmp_path, capsys):
    known = np.ones(book[0].camera.shape_rc, bool)
    sheets = {"on": paper[1], "off": paper[0].photo, "book": book[1], "book-off": book[0].photo}
    for name, pixels in sheets.items():
        write_page(tmp_path / f"{name}.png", Page(pixels, np.ones(pixels.shape[:2], bool), 72.0))
    (tmp_path / "camera.json").write_text(json.dumps(camera_as_json(paper[0].camera)))
    at = {name: str(tmp_path / f"{name}.png") for name in sheets}
    rig = str(tmp_path / "rig.json")
    command = ["calibrate", "laser-lines", at["on"], "--photo", at["off"], "-o", rig]
    assert run([*command, "--camera", str(tmp_path / "camera.json")]) == 0
    said = capsys.readouterr()
    assert "assumed to be 5 mm, so that pages are not at true size" in said.err
    assert "squares rms from their grid" in said.out
    planes, _, notes = read_rig(rig)
    assert planes.shape == (2, 4)
    assert "--square-mm" in notes[0].sentence
    assert run(command) == 3
    assert "has no focal length in its EXIF data" in capsys.readouterr().err
    write_rig(rig, book[0].planes[0], book[0].camera)
    scan = str(tmp_path / "scan.ply")
    assert run(["acquire", "laser-lines", at["book"], "--photo", at["book-off"], "--lasers", rig, "-o", scan]) == 0
    back = read_scan(scan)
    assert back.scan.photo.shape[:2] == known.shape
    assert len(back.scan.mesh.points) > 100_000


@pytest.mark.parametrize(
    ("told", "sentence"),
    [
        ({"lasers": [[1, 0, 0, 1]] * 2}, "does not say “camera”"),
        ({"camera": {}}, "does not say “lasers”"),
        ({"lasers": [[1, 0, 0, 1]], "camera": {}}, "has 1 lasers; two are wanted"),
        ({"lasers": [[1, 0, 0, 1]] * 2, "camera": 5}, "holds no camera"),
    ],
)
def test_a_bad_rig_file_is_a_sentence(tmp_path, told, sentence):
    path = tmp_path / "rig.json"
    path.write_text(json.dumps(told))
    with pytest.raises(InputError, match=sentence):
        read_rig(path)


@pytest.mark.slow
@pytest.mark.shared("laser_lines_book")
def test_real_squared_books_come_out_squared():
    """Lasers and lens found from one photo; the squares of the other, whose book is bent far more, come out equal."""
    camera = Camera(np.array([[1014.9, 0, 499.5], [0, 1014.9, 374.5], [0, 0, 1]]), np.eye(3), np.zeros(3), (750, 1000))
    photos = {name: read_photo(REAL / name).pixels for name in ("Simple.jpg", "gridangle.jpg")}
    rig = calibrate_laser_rig(photos["Simple.jpg"], None, camera, 6.35, lens=True)
    for lit in photos.values():
        upper, lower = line_points(find_two_lines(lit), rig.camera, rig.planes)
        cylinder = fit_cylinder(upper, lower, rig.camera)
        for squares in find_squares(lit):
            flat = intersect_cylinder(cylinder, rays(rig.camera, squares.xy)[0])[1] / 6.35
            place = dict(zip(map(tuple, squares.ij.tolist()), flat, strict=True))
            sides = {}
            for axis, (di, dj) in enumerate(((1, 0), (0, 1))):
                for (i, j), here in place.items():
                    there = place.get((i + di, j + dj), np.full(2, np.nan))
                    if np.isfinite(there - here).all():
                        sides.setdefault((axis, i), []).append(there - here)
            # column by column across the page, mean size both ways and mean angle; beside the outermost lines, which
            # end there, corners are not found where they are
            first, last = squares.ij[:, 0].min(), squares.ij[:, 0].max()
            columns = [i for i in range(first + 1, last - 1) if min(len(sides[axis, i]) for axis in (0, 1)) > 10]
            right, down = (np.array([np.mean(sides[axis, i], axis=0) for i in columns]) for axis in (0, 1))
            size = np.stack([np.linalg.norm(right, axis=1), np.linalg.norm(down, axis=1)])
            angle = np.degrees(
                np.arctan2((right * down).sum(axis=1), right[:, 0] * down[:, 1] - right[:, 1] * down[:, 0])
            )
            assert np.abs(size - 1).max() < 0.03
            assert np.abs(angle).max() < 1.0
