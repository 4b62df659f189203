"""A laser swept over a book page whose every point is known, and what must be refused."""

import json
from dataclasses import replace

import numpy as np
import pytest

from planish.acquire.laser.sweep import Sweep, fit_plane, from_laser, planes_from_background, sweep_stripes
from planish.cli.main import run
from planish.errors import InputError
from planish.gallery import sheet
from planish.gallery.laser import ground_truth, virtual_sweep
from planish.io import read_scan, write_page
from planish.io.cameras import camera_as_json
from planish.io.lasers import read_sweep
from planish.types import Camera, Page

FRAMES = 60


@pytest.fixture(scope="module")
def swept():
    made = virtual_sweep(sheet("book"), frames=FRAMES, photo_px=(640, 480), line_mm=1.0)
    return made, [made.frame(k) for k in range(FRAMES)]


def names(count=FRAMES):
    return [f"{k + 1:03d}.png" for k in range(count)]


def stripes(swept, order=None, **options):
    made, frames = swept
    order = list(range(FRAMES)) if order is None else order
    return sweep_stripes(lambda k: frames[order[k]], names(len(order)), made.photo, **options)


def scan(swept, **options):
    made, _ = swept
    return from_laser(stripes(swept, **options), names(), made.photo, made.camera, made.planes)


def surface_rms(made, acquired):
    _, true = ground_truth(made, acquired.scan.photo_xy)
    off = np.linalg.norm(acquired.scan.mesh.points - true, axis=1)
    return np.sqrt(np.nanmean(off**2))


@pytest.mark.slow
def test_the_surface_under_the_print_is_true_and_without_dividing_it_is_less_so(swept):
    made, _ = swept
    divided, plain = scan(swept), scan(swept, divide=False)
    # pixels of 0.45 mm seen at 40 degrees, lines placed to 0.05 pixels, some 20 averaged; 4 mm between the lines
    assert surface_rms(made, divided) < 0.05
    assert surface_rms(made, plain) > 2 * surface_rms(made, divided)
    assert len(divided.scan.mesh.points) > 3000  # 640 x 480 pixels, cells of 6 to 8
    assert divided.confidence.min() >= 0
    assert divided.confidence.max() <= 1


@pytest.mark.slow
def test_the_photo_is_the_one_without_laser_and_its_places_are_the_camera_s(swept):
    made, _ = swept
    acquired = scan(swept)
    assert np.array_equal(acquired.scan.photo, made.photo)
    assert acquired.scan.photo_xy.shape == (len(acquired.scan.mesh.points), 2)


@pytest.mark.slow
def test_columns_do_as_well_as_rows(swept):
    """The photos laid on their sides, and the camera with them."""
    made, frames = swept
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])  # of the camera: its x is the old one's -y
    rows, cols = made.camera.shape_rc
    matrix = made.camera.matrix.copy()
    matrix[0, 2], matrix[1, 2] = rows - 1 - made.camera.matrix[1, 2], made.camera.matrix[0, 2]
    camera = replace(
        made.camera,
        matrix=matrix,
        rotation=turn @ made.camera.rotation,
        translation=turn @ made.camera.translation,
        shape_rc=(cols, rows),
    )
    photo = np.rot90(made.photo, -1)
    sweep = sweep_stripes(lambda k: np.rot90(frames[k], -1), names(), photo)
    assert sweep.along == "columns"
    mesh = from_laser(sweep, names(), photo, camera, made.planes).scan.mesh
    plain = scan(swept).scan.mesh
    assert abs(len(mesh.points) / len(plain.points) - 1) < 0.05
    assert np.allclose(mesh.points.mean(axis=0), plain.points.mean(axis=0), atol=0.5)


@pytest.mark.slow
def test_planes_found_on_two_known_walls_are_the_true_ones(swept):
    made, _ = swept
    rows, cols = made.camera.shape_rc
    middle = np.arange(rows)
    walls = np.array([[0.0, 0, 1, 0], [0.0, 0.6, 0.8, 0]])  # both through the x axis
    upper = middle < rows / 2
    at = np.full((1, rows, 1), np.nan)
    eye = -made.camera.rotation.T @ made.camera.translation
    for r in middle:  # the pixel of the row whose ray meets the laser's plane on the wall, by bisection
        wall = walls[0 if upper[r] else 1]
        low, high = -5.0 * cols, 5.0 * cols
        for _ in range(60):
            q = (low + high) / 2
            ray = made.camera.rotation.T @ np.linalg.inv(made.camera.matrix) @ [q, r, 1]
            point = eye - (wall[:3] @ eye + wall[3]) / (wall[:3] @ ray) * ray
            side = made.planes[30, 0, :3] @ point + made.planes[30, 0, 3]
            low, high = (q, high) if side * made.planes[30, 0, 0] < 0 else (low, q)
        at[0, r, 0] = q
    sweep = Sweep(at, np.full_like(at, 0.05), "rows", [])
    regions = np.array([[-1e4, 0, 1e4, rows // 2 - 1], [-1e4, rows // 2 + 1, 1e4, rows]])
    found = planes_from_background(sweep, ["a"], made.camera, walls, regions)[0, 0]
    assert np.allclose(found * np.sign(found[0] * made.planes[30, 0, 0]), made.planes[30, 0], atol=1e-6)
    with pytest.raises(InputError, match=r"a .* seen in 0 rows .* region"):
        planes_from_background(sweep, ["a"], made.camera, walls, np.array([[0, -9, 9, -5.0], [0, 0, 9, 9]]))
    bent = np.array([[0.0, 0, 1, 0], [0.0, 0.6, 0.8, -80]])
    sweep = Sweep(at + 3 * np.sin(middle / 9)[None, :, None], sweep.sd, "rows", [])
    with pytest.raises(InputError, match="rms off one plane"):
        planes_from_background(sweep, ["a"], made.camera, bent, regions)


def test_a_plane_is_fitted_in_spite_of_a_stray_point():
    rng = np.random.default_rng(0)
    points = np.c_[rng.uniform(-50, 50, (200, 2)), np.full(200, 7.0)]
    points[0, 2] += 20
    plane, rms = fit_plane(points)
    assert np.allclose(np.abs(plane), [0, 0, 1, 7], atol=1e-9)
    assert rms < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize(
    ("order", "sentence"),
    [
        ([*range(20), 21, 20, *range(22, 60)], "laser jumps back from 0"),
        (np.random.default_rng(0).permutation(60).tolist(), "not in the order of their planes"),
        ([*range(30), 29, *range(31, 60)], r"030.png and 031.png show the laser in the same place"),
    ],
)
def test_photos_out_of_order_are_named(swept, order, sentence):
    made, _ = swept
    with pytest.raises(InputError, match=sentence):
        from_laser(stripes(swept, order), names(), made.photo, made.camera, made.planes)


@pytest.mark.slow
def test_no_laser_is_a_sentence(swept):
    made, _ = swept
    with pytest.raises(InputError, match=r"no laser line is seen in 5 of 5 photos \(001.png, .* and 1 more\)"):
        sweep_stripes(lambda k: made.photo, names(5), made.photo)


@pytest.mark.slow
def test_overexposed_is_a_sentence(swept):
    made, frames = swept
    full = [np.where(frame > made.photo + 10.0, 255, frame).astype(np.uint8) for frame in frames[20:29]]
    with pytest.raises(InputError, match=r"overexposed: \d+ % of the laser line"):
        sweep_stripes(full.__getitem__, names(9), made.photo)


@pytest.mark.slow
def test_sizes_and_kinds_must_agree(swept):
    made, frames = swept
    with pytest.raises(InputError, match=r"003.png is 480 x 600 pixels, the laser-off photo 480 x 640"):
        sweep_stripes(lambda k: frames[k + 20][: 600 if k == 2 else 640], names(5), made.photo)
    with pytest.raises(InputError, match=r"16 bits, the laser-off photo 8"):
        sweep_stripes(lambda k: frames[k].astype(np.uint16), names(5), made.photo)


@pytest.mark.slow
def test_another_camera_is_a_sentence(swept):
    made, _ = swept
    smaller = replace(made.camera, shape_rc=(480, 640))
    with pytest.raises(InputError, match=r"480 x 640 pixels, but the camera's numbers are for 640 x 480"):
        from_laser(stripes(swept), names(), made.photo, smaller, made.planes)
    behind = replace(made.camera, translation=-made.camera.translation)  # under the table, looking down
    with pytest.raises(InputError, match="behind the camera"):
        from_laser(stripes(swept), names(), made.photo, behind, made.planes)


@pytest.mark.slow
def test_the_command_makes_a_scan_that_restore_takes(swept, tmp_path, capsys):
    made, frames = swept
    known = np.ones(made.camera.shape_rc, bool)
    folder = tmp_path / "frames"
    folder.mkdir()
    for k, frame in enumerate(frames):
        write_page(folder / f"{k + 1}.png", Page(frame, known, 72.0))
    write_page(folder / "off.png", Page(made.photo, known, 72.0))
    (tmp_path / "camera.json").write_text(json.dumps(camera_as_json(made.camera)))
    (tmp_path / "planes.json").write_text(json.dumps({"planes": made.planes.tolist()}))
    given = ["--photo", folder / "off.png", "--camera", tmp_path / "camera.json", "--planes", tmp_path / "planes.json"]
    command = ["acquire", "laser", folder, *given, "-o", tmp_path / "scan.ply", "--picture", tmp_path / "look.png"]
    assert run([str(word) for word in command]) == 0, capsys.readouterr().err
    back = read_scan(tmp_path / "scan.ply")
    assert back.unit == "mm"
    assert back.scan.photo.shape == made.photo.shape
    assert surface_rms(made, replace_scan(scan(swept), back.scan)) < 0.05
    assert (tmp_path / "look.png").exists()
    (folder / "7.png").unlink()
    assert run([str(word) for word in command]) == 3
    assert "there are 59 photos, but" in " ".join(capsys.readouterr().err.split())


def replace_scan(acquired, other):
    return replace(acquired, scan=other)


def written(tmp_path, told):
    path = tmp_path / "laser.json"
    path.write_text(told if isinstance(told, str) else json.dumps(told))
    return path


def test_a_turning_mirror_turns_the_plane_about_its_axis(tmp_path):
    axis = {"point": [0, 0, 10], "direction": [0, 2, 0]}
    path = written(tmp_path, {"lasers": [[1, 0, 0, 0]], "axis": axis, "angles_deg": [0, 90]})
    planes = read_sweep(path, names(2))
    assert np.allclose(planes[:, 0], [[1, 0, 0, 0], [0, 0, -1, 10]])  # x = 0, then z = 10: both hold the axis


def test_a_slide_shifts_the_plane(tmp_path):
    path = written(tmp_path, {"lasers": [[2, 0, 0, -6]], "direction": [1, 0, 1], "positions_mm": [0, np.sqrt(2)]})
    assert np.allclose(read_sweep(path, names(2))[:, 0], [[1, 0, 0, -3], [1, 0, 0, -4]])


@pytest.mark.parametrize(
    ("told", "sentence"),
    [
        ("[1]", "holds no lasers"),
        ("{", "is no JSON file"),
        ({}, "says nothing of the laser"),
        ({"plans": []}, "“plans”, which is not known"),
        ({"planes": [[1, 0, 0, 1]]}, "there are 2 photos, but .* tells of 1"),
        ({"planes": [[0, 0, 0, 1], [1, 0, 0, 1]]}, "a, b, c are not all 0"),
        ({"planes": [[1, 0, 0], [1, 0, 0]]}, "must hold planes"),
        ({"planes": [[1, 0, 0, 1], [1, 0, 0, 2]], "photos": ["001.png", "009.png"]}, "nothing for the photo 002.png"),
        (
            {"planes": [[1, 0, 0, 1]] * 3, "photos": ["001.png", "002.png", "3.png"]},
            "tells of 3.png, but no such photo",
        ),
        ({"lasers": [[1, 0, 0, 1]], "angles_deg": [1, 2]}, "no “axis”"),
        ({"lasers": [[1, 0, 0, 1]]}, "“angles_deg” or “positions_mm” is wanted"),
        ({"lasers": [[1, 0, 0, 1]], "positions_mm": [0, 1], "direction": [0, 0, 0]}, "“direction” is 0"),
        ({"background": [{"plane": [0, 0, 1, 0]}]}, "must hold two planes"),
        ({"background": [{"plane": [0, 0, 1, 0]}] * 2}, "has no “region”"),
    ],
)
def test_a_bad_file_of_planes_is_a_sentence(tmp_path, told, sentence):
    with pytest.raises(InputError, match=sentence):
        read_sweep(written(tmp_path, told), names(2))


@pytest.mark.slow
def test_a_camera_is_needed_for_nothing_but_its_numbers():
    """A plane before the camera is met where geometry has it."""
    camera = Camera(np.diag([100.0, 100, 1]), np.eye(3), np.zeros(3), (20, 40))
    at = np.tile(np.arange(5.0, 35.0, 2)[:, None, None], (1, 20, 1))
    planes = np.stack([np.array([1.0, 0, 0.5, -(q / 100 * 200 + 100)]) for q in at[:, 0, 0]])[:, None]
    sweep = Sweep(at, np.full_like(at, 0.05), "rows", [])
    photo = np.zeros((20, 40, 3), np.uint8)
    points = from_laser(sweep, names(15), photo, camera, planes, mask=None).scan.mesh.points
    assert np.allclose(points[:, 2], 200, atol=1e-6)  # every line was laid where its plane meets z = 200
