"""The sheet on a photo: its region, its sides one by one, the gutter of facing pages, and how far the page extends."""

import cv2
import numpy as np
import pytest

from planish.errors import InputError, UsageError
from planish.photo import creases, find_shape, find_shapes
from planish.photo.borders import NAMES, find_borders
from planish.photo.fit import start
from planish.photo.gutter import find_gutter, larger_part, part_of_lines, part_of_region
from planish.photo.line_grouping import line_observations
from planish.photo.lines import TextLines
from planish.photo.page_extent import text_extent
from planish.photo.sheet_region import sheet_regions
from planish.settings import PhotoSettings

GROUND, PAPER = (120, 85, 60), (228, 226, 220)
CORNERS = np.array([[80, 60], [420, 50], [430, 500], [70, 505]])


def table(size_xy=(500, 560)):
    """A brown table with grain."""
    grain = np.random.default_rng(3).normal(0, 6, (size_xy[1], size_xy[0], 1))
    return np.clip(GROUND + grain, 0, 255).astype(np.uint8)


def sheet_on_table(corners=CORNERS):
    photo = table()
    cv2.fillConvexPoly(photo, corners.astype(np.int32), PAPER)
    return photo


def borders_of(photo, angle=0.0):
    found = find_borders(sheet_regions(photo, None), angle)
    assert found is not None
    return found


def away_from_line(xy, one, other):
    along = (other - one) / np.linalg.norm(other - one)
    return np.abs((xy - one) @ [-along[1], along[0]])


def share_inside(outline, corners):
    masks = np.zeros((2, 560, 500), np.uint8)
    for mask, xy in zip(masks, (outline, corners), strict=True):
        cv2.fillPoly(mask, [np.round(xy).astype(np.int32)], 1)
    return (masks[0] & masks[1]).sum() / masks[1].sum()


@pytest.mark.parametrize("colour", [(40, 70, 120), (30, 25, 25), (200, 60, 30)])
def test_dark_and_coloured_print_at_the_rim_belongs_to_the_sheet(colour):
    photo = sheet_on_table()
    band = np.array([[80, 60], [420, 50], [422, 150], [78, 160]])
    cv2.fillConvexPoly(photo, band, colour)
    found = borders_of(photo)
    assert list(found.plain) == [True] * 4
    assert share_inside(found.outline, CORNERS) > 0.98
    assert away_from_line(found.sides[0], CORNERS[0], CORNERS[1]).max() < 3


def test_a_folded_corner_costs_one_side():
    photo = sheet_on_table()
    cv2.fillConvexPoly(photo, np.array([[420, 44], [300, 44], [440, 280], [440, 44]]), GROUND)
    found = borders_of(photo)
    names = {name for name, plain in zip(NAMES, found.plain, strict=True) if plain}
    assert names >= {"bottom", "left"}
    assert len(names) >= 3


def test_a_finger_leaves_the_rest_of_its_side():
    photo = sheet_on_table()
    cv2.ellipse(photo, (440, 300), (60, 26), 0, 0, 360, (205, 150, 125), -1)
    found = borders_of(photo)
    assert list(found.plain) == [True] * 4
    assert away_from_line(found.sides[1], CORNERS[1], CORNERS[2]).max() < 0.015 * 450


def test_where_the_photo_cuts_the_sheet_there_is_no_side():
    found = borders_of(sheet_on_table(np.array([[-9, 60], [420, 50], [430, 500], [-9, 505]])))
    assert list(found.plain) == [True, True, True, False]
    assert list(found.cropped) == [False, False, False, True]


def test_black_bars_around_a_photo_are_no_ground():
    photo = np.pad(sheet_on_table(), ((0, 0), (90, 90), (0, 0)))
    found = borders_of(photo)
    assert list(found.plain) == [True] * 4
    assert away_from_line(found.sides[3], CORNERS[3] + [90, 0], CORNERS[0] + [90, 0]).max() < 3


def lines_at(rows, spans, height=8.0):
    """Text lines, level, one for each row and each (left, right)."""
    ends = np.array([[[left, y], [right, y]] for y in rows for left, right in spans], float)
    xy = np.concatenate([np.linspace(a, b, 12) for a, b in ends])
    count = len(ends)
    return TextLines(
        xy, np.repeat(np.arange(count, dtype=np.int32), 12), np.full(count, height), ends, np.zeros(count, bool),
        0.0, 2.0, 0.03, np.full(count, 220.0), ends,
    )  # fmt: skip


def book(valley):
    """Facing pages, the right one larger, with a valley of that depth between."""
    photo = sheet_on_table(np.array([[20, 60], [480, 60], [480, 500], [20, 500]])).astype(float)
    x = np.arange(500)
    photo[60:500, 20:481] *= (1 - valley * np.exp(-(((x - 190) / 12.0) ** 2)))[None, 20:481, None]
    return photo.astype(np.uint8)


ROWS = range(100, 470, 20)


def test_facing_pages_are_parted_at_the_gutter():
    photo, lines = book(0.3), lines_at(ROWS, [(40, 170), (215, 460)])
    region = next(sheet_regions(photo, lines))
    gutter = find_gutter(region, lines)
    assert gutter is not None
    assert gutter.point[0] == pytest.approx(190, abs=5)
    assert larger_part(region, gutter) == "right"
    kept = part_of_lines(lines, gutter, "right")
    assert kept is not None
    assert kept.ends[:, :, 0].min() == 215
    found = find_borders([part_of_region(region, gutter, "right")], 0.0, gutter)
    assert found is not None
    assert list(found.plain) == [True, True, True, False]


def test_columns_and_shades_that_text_crosses_are_no_gutter():
    columns = lines_at(ROWS, [(40, 170), (215, 460)])
    assert find_gutter(next(sheet_regions(book(0.0), columns)), columns) is None
    crossed = lines_at(ROWS, [(40, 460)])
    assert find_gutter(next(sheet_regions(book(0.3), crossed)), crossed) is None


def test_two_pages_are_refused_where_there_is_one_shape_or_no_text():
    with pytest.raises(UsageError, match="find_shapes"):
        find_shape(book(0.3), PhotoSettings(pages="2"))
    with pytest.raises(InputError, match="no lines of text"):
        find_shapes(sheet_on_table(), PhotoSettings(pages="2"))


def test_margins_follow_the_letters_of_each_line():
    lines = lines_at(range(200, 400, 20), [(100, 400)])
    flat = start(line_observations(lines), 0.0, 500.0, np.array([250.0, 280.0]), across=False)
    low, high = text_extent(lines, flat)
    lines.height[0] = 60.0
    with_title, _ = text_extent(lines, flat)
    assert (low - with_title)[1] * 500 == pytest.approx(4 * (60 - 8), rel=0.01)
    assert (high[1] - low[1]) * 500 == pytest.approx(180 + 7 * 8, rel=0.01)


def printed_book():
    """Facing pages with words, the left one cut off by the photo."""
    photo = cv2.resize(book(0.3), None, fx=3, fy=3, interpolation=cv2.INTER_CUBIC)[:, 150:]
    rng = np.random.default_rng(7)
    for left, right in ((-10, 370), (500, 1230)):
        for y in range(260, 1400, 60):
            x = left
            while x < right - 100:
                word = "".join(rng.choice(list("acemnorsuvwxzhdbl"), rng.integers(2, 8)))
                cv2.putText(photo, word, (x, y), cv2.FONT_HERSHEY_DUPLEX, 0.75, (35, 35, 35), 2, cv2.LINE_AA)
                x += cv2.getTextSize(word, cv2.FONT_HERSHEY_DUPLEX, 0.75, 2)[0][0] + 14
    return photo


def test_the_larger_page_is_made_and_the_other_named():
    photo = printed_book()
    (alone,) = find_shapes(photo, PhotoSettings(shape="text-lines"))
    codes = {warning.code: warning.sentence for warning in alone.warnings}
    assert "on the left" in codes["facing-page"]
    assert alone.scan.photo_xy[:, 0].min() > 360
    left, right = find_shapes(photo, PhotoSettings(shape="text-lines", pages="2"))
    assert left.scan.photo_xy[:, 0].max() < right.scan.photo_xy[:, 0].max()
    assert "facing-page" not in {warning.code for warning in (*left.warnings, *right.warnings)}
    np.testing.assert_allclose(right.scan.photo_xy, alone.scan.photo_xy)


def test_of_two_pages_the_one_with_a_shape_is_made():
    photo = printed_book()
    photo[:, :330] = cv2.GaussianBlur(photo, (0, 0), 12)[:, :330]  # the left page out of focus
    (right,) = find_shapes(photo, PhotoSettings(shape="text-lines", pages="2"))
    assert right.side == "right"
    sentences = {warning.code: warning.sentence for warning in right.warnings}
    assert "the left one has no shape: " in sentences["page-not-made"]


def piece(*slices):
    crease = np.zeros((300, 200), bool)
    crease[slices] = True
    return crease


def test_the_step_to_the_leaves_below_is_no_crease():
    text = np.array([30.0, 30]), np.array([160.0, 150])
    beside, through = piece(slice(60, 200), 180), piece(slice(60, 200), 100)
    a_third, below = piece(200, slice(20, 180)), piece(275, slice(20, 180))
    assert creases._length(beside, text) == creases._length(below, text) == 0
    assert creases._length(beside, None) == pytest.approx(142, abs=2)
    assert creases._length(through, text) == pytest.approx(142, abs=2)
    assert creases._length(a_third, text) == pytest.approx(162, abs=2)


@pytest.mark.parametrize("size_xy", [(9, 60), (40, 30), (90, 80)])
def test_tiny_and_dark_photos_are_no_error(size_xy):
    photo = np.zeros((size_xy[1], size_xy[0], 3), np.uint8)
    photo[size_xy[1] // 3 : 2 * size_xy[1] // 3, size_xy[0] // 4 : size_xy[0] // 2] = 200
    for region in sheet_regions(photo, None):
        assert region.inside.shape == region.small.shape[:2]
