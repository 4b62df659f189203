import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planish.flattening import direction_of_growth, to_page_frame, turned
from shapes import grid, rigid_rms

UV, _ = grid(40, 30, 210, 297)
ASYMMETRIC = UV[(UV[:, 0] > 40) | (UV[:, 1] > 60)]  # a dog-ear at the top left


@given(st.floats(0, 360), st.floats(-500, 500))
def test_any_turn_is_undone(degrees, shift):
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    turn = np.array([[c, -s], [s, c]])
    page, size = to_page_frame(ASYMMETRIC @ turn.T + shift, turn @ [0, -1])
    assert size == pytest.approx((210, 297))
    np.testing.assert_allclose(page, ASYMMETRIC, atol=1e-9)


def test_the_long_side_stands_upright_even_when_the_photo_lay_on_its_side():
    page, size = to_page_frame(UV[:, ::-1] * [1, -1], np.array([0.1, -1.0]))
    assert size == pytest.approx((210, 297))
    assert rigid_rms(page, UV) < 1e-9  # never mirrored


def test_a_ragged_border_hardly_turns_the_page():
    rng = np.random.default_rng(3)
    rough = UV + np.where(rng.random(UV.shape) < 0.5, 0, rng.normal(0, 0.5, UV.shape))
    page, _ = to_page_frame(rough, np.array([0.0, -1.0]))
    shift = (page - rough) - (page - rough).mean(0)
    assert np.abs(shift).max() < 0.5  # half a millimetre over 300 mm: 0.2 degrees


def test_growth_points_where_the_value_grows():
    np.testing.assert_allclose(direction_of_growth(UV, 3 * UV[:, 0] - 4 * UV[:, 1] + 7), [0.6, -0.8], atol=1e-9)
    value = UV[:, 1].copy()
    value[::7] = np.nan
    np.testing.assert_allclose(direction_of_growth(UV, value), [0, 1], atol=1e-9)
    np.testing.assert_array_equal(direction_of_growth(UV, 0 * UV[:, 0] + 5), [0, 0])


def test_a_quarter_turn_is_clockwise_and_exact():
    page, size, turn, shift = turned(UV, 90)
    assert size == pytest.approx((297, 210))
    top_left = np.argmin(np.abs(UV).sum(1))
    np.testing.assert_array_equal(page[top_left], [size[0], 0])  # now at the top right
    np.testing.assert_allclose(UV @ turn.T + shift, page, atol=1e-9)


FINE, _ = grid(298, 211, 210, 297)


def frame_of(page_xy):
    return to_page_frame(page_xy, np.array([0.0, -1.0]))


def test_stray_points_neither_widen_nor_turn_the_page():
    strays = np.array([[-8.0, 70], [-7.5, 70.4], [-3, 200], [60, -2], [190, -9], [222, 300], [214, 20], [100, 301]])
    clean, size = frame_of(FINE)
    page, with_strays = frame_of(np.r_[FINE, strays])
    assert with_strays == pytest.approx(size, abs=1e-9)
    np.testing.assert_allclose(page[: len(FINE)], clean, atol=1e-9)


def test_a_border_in_steps_ends_where_its_outermost_points_do():
    rng = np.random.default_rng(5)
    inside = FINE[(FINE > 2).all(axis=1) & (FINE[:, 0] < 208) & (FINE[:, 1] < 295)]
    depth, along = rng.uniform(0, 0.6, 2000), rng.uniform(0, 1, 2000)
    rim = [
        np.c_[210 * along, depth],
        np.c_[210 * along, 297 - depth],
        np.c_[depth, 297 * along],
        np.c_[210 - depth, 297 * along],
    ]
    _, size = frame_of(np.concatenate([inside, *rim]))
    assert size == pytest.approx((210, 297), rel=0.0005)


@pytest.mark.parametrize("width", [9.0, 15.0, 60.0])
def test_a_tab_of_paper_is_not_cut_off(width):
    """3 % of the longer side and more is paper."""
    tab = np.stack(np.meshgrid(np.arange(100, 100 + width + 0.1, 0.5), np.arange(-5, 0, 0.5)), axis=-1).reshape(-1, 2)
    _, size = frame_of(np.r_[FINE, tab])
    assert size == pytest.approx((210, 302), abs=0.01)


def inside_of(shape):
    x, y = FINE.T
    return FINE[
        {"round": np.hypot((x - 105) / 105, (y - 148.5) / 148.5) <= 1, "three corners": x / 210 <= y / 297}[shape]
    ]


@pytest.mark.parametrize("shape", ["round", "three corners"])
def test_sheets_that_are_no_rectangle_keep_all_they_have(shape):
    xy = inside_of(shape)
    page, size = frame_of(xy)
    assert page.min(axis=0) == pytest.approx([0, 0], abs=0.35)  # the tip of a right angle at 35 degrees, 2 % of a side
    assert (size - page.max(axis=0)) == pytest.approx([0, 0], abs=0.35)


def test_few_points_all_count():
    coarse, _ = grid(5, 4, 210, 297)
    _, size = frame_of(np.r_[coarse, [[100, -10]]])
    assert size == pytest.approx((210, 307))


def test_a_single_line_of_points_has_a_frame():
    page, size = frame_of(np.c_[np.arange(50.0), np.zeros(50)])
    assert size == pytest.approx((0, 49))
    assert np.isfinite(page).all()
