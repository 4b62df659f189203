"""Laser lines whose place is known, on paper with print of random places and darkness."""

import numpy as np
import pytest

from planish.acquire.laser.stripes import find_stripes, laser_channel, laser_off_image

ROOM = 0.3
FINE = 8  # places to a pixel, so that edges of ink and the line fall anywhere within pixels


def code(light, noise, rng, top=255):
    """SRGB code values of linear light, as three equal channels."""
    value = np.where(light <= 0.0031308, 12.92 * light, 1.055 * np.clip(light, 0, 1) ** (1 / 2.4) - 0.055)
    levels = np.clip(np.rint(top * value + noise * rng.standard_normal(light.shape)), 0, top)
    return np.repeat(levels.astype(np.uint8 if top == 255 else np.uint16)[..., None], 3, axis=2)


def photos(places, *, laser=0.5, width=3.0, ink=0.4, noise=1.0, room=ROOM, top=255):
    """Laser-off and laser-on photo (200 rows) with lines at `places` + a tenth of the row [px], and those places."""
    rng = np.random.default_rng(5)
    rows, cols = 200, 300
    fine = np.where(rng.random((rows, cols * FINE // 20)) < ink, 0.05, 0.9).repeat(20, axis=1)
    x = (np.arange(cols * FINE) + 0.5) / FINE - 0.5
    at = np.add.outer(0.1 * np.arange(rows), places)
    line = sum(laser * np.exp(-((x - a[:, None]) ** 2) / 2 / width**2) for a in at.T)
    off, lit = ((fine * light).reshape(rows, cols, FINE).mean(axis=2) for light in (ROOM + 0 * line, room + line))
    return code(off, noise, rng, top), code(lit, noise, rng, top), at


def rms(found, true):
    return np.sqrt(np.mean((found - true) ** 2))


def test_a_line_on_print_is_placed_to_a_tenth_of_a_pixel_and_without_dividing_it_is_not():
    off, lit, true = photos([100.0])
    divided = find_stripes(lit, laser_off_image(off, 1), 1)
    plain = find_stripes(lit, laser_off_image(off, 1, divide=False), 1)
    seen = np.isfinite(plain.at)
    assert np.isfinite(divided.at).all()
    assert rms(divided.at, true) < 0.15  # edges of ink within pixels, and 1 level of noise, leave 0.1
    assert rms(plain.at[seen], true[seen]) > 5 * rms(divided.at, true)


def test_the_standard_deviation_that_it_tells_is_the_one_that_it_has():
    off, lit, true = photos([100.0], ink=0.0)
    found = find_stripes(lit, laser_off_image(off, 1), 1)
    miss = (found.at - true) / found.sd
    assert 0.7 < miss.std() < 1.3  # 200 values: 5 % of sampling, and rounding is not quite normal
    assert np.allclose(found.width, 3.0, atol=0.15)  # its own standard deviation is 0.03


@pytest.mark.parametrize("laser", [1.5, 4.0])
def test_a_clipped_line_is_placed_by_its_flanks(laser):
    off, lit, true = photos([100.0], laser=laser, ink=0.0)
    found = find_stripes(lit, laser_off_image(off, 1), 1)
    assert 0.1 < found.clipped_share < 0.7
    assert rms(found.at, true) < 0.1


def test_several_lines_come_in_order_and_a_row_where_one_is_missing_is_left_out():
    off, lit, true = photos([60.0, 120.0, 200.0])
    found = find_stripes(lit, laser_off_image(off, 1), 1, lines=3)
    assert rms(found.at, true) < 0.15
    lit[:50, :100] = off[:50, :100]  # something stands in the light of the first line
    found = find_stripes(lit, laser_off_image(off, 1), 1, lines=3)
    assert np.isnan(found.at[:50]).all()
    assert np.isfinite(found.at[50:]).all()


def test_along_columns_is_along_rows_of_the_turned_photo():
    off, lit, _ = photos([100.0])
    turned = find_stripes(lit.swapaxes(0, 1), laser_off_image(off.swapaxes(0, 1), 1, "columns"), 1, "columns")
    assert np.array_equal(turned.at, find_stripes(lit, laser_off_image(off, 1), 1).at)


def test_the_room_may_be_darker_with_the_laser_on():
    off, lit, true = photos([100.0], room=0.5 * ROOM, ink=0.1)  # the lamp was dimmed
    assert rms(find_stripes(lit, laser_off_image(off, 1), 1).at, true) < 0.15


def test_sixteen_bits_place_better_than_eight():
    errors = []
    for top in (255, 65535):
        off, lit, true = photos([100.0], ink=0.0, noise=0.0, top=top)
        errors.append(rms(find_stripes(lit, laser_off_image(off, 1), 1).at, true))
    assert errors[1] < errors[0] / 5


def test_where_there_is_no_laser_none_is_found():
    off, lit, _ = photos([100.0], laser=0.0)
    assert np.isnan(find_stripes(lit, laser_off_image(off, 1), 1).at).all()


def test_half_a_line_at_the_edge_of_the_paper_is_not_placed_beside_it():
    """Beyond the edge, black cloth sends no laser light back: what is found is near the line, or said to be unsure."""
    off, lit, true = photos([100.0], ink=0.0)
    rng = np.random.default_rng(1)
    dark = code(np.full((200, 200), 0.01), 1.0, rng)
    off[:, 100:], lit[:, 100:] = dark, code(np.full((200, 200), 0.01), 1.0, rng)
    found = find_stripes(lit, laser_off_image(off, 1), 1)
    seen = np.isfinite(found.at)
    miss = np.abs(found.at - true)[seen]
    assert (true[seen] < 103).all()  # beyond that the paper has less than a third of the line's light
    assert (miss < 6 * found.sd[seen] + 0.5).all()  # by its deviation a sweep leaves such crossings out


def test_the_laser_s_colour_is_told():
    off, lit, _ = photos([100.0])
    for channel in range(3):
        tinted = off.copy()
        tinted[..., channel] = lit[..., channel]
        assert laser_channel(tinted, off) == channel
