import json

import numpy as np
import pytest
import tifffile

from planish.errors import InputError, OutputError
from planish.io.tifxyz import read_tifxyz, write_tifxyz


def grid_of_points(rows=4, cols=5):
    r, c = np.meshgrid(np.arange(rows), np.arange(cols), indexing="ij")
    return np.stack([20.0 * c, 20.0 * r, 100.0 + c], axis=-1)


def write(folder, xyz, **kw):
    folder.mkdir(exist_ok=True)
    for k, axis in enumerate("xyz"):
        tifffile.imwrite(folder / f"{axis}.tif", xyz[..., k].astype(np.float32), **kw)
    (folder / "meta.json").write_text('{"format": "tifxyz", "type": "seg", "scale": [0.05, 0.05]}')
    return folder


@pytest.mark.parametrize("kw", [{}, {"compression": "zlib"}, {"tile": (16, 16)}, {"byteorder": ">"}])
def test_cells_with_four_points_are_faces(tmp_path, kw):
    xyz = grid_of_points()
    xyz[0, 0] = -1
    xyz[3, 4] = 0  # as some writers say that there is none
    xyz[2, 0, 0] = np.nan
    mesh = read_tifxyz(write(tmp_path / "a", xyz, **kw))
    known = np.ones((4, 5), bool)
    known[0, 0] = known[3, 4] = known[2, 0] = False
    np.testing.assert_array_equal(mesh.points, xyz[known])
    assert mesh.polygons.sizes.tolist() == [4] * (12 - 1 - 1 - 2)
    corners = mesh.points[mesh.polygons.corners.reshape(-1, 4)]
    x, y = corners[..., 0], corners[..., 1]
    area = 0.5 * (x * np.roll(y, -1, 1) - y * np.roll(x, -1, 1)).sum(1)
    np.testing.assert_allclose(area, -400)  # clockwise with y up: counter-clockwise seen with the rows running down


def test_texture_coordinates_are_places_in_the_grid(tmp_path):
    mesh = read_tifxyz(write(tmp_path / "a", grid_of_points()))
    np.testing.assert_allclose(mesh.polygons.uv[0], [0.5 / 5, 1 - 0.5 / 4])
    np.testing.assert_allclose(mesh.polygons.uv[-1], [4.5 / 5, 1 - 3.5 / 4])


@pytest.mark.parametrize("factor", [1, 3])
def test_a_mask_takes_points_out(tmp_path, factor):
    folder = write(tmp_path / "a", grid_of_points())
    mask = np.full((4 * factor, 5 * factor), 255, np.uint8)
    mask[-1, 0] = 254
    tifffile.imwrite(folder / "mask.tif", mask)
    assert len(read_tifxyz(folder).points) == 19


def test_a_mask_of_another_size_is_left_out_and_said(tmp_path):
    folder = write(tmp_path / "a", grid_of_points())
    tifffile.imwrite(folder / "mask.tif", np.zeros((5, 5), np.uint8))
    mesh = read_tifxyz(folder)
    assert len(mesh.points) == 20
    assert "mask.tif is no whole multiple" in mesh.warnings[0].sentence


def test_what_is_no_segment_is_refused(tmp_path):
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match=r"lacks meta\.json"):
        read_tifxyz(tmp_path / "empty")
    folder = write(tmp_path / "a", grid_of_points())
    tifffile.imwrite(folder / "y.tif", np.ones((4, 4), np.float32))
    with pytest.raises(InputError, match=r"x\.tif has 5 x 4 points, but y\.tif 4 x 4"):
        read_tifxyz(folder)
    tifffile.imwrite(folder / "y.tif", np.ones((4, 5, 3), np.uint8), photometric="rgb")
    with pytest.raises(InputError, match="3 numbers a point"):
        read_tifxyz(folder)
    (folder / "y.tif").write_bytes((folder / "x.tif").read_bytes()[:100])
    with pytest.raises(InputError, match=r"y\.tif"):
        read_tifxyz(folder)
    write(tmp_path / "a", np.full((4, 5, 3), -1.0))
    with pytest.raises(InputError, match="no points"):
        read_tifxyz(folder)
    (folder / "meta.json").write_text("{")
    with pytest.raises(InputError, match="no JSON"):
        read_tifxyz(folder)
    (folder / "meta.json").write_text('{"format": "vcps"}')
    with pytest.raises(InputError, match="another kind of segment"):
        read_tifxyz(folder)


def test_what_is_written_is_read_again(tmp_path):
    xyz = grid_of_points(30, 40)
    xyz[3:5, 7:9] = np.nan
    write_tifxyz(tmp_path / "flat", xyz, 0.05)
    write_tifxyz(tmp_path / "flat", xyz, 0.05)  # in place of itself
    mesh = read_tifxyz(tmp_path / "flat")
    np.testing.assert_array_equal(mesh.points, xyz[np.isfinite(xyz).all(-1)])
    meta = json.loads((tmp_path / "flat" / "meta.json").read_text())
    assert meta["format"] == "tifxyz"
    assert meta["scale"] == [0.05, 0.05]
    assert meta["bbox"] == [[0, 0, 100], [780, 580, 139]]
    assert [path.name for path in tmp_path.iterdir()] == ["flat"]


def test_a_sheet_at_and_below_zero_is_a_sheet(tmp_path):
    xyz = grid_of_points() - [20, 20, 102]  # x, y and z take 0 and -1 to -2, but never all of them 0
    xyz[..., 2] -= 0.5
    np.testing.assert_array_equal(read_tifxyz(write(tmp_path / "a", xyz)).points, xyz.reshape(-1, 3))


def test_points_below_the_volume_cannot_be_written(tmp_path):
    with pytest.raises(OutputError, match="z at or below 0"):
        write_tifxyz(tmp_path / "flat", grid_of_points() - [0, 0, 100], 0.05)
    assert list(tmp_path.iterdir()) == []
