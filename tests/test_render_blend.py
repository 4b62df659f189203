"""Several photos of one sheet drawn on one page."""

import sys

import cv2
import numpy as np
import pytest

from planish.color import code_values, linear_light
from planish.errors import InputError
from planish.pipeline import restore
from planish.render import draw
from planish.settings import RenderSettings, RestoreSettings
from planish.types import Camera, Mesh, Scan, View
from shapes import grid

pytestmark = pytest.mark.slow

WIDTH, HEIGHT = 120.0, 80.0
DPI = 127.0  # 5 pixels a millimetre


def camera(tilt_deg=0.0, turn_deg=0.0, px=(500, 700), aside_mm=0.0, distance_mm=400.0, focal=2000.0):
    """Over the middle of the sheet, which lies in z = 0 with y up, tilted to its right; 5 px a mm at tilt 0."""
    tilt, turn = np.radians([tilt_deg, turn_deg])
    look = np.diag([1.0, -1, -1])
    lean = np.array([[np.cos(tilt), 0, np.sin(tilt)], [0, 1, 0], [-np.sin(tilt), 0, np.cos(tilt)]])
    around = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    rotation = around @ look @ lean
    eye = np.array([WIDTH / 2 + aside_mm, -HEIGHT / 2, 0]) - distance_mm * rotation[2]
    matrix = np.array([[focal, 0, px[1] / 2 - 0.5], [0, focal, px[0] / 2 - 0.5], [0, 0, 1]])
    return Camera(matrix, rotation, -rotation @ eye, px)


def printed(seed=0):
    """Light of a print with detail of all sizes, 20 pixels a millimetre."""
    rng = np.random.default_rng(seed)
    rows, cols = round(20 * HEIGHT), round(20 * WIDTH)
    light = np.full((rows, cols), 0.6, np.float32)
    for size in (8, 24, 80):
        noise = cv2.GaussianBlur(rng.standard_normal((rows, cols)).astype(np.float32), (0, 0), size)
        light += 0.08 * noise / noise.std()
    return np.clip(light, 0.1, 0.9)


def photographed(light, seen_from, gain=(1.0, 1.0, 1.0), dtype=np.uint8, blur=0.0):
    """Photo of the flat sheet: the print through the homography of its plane."""
    to_space = np.array([[1 / 20, 0, 0.025], [0, -1 / 20, -0.025], [0, 0, 0], [0, 0, 1]])
    onto = seen_from.matrix @ np.c_[seen_from.rotation, seen_from.translation] @ to_space
    rows, cols = seen_from.shape_rc
    fine = 4  # samples across a photo pixel
    scale = np.array([[fine, 0, (fine - 1) / 2], [0, fine, (fine - 1) / 2], [0, 0, 1]])
    seen = cv2.warpPerspective(light, scale @ onto, (cols * fine, rows * fine), flags=cv2.INTER_LINEAR)
    seen = seen.reshape(rows, fine, cols, fine).mean(axis=(1, 3))
    if blur:
        seen = cv2.GaussianBlur(seen, (0, 0), blur)
    codes = code_values(np.dtype(dtype))
    return np.stack([codes[np.rint(np.clip(seen * g, 0, 1) * 65535).astype(int)] for g in gain], axis=-1)


def flat_sheet():
    page_xy, faces = grid(17, 25, WIDTH, HEIGHT)
    return Mesh(np.c_[page_xy * [1, -1], 0 * page_xy[:, 0]], faces[:, ::-1]), page_xy


def drawn(photos, cameras, **kw):
    mesh, page_xy = flat_sheet()
    others = tuple(View(photo, seen_from) for photo, seen_from in zip(photos[1:], cameras[1:], strict=True))
    scan = Scan(mesh, photos[0], camera=cameras[0], others=others)
    return draw(scan, page_xy, (WIDTH, HEIGHT), RenderSettings(dpi=DPI, **kw))


def light_of(page):
    return linear_light(np.iinfo(page.pixels.dtype).max + 1)[page.pixels]


def truth(light):
    """The print in the page's pixels."""
    rows, cols = round(HEIGHT * DPI / 25.4), round(WIDTH * DPI / 25.4)
    return light.reshape(rows, 4, cols, 4).mean(axis=(1, 3))


def test_what_one_photo_does_not_show_comes_from_the_other():
    """The first photo ends at 2 / 3 of the sheet, the second begins at 1 / 3, and is darker and bluer."""
    light, first, second = printed(), camera(px=(500, 440), aside_mm=-36.0), camera(px=(500, 440), aside_mm=36.0)
    photos = [photographed(light, first), photographed(light, second, (0.7, 0.75, 0.8))]
    done = drawn(photos, [first, second])
    assert done.page.known.all()
    assert done.parts == pytest.approx((0.5, 0.5), abs=0.2)
    off = light_of(done.page)[3:-3, 3:-3] / truth(light)[3:-3, 3:-3, None] - 1
    # a code value is up to 1 % of the light, and what the darker photo's rounding adds; unmatched it would be 20 %
    assert np.abs(off.mean(axis=(0, 1))).max() < 0.003
    assert np.sqrt((off**2).mean()) < 0.015
    assert np.abs(np.diff(cv2.blur(off[..., 1], (9, 41))[:, 200:400], axis=1)).max() < 0.003  # no step at the seam


def test_the_page_keeps_the_exposure_of_the_first_photo():
    light, above = printed(), camera()
    done = drawn(
        [photographed(light, above, (0.8,) * 3), photographed(light, camera(turn_deg=3))], [above, camera(turn_deg=3)]
    )
    assert light_of(done.page).mean() == pytest.approx(0.8 * light.mean(), rel=0.005)


def test_the_steeper_photo_is_left_aside():
    """One camera looks straight down, the other from 50 degrees: no pixel is softer than the first alone has it."""
    light, above, aside = printed(), camera(), camera(tilt_deg=50.0)
    photos = [photographed(light, aside), photographed(light, above)]
    both, alone = drawn(photos, [aside, above]), drawn(photos[1:], [above])
    assert both.parts[1] > 0.95
    difference = light_of(both.page)[30:-30, 30:-30] - light_of(alone.page)[30:-30, 30:-30]
    assert np.abs(difference - difference.mean()).max() < 0.02  # two code values: gains are fitted
    assert both.resolution.median_ppi == pytest.approx(alone.resolution.median_ppi, rel=1e-3)


def test_of_equal_photos_the_sharper_one_is_taken_wherever_it_is():
    """Each of two photos is out of focus on another half of the sheet."""
    light, seen_from = printed(), camera()
    sharp, soft = photographed(light, seen_from), photographed(light, seen_from, blur=2.0)
    middle = seen_from.shape_rc[1] // 2
    left, right = sharp.copy(), sharp.copy()
    left[:, middle:], right[:, :middle] = soft[:, middle:], soft[:, :middle]
    alone = light_of(drawn([sharp], [seen_from]).page)
    away = np.r_[10:270, 330:590]  # 6 mm beside the change, which is not sharp itself
    for pair in ((left, right), (right, left)):
        page = light_of(drawn(pair, [seen_from] * 2).page)
        off = np.abs(page - alone)[10:-10, away]
        assert off.max() < 0.01  # a code value, as gains are fitted; the softer one is off by up to 0.1


def test_hidden_parts_are_filled():
    """A sheet laid in a Z: what is under the fold from one side is free from the other."""
    page_xy, faces = grid(15, 61, 150.0, 70.0)
    u = page_xy[:, 0]
    out, back, on = np.clip(u, 0, 60), np.clip(u - 60, 0, 30), np.clip(u - 90, 0, None)
    mesh = Mesh(np.c_[out + 0.2 * back + on, -page_xy[:, 1], 0.9 * back - 0.6 * on], faces[:, ::-1])
    photos, cameras = [], []
    for side in (-1, 1):
        look = np.array([-side * 0.75, 0, -0.66])
        right = np.array([0.66, 0, -side * 0.75])
        rotation = np.stack([right, np.cross(look, right), look])
        rotation /= np.linalg.norm(rotation, axis=1, keepdims=True)
        eye = mesh.points.mean(axis=0) - 500 * rotation[2]
        cameras.append(
            Camera(np.array([[1500.0, 0, 300], [0, 1500, 300], [0, 0, 1]]), rotation, -rotation @ eye, (600, 600))
        )
        photos.append(np.full((600, 600, 3), 240 if side < 0 else 200, np.uint8))
    settings = RenderSettings(dpi=50)
    alone = [
        draw(Scan(mesh, p, camera=c), page_xy, (150.0, 70.0), settings).page
        for p, c in zip(photos, cameras, strict=True)
    ]
    assert not any(page.known.all() for page in alone)
    scan = Scan(mesh, photos[0], camera=cameras[0], others=(View(photos[1], cameras[1]),))
    page = draw(scan, page_xy, (150.0, 70.0), settings).page
    assert (page.known == (alone[0].known | alone[1].known)).all()
    assert np.abs(page.pixels[page.known].astype(int) - 240).max() <= 1


def test_order_of_further_photos_and_bands_do_not_matter(monkeypatch):
    light = printed()
    cameras = [camera(), camera(30.0), camera(-30.0, 10.0)]
    photos = [photographed(light, c, blur=b) for c, b in zip(cameras, (1.5, 0.0, 0.0), strict=True)]
    first = drawn(photos, cameras)
    monkeypatch.setattr(sys.modules["planish.render.bands"], "BAND_PIXELS", 30_000)
    second = drawn([photos[i] for i in (0, 2, 1)], [cameras[i] for i in (0, 2, 1)])
    assert first.parts == (second.parts[0], second.parts[2], second.parts[1])
    assert np.abs(first.page.pixels.astype(int) - second.page.pixels).max() <= 1  # sums in another order


def test_sixteen_bits_beside_eight():
    light, above = printed(), camera(px=(500, 440), aside_mm=-36.0)
    other = camera(px=(500, 440), aside_mm=36.0)
    done = drawn([photographed(light, above), photographed(light, other, dtype=np.uint16)], [above, other])
    assert done.page.pixels.dtype == np.uint16
    assert done.page.known.all()
    off = light_of(done.page)[3:-3, 3:-3] - truth(light)[3:-3, 3:-3, None]
    assert np.sqrt((off**2).mean()) < 0.01


def test_a_photo_of_something_else_is_named():
    light, above = printed(), camera()
    with pytest.raises(InputError, match="no part of the sheet falls on photo 2 of 2"):
        drawn([photographed(light, above)] * 2, [above, camera(aside_mm=900.0)])


def test_the_whole_walk_carries_all_photos():
    light, first, second = printed(), camera(px=(500, 440), aside_mm=-36.0), camera(px=(500, 440), aside_mm=36.0)
    mesh, _ = flat_sheet()
    loose = Mesh(np.r_[mesh.points, [[0.0, 0, 50]]], mesh.faces)  # a point of no face, which cleaning takes out
    scan = Scan(loose, photographed(light, first), camera=first, others=(View(photographed(light, second), second),))
    report = restore(scan, RestoreSettings(render=RenderSettings(dpi=DPI))).report
    assert report.page.known_fraction > 0.99
    assert report.page.photo_parts == pytest.approx([0.5, 0.5], abs=0.2)
    alone = restore(Scan(loose, scan.photo, camera=first), RestoreSettings(render=RenderSettings(dpi=DPI))).report
    assert alone.page.known_fraction < 0.8
    assert alone.page.photo_parts == [1.0]


def test_points_behind_a_camera_are_not_on_its_photo():
    """A camera that stands low over the sheet's left end and looks along it to the right."""
    mesh, page_xy = flat_sheet()
    rotation = np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])
    eye = np.array([40.0, -HEIGHT / 2, 20.0])
    low = Camera(np.array([[300.0, 0, 400], [0, 300, 300], [0, 0, 1]]), rotation, -rotation @ eye, (600, 800))
    page = draw(Scan(mesh, np.full((600, 800, 3), 90, np.uint8), camera=low), page_xy, (WIDTH, HEIGHT)).page
    behind = round(40 / 25.4 * 300)
    assert not page.known[:, :behind].any()
    assert page.known[:, -200:].any()
