"""Range images to scans: every format gives the same points, planes and steps are known, and a page comes back."""

import json

import cv2
import numpy as np
import pytest

from planish.acquire.range_image.grid import from_grid, grid_photo
from planish.acquire.range_image.grid_shape import detect_grid_shape, grid_shape
from planish.acquire.scan_preview import preview
from planish.cli.main import run
from planish.errors import InputError, install_command
from planish.gallery import sheet
from planish.gallery.clouds import range_image
from planish.geometry import project
from planish.io import read_cloud, read_scan
from planish.io.cameras import camera_as_json
from planish.types import Camera

SHAPE = (24, 32)
CAMERA = Camera(np.array([[40.0, 0, 15.5], [0, 40, 11.5], [0, 0, 1]]), np.eye(3), np.zeros(3), SHAPE)


def seen_at(depth):
    """What a camera at the origin that looks along z sees at these depths, (rows, cols, 3)."""
    row, col = np.mgrid[: depth.shape[0], : depth.shape[1]]
    return np.stack([(col - 15.5) * depth / 40, (row - 11.5) * depth / 40, depth], axis=-1)


@pytest.fixture
def bowl():
    """A shallow bowl with a few pixels that saw nothing, and a colour for each pixel."""
    row, col = np.mgrid[: SHAPE[0], : SHAPE[1]]
    points = seen_at(300 + 0.02 * ((row - 11.5) ** 2 + (col - 15.5) ** 2))
    points[3:5, 7:9] = np.nan
    return points, np.stack([8 * col, 10 * row, 255 - 8 * col], axis=-1).astype(np.uint8)


# Formats


def rows_of(bowl):
    points, colours = bowl
    return np.nan_to_num(points).reshape(-1, 3), colours.reshape(-1, 3)


def write_range_grid(path, bowl):
    """A PLY as Stanford's scanners wrote them: only what was seen, and for each pixel a list of one point or none."""
    points, colours = rows_of(bowl)
    seen = points.any(axis=1)
    number = np.cumsum(seen) - 1
    head = ["ply", "format ascii 1.0", f"obj_info num_cols {SHAPE[1]}", f"obj_info num_rows {SHAPE[0]}"]
    head += [f"element vertex {seen.sum()}", *(f"property float {axis}" for axis in "xyz")]
    head += [f"property uchar {name}" for name in ("red", "green", "blue")]
    head += [f"element range_grid {len(points)}", "property list uchar int vertex_indices", "end_header"]
    body = [f"{x:.9g} {y:.9g} {z:.9g} {r} {g} {b}" for (x, y, z), (r, g, b) in zip(points[seen], colours[seen])]  # noqa: B905
    body += [f"1 {n}" if there else "0" for n, there in zip(number, seen, strict=True)]
    path.write_text("\n".join([*head, *body]) + "\n")


def write_sized_ply(path, bowl):
    points, colours = rows_of(bowl)
    head = ["ply", "format ascii 1.0", f"comment width {SHAPE[1]}", f"comment height {SHAPE[0]}"]
    head += [f"element vertex {len(points)}", *(f"property float {axis}" for axis in "xyz")]
    head += [*(f"property uchar {name}" for name in ("red", "green", "blue")), "end_header"]
    lines = [" ".join(f"{v:.9g}" for v in row) for row in np.column_stack([points, colours])]
    path.write_text("\n".join([*head, *lines]) + "\n")


def write_pcd(encoding):
    def write(path, bowl):
        from pypcd4 import Encoding, PointCloud

        points, colours = rows_of(bowl)
        points = np.where(points.any(axis=1, keepdims=True), points, np.nan).astype(np.float32)
        red, green, blue = colours.astype(np.uint32).T
        packed = red << 16 | green << 8 | blue
        kinds = [np.float32, np.float32, np.float32, np.uint32]
        if encoding != "ascii":  # the Point Cloud Library's own way, which needs every bit
            packed, kinds[3] = packed.view(np.float32), np.float32
        cloud = PointCloud.from_points([*points.T, packed], ("x", "y", "z", "rgb"), kinds)
        cloud.metadata = cloud.metadata.derive(width=SHAPE[1], height=SHAPE[0])
        cloud.save(path, encoding=Encoding(encoding))

    return write


def write_text(comment, separator):
    def write(path, bowl):
        points, colours = rows_of(bowl)
        lines = [
            separator.join([*(f"{v:.9g}" for v in place), *map(str, colour)])
            for place, colour in zip(points, colours, strict=True)
        ]
        path.write_text("\n".join([*comment, *lines]) + "\n")

    return write


def write_ptx(path, bowl):
    """In metres, moved by 1 m in x by the matrix; column after column, from below."""
    points, colours = bowl[0] / 1000, bowl[1]
    head = [str(SHAPE[1]), str(SHAPE[0]), "1 0 0", "1 0 0", "0 1 0", "0 0 1"]
    head += ["1 0 0 0", "0 1 0 0", "0 0 1 0", "1 0 0 1"]
    place = np.nan_to_num(points)[::-1].swapaxes(0, 1).reshape(-1, 3)
    paint = colours[::-1].swapaxes(0, 1).reshape(-1, 3)
    lines = [f"{x:.9f} {y:.9f} {z:.9f} 0.5 {r} {g} {b}" for (x, y, z), (r, g, b) in zip(place, paint, strict=True)]
    path.write_text("\n".join([*head, *lines]) + "\n")


def write_e57(path, bowl):
    import pye57

    points, colours = bowl[0] / 1000, bowl[1]
    seen = np.isfinite(points[..., 0])
    row, col = np.nonzero(seen)
    data = {f"cartesian{axis}": points[seen][:, k] for k, axis in enumerate("XYZ")}
    data |= {f"color{name}": colours[seen][:, k] for k, name in enumerate(("Red", "Green", "Blue"))}
    data |= {"rowIndex": row.astype(np.int64), "columnIndex": col.astype(np.int64)}
    with pye57.E57(str(path), mode="w") as file:
        file.write_scan_raw(data)


FORMATS = {
    "range_grid.ply": (write_range_grid, 1),
    "sized.ply": (write_sized_ply, 1),
    "ascii.pcd": (write_pcd("ascii"), 1),
    "binary.pcd": (write_pcd("binary"), 1),
    "compressed.pcd": (write_pcd("binary_compressed"), 1),
    "sized.xyz": (write_text([f"# width {SHAPE[1]} height {SHAPE[0]}"], " "), 1),
    "names.csv": (write_text(["x,y,z,r,g,b"], ","), 1),
    "grid.ptx": (write_ptx, 1000),
    "grid.e57": (write_e57, 1000),
}
LIBRARY = {".pcd": "pypcd4", ".e57": "pye57"}


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_gives_the_same_range_image(bowl, tmp_path, name):
    pytest.importorskip(LIBRARY.get((tmp_path / name).suffix, "numpy"))
    write, per_metre = FORMATS[name]
    write(tmp_path / name, bowl)
    cloud = read_cloud(tmp_path / name)
    shape_rc = grid_shape(cloud.points, cloud.shape_rc, None)
    assert shape_rc == SHAPE
    points = np.where(cloud.points.any(axis=1, keepdims=True), cloud.points, np.nan).reshape(*SHAPE, 3) * per_metre
    wanted = bowl[0] + ([1000, 0, 0] if name == "grid.ptx" else 0)
    np.testing.assert_allclose(points, wanted, atol=2e-5)  # float32 of 300 mm
    seen = np.isfinite(wanted[..., 0])
    np.testing.assert_array_equal(cloud.colours.reshape(*SHAPE, 3)[seen], bowl[1][seen])
    assert cloud.unit == ("m" if per_metre == 1000 or name.endswith(".pcd") else None)


def test_normals_the_scanners_place_and_units_are_read_where_a_file_tells_them(tmp_path):
    path = tmp_path / "points.ply"
    head = "ply\nformat ascii 1.0\ncomment units: cm\nelement vertex 1\n"
    head += "".join(f"property float {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz", "intensity"))
    path.write_text(head + "end_header\n1 2 3 0 0 1 0.5\n")
    cloud = read_cloud(path)
    assert cloud.unit == "cm"
    assert cloud.normals.tolist() == [[0, 0, 1]]
    assert cloud.colours is None  # one strength of echo is no picture
    assert cloud.shape_rc is None


def test_the_strength_of_the_echo_is_a_grey_photo(tmp_path):
    lines = [f"{x} 0 300 {0.2 + 0.01 * x:.3f}" for x in range(40)]
    (tmp_path / "points.asc").write_text("\n".join(lines))
    grey = read_cloud(tmp_path / "points.asc").colours
    assert grey.shape == (40, 3)
    assert (np.diff(grey[1:-1, 0].astype(int)) > 0).all()


# Rows and columns


@pytest.mark.parametrize("shape", [(24, 32), (32, 24), (10, 100), (7, 13)])
def test_rows_are_recognised_by_their_points(shape):
    row, col = np.mgrid[: shape[0], : shape[1]]
    rng = np.random.default_rng(0)
    points = np.stack([col, 2.0 * row, 300 + 0.01 * col**2], axis=-1) + 0.2 * rng.standard_normal((*shape, 3))
    points[1:3, 2:4] = 0
    assert detect_grid_shape(points.reshape(-1, 3)) == shape
    assert detect_grid_shape(rng.permutation(points.reshape(-1, 3))) is None


# Scans


def test_points_stay_where_they_are_and_face_the_scanner(bowl):
    points, colours = bowl
    scan = from_grid(points, colours, mask=None).scan
    col, row = scan.photo_xy.astype(int).T
    np.testing.assert_array_equal(scan.mesh.points, points[row, col])
    a, b, c = (scan.mesh.points[scan.mesh.faces[:, k]] for k in range(3))
    assert ((np.cross(b - a, c - a) * a).sum(axis=1) < 0).all()  # the scanner is at the origin


def test_nothing_is_joined_across_a_depth_jump_and_flying_pixels_go():
    depth = np.where(np.arange(SHAPE[1]) < 16, 300.0, 200.0) * np.ones(SHAPE)
    depth[:, 16] = 250  # the column that saw both
    scan = from_grid(seen_at(depth), None).scan
    assert np.ptp(scan.mesh.points[scan.mesh.faces][..., 2], axis=1).max() < 1e-9
    assert 16 not in scan.photo_xy[:, 0]
    assert len(scan.mesh.points) == SHAPE[0] * (SHAPE[1] - 1)


def test_a_jump_is_seen_without_a_scanners_place_too():
    row, col = np.mgrid[: SHAPE[0], : SHAPE[1]]
    points = np.stack([col - 15.0, 11.0 - row, np.where(col < 16, 0.5, 40.0)], axis=-1)  # the origin lies among them
    mesh = from_grid(points, None).scan.mesh
    assert np.ptp(mesh.points[mesh.faces][..., 2], axis=1).max() == 0
    a, b, c = (mesh.points[mesh.faces[:, k]] for k in range(3))
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()  # y runs up the rows: seen from +z


def test_rows_that_run_as_seen_from_behind_are_turned(bowl):
    points, colours = bowl
    plain, turned = from_grid(points, colours, mask=None).scan, from_grid(points[:, ::-1], colours[:, ::-1]).scan
    np.testing.assert_array_equal(turned.mesh.points, plain.mesh.points)
    np.testing.assert_array_equal(turned.mesh.faces, plain.mesh.faces)
    np.testing.assert_array_equal(turned.photo, plain.photo)
    left = np.zeros(SHAPE, bool)
    left[:, :12] = True  # on the rows as they run in the file
    masked = from_grid(points[:, ::-1], colours[:, ::-1], mask=left).scan
    assert masked.photo_xy[:, 0].min() == pytest.approx(19.5)  # the outer edge of column 20
    behind = from_grid(points, colours, seen_from=np.array([0.0, 0, 900]), mask=None).scan
    np.testing.assert_array_equal(behind.photo, colours[:, ::-1])


def test_a_lone_missing_pixel_is_bridged_but_no_larger_hole(bowl):
    points, colours = bowl
    whole = points.copy()
    points = points.copy()
    points[12, 20] = np.nan
    scan = from_grid(points, colours, mask=None).scan
    at = {tuple(xy): k for k, xy in enumerate(scan.photo_xy.astype(int))}
    assert (7, 3) not in at
    bridged = scan.mesh.points[at[20, 12]]
    assert np.abs(bridged - whole[12, 20]).max() < 0.05  # the bowl's sagitta over one pixel is 0.02 mm


def test_pixels_without_a_point_do_not_blacken_the_photo(bowl):
    points, colours = bowl
    colours = colours.copy()
    colours[3:5, 7:9] = 0
    filled = grid_photo(points, colours)
    assert filled[3:5, 7:9].any(axis=2).all()
    np.testing.assert_array_equal(filled[np.isfinite(points[..., 0])], colours[np.isfinite(points[..., 0])])


def test_a_photo_may_be_larger_or_have_its_own_camera(bowl):
    points, _ = bowl
    large = np.full((48, 64, 3), 200, np.uint8)
    scan = from_grid(points, large, mask=None).scan
    own = project(CAMERA, scan.mesh.points)
    np.testing.assert_allclose(scan.photo_xy, 2 * own + 0.5, atol=1e-9)  # centres of pixels cut in four
    other = Camera(CAMERA.matrix, np.eye(3), np.array([5.0, 0, 0]), SHAPE)
    scan = from_grid(points, np.full((*SHAPE, 3), 200, np.uint8), other, mask=None).scan
    np.testing.assert_allclose(scan.photo_xy, project(other, scan.mesh.points))


@pytest.mark.slow
def test_a_scan_without_colours_can_be_drawn_and_flattened(bowl, tmp_path):
    made = from_grid(bowl[0], None)
    assert made.scan.photo is None
    assert preview(made).shape[0] == 900
    write_text([f"# width {SHAPE[1]} height {SHAPE[0]} units: mm"], " ")(tmp_path / "points.xyz", bowl)
    np.savetxt(tmp_path / "bare.xyz", rows_of(bowl)[0], header=f"width {SHAPE[1]} height {SHAPE[0]}")
    command = ["acquire", "grid", str(tmp_path / "bare.xyz"), "-q", "-o"]
    assert run([*command, str(tmp_path / "scan.ply")]) == 0
    scan = read_scan(tmp_path / "scan.ply").scan
    assert scan.photo is None
    assert run([*command, str(tmp_path / "twice.ply"), "--scale", "2"]) == 0
    twice = read_scan(tmp_path / "twice.ply").scan
    np.testing.assert_allclose(np.ptp(twice.mesh.points, axis=0), 2 * np.ptp(scan.mesh.points, axis=0), rtol=1e-4)


BAD = {
    "zeros": (np.zeros((*SHAPE, 3)), {}, "none of the 768 pixels holds a point"),
    "lonely": (np.where(np.arange(768).reshape(*SHAPE, 1) == 40, np.full(3, 300.0), 0), {}, "1 of 768 pixels"),
    "photo": (seen_at(np.full(SHAPE, 300.0)), {"photo": np.zeros((24, 24, 3), np.uint8)}, "not registered to it"),
    "camera": (
        seen_at(np.full(SHAPE, 300.0)),
        {"photo": np.zeros((9, 9, 3), np.uint8), "photo_camera": CAMERA},
        "the photo is 9 x 9 pixels, but its camera's numbers are for 32 x 24",
    ),
    "mask": (seen_at(np.full(SHAPE, 300.0)), {"mask": np.ones((9, 9), bool)}, "the mask is 9 x 9 pixels"),
}


@pytest.mark.parametrize("case", BAD)
def test_what_cannot_be_used_is_said(case):
    points, more, sentence = BAD[case]
    with pytest.raises(InputError, match=sentence):
        from_grid(points, **{"photo": np.full((*SHAPE, 3), 200, np.uint8), **more})


def test_sizes_that_do_not_match_and_points_in_no_order_are_said(bowl):
    points = rows_of(bowl)[0]
    with pytest.raises(InputError, match=r"30 x 30 pixels would be 900 points, but there are 768.*acquire points"):
        grid_shape(points, None, (30, 30))
    with pytest.raises(InputError, match=r"stand in no order of rows and columns.*acquire points"):
        grid_shape(np.random.default_rng(0).permutation(points), None, None)
    assert grid_shape(points, (12, 64), (24, 32)) == (24, 32)  # what the user says holds


DAMAGED = {
    "cut.pcd": (b"# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 9\nHEIGHT 9\n"
                b"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 81\nDATA binary\n" + bytes(120), "cut short"),
    "no_xyz.pcd": (b"VERSION 0.7\nFIELDS a b\nSIZE 4 4\nTYPE F F\nCOUNT 1 1\nWIDTH 1\nHEIGHT 1\n"
                   b"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 1\nDATA ascii\n1 2\n", "x, y and z are wanted"),
    "bad.e57": (b"ASTM-E57" + bytes(200), "damaged or cut short"),
    "bad.las": (b"LASF" + bytes(300), "damaged or cut short"),
    "short.ptx": (b"2\n2\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n0 0 1 0.5\n",
                  "2 columns and 2 rows, but 1 points follow"),
    "head.ptx": (b"2\n2\n0 0 0\n1 0 0\n", "ten lines of head"),
    "word.xyz": (b"0 0 1\n0 one 1\n", "line of points 2 holds .one., which is no number"),
    "uneven.xyz": (b"0 0 1\n0 0\n", "3 numbers in its first line, but 2 in line of points 2"),
    "two.xyz": (b"0 0\n1 1\n", "x y z, three or more, are wanted"),
    "nothing.xyz": (b"# nothing\n", "holds no points"),
    "nan.xyz": (b"nan nan nan\nnan nan nan\n", "none of its 2 points has three finite"),
    "photo.png": (b"\x89PNG\r\n\x1a\n" + bytes(20), "is no point cloud"),
    "grid.ply": (b"ply\nformat ascii 1.0\nobj_info num_cols 3\nobj_info num_rows 2\nelement vertex 1\n"
                 b"property float x\nproperty float y\nproperty float z\nelement range_grid 4\n"
                 b"property list uchar int vertex_indices\nend_header\n0 0 1\n0\n0\n1 0\n0\n", "has 4 pixels"),
    "index.ply": (b"ply\nformat ascii 1.0\nobj_info num_cols 2\nobj_info num_rows 1\nelement vertex 1\n"
                  b"property float x\nproperty float y\nproperty float z\nelement range_grid 2\n"
                  b"property list uchar int vertex_indices\nend_header\n0 0 1\n1 7\n0\n", "pixel 0 .* holds point 7"),
}  # fmt: skip


@pytest.mark.parametrize("name", DAMAGED)
def test_damaged_files_are_said_to_be(tmp_path, name):
    pytest.importorskip({".pcd": "pypcd4", ".e57": "pye57", ".las": "laspy"}.get((tmp_path / name).suffix, "numpy"))
    data, sentence = DAMAGED[name]
    (tmp_path / name).write_bytes(data)
    with pytest.raises(InputError, match=sentence):
        read_cloud(tmp_path / name)


@pytest.mark.parametrize(("name", "start"), [("a.pcd", b"VERSION 0.7\n"), ("a.e57", b"ASTM-E57"), ("a.las", b"LASF")])
def test_a_missing_library_is_named(tmp_path, monkeypatch, capfd, name, start):
    for library in ("pypcd4", "pye57", "laspy"):
        monkeypatch.setitem(__import__("sys").modules, library, None)
    (tmp_path / name).write_bytes(start)
    assert run(["acquire", "grid", str(tmp_path / name), "-o", str(tmp_path / "scan.ply"), "-q"]) == 6
    assert install_command("clouds") in capfd.readouterr().err


# The whole way: tests/test_sessions.py goes on to the page


@pytest.mark.slow
def test_the_papers_scanner_gives_the_true_surface():
    made = sheet("book")
    image = range_image(made, shape_rc=(160, 120))
    assert np.isfinite(image.points).all(axis=2).mean() > 0.95
    scan = from_grid(image.points, grid_photo(image.points, image.colours)).scan
    on_table = (scan.mesh.points - image.camera.translation) @ image.camera.rotation
    profile = made.bend(np.array([[x, 140.0] for x in np.arange(0, made.width_mm, 0.1)]))
    off = on_table[:, 2] - np.interp(on_table[:, 0], profile[:, 0], profile[:, 2])  # the book is bent across alone
    assert np.median(np.abs(off)) < 0.06  # of 0.05 mm of noise along the rays: 0.034, more where the page is steep
    assert np.ptp(on_table[:, 1]) > made.height_mm - 10


def test_a_photo_with_its_camera_is_drawn_instead_of_the_points_colours(bowl, tmp_path, capfd):
    write_text([f"# width {SHAPE[1]} height {SHAPE[0]} units: mm"], " ")(tmp_path / "p.xyz", bowl)
    cv2.imwrite(str(tmp_path / "photo.png"), np.full((*SHAPE, 3), 90, np.uint8))
    (tmp_path / "camera.json").write_text(json.dumps(camera_as_json(CAMERA)))
    command = ["acquire", "grid", str(tmp_path / "p.xyz"), "-o", str(tmp_path / "scan.ply"), "--mask", "none", "-q"]
    camera = ["--camera", str(tmp_path / "camera.json")]
    assert run([*command, "--photo", str(tmp_path / "photo.png"), *camera]) == 0
    scan = read_scan(tmp_path / "scan.ply").scan
    assert np.abs(scan.photo.astype(int) - 90).max() <= 2  # JPEG
    np.testing.assert_allclose(scan.photo_xy, project(CAMERA, scan.mesh.points), atol=1e-3)  # float32
    assert run([*command, *camera]) == 2
    assert "give the photo with --photo" in capfd.readouterr().err


@pytest.mark.parametrize(("sigma", "warned"), [(0.0, False), (0.1, False), (0.5, True)])
def test_noise_is_reported_and_too_much_of_it_warned_of(sigma, warned):
    x, y = np.meshgrid(np.arange(120.0) - 60, np.arange(90.0) - 45)
    z = 400 + 10 * np.sin(x / 20) + sigma * np.random.default_rng(0).standard_normal(x.shape)
    acquired = from_grid(np.stack([x * z / 400, y * z / 400, z], axis=-1), None)
    if sigma:
        assert abs(acquired.noise_mm / sigma - 1) < 0.15
        assert 0.3 < acquired.noise_length_mm < 1.0  # white: half a pixel
    else:
        assert acquired.noise_length_mm is None
    assert ("scan-noisy" in {warning.code for warning in acquired.warnings}) == warned
