"""Depth maps from files: every kind gives the same millimetres."""

import cv2
import numpy as np
import OpenEXR
import pytest
import tifffile

from planish.errors import InputError, UsageError
from planish.io import read_depths

DEPTH = np.array([[650.0, 0.0, 702.0], [512.0, 433.0, 1200.0]])  # [mm]


def write_exr(path, **channels):
    kept = {name: pixels.astype(np.float32) for name, pixels in channels.items()}
    OpenEXR.File({"type": OpenEXR.scanlineimage}, kept).write(str(path))


@pytest.fixture
def files(tmp_path):
    cv2.imwrite(str(tmp_path / "realsense.png"), DEPTH.astype(np.uint16))
    cv2.imwrite(str(tmp_path / "tum.png"), (5 * DEPTH).astype(np.uint16))
    tifffile.imwrite(tmp_path / "metres.tif", (DEPTH / 1000).astype(np.float32))
    tifffile.imwrite(tmp_path / "mm.tif", DEPTH.astype(np.float32))
    tifffile.imwrite(tmp_path / "double.tif", DEPTH.astype(np.float64))
    tifffile.imwrite(tmp_path / "sixteen.tif", DEPTH.astype(np.uint16))
    np.save(tmp_path / "metres.npy", DEPTH / 1000)
    np.save(tmp_path / "three.npy", np.stack([DEPTH] * 3))
    write_exr(tmp_path / "metres.exr", Z=DEPTH / 1000)
    write_exr(tmp_path / "only.exr", distance=DEPTH)
    write_exr(tmp_path / "colours.exr", A=DEPTH, B=DEPTH)
    return tmp_path


@pytest.mark.parametrize(
    ("name", "scale", "count"),
    [
        ("realsense.png", "realsense", 1),
        ("realsense.png", "auto", 1),
        ("tum.png", "tum", 1),
        ("tum.png", 5000.0, 1),
        ("metres.tif", "auto", 1),
        ("mm.tif", "auto", 1),
        ("double.tif", "auto", 1),
        ("sixteen.tif", "kinect", 1),
        ("metres.npy", "m", 1),
        ("three.npy", "mm", 3),
        ("metres.exr", "auto", 1),
        ("only.exr", "auto", 1),
    ],
)
def test_all_kinds_give_the_same_millimetres(files, name, scale, count):
    frames, _ = read_depths([files / name], scale)
    assert len(frames) == count
    for frame in frames:
        np.testing.assert_allclose(frame, DEPTH, atol=1e-4)  # float32 of 1.2 m


def test_what_was_guessed_is_said(files):
    assert "taken as metres" in read_depths([files / "metres.tif"])[1][0].sentence
    assert read_depths([files / "realsense.png"])[1] == []


def test_a_folder_stands_for_its_maps_by_name(tmp_path):
    for k in (2, 0, 1):
        np.save(tmp_path / f"{k}.npy", DEPTH + k)
    frames, _ = read_depths([tmp_path], "mm")
    assert [frame[0, 0] for frame in frames] == [650, 651, 652]


def test_what_is_no_depth_map_is_said(files, tmp_path):
    cv2.imwrite(str(tmp_path / "eight.png"), DEPTH.astype(np.uint8))
    (tmp_path / "cut.npy").write_bytes((files / "metres.npy").read_bytes()[:140])
    (tmp_path / "text.png").write_text("depth")
    (tmp_path / "cut.exr").write_bytes((files / "metres.exr").read_bytes()[:250])
    np.save(tmp_path / "colours.npy", np.zeros((3, 4, 5, 2)))
    (tmp_path / "empty").mkdir()
    for name, sentence in {
        "eight.png": "8 bits a pixel",
        "cut.npy": "cut short",
        "text.png": "is no image",
        "colours.npy": "one number a pixel is wanted",
        "cut.exr": "damaged or cut short",
        "colours.exr": "has the channels A, B; depth is wanted",
        "nothing.png": "there is no such file",
        "empty": "holds no depth map",
    }.items():
        with pytest.raises(InputError, match=sentence):
            read_depths([tmp_path / name])
    with pytest.raises(UsageError, match="there is no depth scale 'feet'"):
        read_depths([files / "mm.tif"], "feet")
    with pytest.raises(UsageError, match="above 0"):
        read_depths([files / "mm.tif"], -1.0)
