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
    page, size = turned(UV, 90)
    assert size == pytest.approx((297, 210))
    top_left = np.argmin(np.abs(UV).sum(1))
    np.testing.assert_array_equal(page[top_left], [size[0], 0])  # now at the top right
