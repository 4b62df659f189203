"""A second voice is heard where the letters do not tell which way up the page is, and only there."""

import numpy as np
import pytest

import planish
from planish.gallery import sheet, virtual_scan
from planish.settings import RenderSettings, RestoreSettings
from planish.types import Page

SETTINGS = RestoreSettings(render=RenderSettings(dpi=60.0))


def restored(scan, way_up):
    return planish.restore(scan, SETTINGS, way_up=way_up).flattening.page_xy


@pytest.fixture(scope="module")
def blank():
    white = Page(np.full((1100, 850, 3), 255, np.uint8), np.ones((1100, 850), bool), 100.0), ""
    made = sheet("letter", width_mm=215.9, height_mm=279.4)
    return virtual_scan(made, points=3000, photo_px=(600, 450), printed=white).scan


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
