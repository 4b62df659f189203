"""Text that reads backwards is told, and text that does not never is."""

from dataclasses import replace

import numpy as np
import pytest

import planish
from planish.document import reads_backwards
from planish.gallery import sheet, typeset_page, virtual_scan
from planish.settings import RenderSettings, RestoreSettings
from planish.types import Page

PAGE = typeset_page(216, 279, dpi=150)[0]


def turned(page, quarter, mirrored=False):
    pixels = page.pixels[:, ::-1] if mirrored else page.pixels
    return Page(np.rot90(pixels, quarter), np.rot90(page.known, quarter), page.dpi)


@pytest.mark.parametrize("dpi", [60, 150, 200])
def test_a_mirrored_page_is_known_at_any_resolution(dpi):
    page, _ = typeset_page(216, 279, dpi=dpi)
    assert not reads_backwards(page)
    assert reads_backwards(turned(page, 0, mirrored=True))


def test_a_page_upside_down_is_not_mirrored():
    assert not reads_backwards(turned(PAGE, 2))
    assert reads_backwards(turned(PAGE, 2, mirrored=True))


def test_pages_without_much_text_say_nothing():
    blank = Page(np.full((400, 300), 240, np.uint8), np.ones((400, 300), bool), 72.0)
    picture = np.random.default_rng(0).integers(0, 255, (400, 300), np.uint8)
    assert not reads_backwards(blank)
    assert not reads_backwards(Page(picture, blank.known, 72.0))


def test_lines_flush_on_both_sides_and_centred_lines_say_nothing():
    pixels = np.full((900, 600), 255, np.uint8)
    for k in range(20):
        pixels[40 * k + 20 : 40 * k + 32, 60:540] = 0  # bars, no letters
    assert not reads_backwards(Page(pixels, np.ones(pixels.shape, bool), 75.0))


@pytest.mark.slow
def test_a_scan_with_a_mirrored_photo_is_told():
    scan = virtual_scan(sheet("book"), points=4000, photo_px=(1600, 1200)).scan
    settings = RestoreSettings(render=RenderSettings(dpi=150))
    points = scan.mesh.points * [-1, 1, 1]
    mirrored = replace(
        scan,
        mesh=planish.Mesh(points, scan.mesh.faces[:, ::-1]),
        photo=scan.photo[:, ::-1],
        photo_xy=planish.geometry.project(scan.camera, scan.mesh.points) * [-1, 1] + [scan.photo.shape[1] - 1, 0],
        camera=None,
    )
    codes = [[w.code for w in planish.restore(one, settings).report.warnings] for one in (scan, mirrored)]
    assert "text-mirrored" not in codes[0]
    assert "text-mirrored" in codes[1]
