from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage
from skimage.color import deltaE_ciede2000, rgb2lab

from planish.color import code_values, linear_light
from planish.errors import UsageError
from planish.gallery.artwork import CHART_CODES, colour_chart
from planish.illumination import remove_shading
from planish.illumination.lamp_model import LampModel, fit_lamp, robust, robust_slope
from planish.illumination.shadow_visibility import shadow_visibility
from planish.illumination.surface_at_pixels import Surface, coarse_mesh
from planish.settings import ShadingSettings
from planish.types import Mesh, Page, Scan
from shapes import grid

WIDTH, HEIGHT, RADIUS, DPI = 120.0, 160.0, 70.0, 100.0
LAMP, AMBIENT = np.array([150.0, 60.0, 400.0]), 0.25
MIDDLE = np.array([0.0, -HEIGHT / 2, 40.0])
WHITE_LEVEL = 0.8


def bend(page_xy):
    """An arch over the y axis: places in space, and normals."""
    angle = (page_xy[..., 0] - WIDTH / 2) / RADIUS
    normals = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=-1)
    points = np.stack([RADIUS * np.sin(angle), -page_xy[..., 1], RADIUS * (np.cos(angle) - np.cos(0.86))], axis=-1)
    return points, normals


def page_places():
    """Middle of every pixel on the page [mm]."""
    rows, cols = round(HEIGHT * DPI / 25.4), round(WIDTH * DPI / 25.4)
    return np.stack(np.meshgrid(np.arange(cols) + 0.5, np.arange(rows) + 0.5), axis=-1) * 25.4 / DPI


def irradiance(points, normals):
    """Of a near lamp and light from all around, 1 at most about."""
    way = LAMP - points
    distance = np.linalg.norm(way, axis=-1)
    facing = np.maximum((normals * way).sum(axis=-1) / distance, 0)
    lamp = facing * (np.linalg.norm(LAMP - MIDDLE) / distance) ** 2
    return AMBIENT + (1 - AMBIENT) * lamp


def photographed(reflectance, tint=(1.0, 1.0, 1.0), exposure=WHITE_LEVEL, noise=0.7, dtype=np.uint8):
    """A page of known reflectance (rows, cols[, 3]) under the lamp, in code values with noise [1 / 255]."""
    colour = reflectance if reflectance.ndim == 3 else np.repeat(reflectance[..., None], 3, axis=2)
    shine = irradiance(*bend(page_places()))
    light = np.clip(colour * exposure * shine[..., None] * np.array(tint), 0, 1)
    most = np.iinfo(dtype).max
    code = code_values(np.dtype(np.uint16))[np.rint(light * 65535).astype(int)] / 65535 * most
    code = code + np.random.default_rng(0).normal(0, noise * most / 255, code.shape)
    return Page(np.clip(np.rint(code), 0, most).astype(dtype), np.ones(shine.shape, bool), DPI)


@pytest.fixture(scope="module")
def sheet():
    page_xy, faces = grid(81, 61, WIDTH, HEIGHT)
    points, normals = bend(page_xy)
    return Scan(Mesh(points, faces[:, ::-1])), page_xy, normals


def text(shape, ink=0.04, seed=1):
    """Reflectance of blank paper with dark strokes in lines, and where it is blank for 1 mm around."""
    rng = np.random.default_rng(seed)
    paper = np.ones(shape)
    for top in range(40, shape[0] - 40, 18):
        for left in range(40, shape[1] - 40, 5):
            if rng.random() < 0.6:
                paper[top : top + rng.integers(4, 9), left : left + 2] = ink
    return paper, ndimage.binary_erosion(paper == 1, iterations=4)


def evenness(page, blank):
    """From the 10 % to the 90 % quantile of grey on blank paper, in percent of white."""
    smooth = ndimage.uniform_filter(np.asarray(page.pixels, float).mean(axis=2), 5)
    return float(np.ptp(np.quantile(smooth[blank], [0.1, 0.9]))) / np.iinfo(page.pixels.dtype).max * 100


@pytest.fixture(scope="module")
def shape():
    return page_places().shape[:2]


# --- what it is for -------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_paper_becomes_even_and_just_white(sheet, shape):
    paper, blank = text(shape)
    page = photographed(paper)
    made = remove_shading(page, *sheet)
    assert evenness(page, blank) > 15
    assert made.fit.unevenness < 0.008  # of cells, before white is clipped: noise of 0.7 / 255 over 2 x 2 pixels
    assert made.fit.unevenness_before > 0.15
    assert (np.asarray(made.page.pixels)[blank] == 255).mean() > 0.99
    assert made.fit.method == "geometry"
    assert made.fit.warnings == ()
    assert made.page.dpi == DPI


def test_the_lamp_is_found(sheet, shape):
    made = remove_shading(photographed(text(shape)[0]), *sheet)
    # on a sheet of 160 mm, 370 mm below the lamp, brightness known to 0.5 % gives the lamp to a few hundredths
    assert np.linalg.norm(np.array(made.fit.lamp_mm) - LAMP) < 30
    assert made.fit.ambient == pytest.approx(AMBIENT, abs=0.05)


@pytest.mark.parametrize("method", ["geometry", "background"])
def test_a_grey_picture_over_half_the_page_keeps_its_greys(sheet, shape, method):
    paper, _ = text(shape)
    top, bottom, left, right = 60, 360, 40, shape[1] - 40
    picture = 0.25 + 0.5 * np.linspace(0, 1, bottom - top)[:, None] ** 2 * np.ones(right - left)
    paper[top - 12 : bottom + 12, left - 6 : right + 6] = 1
    paper[top:bottom, left:right] = picture
    page = photographed(paper)
    true = code_values(np.dtype(np.uint8))[np.rint((picture - 0.036) / 0.964 * 65535).astype(int)].mean()
    made = remove_shading(page, *sheet, ShadingSettings(shading=method)).page
    assert np.asarray(made.pixels, float)[top:bottom, left:right].mean() == pytest.approx(true, rel=0.03)


def test_colours_keep_their_hue_under_a_tinted_light(sheet, shape):
    """A red stamp on cream paper in warm light: its colour against the paper's is the print's."""
    red = np.array([0.55, 0.05, 0.07])
    colour = np.ones((*shape, 3))
    colour[400:480, 200:380] = red
    colour[100:104, 60:400] = 0.04  # some black print
    made = remove_shading(photographed(colour, tint=(1.0, 0.9, 0.72)), *sheet).page
    stamp = linear_light(256)[np.asarray(made.pixels)[410:470, 210:370]].mean(axis=(0, 1))
    # less what was taken away to make ink black, 0.036; 0.012 in light is about Delta E 2 for a red like this
    np.testing.assert_allclose(stamp, (red - 0.036) / 0.964, atol=0.012)
    assert (np.asarray(made.pixels)[500:600, 100:400] == 255).mean() > 0.99


@pytest.mark.parametrize("gap", [0, 6])
def test_a_chart_of_colours_keeps_them_without_the_shape(sheet, shape, gap):
    """Patches touch, or have white between them; shade of the bend falls across."""
    paper, _ = text(shape)
    colour = np.repeat(paper[..., None], 3, axis=2)
    chart = linear_light(256)[colour_chart(360, 240, gap / 60)]
    colour[190:450, 40:420] = 1
    colour[200:440, 50:410] = 0.036 + 0.964 * chart  # paler than print: what is taken away to make ink black
    page = remove_shading(photographed(colour), *sheet, ShadingSettings(shading="background")).page
    made = linear_light(256)[np.asarray(page.pixels)][200:440, 50:410]
    off = []
    for code in CHART_CODES[1:]:
        inside = ndimage.binary_erosion((chart == linear_light(256)[code]).all(axis=2), iterations=8)
        off.append(delta_e(made[inside].mean(axis=0), linear_light(256)[code]))
    assert np.median(off) < 3
    assert np.quantile(off, 0.95) < 6


def delta_e(light, true):
    """CIEDE2000 of two linear sRGB lights."""
    codes = code_values(np.dtype(np.uint16)) / 65535
    return float(
        deltaE_ciede2000(*(rgb2lab(codes[np.rint(65535 * np.clip(one, 0, 1)).astype(int)]) for one in (light, true)))
    )


def test_a_poster_without_any_white_stays_as_photographed(sheet, shape):
    poster = np.full(shape, 0.05)
    for k, tone in enumerate([0.5, 0.5, 0.3, 0.1, 0.5, 0.2]):
        row, col = 30 + 190 * (k // 3), 20 + 150 * (k % 3)
        poster[row : row + 120, col : col + 100] = tone
    page = photographed(poster)
    made = remove_shading(page, *sheet, ShadingSettings(shading="geometry"))
    assert made.fit.method == "none"
    assert [warning.code for warning in made.fit.warnings] == ["shading-kept"]
    assert made.page is page


def test_a_dark_poster_stays_dark_and_its_white_becomes_white(sheet, shape):
    poster = np.full(shape, 0.1)
    poster[200:330, 120:350] = 1
    page = remove_shading(photographed(poster), *sheet, ShadingSettings(shading="background")).page
    light = linear_light(256)[np.asarray(page.pixels)]
    assert light[220:310, 140:330].min() > 0.97
    # beyond a few centimetres from the white shade, which runs from 0.4 to 1, and print cannot be parted
    assert np.quantile(light[:180], 0.99) < 0.15


@pytest.mark.parametrize("dimmer", [0.3, 0.7])
def test_paper_beyond_a_fold_becomes_white_too(sheet, shape, dimmer):
    """Its shade has an edge as sharp as that of print, but is grey and reaches the rim."""
    paper, blank = text(shape)
    top, bottom, shade = 240, 272, np.ones(shape)  # 4 mm: the light is smoothed over 1.6
    shade[256:] = dimmer
    blank[top:bottom] = False
    made = remove_shading(photographed(paper * shade), *sheet, ShadingSettings(shading="background")).page
    assert np.quantile(np.asarray(made.pixels)[blank], 0.01) > 250


def test_a_page_that_shows_no_paper_stays_as_photographed(sheet, shape):
    """Gaudy all over: what could be print is not divided."""
    patches = np.random.default_rng(3).uniform(0.05, 1, (9, 7, 3))
    page = photographed(np.kron(patches, np.ones((70, 68, 1)))[: shape[0], : shape[1]])
    made = remove_shading(page, *sheet, ShadingSettings(shading="background"))
    assert (np.asarray(made.page.pixels) == page.pixels).all()
    assert made.fit.method == "none"
    assert [warning.code for warning in made.fit.warnings] == ["shading-kept"]


def test_coloured_paper_stays_coloured(sheet, shape):
    yellow = np.ones((*shape, 3)) * [0.95, 0.85, 0.3]
    made = remove_shading(photographed(yellow), *sheet).page
    light = linear_light(256)[np.asarray(made.pixels)]
    blue = light[..., 2]
    assert light[..., 0].min() > 0.98
    assert np.median(blue) == pytest.approx(0.3 / 0.95, abs=0.02)
    assert np.ptp(np.quantile(blue, [0.1, 0.9])) < 0.02


@pytest.mark.slow
def test_ink_becomes_black_and_faint_print_does_not(sheet, shape):
    dark, pale = text(shape, ink=0.05)[0], text(shape, ink=0.3)[0]
    core = [ndimage.binary_erosion(p < 1, np.ones((3, 1))) for p in (dark, pale)]
    black = np.asarray(remove_shading(photographed(dark), *sheet).page.pixels)[core[0]]
    faint = np.asarray(remove_shading(photographed(pale), *sheet).page.pixels)[core[1]]
    assert np.median(black) < 30  # from 63
    assert np.median(linear_light(256)[faint]) == pytest.approx(0.3, abs=0.02)


@pytest.mark.slow
def test_clipped_pixels_are_marked_and_not_believed(sheet, shape):
    paper, blank = text(shape)
    page = photographed(paper, exposure=1.4)
    made = remove_shading(page, *sheet)
    assert (np.asarray(made.page.pixels)[blank] == 255).mean() > 0.99
    full = (np.asarray(page.pixels) == 255).any(axis=2)
    assert 0.1 < full.mean() < 0.9
    assert (made.clipped == full).all()
    assert made.fit.clipped_share == pytest.approx(full.mean())
    assert "clipped in the photo" in made.fit.warnings[0].sentence
    assert remove_shading(photographed(paper), *sheet).fit.warnings == ()
    assert np.linalg.norm(np.array(made.fit.lamp_mm) - LAMP) < 60  # found from half the page


def test_the_light_that_was_divided_out_is_given(sheet, shape):
    """Cell by cell it is what blank paper of this page shows."""
    made = remove_shading(photographed(text(shape)[0], tint=(1.0, 0.9, 0.72)), *sheet)
    middle = (np.arange(max(made.light.shape[:2])) + 0.5) * made.cell_px - 0.5
    rows, cols = (
        np.clip(np.rint(middle[:n]), 0, m - 1).astype(int) for n, m in zip(made.light.shape, shape, strict=False)
    )
    true = WHITE_LEVEL * irradiance(*bend(page_places()))[np.ix_(rows, cols)][..., None] * [1.0, 0.9, 0.72]
    # a cell is two pixels wide, so half a pixel of a light that changes by a percent a millimetre; and noise
    assert np.quantile(np.abs(made.light / true - 1), 0.99) < 0.02


# --- shadows --------------------------------------------------------------------------------------------------------


def wall_and_table():
    """A table 200 mm wide with a wall of 20 mm standing along x = 0, and a lamp far to the left at 45 degrees."""
    table, faces = grid(41, 41, 200.0, 200.0)
    wall, wall_faces = grid(9, 41, 200.0, 20.0)
    points = np.concatenate(
        [
            np.c_[table[:, 0] - 100, table[:, 1] - 100, 0 * table[:, 0]],
            np.c_[0 * wall[:, 0], wall[:, 0] - 100, wall[:, 1]],
        ]
    )
    return Mesh(points, np.concatenate([faces, wall_faces + len(table)]))


def test_shadow_of_a_wall():
    x = np.linspace(-90, 90, 181)
    points = np.stack([x, 0 * x + 3, 0 * x], axis=-1)
    up = np.tile([0.0, 0, 1], (len(x), 1))
    far = 1e5
    share = shadow_visibility(wall_and_table(), np.array([-far, 0, far]), points, up)
    # the shadow reaches as far as the wall is high; a pixel of the lamp's view is 0.4 mm, the slack 1 mm and more
    assert (share[(x > 4) & (x < 16)] == 0).all()
    assert (share[(x < -4) | (x > 24)] == 1).all()


def valley(page_xy):
    """Two leaves that rise by 40 degrees from a fold in the middle of the page: places in space, and normals."""
    slope = np.radians(40.0)
    beside = page_xy[..., 0] - WIDTH / 2
    points = np.stack([beside * np.cos(slope), -page_xy[..., 1], np.abs(beside) * np.sin(slope)], axis=-1)
    normals = np.stack([-np.sign(beside) * np.sin(slope), 0 * beside, 0 * beside + np.cos(slope)], axis=-1)
    return points, normals


def test_a_picture_across_a_cast_shadow_is_not_made_brighter(shape):
    """The left leaf shades the right one; there the light is uncertain, but a grey picture is no paper."""
    page_xy, faces = grid(81, 61, WIDTH, HEIGHT)
    points, normals = valley(page_xy)
    mesh = Mesh(points, faces[:, ::-1])
    lamp, places = np.array([-300.0, -HEIGHT / 2, 120.0]), page_places()
    at, turned = valley(places)
    share = shadow_visibility(mesh, lamp, at, turned)
    way = lamp - at
    distance = np.linalg.norm(way, axis=2)
    facing = np.maximum((turned * way).sum(axis=2) / distance, 0)
    shine = 0.35 + share * facing * (300 / distance) ** 2
    assert 0.15 < (share[:, shape[1] // 2 :] == 0).mean() < 0.6  # the shadow's edge runs over the right leaf
    paper, blank = text(shape, ink=0.2)  # too pale to be made black
    top, bottom, left = shape[0] // 4, 3 * shape[0] // 4, round(0.56 * shape[1])
    paper[top - 8 : bottom + 8, left - 8 : -12] = 1
    blank[top - 8 : bottom + 8, left - 8 :] = False
    paper[top:bottom, left:-20] = 0.4
    light = np.clip(0.8 * paper * shine / shine.max(), 0, 1)
    codes = code_values(np.dtype(np.uint8))[np.rint(light * 65535).astype(int)]
    page = Page(np.repeat(codes[..., None], 3, axis=2), np.ones(shape, bool), DPI)
    made = remove_shading(page, Scan(mesh), page_xy, normals)
    assert evenness(page, blank) > 20
    assert made.fit.unevenness < 0.01
    grey = linear_light(256)[np.asarray(made.page.pixels)[top:bottom, left:-20, 0]]
    # no lamp can be told from a picture alone, so the shadow on it may stay; it is never taken for dark paper
    assert np.quantile(grey, 0.99) < 1.1 * 0.4
    assert grey[share[top:bottom, left:-20] == 1].mean() == pytest.approx(0.4, rel=0.05)


@pytest.mark.parametrize("aside", [0.0, 0.13])
def test_no_line_is_left_at_a_sharp_crease(shape, aside):
    """Its two sides share a cell, or meet between two; strokes across it stay black."""
    fold = np.array([aside, 0.0])
    page_xy, faces = grid(81, 61, WIDTH, HEIGHT)
    page_xy[:, 0] = np.where(page_xy[:, 0] == WIDTH / 2, WIDTH / 2 + aside, page_xy[:, 0])  # a row of points on it
    points, normals = valley(page_xy - fold)
    at, turned = valley(page_places() - fold)
    shine = irradiance(at, turned)
    sides = [shine[:, round(WIDTH / 2 * DPI / 25.4) + k].mean() for k in (-3, 3)]
    assert abs(np.log(sides[0] / sides[1])) > 0.4
    paper = np.ones(shape)
    paper[300:304, 150:320] = 0.05
    codes = code_values(np.dtype(np.uint8))[np.rint(0.7 * paper * shine / shine.max() * 65535).astype(int)]
    page = Page(np.repeat(codes[..., None], 3, axis=2), np.ones(shape, bool), DPI)
    made = np.asarray(remove_shading(page, Scan(Mesh(points, faces[:, ::-1])), page_xy, normals).page.pixels)
    assert made[10:290, 40:-40].min() >= 250  # without the seam a line of 231 would stay
    assert made[301:303, 160:310].max() < 90  # from 63 before black is made black; a stroke is never taken for a seam


def test_a_coarse_mesh_leaves_out_what_is_not_known():
    places = np.stack(np.meshgrid(np.arange(13.0), np.arange(10.0)), axis=-1)
    points = np.concatenate([places, np.zeros((10, 13, 1))], axis=2)
    known = np.ones((10, 13), bool)
    known[3, 6] = False
    mesh = coarse_mesh(Surface(points, 0 * points, 0 * known, known), 3)
    assert len(mesh.points) == 4 * 5 - 1
    assert len(mesh.faces) == 2 * 3 * 4 - 6  # of an inner point six faces are missing
    assert np.ptp(mesh.points, axis=0).tolist() == [12, 9, 0]


# --- robustness -----------------------------------------------------------------------------------------------------


def test_light_is_fitted_to_the_brightest_kind_of_cell():
    """Three cells in four are print of all greys; the light is still the paper's."""
    rng = np.random.default_rng(6)
    points, normals = bend(rng.uniform(0, 1, (3000, 2)) * [WIDTH, HEIGHT])
    shine = irradiance(points, normals)
    printed = rng.random(3000) < 0.75
    bright = shine * np.where(printed, rng.uniform(0.05, 0.8, 3000), 1) * np.exp(rng.normal(0, 0.003, 3000))
    light = fit_lamp(points, normals, np.zeros(3000), bright)
    error = light.log_brightness(points, normals, np.zeros(3000)) - np.log(shine)
    assert np.abs(error).max() < 0.02


def test_slopes_of_the_light_are_its_differences():
    rng = np.random.default_rng(1)
    points, normals = bend(rng.uniform(0, 1, (60, 2)) * [WIDTH, HEIGHT])
    off_axis = rng.uniform(0, 1, 60)
    numbers = np.array([1.9, -0.4, 0.2, -0.2, -1.0, 0.3, 0.2, 0.1, -2.0])  # a low lamp: some points turn their back
    found, slopes = LampModel(MIDDLE, 200.0, numbers).with_slopes(points, normals, off_axis)
    for k in range(9):
        step = 1e-6 * (np.arange(9) == k)
        above, below = (
            LampModel(MIDDLE, 200.0, numbers + s).log_brightness(points, normals, off_axis) for s in (step, -step)
        )
        np.testing.assert_allclose(slopes[:, k], (above - below) / 2e-6, atol=1e-7)
    np.testing.assert_array_equal(found, LampModel(MIDDLE, 200.0, numbers).log_brightness(points, normals, off_axis))


def test_slope_of_the_robust_residual():
    residual = np.linspace(-1, 1, 40)  # without 0, where it bends
    above, below = robust(residual + 1e-6, 0.05), robust(residual - 1e-6, 0.05)
    np.testing.assert_allclose(robust_slope(residual, 0.05), (above - below) / 2e-6, atol=1e-6)


def test_what_is_darker_than_paper_pulls_less_than_what_is_brighter():
    residual = np.array([-2.0, -0.01, 0.0, 0.01, 2.0])
    pull = robust(residual, 0.05)
    assert abs(pull[0]) <= 0.05
    assert pull[4] > 0.3
    np.testing.assert_allclose(pull[1:4], residual[1:4], rtol=0.03)


def test_a_page_without_quiet_paper_falls_back_and_says_so(sheet, shape):
    noise = np.random.default_rng(7).uniform(0.05, 1, shape)
    made = remove_shading(photographed(noise), *sheet)
    assert made.fit.method == "background"
    assert made.fit.lamp_mm is None
    assert "too little blank paper" in made.fit.warnings[0].sentence


@pytest.mark.slow
@pytest.mark.parametrize("method", ["geometry", "background"])
def test_sixteen_bits_grey_and_colour_agree(sheet, shape, method):
    paper, _ = text(shape)
    s = ShadingSettings(shading=method)
    colour = photographed(paper, noise=0.0, dtype=np.uint16)
    grey = replace(colour, pixels=np.asarray(colour.pixels)[..., 0])
    found = [remove_shading(page, *sheet, s).page.pixels for page in (colour, grey)]
    assert found[0].dtype == found[1].dtype == np.uint16
    # the same up to the rounding of light to 65535 steps
    assert np.abs(found[0][..., 0].astype(int) - found[1].astype(int)).max() <= 64


@pytest.mark.slow
def test_exposure_does_not_matter(sheet, shape):
    paper, blank = text(shape)
    found = [np.asarray(remove_shading(photographed(paper, exposure=e), *sheet).page.pixels) for e in (0.3, 0.7)]
    assert np.abs(found[0].astype(int) - found[1])[blank].max() <= 2


def test_unknown_parts_stay_white_and_out_of_the_fit(sheet, shape):
    page = photographed(text(shape)[0])
    known = np.ones(shape, bool)
    known[:, :150] = False
    pixels = np.array(page.pixels)
    pixels[:, :150] = 40
    made = remove_shading(Page(pixels, known, DPI), *sheet)
    assert (np.asarray(made.page.pixels)[:, :150] == 255).all()
    assert np.linalg.norm(np.array(made.fit.lamp_mm) - LAMP) < 60


@settings(max_examples=12)
@given(
    st.tuples(st.integers(1, 30), st.integers(1, 30)), st.sampled_from(["geometry", "background"]), st.integers(0, 2)
)
def test_any_page_comes_through(size, method, kind):
    page_xy, faces = grid(5, 4, 30.0, 30.0)
    points, normals = bend(page_xy)
    pixels = np.random.default_rng(0).integers(0, 256, (*size, 3), np.uint8) if kind == 2 else np.zeros((*size, 3))
    page = Page(pixels.astype(np.uint8), np.full(size, kind != 1), 25.4)
    made = remove_shading(page, Scan(Mesh(points, faces[:, ::-1])), page_xy, normals, ShadingSettings(shading=method))
    assert made.page.pixels.shape == (*size, 3)
    assert made.clipped.shape == size


def test_refusal(sheet, shape):
    with pytest.raises(UsageError, match="choose geometry or background"):
        remove_shading(photographed(np.ones(shape)), *sheet, ShadingSettings(shading="none"))
