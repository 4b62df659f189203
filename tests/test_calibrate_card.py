"""Printed cards: they have their true size, and are found."""

import pikepdf
import pytest

from planish.acquire.calibration.cards import card_page
from planish.acquire.photos.markers import find_markers
from planish.cli.main import run
from planish.color import to_uint8
from planish.errors import UsageError


@pytest.mark.slow
@pytest.mark.parametrize(("paper", "width_mm"), [("a4", 210.0), ("letter", 215.9)])
def test_the_printed_cards_have_their_true_size(paper, width_mm, tmp_path):
    page = card_page(40.0, 4, paper)
    markers = find_markers(to_uint8(page.pixels))
    assert sorted(markers.ids) == [0, 1, 2, 3]
    for corners in markers.corners_xy:
        side_px = [((corners[k] - corners[k - 1]) ** 2).sum() ** 0.5 for k in range(4)]
        assert [side / page.dpi * 25.4 for side in side_px] == pytest.approx(
            [40.0] * 4, abs=0.02
        )  # cells have whole pixels of 0.05 mm
    pdf = tmp_path / "card.pdf"
    assert run(["calibrate", "card", "-o", str(pdf), "--paper", paper]) == 0
    with pikepdf.open(pdf) as document:
        left, bottom, right, top = (float(v) / 72 * 25.4 for v in document.pages[0].mediabox)
        image = next(iter(document.pages[0].Resources.XObject.values()))
        assert int(image.Width) / (right - left) * 25.4 == pytest.approx(page.dpi, rel=1e-4)
        assert int(image.Height) / (top - bottom) * 25.4 == pytest.approx(page.dpi, rel=1e-4)
    assert right - left == pytest.approx(width_mm, abs=0.03)


@pytest.mark.parametrize(
    ("asked", "why"),
    [((5.0, 1), "10 to 140 mm"), ((40.0, 0), "1 to 12"), ((100.0, 3), "do not fit on a4, 1 do")],
)
def test_cards_that_cannot_be_are_refused(asked, why):
    with pytest.raises(UsageError, match=why):
        card_page(*asked)
