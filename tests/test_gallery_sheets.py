import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planish.errors import UsageError
from planish.gallery import SHEETS, sheet
from planish.gallery.profile import curve_of_angle
from planish.gallery.sheets import normals

CASES = {name: sheet(name) for name in SHEETS}
CASES["rounded letter"] = sheet("letter", radius_mm=3.0)
CASES["small book"] = sheet("book", width_mm=105.0, height_mm=148.0)
CASES |= {f"crumple {seed}": sheet("crumpled", seed=seed) for seed in (5, 6)}

fraction = st.floats(0, 1)


def random_places(bent, count, seed=0):
    return np.random.default_rng(seed).uniform(0, 1, (count, 2)) * [bent.width_mm, bent.height_mm]


@given(st.sampled_from(sorted(CASES)), fraction, fraction, fraction, fraction)
def test_a_line_on_the_page_keeps_its_length_wherever_it_runs(name, x0, y0, x1, y1):
    bent = CASES[name]
    size = np.array([bent.width_mm, bent.height_mm])
    start, end = size * [x0, y0], size * [x1, y1]
    count = 5000
    flat_step = np.linalg.norm(end - start) / count
    line = bent.bend(start + np.linspace(0, 1, count + 1)[:, None] * (end - start))
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    # A chord is never longer than the way along the sheet; 1e-10 mm is what is left of 16 digits. A tear would show.
    assert (steps <= flat_step * (1 + 1e-9) + 1e-10).all()
    # It is shorter by (step / radius)^2 / 24, 1e-5 at the tightest radius here (3 mm), except across a sharp crease,
    # of which the Miura fold and the crumple have the most.
    assert (steps < flat_step * (1 - 2e-5) - 1e-10).sum() <= 150


@pytest.mark.parametrize("name", CASES)
def test_every_small_square_stays_a_square(name):
    bent = CASES[name]
    places, step = random_places(bent, 4000), 1e-5
    here = bent.bend(places)
    across, down = (bent.bend(places + d) - here for d in ([step, 0], [0, step]))
    metric = np.stack([(across**2).sum(1), (down**2).sum(1), (across * down).sum(1)], axis=1) / step**2
    # Rounding of coordinates of 300 mm over a step of 1e-5 mm leaves 1e-8; curvature 0.3 / mm leaves 1e-6.
    off = np.abs(metric - [1, 1, 0]).max(axis=1)
    assert np.quantile(off, 0.998) < 5e-6  # the rest has a crease between the two places
    assert off.max() < 1


@pytest.mark.parametrize("name", CASES)
def test_the_whole_sheet_lies_on_the_table(name):
    bent = CASES[name]
    heights = bent.bend(random_places(bent, 100_000))[:, 2]
    assert heights.min() > -1e-3  # found on a lattice that shrinks to 1e-4 mm
    assert heights.min() < 0.5  # the lowest corner of a crumple is seldom hit at random
    if name != "flat":
        assert heights.max() > 10


@pytest.mark.parametrize("name", [name for name in CASES if name not in ("roll", "curl")])
def test_print_looks_up_and_is_not_mirrored(name):
    assert normals(CASES[name], random_places(CASES[name], 20_000))[:, 2].min() > 0.4  # 66 degrees, the spine of a book


def test_the_page_lies_as_it_is_read():
    corners = sheet("flat").bend(np.array([[0, 0], [215.9, 0], [0, 279.4]]))
    np.testing.assert_allclose(corners, [[-107.95, 139.7, 0], [107.95, 139.7, 0], [-107.95, -139.7, 0]], atol=1e-9)


def test_a_turning_angle_becomes_a_circle():
    curve = curve_of_angle(lambda s: s / 7, 40.0)
    s = np.linspace(-1, 41, 100)  # a little beyond the ends too
    np.testing.assert_allclose(curve(s), 7 * np.stack([np.sin(s / 7), 1 - np.cos(s / 7)], axis=1), atol=1e-11)


def test_the_spine_of_the_spread_turns_as_asked():
    bent = sheet("spread", spine_deg=90.0)
    left, right = normals(bent, np.array([[148 - 0.01, 100], [148 + 0.01, 100]]))
    # 0.02 mm of paper between the two turn by 0.05 degrees
    assert np.degrees(np.arccos(left @ right)) == pytest.approx(90, abs=0.1)
    assert bent.bend(np.array([[148.0, 100]]))[0, 2] < bent.bend(np.array([[158.0, 100]]))[0, 2]


@pytest.mark.parametrize("radius_mm", [0.0, 4.0])
def test_the_panels_of_the_letter_climb_as_asked(radius_mm):
    bent = sheet("letter", slopes_deg=(-5.0, 30.0, -20.0), radius_mm=radius_mm)
    for third, slope in enumerate((-5, 30, -20)):
        up, down = bent.bend(np.array([[50, 280 * (third + 0.4) / 3], [50, 280 * (third + 0.6) / 3]]))
        assert np.degrees(np.arctan2(down[2] - up[2], up[1] - down[1])) == pytest.approx(slope, abs=1e-6)


def test_the_corner_of_the_curl_goes_past_the_vertical_and_little_else_does():
    bent = sheet("curl")
    upward = normals(bent, random_places(bent, 50_000))[:, 2]
    corner = normals(bent, np.array([[215.8, 279.3]]))[0, 2]
    assert corner == pytest.approx(np.cos(np.radians(110)), abs=0.01)
    assert 0 < (upward < 0).mean() < 0.01


def test_the_turns_of_the_roll_keep_apart():
    bent = sheet("roll", turns=2.0, pitch_mm=6.0)
    line = bent.bend(np.stack([np.full(3000, 50.0), np.linspace(0, 279.4, 3000)], axis=1))[:, 1:]
    step = np.diff(line, axis=0)
    turned = np.unwrap(np.arctan2(step[:, 1], step[:, 0]))
    assert abs(turned[-1] - turned[0]) == pytest.approx(4 * np.pi, rel=2e-3)  # short of one step at either end
    outer = turned[:-1] - turned[0]
    for k in (0, 500, 1000):
        next_turn = np.abs(np.abs(outer - outer[k]) - 2 * np.pi).argmin()
        assert np.linalg.norm(line[next_turn] - line[k]) == pytest.approx(6.0, abs=0.1)


def test_the_facets_of_the_miura_fold_are_flat_and_lean_as_one():
    bent = sheet("miura")
    upward = normals(bent, random_places(bent, 5000))
    kinds = np.unique(upward.round(6), axis=0)
    assert len(kinds) - 4 <= 10  # four directions, and a few places on creases
    np.testing.assert_allclose(np.median(upward[:, 2]), np.cos(np.radians(34)), atol=1e-6)


def test_what_cannot_be_made_is_refused_in_a_sentence():
    with pytest.raises(UsageError, match="no sheet 'origami' in the gallery; choose one of flat, book"):
        sheet("origami")
    with pytest.raises(UsageError, match="cannot make 9 turns"):
        sheet("roll", turns=9)
    assert sheet("roll", turns=3).name == "roll"
