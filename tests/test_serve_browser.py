"""The service's page in a browser: from the first upload to a page, at three widths, by pointer and keyboard."""

import re
import signal

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import expect

from browser import Overheard, browser
from planish.gallery import sheet, virtual_scan
from planish.io import read_scan, write_scan
from planish.web.outline import read_cut
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
    page.wait_for_selector("#limits:not(:empty)")  # the program of the page has begun
    yield page
    page.close()


@pytest.fixture(scope="module")
def scan(tmp_path_factory):
    """The folder of a small scan with its photo."""
    folder = tmp_path_factory.mktemp("scan")
    taken = virtual_scan(sheet("book", width_mm=74, height_mm=105), points=2000, photo_px=(600, 450)).scan
    write_scan(folder / "my book.obj", taken)
    return folder


def assert_faultless(page, folder, state):
    """No accessibility violations at every width, on a phone in dark mode too."""
    from axe_playwright_python.sync_playwright import Axe

    for width, (across, down) in WIDTHS.items():
        page.set_viewport_size({"width": across, "height": down})
        for scheme in ("light", "dark") if width == "phone" else ("light",):
            page.emulate_media(color_scheme=scheme, reduced_motion="reduce")
            page.screenshot(path=folder / f"{state}-{width}-{scheme}.png", full_page=True)
            assert page.evaluate("document.documentElement.scrollWidth <= innerWidth"), "it must not scroll sideways"
            found = Axe().run(page).response["violations"]
            serious = [fault for fault in found if fault["impact"] in ("serious", "critical")]
            assert [(fault["id"], fault["nodes"][0]["html"]) for fault in serious] == [], (state, width, scheme)


def test_from_the_first_file_to_a_page_and_back(page, server, scan, tmp_path):
    asks_for_what_is_missing(page, scan, tmp_path)
    takes_an_outline(page, tmp_path)
    restores_shows_and_lists(page, tmp_path)
    deletes(page, server)


def asks_for_what_is_missing(page, scan, tmp_path):
    assert_faultless(page, tmp_path, "empty")
    page.set_input_files("#scan", scan / "my book.obj")
    page.wait_for_selector("text=my book.obj needs its material file my book.mtl.")
    page.click("#send")
    assert page.inner_text("#refused") == "my book.obj needs its material file my book.mtl."
    assert page.evaluate("document.activeElement.id") == "add"
    assert_faultless(page, tmp_path, "missing")
    page.set_input_files("#scan", scan / "my book.mtl")
    page.wait_for_selector("text=my book.obj needs its photo my book.jpg.")
    page.set_input_files("#scan", scan / "my book.jpg")
    page.wait_for_selector("text=A scan with its photo.")
    assert page.is_hidden("#missing")
    assert page.locator("#chosen li").count() == 3


def drawn(page):
    """Wait until the photo to draw on is there; by its property, since the page's policy forbids code from text."""
    expect(page.locator("#mark-photo")).not_to_have_js_property("naturalWidth", 0)


def takes_an_outline(page, tmp_path):
    """Drawn by pointer and by keyboard."""
    page.click("#draw")
    drawn(page)
    assert_faultless(page, tmp_path, "outline")
    corners = page.locator(".corner")
    before = corners.nth(0).bounding_box()
    page.mouse.move(before["x"] + before["width"] / 2, before["y"] + before["height"] / 2)
    page.mouse.down()
    page.mouse.move(before["x"] + before["width"] / 2 - 15, before["y"] + before["height"] / 2 - 10)
    page.mouse.up()
    after = corners.nth(0).bounding_box()
    assert (after["x"] - before["x"], after["y"] - before["y"]) == pytest.approx((-15, -10), abs=1)
    place = corners.nth(1).get_attribute("style")
    corners.nth(1).focus()
    page.keyboard.press("ArrowRight")
    assert corners.nth(1).get_attribute("style") != place
    page.click("#mark-more")
    assert corners.count() == 5
    page.keyboard.press("Delete")  # the new one has the focus
    assert corners.count() == 4
    page.click("#mark-done")
    assert "4 corners" in page.inner_text("#drawn")


def restores_shows_and_lists(page, tmp_path):
    page.click("#send")
    page.wait_for_selector("#working:visible, #done:visible")
    page.wait_for_selector("#done:visible")
    assert_faultless(page, tmp_path, "done")
    assert page.inner_text("#verdict") == "Look at it"  # the outline cuts off an eighth of the page
    assert re.search("outline .* no edge of a sheet", page.inner_text("#reasons"))
    assert "outside of the mask of the sheet" in page.inner_text("#warnings")
    assert not re.search(r"--[a-z]|the field |sticks", page.inner_text("#done"))
    assert page.evaluate("[...document.querySelectorAll('#preview img')].every(image => image.naturalWidth > 0)")
    links = page.eval_on_selector_all("#files a, #preview a", "links => links.map(link => link.href)")
    assert len(links) >= 6
    answers = [page.request.get(link) for link in links]
    assert {answer.status for answer in answers} == {200}
    assert all("my-book" in answer.headers["content-disposition"] for answer in answers)
    page.click(".another")
    page.wait_for_selector("#recent:visible >> text=my book.obj")
    assert page.inner_text("#recent .badge") == "look at it"
    assert page.locator("#chosen li").count() == 0
    page.click("#recent a")
    page.wait_for_selector("#done:visible")


def deletes(page, server):
    link = page.get_attribute("#files a", "href")
    page.click("#remove")
    page.wait_for_selector("#start:visible")
    assert page.request.get(f"{server.client.base_url}{link.lstrip('/')}").status == 404
    assert page.is_hidden("#recent")
    host = str(server.client.base_url)
    assert [url for url in page.overheard.requests if not url.startswith((host, "data:", "blob:"))] == []
    assert not page.overheard.complaints


def test_one_photo_and_several_are_told_what_they_need(page, tmp_path):
    for k in range(3):
        Image.new("RGB", (60, 40), (200, 200, 190 + k)).save(tmp_path / f"{k}.png")
    page.set_input_files("#photos", tmp_path / "0.png")
    page.wait_for_selector("text=One photo: ")
    assert page.is_visible("select[name=paper]")
    assert page.is_hidden("input[name=marker-mm]")
    assert_faultless(page, tmp_path, "photo")
    page.set_input_files("#photos", [tmp_path / "1.png", tmp_path / "2.png"])
    page.wait_for_selector("text=3 photos of one sheet")
    assert page.is_hidden("#draw")
    page.select_option("select[name=paper]", "a4")
    page.click("#measure")
    drawn(page)
    page.select_option("#mark-which select", "1")
    page.click("#mark-done")
    assert "millimetres" in page.inner_text("#mark-problem")
    page.fill("#mark-distance input", "120")
    assert_faultless(page, tmp_path, "distance")
    page.click("#mark-done")
    assert page.inner_text("#measured") == "120 mm, on 1.png"
    assert page.input_value("select[name=paper]") == "unknown"  # one answer is enough
    page.reload()
    page.wait_for_selector("#limits:not(:empty)")


def test_an_outline_is_of_the_pixels_that_the_program_reads(page, tmp_path):
    """Of a scan as they are stored, which its texture coordinates are of; of a photo upright."""
    image = Image.new("RGB", (60, 40))
    turned = image.getexif()
    turned[0x0112] = 6  # a quarter turn
    image.save(tmp_path / "photo.jpg", exif=turned)
    (tmp_path / "scan.obj").write_text("mtllib scan.mtl\nv 0 0 0\n")
    (tmp_path / "scan.mtl").write_text("newmtl a\nmap_Kd photo.jpg\n")
    sent = []
    page.route("**/api/jobs", lambda route: (sent.append(route.request.post_data_buffer), route.abort()))
    for files in (["photo.jpg"], ["scan.obj", "scan.mtl", "photo.jpg"]):
        page.set_input_files("#scan", [tmp_path / name for name in files])
        page.wait_for_selector("#draw:visible")
        page.click("#draw")
        drawn(page)
        page.click("#mark-done")
        page.click("#send")
        page.wait_for_selector("#refused:visible")
        page.reload()
        page.wait_for_selector("#limits:not(:empty)")
    page.unroute("**/api/jobs")
    assert [re.search(rb"\d+x\d+ ", body)[0] for body in sent] == [b"40x60 ", b"60x40 "]


def test_a_scan_is_turned_and_cut(page, scan, tmp_path):
    """On a phone, by touch: its points are turned, the outline is drawn on what is seen, and both are sent."""
    page.set_input_files("#scan", [scan / f"my book.{suffix}" for suffix in ("obj", "mtl", "jpg")])
    page.wait_for_selector("#cut:visible")
    page.set_viewport_size({"width": 390, "height": 844})
    page.click("#cut")
    page.wait_for_selector("#turn[open]")
    shown = (
        "document.getElementById('turn-view').getContext('2d').getImageData(0, 0, 1000, 800).data.filter(v => v).length"
    )
    looks = [page.evaluate(shown)]
    box = page.locator("#turn-view").bounding_box()
    middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    for kind, x, y in (("pointerdown", 0, 0), ("pointermove", 0, -90), ("pointerup", 0, -90)):
        at = {"clientX": middle[0] + x, "clientY": middle[1] + y, "pointerId": 1, "pointerType": "touch"}
        page.dispatch_event("#turn-view", kind, at)
    page.wait_for_timeout(100)  # a frame
    looks.append(page.evaluate(shown))
    assert 0 < looks[1] < 0.9 * looks[0]  # tilted, less of it is seen
    assert_faultless(page, tmp_path, "turn")
    page.click("[data-from=above]")
    page.click("#turn-done")
    drawn(page)
    page.click("#mark-done")
    page.wait_for_selector("text=The sheet has an outline of 4 corners")
    sent = []
    page.route("**/api/jobs", lambda route: (sent.append(route.request.post_data_buffer), route.abort()))
    page.click("#send")
    page.wait_for_selector("#refused:visible")
    page.unroute("**/api/jobs")
    page.reload()
    page.wait_for_selector("#limits:not(:empty)")
    cut = read_cut(re.search(rb'name="cut"\r\n\r\n([^\r]+)', sent[0])[1].decode())
    mask, view = cut.mask_and_view()
    mesh = read_scan(scan / "my book.obj").scan.mesh
    col, row = np.rint(mesh.points @ view[:, :3].T + view[:, 3]).astype(int).T
    assert mask[row, col].all()  # the outline that it begins with is around the whole sheet ...
    assert 400 < max(np.ptp(col), np.ptp(row)) < 800  # ... which fills the view


def test_a_scan_that_fails_keeps_the_chosen_files_for_another_try(page, tmp_path):
    (tmp_path / "scan.obj").write_text("v 0 0 0 1 0 0\n")
    page.set_input_files("#scan", tmp_path / "scan.obj")
    page.wait_for_selector("#chosen li")
    page.click("#send")
    page.wait_for_selector("#failed:visible, #refused:visible")
    assert_faultless(page, tmp_path, "failed")
    assert "scan.obj" in page.inner_text("#sentence:visible, #refused:visible")
    if page.is_visible("#failed"):
        page.click("#failed .again")
    page.wait_for_selector("#start:visible")
    assert page.locator("#chosen .what").all_inner_texts() == ["scan.obj"]


def test_photos_taken_one_by_one_under_one_name_are_kept_apart(page, server, tmp_path):
    page.goto(str(server.client.base_url))
    page.reload()
    page.wait_for_selector("#limits:not(:empty)")
    assert (page.get_attribute("#photos", "accept"), page.get_attribute("#photos", "multiple")) == ("image/*", "")
    for k in range(2):
        (tmp_path / str(k)).mkdir()
        (tmp_path / str(k) / "image.jpg").write_bytes(b"x" * (k + 1))
    for k in (0, 1, 1):  # the last one a second time
        page.set_input_files("#photos", tmp_path / str(k) / "image.jpg")
    assert page.locator("#chosen .what").all_inner_texts() == ["image.jpg", "image-2.jpg"]


def test_the_first_start_says_that_it_prepares(page, server):
    def cold(route):
        answer = route.fetch()
        route.fulfill(response=answer, json={**answer.json(), "warm": False})

    page.route("**/api/health", cold)
    page.reload()
    page.wait_for_selector("#preparing:visible")
    page.unroute("**/api/health")
    page.wait_for_selector("#preparing", state="hidden")
