import shutil
import subprocess
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from planish.gallery import sheet, typeset_page, typeset_sheet
from planish.gallery.artwork import CHART_CODES, colour_chart
from planish.gallery.prose import STORY
from planish.gallery.typeset import _line_starts


def ink(page):
    return np.asarray(page.pixels).max(axis=2) < 128


def test_the_page_has_its_size_and_is_mostly_white():
    page, text = typeset_page(148, 210, dpi=150)
    assert page.pixels.shape == (round(210 * 150 / 25.4), round(148 * 150 / 25.4), 3)
    assert page.dpi == 150
    assert page.known.all()
    assert 0.02 < ink(page).mean() < 0.15
    assert len(text.split()) > 200


def test_lines_are_justified_between_the_margins():
    page, _ = typeset_page(table=False, title=None, story=STORY[3:4], dpi=200)
    body = ink(page)[int(0.1 * 2200) :]
    lines = np.flatnonzero(np.diff(body.any(axis=1).astype(int)) == 1)
    right = [body.shape[1] - body[a + 1 : a + 30, ::-1].any(axis=0).argmax() for a in lines]
    # All but the last end at the margin, within the white beside a letter at 200 dpi.
    assert np.ptp(right[:-1]) <= 4
    assert right[0] == pytest.approx(0.885 * 1700, abs=4)


@given(st.lists(st.floats(5, 40), min_size=1, max_size=10), st.floats(0, 15))
def test_paragraphs_break_where_the_gaps_are_most_even(widths, indent):
    widths = np.array(widths)

    def cost(starts):
        total = 0.0
        for k, (first, last) in enumerate(zip(starts, [*starts[1:], len(widths)], strict=True)):
            gaps = last - first - 1
            slack = 60 - indent * (k == 0) - widths[first:last].sum() - 4 * gaps
            if gaps and slack < -0.6 * gaps:
                return np.inf
            total += 0.0 if last == len(widths) else (slack / (4 * max(gaps, 1))) ** 2
        return total

    choices = [[0, *c] for n in range(len(widths)) for c in combinations(range(1, len(widths)), n)]
    assert cost(_line_starts(widths, 4.0, 60.0, indent)) == pytest.approx(min(map(cost, choices)))


def test_columns_leave_a_gutter_and_hold_the_text_in_order():
    page, text = typeset_page(columns=2, point_size=9, dpi=150, title=None)
    rows, cols = page.pixels.shape[:2]
    body = ink(page)[int(0.11 * rows) :]
    assert not body[:, cols // 2 - 8 : cols // 2 + 8].any()
    assert body[:, : cols // 2].any()
    assert body[:, cols // 2 :].any()
    words = " ".join(STORY).replace("# ", "").split()
    said = " ".join(text.splitlines()[1:]).split()  # after the running head
    assert said[:100] == words[:100]


def test_page_numbers_stand_at_the_outer_edge():
    assert typeset_page(page_number=16, dpi=60)[1].startswith("16 On paper")
    assert typeset_page(page_number=17, dpi=60)[1].splitlines()[0].endswith(" 17")


@pytest.mark.slow
def test_table_drawing_picture_and_stamp_appear_when_asked_for():
    plain, text = typeset_page(dpi=100, table=False)
    assert "Tissue" not in text
    assert "Tissue for repairs 9 0.03" in typeset_page(dpi=100)[1]

    drawn, text = typeset_page(dpi=100, table=False, drawing=True)
    assert "Figure 1." in text
    assert (drawn.pixels != plain.pixels).any()

    pictured, text = typeset_page(dpi=100, table=False, picture=True)
    assert "Plate 2." in text
    grey = (np.asarray(pictured.pixels) > 30) & (np.asarray(pictured.pixels) < 225)
    assert grey[:, :, 0].mean() > 0.2  # half the text's height

    stamped = np.asarray(typeset_page(dpi=100, stamp=True)[0].pixels).astype(int)
    red = stamped[..., 0] - stamped[..., 1] > 100
    assert red.mean() > 0.001
    assert np.argwhere(red)[:, 0].min() > 0.75 * len(red)  # at the foot
    assert not (np.asarray(plain.pixels)[..., 0] != np.asarray(plain.pixels)[..., 1]).any()


def test_the_chart_has_every_patch_once_and_of_one_size():
    page, text = typeset_page(105, 148, dpi=100, table=False, chart=True)
    assert "Plate 3." in text
    sizes = [(page.pixels == code).all(axis=2).sum() for code in CHART_CODES]
    assert min(sizes) > 0.9 * max(sizes) > 1000  # sides are rounded to pixels
    touching = colour_chart(60, 40, gap=0)
    assert (touching[:10, :10] == CHART_CODES[0]).all()
    assert (touching[-10:, -10:] == CHART_CODES[-1]).all()


def test_a_spread_has_two_pages():
    bent = sheet("spread")
    page, text = typeset_sheet(bent, dpi=100)
    assert page.pixels.shape[:2] == (827, 2 * round(148 * 100 / 25.4))
    assert text.startswith("16 ")
    assert "\nOn paper that will not lie flat 17\n" in text


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("tesseract") is None, reason="Tesseract is not installed")
def test_tesseract_reads_what_was_set(tmp_path):
    page, text = typeset_page()
    Image.fromarray(np.asarray(page.pixels)).save(tmp_path / "page.png", dpi=(300, 300))
    read = subprocess.run(["tesseract", tmp_path / "page.png", "-"], capture_output=True, text=True, check=True).stdout
    wanted = text.split()
    missing = set(wanted) - set(read.split())
    assert len(missing) <= 0.01 * len(wanted)  # it read all but one of 570 when this was written
