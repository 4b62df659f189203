"""A second voice is heard where the letters do not tell which way up the page is, and only there."""

from dataclasses import replace

import numpy as np
import pytest

import planish
from planish.gallery import sheet, virtual_scan
from planish.settings import RenderSettings, RestoreSettings
from planish.types import Page

pytestmark = pytest.mark.slow

SETTINGS = RestoreSettings(render=RenderSettings(dpi=60.0))


def restored(scan, way_up):
    return planish.restore(scan, SETTINGS, read_orientation=way_up).flattening.page_xy


def unprinted(rows, cols):
    """Of 100 pixels an inch."""
    return Page(np.full((rows, cols, 3), 255, np.uint8), np.ones((rows, cols), bool), 100.0), ""


@pytest.fixture(scope="module")
def blank():
    made = sheet("letter", width_mm=215.9, height_mm=279.4)
    return virtual_scan(made, points=3000, photo_px=(600, 450), printed=unprinted(1100, 850)).scan


def test_what_it_tells_of_a_page_without_letters_is_done(blank):
    as_photographed, also = restored(blank, None), restored(blank, lambda page: None)
    np.testing.assert_array_equal(also, as_photographed)
    turned = restored(blank, lambda page: 180)
    size = np.ptp(as_photographed, axis=0)
    np.testing.assert_allclose(turned, size - as_photographed, atol=0.5)
    lying = restored(blank, lambda page: 90)
    assert np.ptp(lying, axis=0) == pytest.approx(size[::-1], rel=0.01)


def test_it_is_not_asked_where_the_letters_tell():
    made = virtual_scan(sheet("flat"), points=3000, photo_px=(1600, 1200), turn_deg=180.0)

    def never(page):
        raise AssertionError("the page's own letters are sure")

    assert np.abs(restored(made.scan, never) - made.truth_xy).mean() < 5  # the wrong way round is decimetres off


def test_a_mesh_known_to_stand_upright_stays_so():
    lying = sheet("flat", width_mm=203.2, height_mm=127.0)
    made = virtual_scan(lying, points=2000, photo_px=(600, 450), printed=unprinted(500, 800), turn_deg=180.0)
    from_mesh = restored(replace(made.scan, upright=3.0), None)
    near = 3  # mm: the scan's points, 4 mm apart, need not lie on the rim
    assert np.ptp(from_mesh, axis=0) == pytest.approx([203.2, 127], abs=near)
    higher = made.scan.mesh.points[:, 1] > np.median(made.scan.mesh.points[:, 1])
    assert from_mesh[higher, 1].mean() < from_mesh[~higher, 1].mean()
    assert np.ptp(restored(made.scan, None), axis=0) == pytest.approx([127, 203.2], abs=near)  # else the long side is
