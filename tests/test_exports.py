"""Scans as other programs save them: the same sheet, the same photo, the same size (docs/exports.md)."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import KDTree

from planish.errors import InputError
from planish.io import read_scan
from planish.io.units import decide_unit
from planish.pipeline import flatten

HERE = Path(__file__).parent / "exports"
WITH_PHOTO = ["meshlab.obj", "meshlab.ply", "blender.obj", "blender.glb", "cloudcompare.obj", "cloudcompare.ply"]
PHOTO_TO_BE_GIVEN = ["blender.ply"]
FLOAT_MM = 1e-4
"""Most of these hold points as float: 7 digits of 140 mm, after a turn by Blender's axes a few times that."""


@pytest.fixture(scope="module")
def original():
    return read_scan(HERE / "scan.obj").scan


@pytest.fixture(scope="module")
def size(original):
    return flatten(original.mesh).size_mm


def by_corner(scan):
    """Where every corner of every face lies, and which pixel of the photo it shows."""
    photo_xy = scan.photo_xy if scan.photo_xy.ndim == 3 else scan.photo_xy[scan.mesh.faces]
    return scan.mesh.points[scan.mesh.faces].reshape(-1, 3), photo_xy.reshape(-1, 2)


def lying(points):
    """Points in an order that does not matter, in a frame that no turn of the axes by 90 degrees changes."""
    return np.sort(np.linalg.norm(points, axis=1))


@pytest.mark.slow
@pytest.mark.parametrize("name", WITH_PHOTO + PHOTO_TO_BE_GIVEN)
def test_the_sheet_is_the_same(name, original, size):
    found = read_scan(HERE / name, photo=[HERE / "scan.jpg"] if name in PHOTO_TO_BE_GIVEN else None)
    assert found.warnings == []
    assert len(found.scan.mesh.faces) == len(original.mesh.faces)
    points, _ = by_corner(found.scan)
    expected, _ = by_corner(original)
    assert lying(points) == pytest.approx(lying(expected), abs=10 * FLOAT_MM)
    # the solver is done when a step moves points by 2e-6 of the side, 0.0006 mm; a few times that is left
    assert sorted(flatten(found.scan.mesh).size_mm) == pytest.approx(sorted(size), abs=0.005)


@pytest.mark.parametrize("name", WITH_PHOTO + PHOTO_TO_BE_GIVEN)
def test_the_photo_lies_where_it_lay(name, original):
    scan = read_scan(HERE / name, photo=[HERE / "scan.jpg"] if name in PHOTO_TO_BE_GIVEN else None).scan
    # a JPEG that stands beside the file or that Blender packed again: never other pixels than the encoder's few greys
    assert np.abs(scan.photo.astype(int) - original.photo).mean() < 2
    points, photo_xy = by_corner(scan)
    expected, expected_xy = by_corner(original)
    x, y, z = expected.T
    turned = [(x, y, z), (x, z, -y), (x, -z, y)]  # as it was, or from y up to z up, or back
    found = [KDTree(np.stack(way, axis=1)).query(points) for way in turned]
    distance, nearest = min(found, key=lambda pair: pair[0].max())
    assert distance.max() < 10 * FLOAT_MM
    assert photo_xy == pytest.approx(expected_xy[nearest], abs=0.01)  # 6 digits of a part of 320 pixels


def test_a_ply_of_blender_names_no_photo():
    assert read_scan(HERE / "blender.ply").scan.photo is None


def test_millimetres_that_a_glb_calls_metres_are_taken_for_millimetres(size):
    found = read_scan(HERE / "blender-mm.glb")
    assert found.unit == "mm"
    assert "metres, but no sheet is 342 m" in found.warnings[0].sentence
    assert sorted(flatten(found.scan.mesh).size_mm) == pytest.approx(sorted(size), abs=0.005)


class TestUnitsBeyondReason:
    SHEET = np.array([[0.0, 0.0, 0.0], [210.0, 297.0, 0.0]])

    def test_a_unit_that_makes_a_sheet_of_a_street_is_refused(self):
        with pytest.raises(
            InputError,
            match="as m, and no sheet is so large",
        ):
            decide_unit(self.SHEET, "m", None)

    def test_a_unit_that_makes_a_sheet_of_a_grain_of_sand_is_refused(self):
        with pytest.raises(InputError, match=r"0\.364 mm from corner to corner .* no sheet is so small"):
            decide_unit(self.SHEET / 1000, "mm", None)

    def test_metres_that_make_a_page_stay_metres(self):
        assert decide_unit(self.SHEET / 1000, "auto", "m") == ("m", [])

    def test_a_long_scroll_is_doubted_but_read(self):
        unit, warnings = decide_unit(self.SHEET / 10, "m", None)
        assert unit == "m"
        assert "when its numbers are taken as" in warnings[0].sentence
