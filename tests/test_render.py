import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planish.color import code_values, linear_light
from planish.errors import InputError, UsageError
from planish.geometry import project
from planish.render import draw, sharpened
from planish.render.uv_map import uv_map
from planish.settings import RenderSettings
from planish.types import Camera, Mesh, Page, Scan
from shapes import grid

INCH = 25.4


def flat_scan(photo, width, height, photo_xy=None, rows=5, cols=4, px_per_mm=10.0):
    """A flat sheet right under the camera; page and photo have the same orientation."""
    page_xy, faces = grid(rows, cols, width, height)
    mesh = Mesh(np.c_[page_xy * [1, -1], 0 * page_xy[:, 0]], faces[:, ::-1])
    return Scan(mesh, photo, px_per_mm * page_xy - 0.5 if photo_xy is None else photo_xy(page_xy)), page_xy


def grey(levels, dtype=np.uint8):
    """A photo of three equal channels."""
    return np.repeat(np.rint(levels).astype(dtype)[..., None], 3, axis=2)


def over(points_up, px=900, width_mm=150.0, height_mm=400.0):
    """A camera looking straight down on z = 0 around (width / 2, 0)."""
    focal = px * height_mm / (1.4 * width_mm)
    matrix = np.array([[focal, 0, px / 2], [0, focal, px / 2], [0, 0, 1]])
    eye = np.array([points_up[:, 0].mean(), points_up[:, 1].mean(), height_mm])
    turn = np.diag([1.0, -1, -1])
    return Camera(matrix, turn, -turn @ eye, (px, px))


# --- size and place -------------------------------------------------------------------------------------------------


@settings(max_examples=15)
@given(st.floats(5, 60), st.floats(5, 60), st.sampled_from([72.0, 100.0, 150.0]))
def test_true_size(width, height, dpi):
    scan, page_xy = flat_scan(grey(np.full((60, 60), 200.0)), width, height, px_per_mm=1.0)
    page = draw(scan, page_xy, (width, height), RenderSettings(dpi=dpi)).page
    assert page.pixels.shape[:2] == (round(height * dpi / INCH), round(width * dpi / INCH))
    assert page.dpi == dpi


@pytest.mark.parametrize("dpi", [60.0, 127.0, 254.0, 400.0])
def test_pixel_centres(dpi):
    """On a ramp over the photo every page pixel shows its own place, at any resolution."""
    light = np.tile(np.linspace(0.05, 0.95, 200), (100, 1))
    photo = grey(code_values(np.dtype(np.uint16))[np.rint(light * 65535).astype(int)], np.uint16)
    scan, page_xy = flat_scan(photo, 20.0, 10.0)
    page = draw(scan, page_xy, (20.0, 10.0), RenderSettings(dpi=dpi)).page
    x_mm = (np.arange(page.pixels.shape[1]) + 0.5) * INCH / dpi
    expected = 0.05 + 0.9 * (x_mm * 10 - 0.5) / 199
    found = linear_light(65536)[page.pixels[..., 1]]
    inner = (x_mm > 2) & (x_mm < 18)  # away from the rim, where the filter meets the photo's end
    # the ramp rises by 1.8e-3 a millimetre * 25: a shift of 0.01 mm shows as 4.5e-4
    np.testing.assert_allclose(found[:, inner], np.tile(expected[inner], (len(found), 1)), atol=4.5e-4)


@pytest.mark.parametrize("times", [12, 30])
def test_photo_many_times_as_fine(times):
    """The part of the photo under a tile of the page is too large to be held at once, at 30 even of a small one."""
    size = 1800
    light = np.tile(np.linspace(0.05, 0.95, size), (size, 1))
    photo = grey(code_values(np.dtype(np.uint16))[np.rint(light * 65535).astype(int)], np.uint16)
    scan, page_xy = flat_scan(photo, 180.0, 180.0)
    page = draw(scan, page_xy, (180.0, 180.0), RenderSettings(dpi=254 / times)).page
    assert page.known.all()
    x_px = (np.arange(page.pixels.shape[1]) + 0.5) * times - 0.5
    found = linear_light(65536)[page.pixels[..., 1]]
    inner = slice(4, -4)  # the filter reaches three page pixels
    expected = np.tile(0.05 + 0.9 * x_px / (size - 1), (len(found), 1))
    np.testing.assert_allclose(found[inner, inner], expected[inner, inner], atol=1e-4)  # a twentieth of a page pixel


def test_turned_photo():
    """A quarter turn of the photo changes nothing but the photo places."""
    rng = np.random.default_rng(1)
    photo = rng.integers(0, 256, (100, 200, 3), np.uint8)
    scan, page_xy = flat_scan(photo, 20.0, 10.0)
    turned = np.ascontiguousarray(np.rot90(photo))  # x -> y' = 199 - x, y -> x'
    xy = scan.photo_xy
    same = replace(scan, photo=turned, photo_xy=np.c_[xy[:, 1], 199 - xy[:, 0]])
    s = RenderSettings(dpi=300)
    first, second = draw(scan, page_xy, (20.0, 10.0), s).page, draw(same, page_xy, (20.0, 10.0), s).page
    # sums of the filter run in another order: the last bit before rounding
    assert np.abs(first.pixels.astype(int) - second.pixels).max() <= 1


# --- no traces of the mesh ------------------------------------------------------------------------------------------


def test_one_grey_stays_one_grey():
    page_xy, faces = grid(23, 17, 60.0, 80.0)
    rng = np.random.default_rng(0)
    inner = (page_xy > 0).all(axis=1) & (page_xy < [60, 80]).all(axis=1)
    page_xy = page_xy + inner[:, None] * rng.normal(0, 0.6, page_xy.shape)
    photo_xy = 8 * page_xy + 3 * np.sin(page_xy[:, ::-1] / 7) + 40
    scan = Scan(Mesh(np.c_[page_xy * [1, -1], 0 * page_xy[:, 0]], faces[:, ::-1]), grey(np.full((800, 600), 173.0)))
    page = draw(replace(scan, photo_xy=photo_xy), page_xy, (60.0, 80.0), RenderSettings(dpi=200)).page
    assert page.known.all()
    assert (page.pixels == 173).all()


def test_seams_of_a_texture_atlas():
    """Left and right half of the sheet lie at two places of the photo; the page does not show it."""
    rng = np.random.default_rng(2)
    whole = rng.integers(0, 256, (100, 200, 3), np.uint8)
    page_xy, faces = grid(6, 9, 20.0, 10.0)
    corners = 10 * page_xy[faces] - 0.5
    right = page_xy[faces].mean(axis=1)[:, 0] > 10
    corners[right] += [37, 130]
    photo = np.zeros((240, 240, 3), np.uint8)
    photo[:100, :110] = whole[:, :110]  # ten pixels more than the half, for the filter to reach into
    photo[130:230, 127:237] = whole[:, 90:]
    scan = Scan(Mesh(np.c_[page_xy * [1, -1], 0 * page_xy[:, 0]], faces[:, ::-1]), photo, corners[:, ::-1])
    page = draw(scan, page_xy, (20.0, 10.0), RenderSettings(dpi=254)).page
    assert page.known.all()
    assert (page.pixels == whole).all()


def test_coarse_mesh_is_not_faceted():
    """An arch of radius 60 mm with points 18 mm apart: places between them are curved, with and without camera."""
    page_xy, faces = grid(12, 9, 144.0, 198.0)
    bend = lambda uv: np.c_[60 * np.sin((uv[:, 0] - 72) / 60), -uv[:, 1], 60 * np.cos((uv[:, 0] - 72) / 60)]  # noqa: E731
    points = bend(page_xy)
    camera = over(points, width_mm=240.0)
    scan = Scan(Mesh(points, faces[:, ::-1]), grey(np.zeros((900, 900))), project(camera, points))
    px_per_mm = 900 * 400 / (1.4 * 240) / 340
    misses = []
    for this in (scan, replace(scan, camera=camera), replace(scan, camera=camera, photo_xy=None)):
        sheet = uv_map(this, page_xy)
        miss = np.linalg.norm(sheet.photo_xy - project(camera, bend(sheet.page_xy)), axis=1) / px_per_mm
        inside = (np.abs(sheet.page_xy - [72, 99]) < [54, 80]).all(axis=1)
        misses.append((miss[inside].max(), miss.max()))
    # flat faces are wrong by their sagitta, 18^2 / (8 * 60) = 0.68 mm in height, seen at up to 60 degrees
    for inner, anywhere in misses:
        assert inner < 0.04  # a quarter of a pixel at 150 dpi
        assert anywhere < 0.3  # the outermost faces have neighbours on one side only


# --- sharpness ------------------------------------------------------------------------------------------------------


def slanted_edge(size, slope, shift_xy=(0.0, 0.0)):
    """A dark to bright edge with the softness of a pixel's area and a lens blur of half a pixel: linear light."""
    fine = 8
    at = (np.arange(size * fine) + 0.5) / fine - 0.5
    x, y = np.meshgrid(at + shift_xy[0], at + shift_xy[1])
    from scipy.ndimage import gaussian_filter

    edge = (x - size / 2 - slope * (y - size / 2) > 0).astype(float)
    soft = gaussian_filter(edge, 0.5 * fine, mode="nearest")
    return 0.1 + 0.8 * soft.reshape(size, fine, size, fine).mean(axis=(1, 3))


def mtf50(light, slope, centre=None):
    """Spatial frequency [cycles / px] where the contrast of an edge has fallen to half (ISO 12233, slanted edge)."""
    size = len(light)
    centre = size / 2 if centre is None else centre
    y, x = np.mgrid[0:size, 0:size]
    away = (x - centre - slope * (y - size / 2)) / np.hypot(1, slope)
    near = (np.abs(away) < 12) & (y > 8) & (y < size - 9)
    bins = np.floor((away[near] + 12) * 4).astype(int)
    edge = np.bincount(bins, light[near]) / np.bincount(bins)
    line = np.diff(edge) * np.hanning(len(edge) - 1)
    contrast = np.abs(np.fft.rfft(line, 4096))
    contrast /= contrast[0]
    return np.argmax(contrast < 0.5) / 4096 * 4


@pytest.mark.parametrize("turn_deg", [0.0, 1.7])
def test_sharpness_at_equal_resolution(turn_deg):
    """A printed edge keeps nine tenths of its MTF50, though page pixels fall half way between photo pixels."""
    size, slope = 160, 0.09
    light = slanted_edge(size, slope)
    photo = grey(code_values(np.dtype(np.uint16))[np.rint(light * 65535).astype(int)], np.uint16)
    angle = np.radians(turn_deg)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    middle = np.full(2, size / 20)
    scan, page_xy = flat_scan(photo, 16.0, 16.0, lambda uv: 10 * ((uv - middle) @ turn.T + middle) - 0.5 + 0.5)
    page = draw(scan, page_xy, (16.0, 16.0), RenderSettings(dpi=254)).page
    found = linear_light(65536)[page.pixels[..., 1]]
    turned_slope = np.tan(np.arctan(slope) + angle)
    near_middle = slice(20, 140)
    before = mtf50(light[near_middle, near_middle], slope)
    column = np.interp(0.5, found[80, 60:100], np.arange(60, 100)) - 20
    after = mtf50(found[near_middle, near_middle], turned_slope, column)
    assert after > 0.9 * before


def test_light_is_averaged_not_code_values():
    """A chequerboard of black and white pixels seen from afar has half the light of white: code value 188."""
    board = np.indices((400, 400)).sum(axis=0) % 2 * 255
    scan, page_xy = flat_scan(grey(board), 40.0, 40.0)
    page = draw(scan, page_xy, (40.0, 40.0), RenderSettings(dpi=254 / 4)).page
    inner = page.pixels[2:-2, 2:-2].astype(int)
    assert np.abs(inner - 188).max() <= 1


def test_fine_photo_is_averaged_over_the_pixel():
    """What the page can carry of a random print comes through; what it cannot does not come back as moire."""
    from scipy.ndimage import gaussian_filter

    rng = np.random.default_rng(3)
    light = np.clip(0.5 + 0.2 * gaussian_filter(rng.standard_normal((640, 640)), 6) * 12, 0, 1)
    stripes = 0.3 * np.sin(np.arange(640) * 2 * np.pi / 3.1)  # finer than the page's pixels, of 4 photo pixels
    photo = grey(code_values(np.dtype(np.uint16))[np.rint((0.5 * light + 0.25) * 65535).astype(int)], np.uint16)
    fine = code_values(np.dtype(np.uint16))[np.rint((0.5 * light + 0.25 + 0.5 * stripes) * 65535).astype(int)]
    s = RenderSettings(dpi=254 / 4)
    scan, page_xy = flat_scan(photo, 64.0, 64.0)
    plain = linear_light(65536)[draw(scan, page_xy, (64.0, 64.0), s).page.pixels[4:-4, 4:-4, 0]]
    striped = replace(scan, photo=grey(fine, np.uint16))
    with_stripes = linear_light(65536)[draw(striped, page_xy, (64.0, 64.0), s).page.pixels[4:-4, 4:-4, 0]]
    mean = linear_light(65536)[photo[..., 0]].reshape(160, 4, 160, 4).mean(axis=(1, 3))[4:-4, 4:-4]
    # Lanczos keeps a little more of the middle frequencies than a box does
    assert np.abs(plain - mean).max() < 0.02
    # of stripes with an amplitude of 0.15 the filter lets less than 3 % through
    assert np.abs(with_stripes - plain).max() < 0.03 * 0.15


# --- perspective ----------------------------------------------------------------------------------------------------


def test_perspective_inside_faces():
    """A tilted sheet of two triangles: straight in space needs the camera's division inside each of them."""
    page_xy = np.array([[0.0, 0], [100, 0], [100, 140], [0, 140]])
    points = np.c_[page_xy[:, 0], -0.6 * page_xy[:, 1], 0.8 * page_xy[:, 1]]
    camera = over(points, width_mm=200.0, height_mm=400.0)
    place = np.indices((900, 900))[::-1].astype(float).transpose(1, 2, 0).reshape(-1, 2)
    # where the ray of each photo pixel meets the sheet: its place on the page is what is printed there, as grey
    ray = np.c_[(place - 450) / camera.matrix[0, 0], np.ones(len(place))] @ camera.rotation
    eye = -camera.rotation.T @ camera.translation
    normal = np.array([0, 0.8, 0.6])
    hit = eye - ((eye @ normal) / (ray @ normal))[:, None] * ray
    printed = np.clip(hit[:, 2].reshape(900, 900) / 0.8 / 140, 0, 1)
    photo = grey(code_values(np.dtype(np.uint16))[np.rint(printed * 65535).astype(int)], np.uint16)
    scan = Scan(Mesh(points, np.array([[0, 2, 1], [0, 3, 2]])), photo, camera=camera)
    page = draw(scan, page_xy, (100.0, 140.0), RenderSettings(dpi=100)).page
    y_mm = (np.arange(len(page.pixels)) + 0.5) * INCH / 100
    found = linear_light(65536)[page.pixels[20:-20, 20:-20, 0]] * 140
    # 0.1 mm: a third of a photo pixel; without the division the middle is 10 mm off
    np.testing.assert_allclose(found, np.tile(y_mm[20:-20, None], found.shape[1]), atol=0.1)


# --- what the photo did not see -------------------------------------------------------------------------------------


def fold():
    """A sheet laid in a flat Z: its middle third shows its back, and covers the end of the first third."""
    page_xy, faces = grid(15, 61, 150.0, 70.0)
    u = page_xy[:, 0]
    out, back = np.clip(u, 0, 60), np.clip(u - 60, 0, 50)
    on = np.clip(u - 110, 0, None)
    x = out - 0.8 * back + on
    z = 0.6 * back
    return Mesh(np.c_[x, -page_xy[:, 1], z], faces[:, ::-1]), page_xy


@pytest.mark.parametrize("known_camera", [True, False])
def test_hidden_parts(known_camera):
    mesh, page_xy = fold()
    camera = over(mesh.points)
    scan = Scan(mesh, grey(np.full((900, 900), 240.0)), project(camera, mesh.points), camera if known_camera else None)
    known = draw(scan, page_xy, (150.0, 70.0), RenderSettings(dpi=INCH)).page.known  # a pixel a millimetre
    assert known[2:-2, 2:16].all()  # the free part of the first third: to x = 20, less what leans over it (4 mm)
    assert not known[:, 24:108].any()  # under the fold, and the back
    assert known[2:-2, 112:148].all()


def test_unknown_parts_are_in_the_colour_of_paper():
    mesh, page_xy = fold()
    camera = over(mesh.points)
    photo = np.empty((900, 900, 3), np.uint8)
    photo[:] = (240, 230, 210)
    page = draw(Scan(mesh, photo, camera=camera), page_xy, (150.0, 70.0), RenderSettings(dpi=50)).page
    assert not page.known.all()
    assert (page.pixels == [240, 230, 210]).all()


def test_sheet_beyond_the_photo():
    photo = grey(np.full((100, 120), 90.0))
    scan, page_xy = flat_scan(photo, 20.0, 10.0)  # the photo ends at 12 mm
    drawn = draw(scan, page_xy, (20.0, 10.0), RenderSettings(dpi=254))
    assert drawn.page.known[:, :120].all()
    assert not drawn.page.known[:, 121:].any()


def test_points_without_a_photo_place():
    photo_xy = lambda uv: np.where((uv == uv.max(axis=0)).all(axis=1)[:, None], np.nan, 10 * uv - 0.5)  # noqa: E731
    scan, page_xy = flat_scan(grey(np.full((100, 200), 90.0)), 20.0, 10.0, photo_xy, rows=11, cols=21)
    known = draw(scan, page_xy, (20.0, 10.0), RenderSettings(dpi=254)).page.known
    assert not known[-5:, -5:].any()
    assert known[:-20].all()
    assert known[:, :-20].all()


@pytest.mark.slow
def test_refusals():
    photo = grey(np.full((100, 200), 90.0))
    scan, page_xy = flat_scan(photo, 20.0, 10.0)
    with pytest.raises(InputError, match="no photo that could be drawn"):
        draw(Scan(scan.mesh), page_xy, (20.0, 10.0))
    with pytest.raises(InputError, match="no photo that could be drawn"):
        draw(Scan(scan.mesh, photo), page_xy, (20.0, 10.0))
    with pytest.raises(InputError, match=r"no part of the sheet falls on the photo.*200 x 100 pixels"):
        draw(replace(scan, photo_xy=scan.photo_xy + 1000), page_xy, (20.0, 10.0))
    with pytest.raises(InputError, match="printed side up"):
        draw(replace(scan, photo_xy=scan.photo_xy * [-1, 1] + [199, 0]), page_xy, (20.0, 10.0))
    with pytest.raises(InputError, match="is the scan's unit right"):
        draw(scan, page_xy * 1000, (20_000.0, 10_000.0), RenderSettings(dpi=300))


# --- kinds of photo, bands, resolution ------------------------------------------------------------------------------


def test_sixteen_bits():
    photo = np.random.default_rng(4).integers(0, 65536, (100, 200, 3), np.uint16)
    scan, page_xy = flat_scan(photo, 20.0, 10.0)
    page = draw(replace(scan, icc=b"profile"), page_xy, (20.0, 10.0), RenderSettings(dpi=254)).page
    assert page.pixels.dtype == np.uint16
    assert page.icc == b"profile"
    # light is carried in 65535 steps: near black one of them is 13 code values
    bright = photo > 10_000
    assert np.abs(page.pixels.astype(int) - photo)[bright].max() <= 2
    assert np.abs(page.pixels.astype(int) - photo).max() <= 14


def test_bands_equal_the_whole(monkeypatch):
    rng = np.random.default_rng(5)
    scan, page_xy = flat_scan(rng.integers(0, 256, (300, 200, 3), np.uint8), 20.0, 30.0)
    whole = draw(scan, page_xy, (20.0, 30.0), RenderSettings(dpi=300)).page
    monkeypatch.setattr(sys.modules["planish.render.bands"], "BAND_PIXELS", 1000)
    bands = draw(scan, page_xy, (20.0, 30.0), RenderSettings(dpi=300)).page
    assert (whole.pixels == bands.pixels).all()
    assert (whole.known == bands.known).all()


def test_resolution_of_a_squeezed_photo():
    """The photo has 10 pixels a millimetre across and 4 down: the fewer count."""
    scan, page_xy = flat_scan(grey(np.full((80, 200), 90.0)), 20.0, 20.0, lambda uv: uv * [10, 4] - 0.5)
    drawn = draw(scan, page_xy, (20.0, 20.0), RenderSettings(dpi="auto"))
    assert drawn.resolution.median_ppi == pytest.approx(4 * INCH)
    assert drawn.resolution.low_ppi == pytest.approx(4 * INCH)
    assert drawn.page.dpi == 200  # the least usual one that is 1.5 times as fine as a photo of 101.6 pixels an inch


def test_lens_distortion():
    """OpenCV's first radial term: a place at r from the middle [focal lengths] moves out by k1 r^3."""
    points = np.array([[30.0, 40, 0], [-50, 0, 0], [0, 0, 0]])
    camera = Camera(
        np.array([[500.0, 0, 320], [0, 500, 240], [0, 0, 1]]), np.eye(3), np.array([0, 0, 100.0]), (480, 640)
    )
    bent = replace(camera, distortion=np.array([0.1, 0, 0, 0, 0]))
    expected = points[:, :2] / 100 * 500 * (1 + 0.1 * 0.25 * np.array([[1], [1], [0]])) + [320, 240]
    np.testing.assert_allclose(project(bent, points), expected, atol=1e-9)
    np.testing.assert_allclose(project(camera, points), points[:, :2] * 5 + [320, 240], atol=1e-9)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_sharpening_darkens_pale_strokes_and_nothing_else(dtype):
    white = np.iinfo(dtype).max
    rows = 2100  # more than are sharpened at a time
    pixels = np.full((rows, 80, 3), white, dtype)
    pixels[:, 20:22] = 0.7 * white  # a thin stroke, pale from blur
    pixels[:, 50:] = 0.5 * white  # a grey area
    page = Page(pixels, np.ones((rows, 80), bool), 300.0)
    sharp = np.asarray(sharpened(page, 1.0, 300.0).pixels)
    assert (sharp == sharp[:1]).all()  # no seams between bands
    assert sharp[0, 20].max() < 0.5 * white
    assert (sharp[0, :10] == white).all()
    np.testing.assert_allclose(sharp[0, 65:].astype(float), 0.5 * white, atol=1)
    assert sharpened(page, 0.0, 300.0) is page


def test_sharpening_is_checked():
    with pytest.raises(UsageError, match="sharpen must be between 0 and 10"):
        RenderSettings(sharpen=-1.0)
