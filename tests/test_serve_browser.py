"""The service's page in a browser: upload, progress, results and deletion, without requests to other hosts."""

import signal

import pytest

from browser import Overheard, browser
from planish.gallery import sheet, virtual_scan
from planish.io import write_scan
from serve_process import PATIENCE, Server

pytestmark = pytest.mark.slow

WIDTHS = {"phone": (390, 844), "tablet": (768, 1024), "desk": (1440, 900)}


@pytest.fixture(scope="module")
def program():
    with browser() as found:
        yield found


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    started = Server(tmp_path_factory.mktemp("served"))
    yield started
    started.end(signal.SIGKILL)


@pytest.fixture(scope="module")
def page(program, server):
    page = program.new_page()
    page.set_default_timeout(1000 * PATIENCE)
    page.overheard = Overheard(page)
    page.goto(str(server.client.base_url))
    yield page
    page.close()


def assert_faultless(page, folder, state):
    """No accessibility violations at every width, in light and dark mode."""
    from axe_playwright_python.sync_playwright import Axe

    for width, (across, down) in WIDTHS.items():
        page.set_viewport_size({"width": across, "height": down})
        for scheme in ("light", "dark"):
            page.emulate_media(color_scheme=scheme, reduced_motion="reduce")
            page.screenshot(path=folder / f"{state}-{width}-{scheme}.png", full_page=True)
            assert page.evaluate("document.documentElement.scrollWidth <= innerWidth"), "it must not scroll sideways"
            found = Axe().run(page).response["violations"]
            serious = [fault for fault in found if fault["impact"] in ("serious", "critical")]
            assert [(fault["id"], fault["nodes"][0]["html"]) for fault in serious] == [], (state, width, scheme)


def test_a_scan_is_uploaded_followed_viewed_and_deleted(page, server, tmp_path):
    taken = virtual_scan(sheet("book", width_mm=74, height_mm=105), points=2000, photo_px=(600, 450)).scan
    write_scan(tmp_path / "scan.obj", taken)
    assert_faultless(page, tmp_path, "empty")
    page.set_input_files("#scan", [tmp_path / name for name in ("scan.obj", "scan.mtl", "scan.jpg")])
    assert page.locator("#chosen li").count() == 3
    page.click("#send")
    page.wait_for_selector("#working:visible, #done:visible")
    page.wait_for_selector("#done:visible")
    assert_faultless(page, tmp_path, "done")
    assert page.inner_text("#verdict") == "Good"
    assert "Nothing that is known" in page.inner_text("#reasons")
    assert page.evaluate("[...document.querySelectorAll('#preview img')].every(image => image.naturalWidth > 0)")
    links = page.eval_on_selector_all("#files a, #preview a", "links => links.map(link => link.href)")
    assert len(links) >= 6
    assert {page.request.get(link).status for link in links} == {200}
    page.on("dialog", lambda dialog: dialog.accept())
    page.click("#remove")
    page.wait_for_selector("#start:visible")
    assert page.request.get(links[0]).status == 404
    host = str(server.client.base_url)
    assert [url for url in page.overheard.requests if not url.startswith((host, "data:", "blob:"))] == []
    assert not page.overheard.complaints


def test_an_invalid_scan_is_reported_in_the_page(page, tmp_path):
    (tmp_path / "scan.obj").write_text("v 0 0 0\n")
    page.set_input_files("#scan", tmp_path / "scan.obj")
    page.click("#send")
    page.wait_for_selector("#failed:visible, #refused:visible")
    assert_faultless(page, tmp_path, "failed")
    assert "scan.obj" in page.inner_text("#sentence:visible, #refused:visible")


def test_photos_taken_one_by_one_under_one_name_are_kept_apart(page, server, tmp_path):
    page.goto(str(server.client.base_url))
    page.wait_for_selector("#start:visible")
    assert (page.get_attribute("#photos", "accept"), page.get_attribute("#photos", "multiple")) == ("image/*", "")
    for k in range(2):
        (tmp_path / str(k)).mkdir()
        (tmp_path / str(k) / "image.jpg").write_bytes(b"x" * (k + 1))
    for k in (0, 1, 1):  # the last one a second time
        page.set_input_files("#photos", tmp_path / str(k) / "image.jpg")
    assert page.locator("#chosen .what").all_inner_texts() == ["image.jpg", "image-2.jpg"]
