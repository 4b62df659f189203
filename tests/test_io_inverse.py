"""What is written is read again: writers and readers are inverse to each other, whatever the values."""

import io
from pathlib import Path

import numpy as np
import pytest
import tifffile
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from PIL import Image, ImageCms

from planish.errors import OutputError
from planish.io import read_scan, write_page, write_scan
from planish.io.cameras import camera_as_json, camera_from_json, read_camera
from planish.io.gltf import read_gltf
from planish.io.gltf_write import glb_bytes
from planish.io.images import decode_photo
from planish.io.lasers import read_rig, write_rig
from planish.io.obj import obj_parts, read_obj
from planish.io.ply import read_ply
from planish.io.ply_write import ply_parts
from planish.io.polygons import Polygons, of_triangles
from planish.io.tifxyz import read_tifxyz, write_tifxyz
from planish.types import Camera, Mesh, Page, Scan, View
from samples import camera_above, picture, sheet_scan

PATH = Path("sheet")
ICC = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
FLOAT32 = 2.0**-23  # spacing of float32 in parts of the number

some = settings(max_examples=60, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])
coordinate = st.floats(-1e6, 1e6, allow_subnormal=False) | st.just(float("nan"))


@st.composite
def meshes(draw, largest=6, nan=True):
    """Points (n, 3) of which the first is finite, and polygons with or without texture coordinates."""
    count = draw(st.integers(3, 12))
    points = draw(arrays(np.float64, (count, 3), elements=coordinate if nan else st.floats(-1e6, 1e6)))
    points[0] = 0
    sizes = np.array(draw(st.lists(st.integers(3, largest), min_size=1, max_size=6)), np.int32)
    total = int(sizes.sum())
    corners = draw(arrays(np.int32, total, elements=st.integers(0, count - 1)))
    rows = draw(st.integers(0, 5))
    if not rows:
        return points, Polygons(sizes, corners)
    uv = draw(arrays(np.float64, (rows, 2), elements=st.floats(-2, 2)))
    uv_corners = draw(arrays(np.int32, total, elements=st.integers(-1, rows - 1)))
    return points, Polygons(sizes, corners, uv, uv_corners)


def whole_faces(polygons):
    """(p,) the polygons all of whose corners have texture coordinates: a format holds these, or none of a face."""
    first = np.cumsum(polygons.sizes) - polygons.sizes
    return np.minimum.reduceat(polygons.uv_corners, first) >= 0


def corner_places(polygons):
    """(k, 2) texture coordinates of the corners, NaN for none and for those of faces that lack one."""
    places = np.vstack([polygons.uv, [np.nan, np.nan]])[polygons.uv_corners]
    places[~np.repeat(whole_faces(polygons), polygons.sizes)] = np.nan
    return places


def check_same(points, polygons, found, *, point_error, uv_error):
    """Points to so much, where all three numbers are finite; the same faces; the same places of whole faces."""
    finite = np.isfinite(points).all(1)
    assert not np.isfinite(found.points[~finite]).all(1).any()
    np.testing.assert_allclose(found.points[finite], points[finite], rtol=point_error[0], atol=point_error[1])
    np.testing.assert_array_equal(found.polygons.sizes, polygons.sizes)
    np.testing.assert_array_equal(found.polygons.corners, polygons.corners)
    if polygons.uv is None or not whole_faces(polygons).any():
        assert found.polygons.uv is None or (found.polygons.uv_corners < 0).all()
    else:
        np.testing.assert_allclose(corner_places(found.polygons), corner_places(polygons), rtol=0, atol=uv_error)


@some
@given(mesh=meshes())
def test_obj(mesh):
    found = read_obj(PATH, b"".join(obj_parts(*mesh)))
    check_same(*mesh, found, point_error=(0, 5.1e-7), uv_error=5.1e-9)  # 6 and 8 digits


@pytest.mark.slow
@some
@given(mesh=meshes(largest=140))  # from 128 corners on the count of a list needs more than a byte
def test_ply_with_texture_of_the_faces(mesh):
    found = read_ply(PATH, b"".join(ply_parts(*mesh)))
    check_same(*mesh, found, point_error=(0, 0), uv_error=2 * FLOAT32)


@some
@given(mesh=meshes(), data=st.data())
def test_ply_with_texture_of_the_points(mesh, data):
    points, polygons = mesh
    uv = data.draw(arrays(np.float32, (len(points), 2), elements=st.floats(-2, 2, width=32)))
    found = read_ply(PATH, b"".join(ply_parts(points, polygons, point_uv=uv.astype(np.float64))))
    np.testing.assert_array_equal(found.points, points)
    np.testing.assert_array_equal(found.polygons.uv[found.polygons.uv_corners], uv[polygons.corners])


@pytest.mark.slow
@some
@given(mesh=meshes(largest=3), image=st.none() | st.just(b"\x89PNG and so on"), data=st.data())
def test_glb(mesh, image, data):
    points, polygons = mesh
    faces = polygons.corners.reshape(-1, 3)
    uv = data.draw(st.none() | arrays(np.float64, (len(points), 2), elements=st.floats(-2, 2)))
    found = read_gltf(PATH, glb_bytes(points, faces, uv, image))
    expected = of_triangles(faces, uv)
    in_metres = points / 1000
    check_same(in_metres, expected, found, point_error=(FLOAT32, 1e-38), uv_error=4 * FLOAT32)
    assert found.texture == (image if uv is not None else None)


@pytest.mark.slow
@some
@given(
    shape=st.tuples(st.integers(2, 7), st.integers(2, 7)),
    seed=st.integers(0, 999),
    share=st.floats(0, 0.3),
)
def test_tifxyz(shape, seed, share, tmp_path_factory):
    rng = np.random.default_rng(seed)
    xyz = rng.uniform(0.1, 1000, (*shape, 3))
    xyz[rng.random(shape) < share] = np.nan
    xyz[:2, :2] = np.nan_to_num(xyz[:2, :2], nan=7.0)  # one cell at least
    folder = tmp_path_factory.mktemp("grid") / "segment"
    write_tifxyz(folder, xyz, 0.05)
    found = read_tifxyz(folder)
    known = np.isfinite(xyz).all(-1)
    np.testing.assert_array_equal(found.points, xyz[known].astype(np.float32))
    whole_cells = known[:-1, :-1] & known[1:, :-1] & known[1:, 1:] & known[:-1, 1:]
    assert len(found.polygons.sizes) == whole_cells.sum()


@st.composite
def cameras(draw):
    number = st.floats(-1e4, 1e4)
    fx, fy = (draw(st.floats(1e-3, 1e6)) for _ in range(2))
    cx, cy, skew = (draw(number) for _ in range(3))
    turn, _ = np.linalg.qr(np.random.default_rng(draw(st.integers(0, 999))).normal(size=(3, 3)))
    turn *= np.linalg.det(turn)
    distortion = draw(st.sampled_from([0, 4, 5, 8, 12, 14]).flatmap(lambda n: arrays(np.float64, n, elements=number)))
    shape = draw(st.tuples(*[st.integers(1, 2**20 - 1)] * 2))
    translation = draw(arrays(np.float64, 3, elements=number))
    return Camera(np.array([[fx, skew, cx], [0, fy, cy], [0, 0, 1]]), turn, translation, shape, distortion)


def check_same_camera(found, camera):
    for name in ("matrix", "distortion"):
        np.testing.assert_array_equal(getattr(found, name), getattr(camera, name))
    np.testing.assert_allclose(found.translation, camera.translation, rtol=1e-14, atol=1e-300)  # by mm_per_unit
    np.testing.assert_allclose(found.rotation, camera.rotation, atol=1e-14)  # made orthogonal anew
    assert found.shape_rc == camera.shape_rc


@some
@given(camera=cameras(), mm_per_unit=st.sampled_from([1.0, 10.0, 25.4, 1000.0]))
def test_cameras(camera, mm_per_unit, tmp_path_factory):
    from planish.io import write_json

    check_same_camera(camera_from_json("camera.json", camera_as_json(camera)), camera)
    path = tmp_path_factory.getbasetemp() / "camera.json"
    write_json(path, {"cameras": {"a.jpg": camera_as_json(camera, mm_per_unit=mm_per_unit)}})
    check_same_camera(read_camera(path, "a.jpg", mm_per_unit=mm_per_unit), camera)


@pytest.mark.slow
@some
@given(camera=cameras(), planes=arrays(np.float64, (2, 4), elements=st.floats(-1e3, 1e3)))
def test_lasers(camera, planes, tmp_path_factory):
    planes[:, :3] += np.where(np.abs(planes[:, :3]).max(1, keepdims=True) < 1e-3, 1.0, 0.0)
    planes /= np.linalg.norm(planes[:, :3], axis=1, keepdims=True)
    path = tmp_path_factory.getbasetemp() / "rig.json"
    write_rig(path, planes, camera, "a note")
    found = read_rig(path)
    np.testing.assert_allclose(found[0], planes, rtol=1e-14, atol=1e-300)  # made to length 1 anew
    check_same_camera(found[1], camera)


PIXELS = {
    "bilevel": (bool, ()),
    "grey": (np.uint8, ()),
    "colour": (np.uint8, (3,)),
    "deep grey": (np.uint16, ()),
    "deep colour": (np.uint16, (3,)),
}


@pytest.mark.parametrize("kind", PIXELS)
@settings(some, max_examples=25)
@given(
    shape=st.tuples(st.integers(1, 40), st.integers(1, 40)),
    seed=st.integers(0, 999),
    dpi=st.floats(20, 5000),
    icc=st.sampled_from([None, ICC]),
    suffix=st.sampled_from([".tif", ".png"]),
)
@example(shape=(1, 1), seed=0, dpi=300.0, icc=None, suffix=".tif")
def test_pages_without_loss(kind, shape, seed, dpi, icc, suffix, tmp_path_factory):
    dtype, channels = PIXELS[kind]
    top = np.iinfo(dtype).max if dtype is not bool else 1
    pixels = np.random.default_rng(seed).integers(0, top, (*shape, *channels), endpoint=True).astype(dtype)
    path = tmp_path_factory.getbasetemp() / f"page{suffix}"
    write_page(path, Page(pixels, np.ones(shape, bool), dpi, icc if channels else None))
    data = path.read_bytes()
    with Image.open(io.BytesIO(data)) as image:
        assert image.info["dpi"] == pytest.approx((dpi, dpi), abs=0.0127 if suffix == ".png" else 1e-3)  # whole px a m
        assert image.info.get("icc_profile") == (icc if channels else None)
        if dtype is bool:
            assert image.mode == "1"
            np.testing.assert_array_equal(np.asarray(image), pixels)
            return
    if suffix == ".tif":
        stored = tifffile.imread(io.BytesIO(data))
        assert stored.dtype == dtype
        np.testing.assert_array_equal(stored.reshape(pixels.shape), pixels)
    if min(shape) >= 8:  # else it is no photo
        photo = decode_photo("page", data).pixels
        assert photo.dtype == dtype
        np.testing.assert_array_equal(photo, pixels if channels else np.repeat(pixels[..., None], 3, axis=2))


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".glb"])
def test_a_scan_of_several_photos(tmp_path, suffix):
    views = [
        View(picture(dtype=dtype), Camera(camera_above().matrix, np.eye(3), np.array([x, 2.0, 300.0]), (40, 60)))
        for x, dtype in ((1.0, np.uint8), (2.0, np.uint16))
    ]
    scan = sheet_scan(camera=camera_above(), others=tuple(views))
    files = write_scan(tmp_path / f"sheet{suffix}", scan)
    assert sorted(files) == sorted(tmp_path.iterdir())
    photos = [tmp_path / name for name in ("sheet.jpg", "sheet-2.jpg", "sheet-3.png")]
    again = read_scan(files[0], photo=photos, camera=tmp_path / "sheet_cameras.json").scan
    check_same_camera(again.camera, scan.camera)
    for found, view in zip(again.others, views, strict=True):
        check_same_camera(found.camera, view.camera)
        assert found.photo.dtype == view.photo.dtype
        assert np.abs(found.photo.astype(int) - view.photo).max() <= 8  # JPEG of a smooth picture; PNG is exact


def test_several_photos_need_a_camera_each(tmp_path):
    scan = sheet_scan(others=(View(picture(), camera_above()),))
    with pytest.raises(OutputError, match="the camera of each"):
        write_scan(tmp_path / "sheet.ply", scan)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["my sheet", "a.b", "Blatt № 7", "-sheet", "#1", "50% off"])
@pytest.mark.parametrize("suffix", [".obj", ".ply"])
def test_names_of_every_kind_find_their_photo(tmp_path, name, suffix):
    scan = sheet_scan()
    path, *_ = write_scan(
        tmp_path / f"{name}{suffix}", Scan(Mesh(scan.mesh.points, scan.mesh.faces), *(scan.photo, scan.photo_xy))
    )
    found = read_scan(path)
    assert found.warnings == []
    assert found.scan.photo is not None
