import json

import numpy as np
import pytest
from PIL import Image

from captures import DATA
from planish.errors import InputError, OutputError, UsageError
from planish.geometry import project
from planish.io import check_flat_name, read_scan, write_flat, write_scan
from planish.types import Mesh, Scan
from samples import camera_above, obj_text, picture, sheet_scan, write_obj_by_hand

# Reading


def test_texture_coordinates_become_photo_pixels(tmp_path):
    scan = sheet_scan()
    found = read_scan(write_obj_by_hand(tmp_path, scan))
    np.testing.assert_allclose(found.scan.mesh.points, scan.mesh.points, atol=5e-7)  # written with 6 digits
    np.testing.assert_array_equal(found.scan.mesh.faces, scan.mesh.faces)
    np.testing.assert_allclose(found.scan.photo_xy, scan.photo_xy, atol=1e-6)
    np.testing.assert_array_equal(found.scan.photo, scan.photo)
    assert found.unit == "mm"
    assert found.warnings == []


def test_the_corners_of_the_photo(tmp_path):
    (tmp_path / "sheet.obj").write_text(
        "mtllib sheet.mtl\nusemtl page\nv 0 0 0\nv 200 0 0\nv 0 280 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n"
    )
    (tmp_path / "sheet.mtl").write_text("newmtl page\nmap_Kd photo.png\n")
    Image.fromarray(picture()).save(tmp_path / "photo.png")
    found = read_scan(tmp_path / "sheet.obj")
    np.testing.assert_array_equal(found.scan.photo_xy, [[-0.5, 39.5], [59.5, 39.5], [-0.5, -0.5]])  # 60 x 40 pixels


def test_seams_give_places_per_corner(tmp_path):
    (tmp_path / "sheet.obj").write_text(
        "v 0 0 0\nv 200 0 0\nv 200 280 0\nv 0 280 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0.5 0.5\n"
        "f 1/1 2/2 3/3 4/1\nf 1/4 3/3 4/1\n"
    )
    Image.fromarray(picture()).save(tmp_path / "photo.png")
    found = read_scan(tmp_path / "sheet.obj", photo=tmp_path / "photo.png")
    assert found.scan.photo_xy.shape == (3, 3, 2)
    assert found.polygons.sizes.tolist() == [4, 3]
    np.testing.assert_array_equal(found.scan.photo_xy[2], [[29.5, 19.5], [59.5, -0.5], [-0.5, 39.5]])


def test_another_photo_can_be_given(tmp_path):
    path = write_obj_by_hand(tmp_path, sheet_scan())
    Image.fromarray(picture(80, 120)).save(tmp_path / "better.png")
    found = read_scan(path, photo=tmp_path / "better.png")
    assert found.scan.photo.shape == (80, 120, 3)
    np.testing.assert_allclose(found.scan.photo_xy, (sheet_scan().photo_xy + 0.5) * 2 - 0.5, atol=2e-6)


def test_texture_outside_the_photo_is_said(tmp_path):
    scan = sheet_scan()
    places = scan.photo_xy.copy()
    places[:5, 0] -= 20
    found = read_scan(write_obj_by_hand(tmp_path, Scan(scan.mesh, scan.photo, places)))
    assert "face corners have texture coordinates outside 0 to 1" in found.warnings[0].sentence
    np.testing.assert_allclose(found.scan.photo_xy, places, atol=1e-6)


@pytest.mark.parametrize(
    "make", [lambda p: p.unlink(), lambda p: p.write_bytes(b"broken"), lambda p: p.write_bytes(b"")]
)
def test_without_its_texture_the_geometry_is_read_all_the_same(tmp_path, make):
    path = write_obj_by_hand(tmp_path, sheet_scan())
    make(tmp_path / "photo.png")
    found = read_scan(path)
    assert found.scan.photo is None
    assert found.scan.photo_xy is None
    assert "photo.png" in found.warnings[0].sentence
    assert len(found.scan.mesh.points) == 35


@pytest.mark.parametrize("content", [b"broken", b""])
def test_a_photo_that_was_asked_for_must_be_good(tmp_path, content):
    path = write_obj_by_hand(tmp_path, sheet_scan())
    (tmp_path / "bad.jpg").write_bytes(content)
    with pytest.raises(InputError, match=r"bad\.jpg"):
        read_scan(path, photo=tmp_path / "bad.jpg")
    with pytest.raises(InputError, match=r"none\.jpg: there is no such file"):
        read_scan(path, photo=tmp_path / "none.jpg")


def bare_sheet(folder, scan):
    """The mesh without texture coordinates, the photo and the camera beside it."""
    for path in write_scan(folder / "full.obj", scan):
        if path.suffix == ".jpg":
            path.rename(folder / "photo.jpg")
    text, _ = obj_text(scan)
    lines = [line for line in text.splitlines() if line.startswith("v ")]
    lines += [f"f {a} {b} {c}" for a, b, c in scan.mesh.faces + 1]
    (folder / "sheet.obj").write_text("\n".join(lines) + "\n")
    return folder / "sheet.obj"


def test_a_photo_without_texture_coordinates_needs_a_camera(tmp_path):
    scan = sheet_scan(camera=camera_above())
    path = bare_sheet(tmp_path, scan)
    with pytest.raises(InputError, match="give camera"):
        read_scan(path, photo=tmp_path / "photo.jpg")
    found = read_scan(path, photo=tmp_path / "photo.jpg", camera=tmp_path / "full_camera.json")
    assert found.scan.photo_xy is None
    np.testing.assert_allclose(project(found.scan.camera, scan.mesh.points), project(scan.camera, scan.mesh.points))


def test_a_camera_places_another_photo_and_texture_coordinates_their_own(tmp_path):
    scan = sheet_scan(camera=camera_above())
    write_scan(tmp_path / "sheet.obj", scan)
    camera = tmp_path / "sheet_camera.json"
    (tmp_path / "other.jpg").write_bytes((tmp_path / "sheet.jpg").read_bytes())
    for photo, placed_by_texture in [(None, True), ("sheet.jpg", True), ("other.jpg", False)]:
        found = read_scan(tmp_path / "sheet.obj", photo=photo and tmp_path / photo, camera=camera)
        assert (found.scan.photo_xy is not None) == placed_by_texture
        assert found.scan.camera is not None


def test_a_photo_of_another_size_than_the_camera_says(tmp_path):
    scan = sheet_scan(camera=camera_above())
    write_scan(tmp_path / "sheet.obj", scan)
    Image.fromarray(picture(80, 100)).save(tmp_path / "larger.png")  # by no one factor both ways
    with pytest.raises(InputError, match=r"larger\.png is 100 x 80 pixels, but .*sheet_camera\.json is for .* 60 x 40"):
        read_scan(tmp_path / "sheet.obj", photo=tmp_path / "larger.png", camera=tmp_path / "sheet_camera.json")


def test_a_photo_is_turned_where_only_that_fits_the_camera(tmp_path):
    scan = sheet_scan(camera=camera_above())
    path = bare_sheet(tmp_path, scan)
    exif = Image.Exif()
    exif[0x0112] = 6
    Image.fromarray(picture()).transpose(Image.Transpose.ROTATE_90).save(tmp_path / "stored.png", exif=exif)
    found = read_scan(path, photo=tmp_path / "stored.png", camera=tmp_path / "full_camera.json")
    np.testing.assert_array_equal(found.scan.photo, picture())


def test_a_camera_that_looks_away_is_refused(tmp_path):
    write_scan(tmp_path / "sheet.obj", sheet_scan(camera=camera_above()))
    camera = tmp_path / "sheet_camera.json"
    told = json.loads(camera.read_text())
    camera.write_text(json.dumps(told | {"rotation": np.diag([1, 1, 1]).tolist(), "translation": [0, 0, -400]}))
    with pytest.raises(InputError, match="looks away from the scan"):
        read_scan(tmp_path / "sheet.obj", camera=camera)


@pytest.mark.parametrize(("unit", "factor"), [("mm", 1.0), ("cm", 10.0), ("m", 1000.0), ("in", 25.4)])
def test_units(tmp_path, unit, factor):
    scan = sheet_scan()
    text, _ = obj_text(Scan(Mesh(scan.mesh.points / factor, scan.mesh.faces), scan.photo, scan.photo_xy))
    (tmp_path / "sheet.obj").write_text(text)
    for asked in ("auto", unit):
        found = read_scan(tmp_path / "sheet.obj", units=asked)
        assert found.unit == unit
        np.testing.assert_allclose(found.scan.mesh.points, scan.mesh.points, atol=1e-6 * factor)
    assert any("the file names no unit" in w.sentence for w in read_scan(tmp_path / "sheet.obj").warnings) == (
        unit != "mm"
    )


@pytest.mark.parametrize("scale", [0.01, 10.0])
def test_a_page_of_two_metres_or_two_millimetres_is_doubted(tmp_path, scale):
    scan = sheet_scan()
    text, _ = obj_text(Scan(Mesh(scan.mesh.points * scale, scan.mesh.faces), scan.photo, scan.photo_xy))
    (tmp_path / "sheet.obj").write_text(text)
    assert any(
        "when its numbers are taken as" in warning.sentence
        for warning in read_scan(tmp_path / "sheet.obj", units="mm").warnings
    )
    with pytest.raises(UsageError, match="the unit must be auto"):
        read_scan(tmp_path / "sheet.obj", units="parsec")


def test_a_point_beyond_all_numbers_is_refused(tmp_path):
    (tmp_path / "far.obj").write_text("v 1e200 0 0\nv 200 0 0\nv 0 280 0\nf 1 2 3\n")
    with pytest.raises(InputError, match="so far from the others"):
        read_scan(tmp_path / "far.obj")


@pytest.mark.parametrize(
    ("name", "content", "sentence"),
    [
        ("sheet.obj", None, "there is no such file"),
        ("sheet.obj", b"", "is empty"),
        ("sheet.stl", b"solid sheet\nendsolid\n", "holds no points"),
        ("sheet.obj", bytes(range(256)) * 10, "no mesh that planish reads"),
        ("photo.jpg", b"\xff\xd8\xff\xe0\x00\x10JFIF\x00", "no mesh that planish reads"),
        ("notes.txt", b"Dear colleague, here is\nthe scan.\n", "is no OBJ"),
    ],
)
def test_what_is_no_mesh_at_all(tmp_path, name, content, sentence):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=sentence) as caught:
        read_scan(tmp_path / name)
    assert name in str(caught.value)


def test_a_folder_that_is_no_segment(tmp_path):
    with pytest.raises(InputError, match="no tifxyz"):
        read_scan(tmp_path)


@pytest.mark.parametrize("suffix", [".ply", ".glb", ".obj"])
def test_the_content_counts_where_the_suffix_lies(tmp_path, suffix):
    for path in write_scan(tmp_path / f"sheet{suffix}", Scan(sheet_scan().mesh))[:1]:
        found = read_scan(path.rename(tmp_path / "sheet.dat"))
    np.testing.assert_allclose(found.scan.mesh.points, sheet_scan().mesh.points, atol=2e-5)


# Writing scans


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".glb"])
@pytest.mark.parametrize("kind", ["points", "corners", "16 bit", "bare"])
def test_a_scan_comes_back(tmp_path, suffix, kind):
    scan = sheet_scan(camera=camera_above(), icc=None)
    if kind == "corners":
        places = scan.photo_xy[scan.mesh.faces].copy()
        places[: len(places) // 2] += 1.5
        places[3] = np.nan
        scan = Scan(scan.mesh, scan.photo, places, scan.camera)
    elif kind == "16 bit":
        scan = Scan(scan.mesh, picture(dtype=np.uint16), scan.photo_xy, scan.camera)
    elif kind == "bare":
        scan = Scan(scan.mesh)
    files = write_scan(tmp_path / f"sheet{suffix}", scan)
    assert sorted(files) == sorted(tmp_path.iterdir())
    camera = tmp_path / "sheet_camera.json" if scan.camera else None
    found = read_scan(files[0], camera=camera)
    outside = suffix == ".glb" and kind == "corners"  # where GLB puts corners that have no place
    assert (
        [w for w in found.warnings if w.code == "texture-outside-photo"]
        == found.warnings[: int(outside)]
        == found.warnings
    )
    again = found.scan
    points, faces = again.mesh.points, again.mesh.faces
    exact = {".obj": 5e-7, ".ply": 0, ".glb": 2e-5}[suffix]  # 6 digits; doubles; float32 of 0.28 m
    count = len(scan.mesh.points)  # GLB repeats points at seams, after the others
    np.testing.assert_allclose(points[:count], scan.mesh.points, rtol=0, atol=exact)
    np.testing.assert_allclose(points[faces], scan.mesh.points[scan.mesh.faces], rtol=0, atol=exact)
    if kind == "bare":
        assert again.photo is None
        return
    corners = scan.photo_xy if scan.photo_xy.ndim == 3 else scan.photo_xy[scan.mesh.faces]
    got = again.photo_xy if again.photo_xy.ndim == 3 else again.photo_xy[faces]
    seen = np.isfinite(corners).all((1, 2))
    np.testing.assert_allclose(got[seen], corners[seen], atol=1e-5)  # float32 of 60 pixels, or 8 digits
    assert (got[~seen][..., 0] < -0.5).all() if suffix == ".glb" else np.isnan(got[~seen]).all()
    if kind == "16 bit":
        np.testing.assert_array_equal(again.photo, scan.photo)
    else:
        assert np.abs(again.photo.astype(int) - scan.photo).max() <= 8  # JPEG of a smooth picture
    np.testing.assert_allclose(again.camera.translation, scan.camera.translation)


def test_scans_of_other_suffixes_are_refused(tmp_path):
    with pytest.raises(OutputError, match=r"\.obj, \.ply or \.glb"):
        write_scan(tmp_path / "sheet.stl", sheet_scan())
    with pytest.raises(OutputError, match="there is no folder"):
        write_scan(tmp_path / "none" / "sheet.obj", sheet_scan())
    assert list(tmp_path.iterdir()) == []


# Writing flat meshes


def quads_and_pentagon(folder):
    """A file with polygons, a seam, and a point of no face, in centimetres."""
    (folder / "sheet.obj").write_text(
        "# units: cm\n"
        "v 0 0 0\nv 10 0 1\nv 10 14 1\nv 0 14 0\nv 99 99 99\nv 20 0 0\nv 20 14 0\nv 25 7 0\n"
        "vt 0 0\nvt 0.5 0\nvt 0.5 1\nvt 0 1\nvt 1 0\nvt 1 1\nvt 0.9 0.5\nvt 0.6 0\n"
        "f 1/1 2/2 3/3 4/4\nf 2/8 6/5 8/7 7/6 3/3\nf 6 8 7\n"
    )
    return read_scan(folder / "sheet.obj")


PAGE_XY = np.array([[0, 140], [100, 140], [100, 0], [0, 0], [50, 50], [200, 140], [200, 0], [250, 70]], float)
"""Where the points of `quads_and_pentagon` lie on the page; y down."""


@pytest.mark.parametrize("suffix", [".obj", ".ply"])
def test_flat_points_keep_order_faces_and_texture(tmp_path, suffix):
    found = quads_and_pentagon(tmp_path)
    write_flat(tmp_path / f"flat{suffix}", found, PAGE_XY)
    flat = read_scan(tmp_path / f"flat{suffix}")
    assert flat.unit == "mm"
    expected = np.c_[PAGE_XY[:, 0], 140 - PAGE_XY[:, 1], np.zeros(8)]
    np.testing.assert_allclose(flat.scan.mesh.points, expected, atol=1e-9)
    np.testing.assert_array_equal(flat.polygons.sizes, found.polygons.sizes)
    np.testing.assert_array_equal(flat.polygons.corners, found.polygons.corners)

    def uv(polygons):
        return np.vstack([polygons.uv, [np.nan, np.nan]])[polygons.uv_corners]

    np.testing.assert_allclose(uv(flat.polygons), uv(found.polygons), atol=1e-7)


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".glb"])
def test_the_printed_side_is_up(tmp_path, suffix):
    found = quads_and_pentagon(tmp_path)  # counter-clockwise from +z, as is its page
    write_flat(tmp_path / f"flat{suffix}", found, PAGE_XY)
    mesh = read_scan(tmp_path / f"flat{suffix}").scan.mesh
    a, b, c = (mesh.points[mesh.faces[:, k]] for k in range(3))
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".glb"])
def test_places_on_the_page_as_texture(tmp_path, suffix):
    found = quads_and_pentagon(tmp_path)
    write_flat(tmp_path / f"flat{suffix}", found, PAGE_XY, as_="uv")
    flat = read_scan(tmp_path / f"flat{suffix}")
    assert flat.unit == ("m" if suffix == ".glb" else "cm")
    np.testing.assert_allclose(flat.scan.mesh.points[:8], found.scan.mesh.points, atol=1e-4)  # float32 of 1 m
    mm = flat.polygons.uv[flat.polygons.uv_corners]
    expected = np.c_[PAGE_XY[:, 0], 140 - PAGE_XY[:, 1]][flat.polygons.corners]
    np.testing.assert_allclose(mm, expected, atol=2e-5)  # float32 of 250


def test_glb_repeats_points_at_seams_after_the_others(tmp_path):
    found = quads_and_pentagon(tmp_path)
    write_flat(tmp_path / "flat.glb", found, PAGE_XY)
    flat = read_scan(tmp_path / "flat.glb")
    expected = np.c_[PAGE_XY[:, 0], 140 - PAGE_XY[:, 1], np.zeros(8)]
    np.testing.assert_allclose(flat.scan.mesh.points[:8], expected, atol=2e-5)
    assert len(flat.scan.mesh.points) > 8


def test_scalars_and_their_colours(tmp_path):
    found = quads_and_pentagon(tmp_path)
    strain = np.arange(6) / 10.0  # two triangles of the quad, three of the pentagon, one
    write_flat(tmp_path / "flat.ply", found, PAGE_XY, scalars={"strain": strain, "noise": np.arange(8.0)})
    data = (tmp_path / "flat.ply").read_bytes()
    head, _, body = data.partition(b"end_header\n")
    assert b"property float strain" in head
    assert b"colours: strain from 0" in head
    last = np.frombuffer(body[-7:], [("strain", "<f4"), ("rgb", "u1", 3)])
    assert last["strain"][0] == pytest.approx(0.5)
    assert last["rgb"][0].tolist() == [253, 231, 37]  # the bright end of viridis
    assert len(read_scan(tmp_path / "flat.ply").polygons.sizes) == 3
    with pytest.raises(UsageError, match="7 values; 8 "):
        write_flat(tmp_path / "flat.ply", found, PAGE_XY, scalars={"strain": np.zeros(7)})
    with pytest.raises(OutputError, match=r"only \.ply holds"):
        write_flat(tmp_path / "flat.obj", found, PAGE_XY, scalars={"strain": strain})


def test_the_page_as_a_grid_in_space(tmp_path):
    scan = sheet_scan(29, 21)
    places = scan.photo_xy.copy()
    page = np.c_[(places[:, 0] - 4) * 4, (places[:, 1] - 4) * 280 / 30]
    lifted = Scan(Mesh(scan.mesh.points + [0, 0, 10], scan.mesh.faces))
    write_scan(tmp_path / "sheet.ply", lifted)
    found = read_scan(tmp_path / "sheet.ply")
    write_flat(tmp_path / "segment", found, page, as_="uv")
    write_flat(tmp_path / "segment", found, page, as_="uv")
    grid = read_scan(tmp_path / "segment")
    assert len(grid.scan.mesh.points) == pytest.approx(29 * 21, rel=0.1)
    angle = np.arctan2(grid.scan.mesh.points[:, 0], grid.scan.mesh.points[:, 2] - 10 + 60 * np.cos(100 / 60))
    u = grid.polygons.uv[:, 0] * len(np.unique(grid.polygons.uv[:, 0])) - 0.5
    step = json.loads((tmp_path / "segment" / "meta.json").read_text())["scale"][0]
    np.testing.assert_allclose(angle * 60 + 100, u / step, atol=0.01)  # chords of 10 mm on a radius of 60


def test_names_of_flat_meshes():
    for name in ("flat.obj", "FLAT.OBJ", "flat.ply", "flat.glb"):
        check_flat_name(name)
        check_flat_name(name, "uv")
    check_flat_name("segment", "uv")
    check_flat_name("segment.tifxyz", "uv")
    with pytest.raises(OutputError, match="set as_=uv"):
        check_flat_name("segment")
    with pytest.raises(OutputError, match=r"\.stl is none of them"):
        check_flat_name("flat.stl")


# Several photos


def two_photos(folder):
    """A sheet with photos a.png and b.png, whose cameras are in both.json, a.json and b.json."""
    scan = sheet_scan()
    write_scan(folder / "sheet.ply", Scan(scan.mesh))
    cameras = {}
    for name, height in (("a", 500.0), ("b", 700.0)):
        Image.fromarray(picture() + np.uint8(name == "b")).save(folder / f"{name}.png")
        above = {"focal_px": 300, "width": 60, "height": 40, "cam": [100, -140, height]}
        cameras[f"{name}.png"] = above
        (folder / f"{name}.json").write_text(json.dumps(above))
    (folder / "both.json").write_text(json.dumps({"cameras": cameras}))
    return folder / "sheet.ply", [folder / "a.png", folder / "b.png"]


def test_several_photos_with_one_camera_file_or_one_each(tmp_path):
    sheet, photos = two_photos(tmp_path)
    one = read_scan(sheet, photo=photos, camera=tmp_path / "both.json")
    each = read_scan(sheet, photo=photos, camera=[tmp_path / "a.json", tmp_path / "b.json"])
    for found in (one, each):
        (other,) = found.scan.others
        np.testing.assert_array_equal(found.scan.photo, picture())
        np.testing.assert_array_equal(other.photo, picture() + np.uint8(1))
        assert found.scan.camera.translation[2] == 500
        assert other.camera.translation[2] == 700
        assert found.warnings == []
    assert one.sources == (sheet, *photos, tmp_path / "both.json")
    assert each.sources == (sheet, *photos, tmp_path / "a.json", tmp_path / "b.json")
    turned = read_scan(sheet, photo=photos[::-1], camera=tmp_path / "both.json").scan
    assert turned.camera.translation[2] == 700


def test_photos_and_cameras_that_do_not_match(tmp_path):
    sheet, (a, b) = two_photos(tmp_path)
    cam_a, cam_b, both = (tmp_path / name for name in ("a.json", "b.json", "both.json"))
    for photos, cameras, said in (
        ([a, b], None, "2 photos were given and no camera"),
        ([a, a], both, "a.png was given twice"),
        ([a, b], cam_a, "a.json holds one camera, but 2 photos were given"),
        ([a], [cam_a, cam_b], "1 photo and 2 cameras were given"),
        (None, [cam_a, cam_b], "no photos and 2 cameras were given"),
    ):
        with pytest.raises(InputError, match=said):
            read_scan(sheet, photo=photos, camera=cameras)


def test_a_further_photo_of_the_wrong_size(tmp_path):
    sheet, photos = two_photos(tmp_path)
    Image.fromarray(picture(20, 40)).save(photos[1])
    with pytest.raises(InputError, match=r"b\.png is 40 x 20 pixels, but .*both\.json is for a photo of 60 x 40"):
        read_scan(sheet, photo=photos, camera=tmp_path / "both.json")


def test_a_further_photo_with_another_colour_profile(tmp_path):
    from PIL import ImageCms

    sheet, photos = two_photos(tmp_path)
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    Image.fromarray(picture()).save(photos[1], icc_profile=profile)
    (said,) = read_scan(sheet, photo=photos, camera=tmp_path / "both.json").warnings
    assert "b.png has another colour profile than the first photo" in said.sentence


# Real captures


@pytest.mark.slow
@pytest.mark.shared("virtual_scans")
@pytest.mark.parametrize("name", ["book_clean", "letter"])
def test_camera_and_texture_of_a_virtual_scan_agree(name):
    base = DATA / "virtual_scans" / name / name
    found = read_scan(base.with_suffix(".obj"), camera=base.with_name(f"{name}_camera.json"))
    assert found.unit == "mm"
    assert found.warnings == []
    seen = project(found.scan.camera, found.scan.mesh.points)
    np.testing.assert_allclose(seen, found.scan.photo_xy, atol=0.003)  # texture coordinates of 6 digits


@pytest.mark.shared("curled_map")
def test_matrices_and_texture_of_the_curled_map_agree():
    folder = DATA / "curled_map"
    found = read_scan(folder / "curled_map.obj", camera=folder / "cameras.json")
    seen = project(found.scan.camera, found.scan.mesh.points)
    np.testing.assert_allclose(seen, found.scan.photo_xy, atol=0.001)  # texture coordinates of 6 digits
    other = read_scan(folder / "curled_map.obj", camera=folder / "cameras.json", photo=folder / "frame0024.jpg")
    assert other.scan.photo_xy is None


@pytest.mark.shared("handheld_sheet")
@pytest.mark.parametrize("name", ["033", "065", "097", "145"])
def test_handheld_sheets_are_read(name):
    found = read_scan(DATA / "handheld_sheet" / f"{name}.obj")
    assert found.scan.mesh.points.shape == (301, 3)
    assert found.scan.photo.shape == (480, 640, 3)
    assert found.unit == "mm"
