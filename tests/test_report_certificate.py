import json
from dataclasses import replace

import numpy as np
import pikepdf
import pytest

from planish.cli.main import run
from planish.gallery import sheet, virtual_scan
from planish.io import write_scan
from planish.pipeline import restore
from planish.report import certificate, contact_sheet, guideline
from planish.report.certificate import CLIPPED, HEIGHT, WIDTH
from planish.report.drawing import GOLD, Sheet, fitted, length, rgb_uint8, wrapped
from planish.report.fadgi import RESOLUTION_PPI, SCALE_PERCENT, stars
from planish.report.heat import coloured, over_page
from planish.settings import RenderSettings, RestoreSettings, ShadingSettings
from planish.types import Diagnostic
from shapes import grid

pytestmark = pytest.mark.slow

AT_100_DPI = RestoreSettings(render=RenderSettings(dpi=100.0))


@pytest.fixture(scope="module")
def restored():
    made = virtual_scan(sheet("book"), points=5000, photo_px=(900, 700), noise_mm=0.05)
    return made.scan, restore(made.scan, AT_100_DPI)


def count(pixels, colour):
    return int((pixels == np.array(colour, np.uint8)).all(axis=2).sum())


# --- the certificate ------------------------------------------------------------------------------------------------


def test_a_certificate_is_a_sheet_of_a4(restored):
    pixels = certificate(restored[1], "book.obj")
    assert pixels.shape == (HEIGHT, WIDTH, 3)
    assert pixels.dtype == np.uint8
    assert pytest.approx(297 / 210, rel=1e-3) == HEIGHT / WIDTH
    # nothing runs into the margins of the sheet
    assert (pixels[:, :100] == 255).all()
    assert (pixels[:, -100:] == 255).all()
    assert (pixels[-40:] == 255).all()


def test_what_it_says_follows_the_report(restored):
    _, done = restored
    one = certificate(done)
    noted = replace(done, report=replace(done.report, warnings=[Diagnostic("broken", "the lamp was broken " * 60)] * 3))
    two = certificate(noted)
    changed = np.nonzero((one != two).any(axis=(1, 2)))[0]
    assert changed.min() > HEIGHT / 2  # the notes stand at the foot
    assert (two[-40:] == 255).all()  # however many there are
    named = certificate(done, "a very long name of a file " * 20)
    assert (named[:, -100:] == 255).all()


def test_clipped_parts_are_red_on_the_map_of_light(restored):
    _, done = restored
    clipped = np.zeros(done.unshaded.pixels.shape[:2], bool)
    clipped[: len(clipped) // 2] = True
    assert count(certificate(done), CLIPPED) == 0
    red = count(certificate(replace(done, clipped=clipped)), CLIPPED)
    assert red > 0.4 * 300 * 400  # half of a map of 320 x 415 pixels; the blend at its edge is not counted


def test_a_page_without_shade_removed_has_a_certificate_too():
    made = virtual_scan(sheet("letter"), points=3000, photo_px=(500, 400))
    settings = replace(AT_100_DPI, shading=ShadingSettings(shading="none"))
    done = restore(made.scan, settings)
    assert done.light is None
    assert done.clipped is None
    assert certificate(done).shape == (HEIGHT, WIDTH, 3)
    assert [criterion.name for criterion in done.report.guideline.criteria] == ["resolution", "accuracy of scale"]


def test_the_command_writes_it_as_a4(tmp_path, capsys):
    made = virtual_scan(sheet("letter"), points=3000, photo_px=(500, 400))
    write_scan(tmp_path / "letter.obj", made.scan)
    page, paper, report = (tmp_path / name for name in ("page.png", "certificate.pdf", "report.json"))
    command = ["restore", str(tmp_path / "letter.obj"), "-o", str(page), "--dpi", "72", "-q"]
    assert run([*command, "--certificate", str(paper), "--report", str(report)]) == 0
    with pikepdf.open(paper) as pdf:
        width, height = (float(mm) / 72 * 25.4 for mm in pdf.pages[0].mediabox[2:])
    assert (width, height) == pytest.approx((210, 297), abs=0.1)  # half a pixel of 200 dpi
    said = json.loads(report.read_text())["guideline"]
    assert "FADGI" in said["name"]
    stars_of = {criterion["name"]: criterion["stars"] for criterion in said["criteria"]}
    assert stars_of["resolution"] == 0  # 500 pixels of photo for 11 inches
    assert stars_of["accuracy of scale"] == 4  # a scan without noise
    assert len(stars_of) == 3
    capsys.readouterr()
    assert run([*command, "--certificate", str(tmp_path / "certificate.doc")]) == 4
    assert "certificate.doc" in capsys.readouterr().err


# --- the guideline --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("value", "limits", "reached"),
    [
        (149.9, RESOLUTION_PPI, 0),
        (150.0, RESOLUTION_PPI, 1),
        (300.0, RESOLUTION_PPI, 3),  # two and three stars ask for the same
        (400.0, RESOLUTION_PPI, 4),
        (5.0, SCALE_PERCENT, 0),
        (4.9, SCALE_PERCENT, 1),
        (0.01, SCALE_PERCENT, 4),
    ],
)
def test_stars(value, limits, reached):
    assert stars(value, limits) == reached


def test_interpolated_pixels_earn_no_stars(restored):
    _, done = restored
    report = done.report
    for dpi, p10, wanted in ((600.0, 210.0, 210.0), (200.0, 410.0, 200.0)):
        found = guideline(replace(report, page=replace(report.page, dpi=dpi, effective_ppi_p10=p10))).criteria[0]
        assert found.value == wanted
        assert found.stars == 1


def test_scale_counts_the_errors_of_both_sides(restored):
    _, done = restored
    report = done.report
    flat = replace(report.flatten, expected_error_mm=1.0)
    page = replace(report.page, width_mm=100.0, height_mm=200.0)
    found = guideline(replace(report, flatten=flat, page=page)).criteria[-1]
    assert found.value == pytest.approx(100 * np.sqrt(2) / 100)  # two errors of 1 mm add up to sqrt(2)
    assert found.stars == 3
    assert report.guideline == guideline(report)


# --- maps -----------------------------------------------------------------------------------------------------------


def test_values_over_the_page_are_linear_between_points():
    page_xy, faces = grid(5, 4, 60.0, 90.0)
    values = np.c_[page_xy[:, 0], 2 * page_xy[:, 1] + 1]
    over = over_page(page_xy, faces, values, (60.0, 90.0), rows=90)
    y, x = np.mgrid[0:90, 0:60] + 0.5  # a pixel a millimetre
    np.testing.assert_allclose(over, np.stack([x, 2 * y + 1], axis=-1), atol=1e-4)  # weights are float32


def test_places_without_a_face_are_white():
    page_xy, faces = grid(5, 4, 30.0, 90.0)
    over = over_page(page_xy, faces, page_xy[:, 0], (60.0, 90.0), rows=90)
    assert np.isnan(over[:, 31:]).all()
    picture = coloured(over, 0.0, 30.0)
    assert (picture[:, 31:] == 255).all()
    assert (np.diff(picture[45, :30, 1].astype(int)) >= 0).all()  # the colours' green grows with the value


# --- words and pictures ---------------------------------------------------------------------------------------------


def test_words_are_broken_at_spaces_and_fit():
    lines = wrapped("one two three four five six seven", 20.0, 120.0)
    assert " ".join(lines) == "one two three four five six seven"
    assert len(lines) > 1
    assert max(length(line, 20.0) for line in lines) <= 120.0


def test_a_filled_star_is_gold_and_an_empty_one_is_not():
    gold = tuple(int(GOLD[k : k + 2], 16) for k in (1, 3, 5))
    for filled in (True, False):
        drawn = Sheet(60, 60)
        drawn.star(30, 30, 20, filled=filled)
        assert (count(drawn.pixels, gold) > 200) is filled


@pytest.mark.parametrize("dtype", [bool, np.uint8, np.uint16])
def test_pictures_of_any_kind_become_eight_bit_colour(dtype):
    white = np.ones((4, 6), dtype) * (True if dtype is bool else np.iinfo(dtype).max)
    assert (rgb_uint8(white.astype(dtype)) == 255).all()
    assert rgb_uint8(white.astype(dtype)).shape == (4, 6, 3)


def test_fitted_keeps_the_shape():
    assert fitted(np.zeros((100, 50, 3), np.uint8), 80, 80).shape == (80, 40, 3)
    assert fitted(np.zeros((10, 40, 3), np.uint8), 80, 80).shape == (20, 80, 3)


def test_a_contact_sheet_shows_every_picture_once_in_reading_order():
    colours = [(200, 0, 0), (0, 200, 0), (0, 0, 200)]
    pictures = {f"picture {k}": np.full((70, 56, 3), colour, np.uint8) for k, colour in enumerate(colours)}
    drawn = contact_sheet(pictures, "Three", columns=2)
    places = [np.argwhere((drawn == np.array(colour)).all(axis=2)) for colour in colours]
    assert all(len(place) == 700 * 560 for place in places)  # of the same shape as the cards
    red, green, blue = (place.mean(axis=0) for place in places)
    assert red[0] == green[0] < blue[0]
    assert red[1] == blue[1] < green[1]
