"""The HTML view in a browser, at three widths, in light and dark mode."""

import re
from contextlib import contextmanager
from io import BytesIO
from itertools import pairwise

import numpy as np
import pytest
from PIL import Image

import planish
from browser import Overheard, browser
from planish.gallery import sheet, virtual_scan
from planish.view import view_page

pytestmark = pytest.mark.slow

WIDTHS = {"phone": (390, 844), "tablet": (768, 1024), "desk": (1440, 900)}
READY = ":root[data-ready]"


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """View of a page of a book, with as many points and pixels as for a large scan."""
    scan = virtual_scan(sheet("book"), points=25_000, photo_px=(1600, 1200), noise_mm=0.05).scan
    path = tmp_path_factory.mktemp("view") / "book.html"
    path.write_bytes(view_page(planish.restore(scan), "A book"))
    return path


@pytest.fixture(scope="module")
def program():
    with browser() as found:
        yield found


@contextmanager
def opened(program, path, width="desk", **how):
    across, down = WIDTHS[width]
    context = program.new_context(viewport={"width": across, "height": down}, **how)
    page = context.new_page()
    page.overheard = Overheard(page)
    page.goto(path.as_uri())
    page.wait_for_selector(READY)
    yield page
    context.close()


def screenshot(page, selector):
    """Screenshot of an element."""
    shot = page.locator(selector).screenshot()
    return np.asarray(Image.open(BytesIO(shot)).convert("RGB")).astype(float)


def changed(before, after):
    """Fraction of pixels with a clearly different colour."""
    return float((np.abs(before - after).max(axis=2) > 24).mean())


def set_slider(page, selector, value):
    page.locator(selector).fill(str(value))
    page.wait_for_timeout(150)  # two frames


@pytest.fixture(scope="module", params=WIDTHS)
def page(program, made, request):
    """The page, open at one of the widths."""
    with opened(program, made, request.param) as page:
        page.width = request.param
        yield page


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_it_makes_no_requests_and_has_no_serious_accessibility_violation(page, tmp_path, scheme):
    from axe_playwright_python.sync_playwright import Axe

    page.emulate_media(color_scheme=scheme)
    page.screenshot(path=tmp_path / f"{page.width}-{scheme}.png", full_page=True)
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth"), "it must not scroll sideways"
    found = Axe().run(page).response["violations"]
    serious = [fault for fault in found if fault["impact"] in ("serious", "critical")]
    assert [(fault["id"], fault["nodes"][0]["html"]) for fault in serious] == []
    assert not page.overheard.complaints
    assert {url.partition(":")[0] for url in page.overheard.requests} <= {"file", "data"}


def test_the_slider_animates_the_sheet(program, made):
    with opened(program, made) as page:
        slider = page.locator("#step")
        last = int(slider.get_attribute("max"))
        bent = screenshot(page, "#space")
        assert slider.get_attribute("aria-valuetext").startswith(f"step 0 of {last}, 2")  # about 24 mm high
        set_slider(page, "#step", last // 2)
        falling = screenshot(page, "#space")
        set_slider(page, "#step", last)
        flat = screenshot(page, "#space")
        assert slider.get_attribute("aria-valuetext") == f"step {last} of {last}, 0.0 mm high"
        assert min(changed(bent, falling), changed(bent, flat)) > 0.01  # the sheet moves by centimetres
        slider.press("Home")
        page.wait_for_timeout(150)
        assert changed(bent, screenshot(page, "#space")) < 0.001


@pytest.mark.parametrize("motion", ["no-preference", "reduce"])
def test_the_button_plays_the_animation(program, made, motion):
    with opened(program, made, reduced_motion=motion) as page:
        page.clock.install()  # a machine without a graphics card may need a second for each picture
        page.locator("#play").press("Enter")
        assert page.locator("#play").inner_text() == "Pause"
        page.clock.fast_forward("00:05")
        page.wait_for_selector("#play:text-is('Replay')")
        assert page.locator("#step").input_value() == page.locator("#step").get_attribute("max")


def test_the_wipe_separates_two_images(program, made):
    with opened(program, made) as page:
        shots = {}
        for share in (0, 50, 100):
            set_slider(page, "#wipe", share)
            shots[share] = screenshot(page, "#paper")
        half = shots[50].shape[1] // 2 - 30  # clear of the handle
        assert changed(shots[0], shots[100]) > 0.2  # the photo is dark and bent, the page white
        assert changed(shots[50][:, :half], shots[100][:, :half]) < 0.001
        assert changed(shots[50][:, -half:], shots[0][:, -half:]) < 0.001


def test_every_layer_can_be_shown(program, made):
    with opened(program, made) as page:
        seen = []
        for name in ("warped", "restored", "unshaded", "binary", "strain", "ppi", "error"):
            page.select_option("#left", name)
            page.select_option("#right", name)
            page.wait_for_timeout(150)
            assert page.locator("#paper .shown").count() == 1
            assert page.locator("#page-legend .legend").count() == (name in ("strain", "ppi", "error"))
            seen.append(screenshot(page, "#paper"))
        assert all(changed(one, other) > 0.01 for one, other in pairwise(seen))


def test_the_mouse_wipes_zooms_and_reads_millimetres(program, made):
    with opened(program, made) as page:
        box = page.locator("#window").bounding_box()
        middle, height = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        page.mouse.move(middle, height)
        reading = page.locator("#reading")
        read = re.match(
            r"(.+) mm from the left, (.+) mm from the top · strain .+ % · effective ppi", reading.inner_text()
        )
        # The middle of a page of 215.9 x 279.4 mm; a pixel of the screen is half a millimetre.
        assert [float(mm) for mm in read.groups()] == pytest.approx([107.95, 139.7], abs=0.5)
        page.mouse.down()
        page.mouse.move(box["x"] + box["width"] / 4, height, steps=4)
        page.mouse.up()
        assert page.locator("#wipe").input_value() == "25"
        page.locator("#window").focus()
        wide = page.locator("#paper").bounding_box()["width"]
        page.mouse.wheel(0, -300)  # e times as large
        page.wait_for_timeout(150)
        assert page.locator("#paper").bounding_box()["width"] == pytest.approx(np.e * wide, rel=0.01)
        page.keyboard.press("0")
        assert page.locator("#paper").bounding_box()["width"] == pytest.approx(wide)


def test_the_theme_switch_overrides_the_system(program, made):
    with opened(program, made, color_scheme="dark") as page:
        dark = screenshot(page, "header").mean()
        page.select_option("#theme", "light")
        assert screenshot(page, "header").mean() > dark + 100


def test_without_javascript_the_page_is_readable(program, made):
    context = program.new_context(java_script_enabled=False)
    page = context.new_page()
    page.goto(made.as_uri())
    page.wait_for_timeout(150)
    assert page.locator("#picture-unshaded").is_visible()
    assert page.locator("#report").is_visible()
    assert not page.locator("#play").is_visible()
    context.close()


def test_a_hostile_name_is_escaped(program, tmp_path):
    """As a scan without a photo, to see that as well."""
    mesh, _ = planish.gallery.sheet_mesh(sheet("wave"), points=900, layout="grid")
    scan = planish.Scan(mesh)
    name = "</title></script><script>document.title='taken'</script><img src=x onerror=\"document.title='taken'\">"
    path = tmp_path / "page.html"
    path.write_bytes(view_page(planish.restore(scan), name))
    with opened(program, path) as page:
        assert page.title().startswith(name)
        assert page.locator("h1").inner_text() == name
        assert not page.overheard.complaints
        assert page.locator("#surface option").all_inner_texts() == ["Strain", "Expected error", "Plain"]
