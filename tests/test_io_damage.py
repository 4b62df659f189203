"""Damaged files of every kind: whatever is read of them, nothing but an InputError comes out."""

import io
import json
import struct
from pathlib import Path

import numpy as np
import pytest
import tifffile
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

from planish.errors import InputError
from planish.io import images, read_scan
from planish.io.cameras import camera_as_json, read_camera
from planish.io.captures import image_files
from planish.io.depths import read_depths
from planish.io.exif import focal_length_px
from planish.io.gltf import read_gltf
from planish.io.gltf_write import glb_bytes
from planish.io.images import decode_grid, decode_photo
from planish.io.obj import read_obj
from planish.io.pages import jpeg_bytes, png_bytes
from planish.io.ply import read_ply
from planish.io.ply_write import ply_parts
from planish.io.polygons import of_triangles, triangulate
from planish.io.suppress_stderr import OWN_PROCESS
from samples import camera_above, obj_text, picture, sheet_scan

SCAN = sheet_scan()
UV = np.random.default_rng(0).random((35, 2))
ASCII_PLY = (
    b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    b"element face 1\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\nend_header\n"
    b"0 0 0\n1 0 0\n0 1 0\n3 0 1 2 6 0 0 1 0 0 1\n"
)


def tiff(pixels, **kw):
    file = io.BytesIO()
    tifffile.imwrite(file, pixels, **kw)
    return file.getvalue()


def saved(kind, **kw):
    file = io.BytesIO()
    Image.fromarray(picture()).save(file, kind, **kw)
    return file.getvalue()


MESHES = {
    "obj": (read_obj, obj_text(SCAN)[0].encode()),
    "ascii ply": (read_ply, ASCII_PLY),
    "binary ply": (read_ply, b"".join(ply_parts(SCAN.mesh.points, of_triangles(SCAN.mesh.faces, UV)))),
    "glb": (read_gltf, glb_bytes(SCAN.mesh.points, SCAN.mesh.faces, UV, jpeg_bytes(SCAN.photo))),
}
PHOTOS = {
    "jpeg": jpeg_bytes(picture()),
    "png": png_bytes(picture()),
    "16 bit png": png_bytes(picture(dtype=np.uint16)),
    "tiff": saved("TIFF", compression="tiff_lzw"),
    "16 bit tiff": tiff(picture(dtype=np.uint16), photometric="rgb"),
    "16 bit tiff in planes": tiff(
        np.moveaxis(picture(dtype=np.uint16), 2, 0).copy(), photometric="rgb", planarconfig=2
    ),
    "webp": saved("WEBP"),
    "bmp": saved("BMP"),
    "jpeg 2000": saved("JPEG2000"),
    "ppm": saved("PPM"),
}


@st.composite
def damaged(draw, data):
    """A file with some bytes changed, lost, doubled or cut off; the first ones most often."""
    data = bytearray(data)
    for _ in range(draw(st.integers(1, 4))):
        length = len(data)
        reach = draw(st.sampled_from([60, 600, length]))
        at = draw(st.integers(0, max(0, min(reach, length) - 1)))
        match draw(st.sampled_from(["change", "number", "cut", "lose", "double", "insert"])):
            case "change" if length:
                data[at] = draw(st.integers(0, 255))
            case "number":
                data[at : at + 4] = draw(st.sampled_from([b"\xff\xff\xff\xff", b"\0\0\0\0", b"9999", b"-1 .", b"nan "]))
            case "cut":
                del data[at:]
            case "lose":
                del data[at : at + draw(st.integers(1, 40))]
            case "double":
                data[at:at] = data[at : at + 20]
            case "insert":
                data[at:at] = draw(st.binary(max_size=8))
    return bytes(data)


def read_or_refused(read, *args):
    """What was read, or None where it was refused in one sentence; any other error goes through."""
    try:
        return read(*args)
    except InputError as problem:
        sentence = str(problem)
    assert "\n" not in sentence
    return None


quick = settings(max_examples=150, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])


@pytest.mark.slow
@pytest.mark.parametrize("kind", MESHES)
@quick
@given(data=st.data())
def test_damaged_meshes(kind, data):
    read, good = MESHES[kind]
    mesh = read_or_refused(read, Path("sheet"), data.draw(damaged(good)))
    if mesh is not None:
        assert mesh.polygons.corners.min() >= 0
        assert mesh.polygons.corners.max() < len(mesh.points)
        assert len(triangulate(mesh.points, mesh.polygons)) >= 1


@pytest.mark.slow
@pytest.mark.parametrize("kind", PHOTOS)
@quick
@given(data=st.data())
def test_damaged_photos(kind, data):
    photo = read_or_refused(decode_photo, "photo", data.draw(damaged(PHOTOS[kind])))
    if photo is not None:
        assert photo.pixels.ndim == 3
        assert photo.pixels.shape[2] == 3
        assert photo.pixels.dtype in (np.uint8, np.uint16)


@pytest.mark.slow
@quick
@given(data=st.data())
def test_damaged_grids(data):
    read_or_refused(decode_grid, "x.tif", data.draw(damaged(tiff(picture()[..., 0].astype(np.float32)))))


@quick
@given(data=st.data())
def test_damaged_cameras(data, tmp_path_factory):
    good = json.dumps(camera_as_json(camera_above())).encode()
    path = tmp_path_factory.getbasetemp() / "camera.json"
    path.write_bytes(data.draw(damaged(good)) or b" ")
    camera = read_or_refused(read_camera, path)
    assert camera is None or camera.matrix.shape == (3, 3)


@pytest.mark.parametrize("read", [read_obj, read_ply, read_gltf])
@quick
@given(data=st.binary(max_size=300))
def test_random_bytes(read, data):
    starts = {read_obj: b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 ", read_ply: b"ply\nformat ", read_gltf: b"glTF\2\0\0\0"}
    for content in (data, starts[read] + data):
        read_or_refused(read, Path("sheet"), content)


# Finds of the fuzzers (fuzz/), each with the least that shows it


@pytest.mark.parametrize(("kind", "order"), [("jpeg", ">"), ("webp", "<")])
def test_an_image_that_says_it_is_huge_is_refused_before_it_fills_the_memory(kind, order):
    """A header of 236 megapixels on a file of some hundred bytes took a gigabyte and ten seconds."""
    rows, cols = picture().shape[:2]
    size = struct.pack(f"{order}HH", *((rows, cols) if kind == "jpeg" else (cols, rows)))
    assert size in PHOTOS[kind]
    with pytest.raises(InputError, match=r"no photo fits so many into|more pixels than are read of a WebP"):
        decode_photo("photo", PHOTOS[kind].replace(size, struct.pack(f"{order}H", 16_000) * 2))


def test_a_chunk_of_a_png_that_says_it_is_huge_takes_no_memory():
    """OpenCV, which reads 16 bits, took 1.3 GB for it; Pillow, which looks first, passes over it."""
    good = PHOTOS["16 bit png"]
    header = 8 + 25
    with pytest.raises(InputError, match=r"damaged or was cut short"):
        decode_photo("photo", good[:header] + struct.pack(">I", 0x5000_0000) + b"tEXt" + good[header:])
    with pytest.raises(ValueError, match=r"one of its chunks claims 1,342,177,280 bytes"):
        images._by_opencv(good[:-12] + struct.pack(">I", 0x5000_0000) + b"tEXt")


def test_a_tiff_of_64_bit_numbers_is_one_grid_and_no_larger_than_its_file():
    """Pillow does not know these, so its checks of sizes do not hold for them."""
    numbers = np.arange(80.0).reshape(8, 10)
    np.testing.assert_array_equal(decode_grid("depth", tiff(numbers)), numbers)
    with pytest.raises(InputError, match=r"numbers in the shape \(3, 8, 10\)"):
        decode_grid("depth", tiff(np.stack([numbers] * 3), photometric="rgb", planarconfig="separate"))
    bits = struct.pack("<HHIH", 258, 3, 1, 32)
    four = tiff(numbers.astype(np.float32), byteorder="<").replace(bits, bits[:8] + b"\4\0")
    with pytest.raises(InputError, match=r"numbers in the shape \(0,\)"):  # floats of 4 bits, which nothing decodes
        decode_grid("depth", four)
    width, rows = (struct.pack("<HHII", tag, 4, 1, size) for tag, size in ((256, 10), (257, 8)))
    data = tiff(numbers, byteorder="<")
    assert width in data
    data = data.replace(width, width[:8] + struct.pack("<I", 15_000)).replace(rows, rows[:8] + struct.pack("<I", 9_000))
    with pytest.raises(InputError, match="15000 x 9000 pixels, but no photo fits so many"):
        decode_grid("depth", data)


@pytest.mark.parametrize("kind", ["tiff", "16 bit png", "16 bit tiff"])
def test_decoders_print_nothing_in_a_process_of_our_own(kind, capfd, monkeypatch):
    """Libtiff, libpng and Pillow's warnings each told of a damaged file in words of their own."""
    monkeypatch.setenv(OWN_PROCESS, "1")
    good = PHOTOS[kind]
    for k in range(8, len(good), max(1, len(good) // 60)):
        data = good[:k] + bytes([good[k] ^ 0x55]) + good[k + 1 :]
        read_or_refused(decode_photo, "photo", data)
        focal_length_px(io.BytesIO(data))
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("kind", ["jpeg", "png"])
def test_a_damaged_exif_does_not_damage_the_photo(kind):
    good = {"jpeg": saved("JPEG", exif=b"Exif\0\0no TIFF at all"), "png": saved("PNG", exif=b"no TIFF at all")}[kind]
    assert decode_photo("photo", good, upright=True).pixels.shape == picture().shape
    assert focal_length_px(io.BytesIO(good)) is None


@pytest.mark.parametrize("header", [b"{'descr': '<u2', 'shape': (", b"{'descr': \t0, [", b"{'descr': '\\x", b"("])
def test_a_depth_map_whose_header_python_cannot_parse(tmp_path, header):
    path = tmp_path / "depth.npy"
    path.write_bytes(b"\x93NUMPY\1\0" + struct.pack("<H", len(header) + 1) + header + b"\n")
    with pytest.raises(InputError, match="damaged or was cut short"):
        read_depths([path])


def test_digits_that_are_no_numbers_in_the_names_of_photos(tmp_path):
    for name in ("x²", "x10", "x9"):  # ² is a digit to str.isdigit, and no number to int
        Image.fromarray(picture()).save(tmp_path / f"{name}.png")
    assert [path.stem for path in image_files([tmp_path])] == ["x9", "x10", "x²"]


@pytest.mark.parametrize("place", [100, 107])
def test_a_las_header_that_promises_millions_of_records_is_not_believed(place):
    """The library made an object for each of four thousand million records that were not there."""
    read_las = pytest.importorskip("planish.io.cloud_las").read_las
    header = bytearray(b"LASF" + bytes(371))
    header[24:26], header[105:107] = b"\1\2", struct.pack("<H", 26)
    header[place : place + 4] = b"\xff\xff\xff\xff"
    with pytest.raises(InputError, match="promises"):
        read_las(Path("points.las"), bytes(header))


@pytest.mark.parametrize(
    "text",
    [
        "Shape { geometry IndexedFaceSet { coord",
        "Shape { geometry IndexedFaceSet { coordIndex",
        "Shape { children 5 geometry IndexedFaceSet { children 7 } }",
    ],
    ids=["node without a value", "field without a value", "a field called children"],
)
def test_vrml_that_breaks_off_or_names_its_fields_oddly(tmp_path, text):
    """The fuzzer's finds: each ended in an exception of Python's."""
    (tmp_path / "sheet.wrl").write_text(f"#VRML V2.0 utf8\n{text}")
    with pytest.raises(InputError, match=r"sheet\.wrl"):
        read_scan(tmp_path / "sheet.wrl")


def test_names_without_end_become_short_warnings(tmp_path):
    scan = tmp_path / "scan.obj"
    square = "v 0 0 0\nv 90 0 0\nv 90 90 0\nv 0 90 0\nf 1 2 3\nf 1 3 4\n"
    libraries = "".join(f"mtllib m{k}.mtl\n" for k in range(500))
    scan.write_text(f"mtllib {'a' * 10**6}\n{libraries}mtllib \x1b[31mred.mtl\n{square}")
    warnings = [str(warning) for warning in read_scan(scan).warnings if warning.code == "material-file-missing"]
    assert len(warnings) == 20
    assert max(map(len, warnings)) <= 1000
    assert warnings[-1].endswith("(and 482 more of this kind)")
    scan.write_text(f"mtllib \x1b[31mred.mtl\n{square}")
    assert str(read_scan(scan).warnings[0]).endswith("names the material file  [31mred.mtl, which does not exist")


def test_a_line_of_many_words_is_not_looked_up_in_every_combination(tmp_path, monkeypatch):
    looked_up = []
    monkeypatch.setattr("planish.io.obj.find_beside", lambda path, name, inside: looked_up.append(name))
    scan = tmp_path / "scan.obj"
    scan.write_text(f"mtllib {'a ' * 10_000}\nv 0 0 0\nv 90 0 0\nv 90 90 0\nf 1 2 3\n")
    read_scan(scan)
    assert 0 < len(looked_up) < 70_000


def test_an_error_with_an_endless_name_is_one_short_line():
    problem = InputError(f"there is no {'x' * 10**6}\n\n.obj")
    assert len(str(problem)) <= 1000
    assert "\n" not in str(problem)
