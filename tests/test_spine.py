"""Where an open book is parted into pages, and that nothing else is."""

from functools import cache

import cv2
import numpy as np
import pytest

import planish
from planish.document.page_split import find_gutter, gutter_of_surface, split_pages
from planish.gallery import sheet, sheet_mesh, typeset_page, virtual_scan
from planish.settings import RenderSettings, RestoreSettings
from planish.types import Mesh, Page, Spine

SINGLE = ["flat", "book", "letter", "curl", "wave", "miura", "roll", "crumpled"]


@cache
def bent(name, **how):
    made = sheet(name, **how)
    return made, *sheet_mesh(made, points=20_000)


def spine_on(name, **how):
    made, mesh, page_xy = bent(name, **how)
    return gutter_of_surface(mesh, page_xy, (made.width_mm, made.height_mm))


@pytest.mark.parametrize("spine_deg", [40.0, 80.0, 118.0])
def test_the_spine_of_a_spread_is_found_where_it_is(spine_deg):
    found = spine_on("spread", spine_deg=spine_deg)
    assert found.x_mm == pytest.approx(148, abs=0.3)  # a mesh of 2 mm places a crease to a part of its edges
    assert found.turn_deg < spine_deg  # the leaves rise most at the spine itself
    assert found.found_by == "surface"


def test_noise_hardly_moves_the_spine():
    made, mesh, page_xy = bent("spread")
    rng = np.random.default_rng(1)
    noisy = Mesh(mesh.points + rng.normal(0, 0.1, mesh.points.shape), mesh.faces)
    assert gutter_of_surface(noisy, page_xy, (made.width_mm, made.height_mm)).x_mm == pytest.approx(148, abs=0.3)


def test_a_strip_along_the_spine_that_nobody_saw_does_not_hide_it():
    made, mesh, page_xy = bent("spread")
    hidden = np.abs(page_xy[mesh.faces].mean(axis=1)[:, 0] - 150) < 5
    seen = Mesh(mesh.points, mesh.faces[~hidden])
    assert gutter_of_surface(seen, page_xy, (made.width_mm, made.height_mm)).x_mm == pytest.approx(148, abs=3)


@pytest.mark.parametrize("name", SINGLE)
def test_single_sheets_have_no_spine(name):
    assert spine_on(name) is None


@pytest.mark.parametrize(
    ("name", "how"),
    [
        ("letter", {"slopes_deg": (-40.0, 40.0, -40.0)}),
        ("letter", {"width_mm": 297.0, "height_mm": 210.0}),
        ("wave", {"width_mm": 297.0, "height_mm": 210.0, "direction_deg": 0.0, "steepness_deg": 45.0, "waves": 2.5}),
        ("wave", {"width_mm": 297.0, "height_mm": 210.0, "direction_deg": 2.4, "steepness_deg": 44.0, "waves": 3.1}),
        ("miura", {"width_mm": 297.0, "height_mm": 210.0, "cells": (6.0, 5.0), "fold_deg": 45.0}),
        ("spread", {"spine_deg": -118.0}),  # a ridge
    ],
)
def test_folds_and_waves_are_no_spine(name, how):
    assert spine_on(name, **how) is None


@pytest.mark.parametrize("slopes", [(-4.0, 42.0, -14.0), (-57.8, 13.9, -51.6), (-19.0, -52.3, 35.7)])
def test_a_letter_on_end_has_its_folds_at_its_thirds(slopes):
    made, mesh, page_xy = bent("letter", width_mm=210.0, height_mm=297.0, slopes_deg=slopes)
    on_end = np.stack([made.height_mm - page_xy[:, 1], page_xy[:, 0]], axis=1)
    assert gutter_of_surface(mesh, on_end, (made.height_mm, made.width_mm)) is None


def test_coarse_scans_of_books_that_lie_nearly_flat_have_a_spine():
    made = sheet("spread", spine_deg=45.0)
    mesh, page_xy = sheet_mesh(made, points=5000)
    noisy = Mesh(mesh.points + np.random.default_rng(0).normal(0, 0.1, mesh.points.shape), mesh.faces)
    assert gutter_of_surface(noisy, page_xy, (made.width_mm, made.height_mm)).x_mm == pytest.approx(148, abs=0.5)


def test_a_spine_that_lies_across_is_none():
    made, mesh, page_xy = bent("spread")
    on_end = np.stack([made.height_mm - page_xy[:, 1], page_xy[:, 0]], axis=1)
    assert gutter_of_surface(mesh, on_end, (made.height_mm, made.width_mm)) is None


def page_of(pixels, dpi=150.0):
    return Page(np.asarray(pixels, np.uint8), np.ones(np.shape(pixels)[:2], bool), dpi)


def one_page_over_the_spine():
    return typeset_page(296, 210, dpi=150, point_size=9)[0]


def two_columns_across():
    return typeset_page(296, 210, dpi=150, columns=2, title=None, table=False)[0]


def test_text_that_runs_across_the_spine_is_not_cut_unasked():
    """A landscape letter folded in the middle has a valley like a book's, and lines across it."""
    _, mesh, page_xy = bent("spread")
    page = one_page_over_the_spine()
    assert find_gutter(mesh, page_xy, page, always=False) is None
    forced = find_gutter(mesh, page_xy, page, always=True)
    assert forced.crossed
    assert forced.x_mm == pytest.approx(148, abs=4)


def test_one_line_across_is_enough():
    _, mesh, page_xy = bent("spread")
    pixels = np.full((1240, 1748, 3), 255, np.uint8)
    cv2.putText(pixels, "A heading across both pages", (500, 300), cv2.FONT_HERSHEY_DUPLEX, 1.4, (0, 0, 0), 3)
    assert find_gutter(mesh, page_xy, page_of(pixels), always=False) is None
    assert find_gutter(mesh, page_xy, page_of(np.full((1240, 1748, 3), 255)), always=False) is not None


@pytest.mark.slow
def test_without_a_valley_the_gutter_of_the_print_is_cut_if_so_asked():
    _, mesh, page_xy = bent("flat", width_mm=296.0, height_mm=210.0)
    page = two_columns_across()
    assert find_gutter(mesh, page_xy, page, always=False) is None
    found = find_gutter(mesh, page_xy, page, always=True)
    assert (found.found_by, found.crossed) == ("gutter", False)
    assert found.x_mm == pytest.approx(148, abs=2)
    blocked = find_gutter(mesh, page_xy, one_page_over_the_spine(), always=True)
    assert (blocked.found_by, blocked.crossed) == ("middle", True)


def test_the_cut_goes_beside_a_letter_that_touches_the_spine():
    _, mesh, page_xy = bent("spread")
    pixels = np.full((1240, 1748, 3), 255, np.uint8)
    pixels[200:1000:40, 866:880] = 0  # letters that reach 1 mm over the spine at column 874, from the left
    found = find_gutter(mesh, page_xy, page_of(pixels), always=True)
    left, right = split_pages(page_of(pixels), found)
    assert 0 < found.x_mm - 148 < 2
    assert (np.asarray(right.pixels) == 255).all()
    assert left.pixels.shape[1] + right.pixels.shape[1] == 1748


def test_every_pixel_goes_into_one_part():
    pixels = np.arange(60, dtype=np.uint16).reshape(4, 15)
    page = Page(pixels, pixels % 7 > 0, 25.4, b"profile")
    for x_mm in (-3.0, 0.0, 6.4, 99.0):
        left, right = split_pages(page, Spine(x_mm, 0.0, "middle"))
        np.testing.assert_array_equal(np.hstack([left.pixels, right.pixels]), pixels)
        np.testing.assert_array_equal(np.hstack([left.known, right.known]), page.known)
        assert left.known.size
        assert right.known.size
        assert (right.dpi, right.icc) == (25.4, b"profile")


@pytest.fixture(scope="module")
def spread():
    return virtual_scan(sheet("spread"), points=20_000, photo_px=(2000, 1500))


def restored(scan, **settings):
    return planish.restore(scan, RestoreSettings(render=RenderSettings(dpi=100.0), **settings))


@pytest.mark.slow
def test_a_spread_comes_out_as_two_pages(spread):
    done = restored(spread.scan, pages="2")
    parts = done.report.pages
    assert [part.side for part in parts] == ["left", "right"]
    assert [part.width_mm for part in parts] == pytest.approx([148, 148], abs=1)  # a mesh of 1.7 mm cuts a millimetre
    # off the valley, on whichever side its points happen to be farther from it
    assert parts[1].left_mm == done.report.spine.x_mm
    assert not any("split" in warning.sentence or "spine" in warning.sentence for warning in done.report.warnings)
    sides = split_pages(done.rendered, done.report.spine)
    wide = [side.known.shape[1] for side in sides]
    assert wide == pytest.approx([part.width_mm / 25.4 * 100 for part in parts], abs=1)  # whole pixels


def test_unasked_a_sheet_stays_whole():
    assert RestoreSettings().pages == "1"


@pytest.mark.slow
def test_a_blank_spread_is_turned_by_its_spine(spread):
    """No text tells which way is up; the photo's top does, though the long side lies."""
    blank = page_of(np.full((1240, 1748, 3), 255, np.uint8)), ""
    scan = virtual_scan(spread.sheet, points=20_000, photo_px=(2000, 1500), printed=blank)
    done = restored(scan.scan, pages="auto")
    assert done.flattening.size_mm[0] > done.flattening.size_mm[1]
    assert np.abs(done.flattening.page_xy - scan.truth_xy).mean() < 1
    assert len(done.report.pages) == 2


@pytest.mark.slow
def test_a_letter_is_not_split_and_that_is_said():
    made = virtual_scan(sheet("letter"), points=4000, photo_px=(1000, 750))
    done = restored(made.scan, pages="auto")
    assert len(done.report.pages) == 1
    assert any("stays one page" in warning.sentence for warning in done.report.warnings)
