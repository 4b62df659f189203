from functools import cache

import cv2
import numpy as np
import pytest

from planish.document.orientation import detect_orientation, skew_angle
from planish.gallery import typeset_page
from planish.gallery.prose import STORY
from planish.types import Page


@cache
def printed(**how):
    return typeset_page(148, 210, dpi=150, point_size=9, **how)[0]


def turned(page, degrees):
    """Clockwise, by quarter turns or by any angle about the middle."""
    if degrees % 90 == 0:
        quarters = -round(degrees / 90)
        return Page(np.rot90(page.pixels, quarters), np.rot90(page.known, quarters), page.dpi)
    rows, cols = page.known.shape
    turn = cv2.getRotationMatrix2D((cols / 2, rows / 2), -degrees, 1.0)
    pixels = cv2.warpAffine(np.asarray(page.pixels), turn, (cols, rows), flags=cv2.INTER_CUBIC, borderValue=(255,) * 3)
    return Page(pixels, page.known, page.dpi)


def shaded(page, darkest=0.35):
    """Darker towards the left, as beside a spine."""
    light = np.linspace(darkest, 1, page.known.shape[1])[None, :, None]
    return Page((page.pixels * light).astype(np.uint8), page.known, page.dpi)


def page_of(pixels):
    return Page(np.asarray(pixels, np.uint8), np.ones(np.shape(pixels)[:2], bool), 150.0)


@pytest.mark.parametrize("degrees", [-5.0, -0.9, -0.06, 0.0, 0.13, 2.2])
@pytest.mark.parametrize("columns", [1, 2])
def test_the_skew_of_text_is_found_within_a_tenth_of_a_degree(columns, degrees):
    found, confidence = skew_angle(turned(printed(columns=columns), degrees))
    assert abs(found - degrees) < 0.1  # what an archive asks of deskewing; at the page's rim a third of a millimetre
    assert confidence > 0.9


def test_the_two_pages_of_a_spread_do_not_pull_each_other_askew():
    # The right page's lines lie a third of a line lower: joined across the spine they would slope by 0.3 degrees.
    page = printed()
    lower = np.roll(page.pixels, 7, axis=0)
    spread = page_of(np.concatenate([page.pixels, lower], axis=1))
    assert abs(skew_angle(spread)[0]) < 0.05


def test_skew_is_found_in_shade_and_has_no_taste_for_level():
    for degrees in (0.05, 0.1, 0.15):  # between whole-pixel shifts of the strips, where sharpness misleads
        assert abs(skew_angle(turned(shaded(printed()), degrees))[0] - degrees) < 0.03


@pytest.mark.parametrize("needed", [0, 90, 180, 270])
@pytest.mark.parametrize("how", [{}, {"columns": 2}, {"picture": True, "stamp": True}, {"drawing": True}])
def test_a_page_is_turned_upright_from_any_way_round(how, needed):
    degrees, confidence = detect_orientation(turned(shaded(printed(**how)), -needed))
    assert degrees == needed
    assert confidence > 0.5


def test_a_landscape_page_is_upright_as_it_is():
    assert detect_orientation(typeset_page(210, 148, dpi=150, columns=2)[0])[0] == 0


def test_a_tilted_page_upside_down_is_told():
    assert detect_orientation(turned(turned(printed(), 180), 2.5))[0] == 180


def test_where_letters_tell_little_what_was_told_counts():
    capitals = typeset_page(148, 210, dpi=150, title=None, story=tuple(p.upper() for p in STORY), table=False)[0]
    assert detect_orientation(capitals, prior=4.0)[0] == 0
    assert detect_orientation(capitals, prior=-4.0)[0] == 180
    assert detect_orientation(turned(printed(), 180), prior=0.5)[0] == 180  # letters in mixed case are surer than that


def test_letters_larger_than_usual_on_grainy_paper_are_read():
    page = printed()
    grain = np.random.default_rng(0).normal(0, 12, page.pixels.shape)
    enlarged = Page(np.clip(0.6 * page.pixels + grain, 0, 255).astype(np.uint8), page.known, 75.0)  # twice as large
    assert detect_orientation(turned(enlarged, 180))[0] == 180
    assert detect_orientation(enlarged, prior=-1.0)[0] == 0


def ruled_paper():
    """A few words above faint rules, beneath each of which the paper is a trace darker."""
    page = np.full((1000, 800), 230.0)
    for row in range(150, 980, 40):
        page[row : row + 3] = 190
        page[row + 8 : row + 24] -= 6 * np.sin(np.pi * np.arange(0.5, 16) / 16)[:, None]
    page[60:110, 40:140] = printed().pixels[150:200, 100:200, 0] * 0.9
    return np.repeat(page[..., None], 3, axis=2)


def test_the_rules_of_ruled_paper_say_nothing():
    for way_round in (ruled_paper(), ruled_paper()[::-1, ::-1]):
        assert detect_orientation(page_of(way_round)) == (0, 0.0)


def test_columns_stay_upright_where_the_prior_is_surer_than_the_letters():
    capitals = typeset_page(148, 210, dpi=150, title=None, story=tuple(p.upper() for p in STORY), table=False)[0]
    assert detect_orientation(turned(capitals, 90), prior=1.3)[0] == 0
    assert detect_orientation(turned(printed(), 90), prior=1.3)[0] == 270  # letters in mixed case are surer than that


def test_capitals_have_lines_but_no_certain_way_up():
    page = typeset_page(148, 210, dpi=150, title=None, story=tuple(p.upper() for p in STORY), table=False)[0]
    for way in (0, 180):
        degrees, confidence = detect_orientation(turned(page, way))
        assert degrees == 0
        assert confidence < 0.5
    assert detect_orientation(turned(page, 90))[0] in (90, 270)


def test_what_was_not_seen_says_nothing():
    page = printed()
    known = page.known.copy()
    known[:, : known.shape[1] // 2] = False
    pixels = np.where(known[..., None], page.pixels, np.uint8(0))  # black, and its edge the strongest of all
    degrees, _ = skew_angle(Page(pixels, known, page.dpi))
    assert abs(degrees) < 0.1
    assert detect_orientation(turned(Page(pixels, known, page.dpi), 180))[0] == 180


def creased():
    """A blank sheet with the broken shade of a fold across it."""
    page = np.full((1200, 900), 250)
    for k in range(18):
        page[600 + k % 4 : 604 + k % 4, 50 * k : 50 * k + 50] = 60
    return page


def ruled():
    page = np.full((800, 600), 255)
    page[100:700:40, 50:550] = 0
    page[100:700, 50:550:40] = 0
    return page


@pytest.mark.parametrize(
    "pixels",
    [
        np.zeros((1, 1)),
        np.full((600, 400), 230),
        np.zeros((600, 400)),
        ruled(),
        creased(),
        cv2.GaussianBlur(np.random.default_rng(0).normal(128, 900, (800, 600)), (0, 0), 4).clip(0, 255),
    ],
    ids=["one pixel", "blank", "black", "squared", "creased", "clouds"],
)
def test_without_lines_of_text_a_page_stays_as_it_is(pixels):
    degrees, confidence = skew_angle(page_of(pixels))
    assert degrees == 0
    assert confidence < 0.7
    assert detect_orientation(page_of(pixels)) == (0, 0.0)


def test_grey_16_bit_and_black_and_white_pages_are_read_alike():
    page = turned(printed(), 1.0)
    grey = cv2.cvtColor(np.asarray(page.pixels), cv2.COLOR_RGB2GRAY)
    for pixels in (grey, page.pixels.astype(np.uint16) * 257, grey > 128):
        assert abs(skew_angle(Page(pixels, page.known, page.dpi))[0] - 1.0) < 0.05
