"""Units and scale: strays, lengths as units, depth scales, decimal commas, runaway points, the origin."""

import json

import numpy as np
import pytest

import planish
from planish.acquire.range_image.depth import along_axis
from planish.acquire.range_image.grid import plausible_origin
from planish.cli.acquire.common import scale_warnings
from planish.cli.main import run
from planish.errors import UsageError
from planish.io import read_captures, read_cloud, read_depths, read_scan
from planish.io.encode import png_bytes
from planish.io.units import unit_named_in
from planish.settings import mm_per_unit
from planish.types import Camera
from samples import sheet_scan


def obj(points, faces):
    text = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in points]
    return "\n".join([*text, *("f " + " ".join(map(str, face)) for face in np.asarray(faces) + 1)]) + "\n"


@pytest.mark.parametrize("scale", [1.0, 0.001])
def test_points_of_no_face_do_not_decide_the_unit(tmp_path, scale):
    mesh = sheet_scan().mesh
    points = np.r_[mesh.points * scale, [[3000, 0, 0], [0, 4000, 10]]]
    (tmp_path / "sheet.obj").write_text(obj(points, mesh.faces))
    found = read_scan(tmp_path / "sheet.obj")
    assert found.unit == ("mm" if scale == 1 else "m")


def test_a_single_runaway_point_in_a_face_does_not_decide_the_unit(tmp_path):
    mesh = sheet_scan(31, 21).mesh
    points = mesh.points.copy()
    points[330] += [0, 0, 90_000]
    (tmp_path / "sheet.obj").write_text(obj(points, mesh.faces))
    assert read_scan(tmp_path / "sheet.obj").unit == "mm"


@pytest.mark.parametrize(
    ("unit", "mm"), [("7.91um", 0.00791), ("0.00791mm", 0.00791), ("2.4 µm", 0.0024), ("1e-2 cm", 0.1), ("ft", 304.8)]
)
def test_any_length_is_a_unit(tmp_path, unit, mm):
    assert mm_per_unit(unit) == pytest.approx(mm, rel=1e-12)
    mesh = sheet_scan().mesh
    (tmp_path / "sheet.obj").write_text(obj(mesh.points / mm, mesh.faces))
    found = read_scan(tmp_path / "sheet.obj", units=unit)
    assert found.unit == unit
    # six digits after the point of numbers up to 1e5
    np.testing.assert_allclose(found.scan.mesh.points, mesh.points, atol=1e-6 * max(mm, 1) + 1e-9)


@pytest.mark.parametrize("unit", ["", "mm2", "0mm", "-1mm", "7,9um", "nanmm"])
def test_what_is_no_length_is_refused(unit):
    with pytest.raises(UsageError, match="unit"):
        mm_per_unit(unit)


class TestScaleBar:
    """A sheet in steps of 31.7 mm, which the program takes for inches."""

    MM = 31.7

    @pytest.fixture
    def sheet(self, tmp_path):
        mesh = sheet_scan().mesh
        (tmp_path / "sheet.obj").write_text(obj(mesh.points / self.MM - 4, mesh.faces))
        return tmp_path / "sheet.obj"

    @pytest.fixture
    def flatten(self, sheet, tmp_path, capsys):
        """Run planish flatten; its report."""

        def run_it(*options):
            report = tmp_path / "report.json"
            code = run(["flatten", str(sheet), "-o", str(tmp_path / "f.obj"), "--report", str(report), *options])
            told = capsys.readouterr().err
            return code, told, json.loads(report.read_text()) if report.exists() else None

        return run_it

    @pytest.fixture
    def bar(self, sheet):
        """Two points of the file's own numbers, and their distance in mm."""
        points = read_scan(sheet, units="mm").scan.mesh.points
        ends = points[0], points[-1]
        return *ends, float(np.linalg.norm(ends[1] - ends[0])) * self.MM

    def test_a_scale_and_a_scale_bar_give_the_true_size(self, flatten, bar):
        true = planish.flatten(sheet_scan().mesh).size_mm
        start, end, length = bar
        assert min(*start, *end) < 0  # numbers below 0 are no flags
        for options in (
            ["--scale", str(self.MM)],
            ["--scale-bar", *map(repr, map(float, [*start, *end, length]))],
            ["--units", f"{self.MM}mm"],
        ):
            code, told, report = flatten(*options)
            assert code == 0
            assert report["scan"]["unit"] == "31.7mm"
            assert sorted([report["page"]["width_mm"], report["page"]["height_mm"]]) == pytest.approx(
                sorted(true),
                rel=1e-5,  # six digits after the point of numbers up to 9
            )
            assert "unit-guessed" not in report["reason_codes"] + report["warning_codes"]
            assert "unit" not in told

    def test_without_them_the_unit_is_a_guess(self, flatten):
        _, told, report = flatten()
        assert report["scan"]["unit"] == "in"
        assert "unit-guessed" in report["reason_codes"]
        assert "taken as in" in told

    def test_a_known_length_in_python(self, sheet, bar):
        unit = planish.scale_bar(*bar)
        assert planish.read_scan(sheet, units=unit).unit == "31.7mm"
        mesh = planish.read_scan(sheet, units="mm").scan.mesh
        flat = planish.flatten(mesh.points, mesh.faces, units=unit)
        assert flat.size_mm == pytest.approx(planish.flatten(sheet_scan().mesh).size_mm, rel=1e-5)

    @pytest.mark.parametrize(
        ("options", "sentence"),
        [
            (["--scale", "2", "--units", "mm"], "give one of --units, --scale and --scale-bar"),
            (["--scale", "2", "--scale-bar", *"0001112"], "give one of --units, --scale and --scale-bar"),
            (["--scale", "0"], "--scale must be above 0, not 0"),
            (["--scale", "-2"], "--scale must be above 0, not -2"),
            (["--scale", "nan"], "--scale must be above 0, not nan"),
            (["--scale-bar", *"0000005"], "the ends of the scale bar are 0 apart"),
            (["--scale-bar", *"0001110"], "the scale bar is 0.0 mm long"),
        ],
    )
    def test_what_cannot_be_is_refused(self, flatten, options, sentence):
        code, told, report = flatten(*options)
        assert (code, report) == (2, None)
        assert told.startswith("planish: " + sentence)

    @pytest.mark.parametrize("command", ["restore", "view", "acquire grid", "acquire points"])
    def test_every_command_that_reads_coordinates_takes_them(self, command, sheet, tmp_path, capsys):
        arguments = [*command.split(), str(sheet), "-o", str(tmp_path / ("s.ply" if "acquire" in command else "p.png"))]
        assert run([*arguments, "--scale", "2", "--units", "mm"]) == 2
        assert "give one of --units, --scale" in capsys.readouterr().err


def test_a_scale_bar_of_no_place_is_refused():
    with pytest.raises(planish.InputError, match="the end of the scale bar"):
        planish.scale_bar((0, 0, 0), (1, np.nan, 0), 5)


def test_a_length_named_in_a_comment():
    assert unit_named_in("units: 7.91um") == "7.91um"
    assert unit_named_in("units = mm") == "mm"


@pytest.mark.parametrize(("name", "per_metre"), [("d405", 10_000), ("l515", 4000), ("redwood", 1000), ("tum", 5000)])
def test_depth_scales_by_name(tmp_path, name, per_metre):
    (tmp_path / "depth.png").write_bytes(png_bytes(np.full((4, 5), 2000, np.uint16)))
    frames, _ = read_depths([tmp_path / "depth.png"], name)
    assert frames[0][0, 0] == pytest.approx(2000 / per_metre * 1000)


def test_depths_of_sun_are_turned_back(tmp_path):
    depth = np.array([[700, 8192, 65_000]], np.uint16)
    (tmp_path / "depth.png").write_bytes(png_bytes((depth << 3) | (depth >> 13)))
    np.testing.assert_allclose(read_depths([tmp_path / "depth.png"], "sun")[0][0], depth)


@pytest.mark.parametrize(
    ("factor", "scale", "hint"), [(10, "auto", "d405"), (4, "realsense", "l515"), (5, 1000, "tum")]
)
def test_a_sheet_of_absurd_size_is_told_with_the_scale_that_mends_it(factor, scale, hint):
    points = sheet_scan().mesh.points
    assert scale_warnings(points, scale) == []
    (warning,) = scale_warnings(points * factor, scale)
    assert f"{{scale={hint}}}" in warning.hint


def cloud_text(points, separator=";"):
    rows = [separator.join([*(f"{x:.3f}".replace(".", ",") for x in row), "200", "30", "30"]) for row in points]
    return "\n".join(["X;Y;Z;R;G;B", *rows]) + "\n"


@pytest.mark.parametrize("separator", [";", "\t", " ", "; "])
def test_decimal_commas(tmp_path, separator):
    points = np.random.default_rng(0).uniform(-100, 100, (50, 3)).round(3)
    (tmp_path / "cloud.csv").write_text(cloud_text(points, separator))
    found = read_cloud(tmp_path / "cloud.csv")
    np.testing.assert_allclose(found.points, points)
    assert found.colours.tolist() == [[200, 30, 30]] * 50


def test_commas_between_whole_numbers_are_separators(tmp_path):
    (tmp_path / "cloud.csv").write_text("1,2,3\n4,5,6\n7.5,8,9\n")
    np.testing.assert_allclose(read_cloud(tmp_path / "cloud.csv").points, [[1, 2, 3], [4, 5, 6], [7.5, 8, 9]])
    (tmp_path / "cloud.txt").write_text("1,5, 2,5, 3,5\n")
    assert read_cloud(tmp_path / "cloud.txt").points.shape == (1, 3)


def test_points_of_pcd_are_metres(tmp_path):
    pytest.importorskip("pypcd4")
    (tmp_path / "room.pcd").write_text(
        "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 3\nHEIGHT 1\n"
        "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 3\nDATA ascii\n0 0 1\n4 0 1\n0 2 1\n"
    )
    assert read_cloud(tmp_path / "room.pcd").unit == "m"


def test_colours_of_16_bits_in_e57(tmp_path):
    pye57 = pytest.importorskip("pye57")
    from planish.io import cloud_e57

    count = 8
    colours = np.linspace(0, 65535, count).astype(np.uint16)
    data = {f"cartesian{axis}": np.arange(count, dtype=np.float64) for axis in "XYZ"}
    with pye57.E57(str(tmp_path / "a.e57"), mode="w") as file:
        file.write_scan_raw({**data, **{f"color{name}": colours % 256 for name in ("Red", "Green", "Blue")}})
    found = cloud_e57.read_e57(tmp_path / "a.e57")
    assert found.colours[:, 0].tolist() == (colours % 256).tolist()


def tifxyz(folder, points):
    import tifffile

    folder.mkdir()
    for k, axis in enumerate("xyz"):
        tifffile.imwrite(folder / f"{axis}.tif", points[..., k].astype(np.float32))
    (folder / "meta.json").write_text(json.dumps({"format": "tifxyz", "scale": [0.05, 0.05]}))
    return folder


def test_lone_points_far_from_all_others_are_left_out(tmp_path):
    row, col = np.mgrid[:12, :9]
    points = np.stack([20.0 * col, 20.0 * row, 100 + 30 * np.sin(col / 3)], axis=-1)
    points[5, 4] = [1e5, 3, 1e5]
    points[0, 0, 2] += 150  # under ten cells: a steep corner, which stays
    found = read_scan(tifxyz(tmp_path / "sheet", points), units="7.91um")
    assert len(found.scan.mesh.points) == 12 * 9 - 1
    assert [warning.code for warning in found.warnings if warning.code == "points-far-off"]
    assert "1 points lie more than 10 cells" in str(found.warnings[0])


@pytest.mark.parametrize("first", ["white", "black", "neither"])
def test_white_and_black_are_found_where_they_come_first(tmp_path, first):
    patterns = [np.full((16, 16), 40 + 3 * k, np.uint8) for k in range(4)]
    for k, pattern in enumerate(patterns):
        pattern[:, ::2] += 60
        pattern[k, k] = 0
    white, black = np.full((16, 16), 200, np.uint8), np.full((16, 16), 5, np.uint8)
    ends = [black, white] if first == "black" else [white, black]
    for k, image in enumerate([*patterns, *ends] if first == "neither" else [*ends, *patterns]):
        (tmp_path / f"{k}.png").write_bytes(png_bytes(np.repeat(image[..., None], 3, axis=2)))
    found = read_captures([tmp_path])
    np.testing.assert_array_equal(found.frames, [*patterns, white, black])
    assert found.photo.max() == found.photo.min() == 200
    assert [warning.code for warning in found.warnings] == ["white-black-first"] * (first != "neither")


def test_distances_along_the_rays_become_depths():
    camera = Camera(np.array([[100.0, 0, 31.5], [0, 90, 23.5], [0, 0, 1]]), np.eye(3), np.zeros(3), (48, 64))
    row, col = np.mgrid[:48, :64]
    depth = 300.0 + col + 2 * row
    slant = np.sqrt(1 + ((col - 31.5) / 100) ** 2 + ((row - 23.5) / 90) ** 2)
    np.testing.assert_allclose(along_axis(depth * slant, camera), depth)


SHEET = np.stack(np.meshgrid(np.linspace(-100, 100, 20), np.linspace(-130, 130, 20), [0.0]), axis=-1).reshape(-1, 3)


@pytest.mark.parametrize(
    ("shift", "stood_there"),
    [
        ([0, 0, 600], True),  # as a camera sees it, z away from it
        ([50, -40, -500], True),
        ([0, 0, 0], False),  # the origin lies within the sheet
        ([300, 200, 750], False),  # a table in a world
        ([4.3e8, -5.1e9, 78_000], False),  # surveyors' numbers
        ([0, 0, 9000], False),  # nobody scans a sheet 9 m away
    ],
)
def test_the_origin_is_the_scanners_place_only_where_that_is_plausible(shift, stood_there):
    assert (plausible_origin(SHEET + shift) is not None) == stood_there
