import numpy as np
import pytest

from planish.document import split_pages
from planish.render import mask_of, missing_regions
from planish.types import Page, Spine


def page_with(holes, shape=(200, 160), dpi=50.8):
    """Pages of 2 pixels a millimetre; holes as (top, bottom, left, right)."""
    known = np.ones(shape, bool)
    for top, bottom, left, right in holes:
        known[top:bottom, left:right] = False
    return Page(np.full((*shape, 3), 200, np.uint8), known, dpi)


def test_parts_are_counted_once_each_and_measured():
    found = missing_regions(page_with([(10, 20, 10, 40), (50, 60, 0, 8), (190, 200, 150, 160)]))
    assert found.regions == 3
    assert found.area_mm2 == pytest.approx((10 * 30 + 10 * 8 + 10 * 10) / 4)


def test_parts_that_touch_at_a_corner_are_one():
    assert missing_regions(page_with([(10, 20, 10, 20), (20, 30, 20, 30)])).regions == 1


def test_a_rim_in_steps_is_no_hole():
    rim = [(0, 1, 0, 160), (0, 200, 0, 1), (100, 101, 20, 140)]
    assert missing_regions(page_with(rim)).regions == 0
    found = missing_regions(page_with([*rim, (60, 70, 0, 10)]))
    assert found.regions == 1
    assert found.area_mm2 == pytest.approx((160 + 200 - 1 + 10 * 9) / 4)  # the hole and the rim that it hangs on


def test_a_whole_page_and_a_page_nobody_saw():
    assert missing_regions(page_with([])).regions == 0
    nothing = missing_regions(page_with([(0, 200, 0, 160)]))
    assert nothing.regions == 1
    assert nothing.area_mm2 == pytest.approx(100 * 80)


def test_the_mask_has_the_page_s_size_and_says_what_is_known():
    page = page_with([(10, 20, 10, 40)])
    clipped = np.zeros(page.known.shape, bool)
    clipped[5:15, 5:15] = True
    specks = clipped.copy()
    specks[100, 20:120] = specks[150, 50] = True
    mask = mask_of(page, specks)
    assert mask.dpi == page.dpi
    assert set(np.unique(mask.pixels)) == {0, 128, 255}
    np.testing.assert_array_equal(mask.pixels == 0, ~page.known)
    np.testing.assert_array_equal(mask.pixels == 128, clipped & page.known)
    assert set(np.unique(mask_of(page).pixels)) == {0, 255}


def test_the_mask_is_cut_as_the_page_is():
    left, right = split_pages(mask_of(page_with([(10, 20, 10, 40)])), Spine(40.0, 0.0, "middle"))
    assert (left.pixels == 0).sum() == 300
    assert (right.pixels == 255).all()
