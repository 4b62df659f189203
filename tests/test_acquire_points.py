"""Points in any order to scans: truth from planes and cylinders, and a page from a virtual photogrammetry cloud."""

import json

import cv2
import numpy as np
import pytest

from planish.acquire.points.normals import fit_tangent_planes, orient_normals
from planish.acquire.points.scan import from_points
from planish.cli.main import run
from planish.errors import InputError, install_command
from planish.gallery import sheet
from planish.gallery.clouds import photogrammetry_cloud
from planish.geometry import project
from planish.io import read_cloud, read_scan
from planish.io.cameras import camera_as_json
from planish.types import Camera

skimage = pytest.importorskip("skimage", reason="the extra planish[points] is not installed")

RADIUS = 60.0


def cylinder(count=20_000, noise=0.05, angle=2.0):
    """A sheet 80 mm high, bent round the y axis by `angle` [rad]: points in no order, and their outward normals."""
    rng = np.random.default_rng(0)
    turn, y = rng.uniform(-angle / 2, angle / 2, count), rng.uniform(-40, 40, count)
    outward = np.stack([np.sin(turn), 0 * turn, np.cos(turn)], axis=1)
    points = RADIUS * outward + [0, 0, 100] + y[:, None] * [0, 1, 0]
    return points + noise * rng.standard_normal(points.shape), outward


def off_cylinder(points):
    return np.hypot(points[:, 0], points[:, 2] - 100) - RADIUS


def area(mesh):
    a, b, c = (mesh.points[mesh.faces[:, k]] for k in range(3))
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()


def facing(mesh, towards):
    """Part of the faces whose printed side looks there, one direction for each corner."""
    a, b, c = (mesh.points[mesh.faces[:, k]] for k in range(3))
    return ((np.cross(b - a, c - a) * towards[mesh.faces[:, 0]]).sum(axis=1) > 0).mean()


def outward_at(mesh):
    return mesh.points * [1, 0, 1] - [0, 0, 100]


@pytest.mark.slow
def test_the_surface_is_truer_than_the_points_and_ends_where_they_end():
    points, _ = cylinder()
    mesh = from_points(points, seen_from=np.array([0.0, 0, 900])).scan.mesh
    off = off_cylinder(mesh.points)
    # 0.05 mm of noise, of which the mean of about eight points is left: 0.018; and nothing of the curvature
    assert np.sqrt((off**2).mean()) < 0.03
    assert abs(off.mean()) < 0.005
    true, around = 2 * RADIUS * 80, 2 * (2 * RADIUS + 80)
    assert abs(area(mesh) - true) < np.sqrt(true / 20_000) * around  # the border is known to a spacing


@pytest.mark.slow
def test_strays_are_left_out():
    points, _ = cylinder()
    rng = np.random.default_rng(1)
    strays = points[:200] + rng.uniform(3, 12, (200, 1)) * [0, 0, 1]
    found = fit_tangent_planes(np.vstack([points, strays]))
    assert found.kept[:-200].mean() > 0.99
    assert found.kept[-200:].mean() < 0.05  # some planes lean so that they pass through theirs
    mesh = from_points(np.vstack([points, strays]), seen_from=np.array([0.0, 0, 900])).scan.mesh
    assert np.abs(off_cylinder(mesh.points)).max() < 0.5


def test_noise_and_spacing_are_told():
    points, _ = cylinder(noise=0.2)
    found = fit_tangent_planes(points)
    assert abs(found.noise_mm - 0.2) < 0.02
    assert abs(found.spacing_mm - np.sqrt(2 * RADIUS * 80 / 20_000)) < 0.05


def test_sides_agree_all_around_a_curl():
    points, outward = cylinder(angle=5.5)  # its two ends nearly meet, and face away from each other
    found = fit_tangent_planes(points)
    towards = np.tile([0.0, 0, 1], (len(points), 1))
    turned = orient_normals(points[found.kept], found.normals, found.spacing_mm, towards)
    agree = (turned * outward[found.kept]).sum(axis=1)
    assert (np.sign(agree) == np.sign(agree[0])).all()


@pytest.mark.parametrize("hint", ["place", "camera", "normals", "origin"])
def test_the_printed_side_is_the_one_that_was_seen(hint):
    points, outward = cylinder(count=5000)
    above = Camera(np.diag([500.0, 500, 1]), np.diag([1.0, -1, -1]), np.array([0.0, 0, 900]), (1000, 1000))
    photo = np.full((1000, 1000, 3), 200, np.uint8)
    made = {
        "place": lambda: from_points(points, seen_from=np.array([0.0, 0, 20])),
        "camera": lambda: from_points(points, photo=photo, photo_camera=above, mask=None),
        "normals": lambda: from_points(points, normals=-outward),
        "origin": lambda: from_points(points + [0, 0, 400]),
    }[hint]()
    mesh = made.scan.mesh
    outwards = outward_at(mesh) if hint != "origin" else mesh.points * [1, 0, 1] - [0, 0, 500]
    inside = hint in ("place", "normals", "origin")  # seen from below, where the origin is
    assert facing(mesh, -outwards if inside else outwards) == 1
    assert [warning.code for warning in made.warnings] == ["origin-as-scanner"] * (hint == "origin")


def test_a_side_that_nothing_tells_is_taken_and_said():
    points, _ = cylinder(count=5000)
    made = from_points(points - [0, 0, 150])  # the origin lies among them
    assert "towards +z" in made.warnings[0].sentence


@pytest.mark.slow
def test_the_photo_is_made_of_the_points_colours():
    points, _ = cylinder()
    red = np.where(points[:, 1] > 0, 255, 0)
    colours = np.stack([red, 255 - red, 0 * red + 40], axis=1).astype(np.uint8)
    scan = from_points(points, colours, seen_from=np.array([0.0, 0, 900]), mask=None).scan
    np.testing.assert_allclose(scan.photo_xy, project(scan.camera, scan.mesh.points))
    col, row = np.rint(scan.photo_xy).astype(int).T
    clear = np.abs(scan.mesh.points[:, 1]) > 2  # farther from the change of colour than points are apart
    seen = scan.photo[row, col][clear]
    np.testing.assert_array_equal(seen[:, 0] > 128, scan.mesh.points[clear, 1] > 0)
    assert set(np.unique(seen[:, 0])) <= {0, 255}


@pytest.mark.slow
def test_the_table_goes_also_where_the_sheet_hides_it():
    made = photogrammetry_cloud(sheet("letter"), points=20_000, photo_px=None)
    mesh = from_points(made.points, made.colours, made.normals).scan.mesh
    rise = sheet("letter").bend(np.array([[108.0, y] for y in np.arange(0, 279, 0.5)]))
    height = np.interp(mesh.points[:, 1], rise[::-1, 1], rise[::-1, 2])  # the letter's folds run across the page
    assert np.abs(mesh.points[:, 2] - height).max() < 3  # the table beside its middle is 60 mm lower


BAD = {
    "few": ({"points": np.ones((40, 3))}, "40 of 40 points have a place .* at least 500"),
    "zeros": ({"points": np.zeros((4000, 3))}, "0 of 4,000 points have a place"),
    "size": (
        {
            "points": cylinder(1000)[0],
            "photo": np.zeros((9, 9, 3), np.uint8),
            "photo_camera": Camera(np.diag([500.0, 500, 1]), np.eye(3), np.zeros(3), (10, 10)),
        },
        "the photo is 9 x 9 pixels, but its camera's numbers are for 10 x 10",
    ),
    "away": (
        {
            "points": cylinder(1000)[0],
            "photo": np.full((100, 100, 3), 200, np.uint8),
            "photo_camera": Camera(np.diag([500.0, 500, 1]), np.eye(3), np.array([0, 0, 5000.0]), (100, 100)),
            "mask": np.pad(np.zeros((90, 90), bool), (0, 10), constant_values=True),
        },
        "none of the points lie on the sheet that the photo shows",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_what_cannot_be_used_is_said(case):
    arguments, sentence = BAD[case]
    with pytest.raises(InputError, match=sentence):
        from_points(**arguments)


def test_a_missing_library_is_named(tmp_path, monkeypatch, capfd):
    np.savetxt(tmp_path / "p.xyz", cylinder(1000)[0])
    monkeypatch.setitem(__import__("sys").modules, "skimage.measure", None)
    assert run(["acquire", "points", str(tmp_path / "p.xyz"), "-o", str(tmp_path / "scan.ply"), "-q"]) == 6
    assert install_command("points") in capfd.readouterr().err


def test_a_name_that_no_scan_can_have_is_refused_before_any_work(tmp_path, capfd):
    assert run(["acquire", "points", "nothing.xyz", "-o", str(tmp_path / "scan.txt"), "-q"]) == 4
    assert "written as .obj, .ply or .glb" in capfd.readouterr().err


def test_a_photo_without_its_camera_is_refused(tmp_path, capfd):
    command = ["acquire", "points", "p.xyz", "--photo", "p.jpg", "-o", str(tmp_path / "scan.ply"), "-q"]
    assert run(command) == 2
    assert "--photo needs --camera" in capfd.readouterr().err


def test_las_gives_metres_and_colours(tmp_path):
    laspy = pytest.importorskip("laspy", reason="the extra planish[clouds] is not installed")
    points = cylinder(1000)[0] / 1000
    for name in ("points.las", "points.laz"):
        file = laspy.create(point_format=2, file_version="1.2")
        file.header.scales = [1e-6] * 3
        file.x, file.y, file.z = points.T
        file.red, file.green, file.blue = (np.arange(1000) * 60, np.full(1000, 300), np.zeros(1000))
        file.write(tmp_path / name)
        cloud = read_cloud(tmp_path / name)
        np.testing.assert_allclose(cloud.points, points, atol=1e-6)
        assert cloud.unit == "m"
        assert cloud.colours.dtype == np.uint16
        assert cloud.colours[10].tolist() == [600, 300, 0]


@pytest.mark.slow
def test_the_command_draws_the_photo_by_its_camera(tmp_path):
    made = sheet("book")
    cloud = photogrammetry_cloud(made, points=8000, photo_px=(1000, 750))
    data = np.column_stack([cloud.points, cloud.colours])
    np.savetxt(tmp_path / "points.xyz", data, fmt=["%.3f"] * 3 + ["%d"] * 3, header="units: mm")
    cv2.imwrite(str(tmp_path / "photo.png"), cloud.photo[..., ::-1])
    (tmp_path / "camera.json").write_text(json.dumps(camera_as_json(cloud.camera)))
    command = ["acquire", "points", str(tmp_path / "points.xyz"), "-o", str(tmp_path / "scan.ply"), "-q"]
    command += ["--photo", str(tmp_path / "photo.png"), "--camera", str(tmp_path / "camera.json")]
    assert run([*command, "--picture", str(tmp_path / "look.png")]) == 0
    scan = read_scan(tmp_path / "scan.ply").scan
    np.testing.assert_allclose(scan.photo_xy, project(cloud.camera, scan.mesh.points), atol=1e-3)  # float32
