"""Lines that are not Latin text: staves, tables, joined scripts and columns; all drawn here, without fonts."""

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from planish import UsageError
from planish.gallery import music_page, script_page
from planish.photo import find_shape
from planish.photo.line_grouping import reject_false_lines
from planish.photo.lines import find_text_lines
from planish.photo.working_image import working_image
from planish.settings import PhotoSettings

PAGE = (1400, 1000)


def blank():
    return np.full((*PAGE, 3), 235, np.uint8)


def lines_of(photo):
    return reject_false_lines(find_text_lines(working_image(photo)))


def waved(page, depth=18.0):
    """The page with its rows moved down by a sine of a whole wave."""
    rows, cols = np.mgrid[: page.shape[0], : page.shape[1]].astype(np.float32)
    moved = rows - depth * np.sin(2 * np.pi * cols / page.shape[1])
    return cv2.remap(np.asarray(page), cols, np.asarray(moved, np.float32), cv2.INTER_LINEAR, borderValue=(255,) * 3)


def joined_words(stroke_at, rng, pitch=60):
    """Lines of words, each strung on one stroke, of which stems and loops stand up and hang down."""
    page = blank()
    for base in range(120, 1280, pitch):
        x = 90
        while x < 880:
            width = int(rng.integers(25, 75))
            cv2.line(page, (x, base), (x + width, base), (30,) * 3, 3)
            for at in range(x + 3, x + width, 9):
                up, down = (rng.integers(0, 12, 2) * np.array(stroke_at)).astype(int)
                cv2.line(page, (at, base - up), (at + int(rng.integers(-3, 4)), base + down), (30,) * 3, 2)
            x += width + 14
    return page


def kanji(page, x, y, rng):
    """A square of strokes, more and thicker ones upright, as kanji have."""
    for at in rng.choice(np.arange(2, 24, 6), 3, replace=False):
        cv2.line(page, (x + int(at), y + int(rng.integers(0, 5))), (x + int(at), y + 23), (30,) * 3, 3)
    for at in rng.choice(np.arange(2, 24, 7), 2, replace=False):
        cv2.line(page, (x + int(rng.integers(0, 4)), y + int(at)), (x + 23, y + int(at)), (30,) * 3, 1)


def columns_page():
    rng, page = np.random.default_rng(3), blank()
    for x in range(120, 880, 52):
        for y in range(100 + int(rng.integers(0, 20)), 1250, 28):
            kanji(page, x, y, rng)
    return page


def test_the_lines_of_staves_are_followed_along_their_wave():
    page = music_page(180, 252, dpi=140)[0].pixels
    lines = lines_of(waved(page))
    assert lines.rule.all()  # notes are no text
    assert len(lines.height) >= 40  # of four systems of two staves
    straight = lines.photo_xy[:, 1] - 18 * np.sin(2 * np.pi * lines.photo_xy[:, 0] / page.shape[1])
    deviation = [np.ptp(straight[lines.line == k]) for k in range(len(lines.height))]
    assert np.median(deviation) < 2  # px; a staff line is 10 from the next one
    begin = lines.ends[:, 0, 0]
    assert np.abs(begin - 0.115 * page.shape[1]).min() < 4  # under the brackets


@pytest.mark.parametrize("stroke_at", [(0.4, 1.6), (1.0, 1.0)], ids=["head line", "baseline"])
def test_joined_words_lie_on_their_stroke(stroke_at):
    lines = lines_of(waved(joined_words(stroke_at, np.random.default_rng(1))))
    y = lines.photo_xy[:, 1] - 18 * np.sin(2 * np.pi * lines.photo_xy[:, 0] / PAGE[1])
    off = (y + 30) % 60 - 30
    assert np.median(np.abs(off)) < 1  # px, of strokes 3 px thick
    assert len(lines.height) >= 20
    assert lines.straightness < 0.05


def test_columns_run_down_the_page_from_right_to_left():
    lines = find_text_lines(working_image(columns_page()))
    assert lines.columns
    assert np.degrees(lines.angle) == pytest.approx(90, abs=2)
    scan = find_shape(columns_page(), PhotoSettings(shape="text-lines")).scan
    right, down = np.corrcoef(np.c_[scan.mesh.points[:, :2], scan.photo_xy].T)[:2, 2:]
    assert right[0] > 0.99
    assert down[1] < -0.99  # y of a scan runs up


def table():
    page = blank()
    for y in range(300, 1101, 100):
        cv2.line(page, (150, y), (850, y), (60,) * 3, 2)
    for x in range(150, 851, 175):
        cv2.line(page, (x, 300), (x, 1100), (60,) * 3, 2)
    return page


def test_the_sides_of_a_table_are_level_and_upright():
    lines = lines_of(table())
    assert lines.rule.all()
    assert len(lines.uprights) == 5
    beside = table()[:, :140].copy()
    cv2.line(beside, (70, 200), (70, 1200), (60,) * 3, 2)  # as the edge of a leaf: it crosses nothing
    page = table()
    page[:, :140] = beside
    assert len(lines_of(page).uprights) == 5


def test_a_flat_table_seen_askew_is_square_again():
    camera = np.array([[1280, 0, 619.5], [0, 1280, 799.5], [0, 0, 1]])  # 0.8 of the long side, as is assumed
    turn = Rotation.from_euler("xyz", [20, 8, -3], degrees=True).as_matrix()
    to_photo = camera @ np.c_[turn[:, :2], turn @ [-500, -700, 0] + [0, 0, 1400]]
    photo = cv2.warpPerspective(table(), to_photo, (1240, 1600), borderValue=(235,) * 3)
    scan = find_shape(photo, PhotoSettings(shape="text-lines")).scan
    true = cv2.perspectiveTransform(scan.photo_xy[None].astype(np.float64), np.linalg.inv(to_photo))[0]
    cols = int(scan.mesh.faces[0, 1])
    page = np.stack([*np.divmod(np.arange(len(true)), cols), np.ones(len(true))], axis=1)  # points are a regular grid
    inside = ((true > [150, 300]) & (true < [850, 1100])).all(axis=1)
    fitted = page @ np.linalg.lstsq(page[inside], true[inside], rcond=None)[0]
    # Any stretch is allowed, as the focal length is not known; of the 700 pixels between its sides half a percent.
    assert np.abs(fitted - true)[inside].max() < 4


def test_a_script_without_a_font_is_refused_in_a_sentence():
    with pytest.raises(UsageError, match="no font for japanese was found"):
        script_page("japanese", font="no-such-font.ttf")


def test_arabic_is_set_from_right_to_left():
    try:
        page, text = script_page("arabic", 105, 148, dpi=100)
    except UsageError as missing:
        pytest.skip(str(missing))
    dark = (page.pixels[..., 0] < 128).any(axis=0)
    assert np.flatnonzero(dark)[[0, -1]] == pytest.approx([0.115 * len(dark), 0.885 * len(dark)], abs=6)
    assert text.startswith("الورق")


def test_rules_that_do_not_lie_level_with_the_text_are_left_out():
    rng, page = np.random.default_rng(5), blank()
    for y in [*range(120, 420, 40), *range(980, 1300, 40)]:
        x = 80
        while x < 800:
            word = "".join(rng.choice(list("acemnorsuvwxz"), rng.integers(2, 8)))
            cv2.putText(page, word, (x, y), cv2.FONT_HERSHEY_DUPLEX, 0.7, (35, 35, 35), 2, cv2.LINE_AA)
            x += cv2.getTextSize(word, cv2.FONT_HERSHEY_DUPLEX, 0.7, 2)[0][0] + 14
    for y in range(500, 940, 60):  # curves of a chart between two blocks of text
        across = np.arange(80, 920)
        curve = np.stack([across, y + 0.12 * (across - 500) + 12 * np.sin(across / 130)], axis=1)
        cv2.polylines(page, [curve.astype(np.int32)], False, (35, 35, 35), 2, cv2.LINE_AA)
    lines = lines_of(page)
    assert lines.rule.sum() >= 6
    found = find_shape(page, PhotoSettings(shape="text-lines"))
    assert found.report.lines == (~lines.rule).sum()
    assert found.report.straightness < 0.05
