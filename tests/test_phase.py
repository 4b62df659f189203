"""Waves on top of the Gray code: truth from the patterns themselves and from a virtual projector."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from planish.acquire.structured_light import gray_code
from planish.acquire.structured_light.gray_code import decode, frame_count
from planish.acquire.structured_light.phase import HALF_BITS, PERIOD, all_patterns, decode_phase, patterns, phase_steps
from planish.acquire.structured_light.phase_frames import check_waves
from planish.acquire.structured_light.scan import find_correspondence, from_gray_code
from planish.acquire.structured_light.subpixel import refine_subpixel
from planish.cli.main import run
from planish.errors import InputError, UsageError
from planish.gallery import sheet, typeset_sheet
from planish.gallery.devices import projector_rig, structured_light
from planish.gallery.scene_view import render_view
from planish.geometry import project

CAMERA, PROJECTOR = (256, 320), (400, 640)
"""Pixels of the camera are twice those of the projector: the finest stripes, of two pixels, are hardly seen."""

STEPS = 8

LEVELS = 0.1
"""Pixels: levels of `shown` are rounded to tens, 3 of 115 rms, in 8 photos: 16 / 2 pi sqrt(2 / 8) 3 / 115 = 0.03."""

SHAPE = 40, 70
BITS = frame_count(SHAPE) - 2


def split(frames, shape_rc):
    """Photos of the code, and of the waves."""
    bits = frame_count(shape_rc) - 2
    return np.concatenate([frames[:bits], frames[-2:]]), frames[bits:-2]


@pytest.fixture(scope="module")
def capture():
    book = sheet("book")
    rig = projector_rig(book, CAMERA, PROJECTOR)
    made = structured_light(book, *rig, all_patterns(PROJECTOR, STEPS), typeset_sheet(book)[0])
    seen = render_view(book, rig[0])
    true = project(rig[1], seen.points.reshape(-1, 3)).reshape(*CAMERA, 2)
    return rig, made, true, np.isfinite(seen.page_xy[..., 0]), seen


@pytest.fixture(scope="module")
def shown():
    return np.stack(list(all_patterns(SHAPE, STEPS))) // 10 * 9  # white is not clipped


@settings(max_examples=15)
@given(st.integers(17, 200), st.integers(17, 200), st.integers(3, 16))
def test_waves_tell_their_own_pixels(rows, cols, steps):
    frames = np.stack(list(all_patterns((rows, cols), steps)))
    assert phase_steps(len(frames), (rows, cols)) == steps
    found = decode_phase(*split(frames, (rows, cols)), (rows, cols))
    # levels are rounded: 0.5 of 127 at most in each of 3 photos or more, 16 pixels a turn
    np.testing.assert_allclose(found.projector_xy[..., 0], np.tile(np.arange(cols), (rows, 1)), atol=0.02)
    np.testing.assert_allclose(found.projector_xy[..., 1], np.tile(np.arange(rows)[:, None], (1, cols)), atol=0.02)
    assert found.confidence.min() > 0.98


def test_errors_of_one_step_of_the_code_do_no_harm(shown):
    """The code as it is read half a stripe beside: one bit of two neighbours is wrong, and no place moves."""
    code, waves = split(shown, SHAPE)
    for shift in (-1, 1):
        beside = np.concatenate([np.roll(code[:-2], shift, axis=2), code[-2:]])
        found = decode_phase(beside, waves, SHAPE).projector_xy[2:-2, 2:-2]
        np.testing.assert_allclose(found[..., 0], np.tile(np.arange(2, 68), (36, 1)), atol=LEVELS)


def test_the_finest_stripes_are_not_needed(shown):
    code, waves = split(shown, SHAPE)
    blurred = code.copy()
    for axis_bits, start in ((7, 0), (6, 14)):  # 70 columns, 40 rows
        blurred[start + 2 * (axis_bits - HALF_BITS) : start + 2 * axis_bits] = 128
    assert (decode(blurred, SHAPE).column == -1).all()
    found = decode_phase(blurred, waves, SHAPE).projector_xy
    np.testing.assert_allclose(found[..., 0], np.tile(np.arange(70), (40, 1)), atol=LEVELS)
    with pytest.raises(InputError, match=r"two pixels of the projector wide, must be seen.*phase_steps=8"):
        find_correspondence(blurred, SHAPE)


@pytest.mark.slow
def test_places_are_true_to_the_noise(capture):
    _, made, true, on_sheet, _ = capture
    code, waves = split(made.frames, PROJECTOR)
    found = decode_phase(code, waves, PROJECTOR)
    off = np.abs(found.projector_xy - true)[on_sheet & (found.confidence > 0.8)]
    # blank paper: contrast B of about 90 levels, noise 1: 16 / 2 pi sqrt(2 / 8) / 90 = 0.014 px; ink beside more
    assert np.nanmedian(off) < 0.05
    assert np.isfinite(found.projector_xy[on_sheet]).mean() > 0.99


@pytest.mark.slow
def test_waves_halve_the_error_where_stripes_are_fine(capture):
    rig, made, _, on_sheet, seen = capture
    code, _ = split(made.frames, PROJECTOR)
    off = []
    for frames in (code, made.frames):
        scan = from_gray_code(frames, *rig, made.photo).scan
        column, row = scan.photo_xy.astype(int).T
        error = ((scan.mesh.points - seen.points[row, column]) * seen.normals[row, column]).sum(axis=1)
        off.append(np.sqrt(np.mean(error[on_sheet[row, column]] ** 2)))
    assert off[1] < 0.6 * off[0]


@pytest.mark.slow
def test_a_bright_camera_curve_does_no_harm(capture):
    """Photos in sRGB: 8 steps cancel the overtones of the curve, and finest stripes may blur to light grey."""
    _, made, true, on_sheet, _ = capture
    curved = np.rint(255 * (made.frames / 255.0) ** (1 / 2.2)).astype(np.uint8)
    place = find_correspondence(curved, PROJECTOR).projector_xy
    plain = find_correspondence(made.frames, PROJECTOR).projector_xy
    off = [np.nanquantile(np.abs(found - true)[on_sheet], 0.9) for found in (place, plain)]
    assert off[0] < off[1] + 0.02


@pytest.mark.slow
def test_out_of_focus(capture):
    _, made, true, on_sheet, _ = capture
    soft = np.stack([ndimage.gaussian_filter(frame, 2.0) for frame in made.frames])
    off = [
        np.abs(find_correspondence(f, PROJECTOR).projector_xy - true)[on_sheet]
        for f in (split(soft, PROJECTOR)[0], soft)
    ]
    assert np.isfinite(off[1]).mean() > 0.999
    assert np.isfinite(off[0]).mean() > 0.99  # stripes that blur away tear no holes
    assert np.nanmedian(off[1]) < np.nanmedian(off[0])  # waves are the better where paper is blank
    assert max(np.nanquantile(off, 0.9, axis=(1, 2))) < 0.3  # print smears over 4 projector pixels


def test_waves_and_crossings_agree(shown):
    code, waves = split(shown, SHAPE)
    place = refine_subpixel(code, decode(code, SHAPE), SHAPE, None, decode_phase(code, waves, SHAPE))
    np.testing.assert_allclose(place[8:-8, 8:-8, 0], np.tile(np.arange(8, 62), (24, 1)), atol=LEVELS)


BAD = {
    "a wave is missing": (
        lambda f: np.delete(f, BITS + 3, 0),
        f"wave 4 of the columns is missing before photo {BITS + 4}",
    ),
    "the last wave is missing": (lambda f: np.delete(f, -3, 0), "the last wave, white or black is missing"),
    "a photo of the code is missing": (lambda f: np.delete(f, 4, 0), "photo 5 or 6 is missing"),
    "a wave is doubled": (
        lambda f: np.insert(f, BITS + 9, f[BITS + 9], 0),
        f"photos {BITS + 10} and {BITS + 11} show the same wave, take one of them away",
    ),
    "far too many": (lambda f: f[[*range(BITS), *([BITS] * 40), -2, -1]], "40 beside it; waves come in equal numbers"),
    "two waves are missing": (lambda f: np.delete(f, [BITS + 3, BITS + 9], 0), f"photo {BITS + 4} shows wave 5"),
    "one doubled, one lost": (
        lambda f: f[[*range(BITS + 3), BITS + 2, *range(BITS + 4, len(f))]],
        f"photos {BITS + 3} and {BITS + 4} show the same wave",
    ),
    "shuffled": (
        lambda f: f[[*range(BITS + 1), BITS + 2, BITS + 1, *range(BITS + 3, len(f))]],
        f"photo {BITS + 2} shows wave 3 of the columns, where wave 2 of 8 of the columns is wanted",
    ),
    "rows first": (
        lambda f: f[[*range(BITS), *range(BITS + 8, BITS + 16), *range(BITS, BITS + 8), -2, -1]],
        f"photo {BITS + 1} shows wave 1 of the rows, where wave 1 of 8 of the columns",
    ),
    "something else": (
        lambda f: f[[*range(BITS + 4), -2, *range(BITS + 5, len(f))]],
        f"photo {BITS + 5} shows no wave",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_photos_of_waves_that_do_not_do_are_named(shown, case):
    spoil, sentence = BAD[case]
    check_waves(*split(shown, SHAPE), SHAPE)
    with pytest.raises(InputError) as said:
        find_correspondence(spoil(shown), SHAPE)
    assert sentence in str(said.value)


def test_patterns_with_waves_are_written(tmp_path):
    assert run(["acquire", "patterns", "--size", "64", "40", "--phase-steps", "4", "-o", str(tmp_path)]) == 0
    names = sorted(tmp_path.iterdir())
    assert len(names) == frame_count((40, 64)) + 8
    frames = np.stack([cv2.imread(str(name), 0) for name in names])
    dimmed = (frames * 0.9).astype(np.uint8)
    assert (np.abs(find_correspondence(dimmed, (40, 64)).projector_xy[10, 10:50, 0] - np.arange(10, 50)) < 0.02).all()
    assert (frames[-2] == 255).all()
    assert (frames[-1] == 0).all()
    assert run(["acquire", "patterns", "--size", "64", "40", "--phase-steps", "2", "-o", str(tmp_path)]) == 2
    with pytest.raises(UsageError, match="17 steps of phase were asked for; 3 to 16"):
        list(patterns((40, 64), 17))
    assert len(list(gray_code.patterns((40, 64)))) == len(names) - 8
    assert PERIOD / 2 == 2**HALF_BITS
