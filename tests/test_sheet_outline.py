"""The sheet on its photo: ground is left out and told; shade and print on the sheet are no ground."""

import numpy as np
import pytest

from planish.acquire.points.scan import from_points
from planish.document.sheet_outline import sheet_mask

ROWS, COLS = np.mgrid[:300, :400].astype(float)


def photo_of(grey):
    noisy = np.asarray(grey, float) + np.random.default_rng(2).normal(0, 2, ROWS.shape)
    return np.repeat(np.clip(noisy, 0, 255).astype(np.uint8)[..., None], 3, axis=2)


def on_table(paper):
    """Paper of that brightness on a dark table that is seen all around."""
    inside = (np.abs(ROWS - 150) < 100) & (np.abs(COLS - 200) < 140)
    return np.where(inside, paper, 60.0), inside


def test_a_table_all_around_is_left_out_and_told():
    grey, inside = on_table(220.0)
    mask, (warning,) = sheet_mask(photo_of(grey), "auto")
    assert (mask & ~inside).sum() == 0
    assert mask.sum() > 0.97 * inside.sum()  # but a pixel of the rim
    assert warning.code == "surroundings-left-out"
    assert abs(float(warning.sentence.split()[0]) - 100 * (1 - mask.mean())) <= 1  # it is rounded


def test_a_sheet_that_reaches_two_borders_of_the_view_is_still_apart_from_its_table():
    grey = np.where(np.abs(ROWS - 150) < 100, 220.0, 60.0)
    mask, _ = sheet_mask(photo_of(grey), "auto")
    assert 0.6 < mask.mean() < 0.68


@pytest.mark.parametrize("shaded", ["left", "right", "top", "left and right", "all sides"])
def test_shade_on_a_sheet_alone_is_no_ground(shaded):
    away = {
        "left": COLS / 72,
        "right": (399 - COLS) / 72,
        "top": ROWS / 54,
        "left and right": np.minimum(COLS, 399 - COLS) / 72,
        "all sides": np.minimum(np.minimum(COLS, 399 - COLS) / 72, np.minimum(ROWS, 299 - ROWS) / 54),
    }[shaded]  # 72 of 400 pixels: 38 of 210 mm
    mask, (warning,) = sheet_mask(photo_of(230 * (0.22 + 0.78 * np.clip(away, 0, 1))), "auto")
    assert mask is None
    assert warning.code in ("sheet-outline-doubtful", "sheet-not-found")


def test_dark_print_on_one_side_of_a_sheet_alone_is_no_ground():
    mask, (warning,) = sheet_mask(photo_of(np.where(COLS < 130, 40.0, 225.0)), "auto")
    assert mask is None
    assert warning.code == "sheet-outline-doubtful"
    assert warning.sentence.startswith("33 %")


def test_shade_at_the_rim_of_a_sheet_on_its_table_is_told():
    grey, inside = on_table(230 * (0.22 + 0.78 * np.clip((COLS - 60) / 60, 0, 1)))
    mask, (warning,) = sheet_mask(photo_of(grey), "auto")
    assert mask.sum() < 0.95 * inside.sum()
    assert "as soft as shade" in warning.sentence


def test_points_with_colours_lose_nothing_to_the_shade_of_a_spine():
    pytest.importorskip("skimage")
    s, y = np.meshgrid(np.linspace(0, 190, 64), np.linspace(-125, 125, 80))
    angle = (s - 95) / 180
    points = np.stack([180 * np.sin(angle), y, 180 * np.cos(angle)], axis=-1).reshape(-1, 3)
    grey = 230 * (0.22 + 0.78 * np.clip(s.ravel() / 34, 0, 1))
    colours = np.repeat(np.rint(grey).astype(np.uint8)[:, None], 3, axis=1)
    shaded = from_points(points, colours)
    plain = from_points(points, np.full_like(colours, 230))
    assert len(shaded.scan.mesh.points) == len(plain.scan.mesh.points)
    assert "sheet-outline-doubtful" in [warning.code for warning in shaded.warnings]
