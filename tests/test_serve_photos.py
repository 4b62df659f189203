"""Photos of a sheet sent to the service: measured, restored, and the same said as by `planish photo`."""

import json
import signal

import numpy as np
import pytest
from PIL import Image

from planish.cli.acquire.virtual_photos import phone_jpeg
from planish.errors import UsageError
from planish.gallery import photo_shoot, sheet, typeset_page, virtual_scan
from planish.job import photo_sheet
from planish.job.photo_sheet import PhotographedSheet
from planish.settings import BinarizeSettings, PhotoSettings, RenderSettings, RestoreSettings
from planish.web.outline import read_outline
from planish.web.restore_photos import restore_photos
from planish.web.upload_request import UploadRequest
from serve_process import PATIENCE, Server

pytestmark = pytest.mark.slow

CARD_MM = 25.0


@pytest.fixture(scope="module")
def photos(tmp_path_factory):
    """Five small photos of a small folded letter, and one of something else."""
    folder = tmp_path_factory.mktemp("photos")
    bent = sheet("letter", width_mm=105, height_mm=148)
    page, _ = typeset_page(105, 148, 300, point_size=8)
    size = {"photo_px": (1200, 900), "distance_mm": 250.0, "card_mm": CARD_MM}
    shoot = photo_shoot(bent, page, 5, rng=2, other_subjects=1, **size)
    paths = [folder / f"IMG_{k}.jpg" for k in range(len(shoot.photos))]
    for path, photo in zip(paths, shoot.photos, strict=True):
        path.write_bytes(phone_jpeg(photo))
    return paths, [path.name for path, useful in zip(paths, shoot.useful, strict=True) if not useful]


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    started = Server(tmp_path_factory.mktemp("served"))
    yield started
    if started.process.poll() is None:
        started.end(signal.SIGKILL)


def test_photos_become_a_page_of_true_size(server, photos, tmp_path):
    paths, useless = photos
    told = list(
        server.events(
            server.send(paths, **{"marker-mm": f"{CARD_MM:g}", "formats": "png", "dpi": "200", "view": "true"})
        )
    )
    assert told[-1]["state"] == "done", told[-1]["sentence"]
    assert told[-1]["title"] == f"{len(paths)} photos"
    stages = list(dict.fromkeys(state["stage"] for state in told if state["stage"]))
    assert stages[0] == "photos"
    assert any("left out" in sentence and useless[0] in sentence for sentence in told[-1]["warnings"])
    files = {file["name"]: server.client.get(file["href"]).content for file in told[-1]["files"]}
    assert {"page.png", "page-bw.png", "report.json", "view.html", "preview.jpg"} <= set(files)
    report = json.loads(files["report.json"])
    assert report["photos"]["used"] == 5
    assert report["photos"]["scale"] == "marker"
    sides = report["page"]["width_mm"], report["page"]["height_mm"]
    assert sides == pytest.approx((105, 148), rel=0.01)  # 1 MP: a pixel is 0.2 mm, and each border is a pixel unsure
    (tmp_path / "page.png").write_bytes(files["page.png"])
    with Image.open(tmp_path / "page.png") as page:
        assert page.info["dpi"][0] == pytest.approx(200, abs=0.1)


def test_without_a_size_no_dpi_is_claimed(tmp_path, monkeypatch):
    """The shape is a scan's, since measuring photos once more takes half a minute."""
    scan = virtual_scan(sheet("letter"), points=2000, photo_px=(400, 300)).scan
    found = PhotographedSheet(scan, False, {}, lambda restoration: restoration.report)
    monkeypatch.setattr(photo_sheet, "shape_of_several", lambda *_: found)
    photos, view, formats = ("a.jpg", "b.jpg"), False, ("png",)
    request = UploadRequest(
        scan="",
        photo=photos,
        camera=(),
        size=PhotoSettings(),
        settings=RestoreSettings(),
        units="mm",
        view=view,
        formats=formats,
    )
    restore_photos(tmp_path, request, lambda stage, share: None)
    for name in ("page.png", "page-bw.png"):
        with Image.open(tmp_path / name) as image:
            assert "dpi" not in image.info


def test_of_one_photo_the_outline_is_kept_and_facing_pages_are_numbered(tmp_path, monkeypatch):
    scan = virtual_scan(sheet("letter"), points=2000, photo_px=(400, 300)).scan
    asked = []

    def shapes(file, settings, progress, outline):
        asked.append((file.name, settings.pages, settings.paper, outline.shape, outline[1, 1], outline[-1, 0]))
        return [PhotographedSheet(scan, True, {}, lambda done: done.report, number=k) for k in (1, 2)]

    monkeypatch.setattr(photo_sheet, "shapes_of_one", shapes)
    request = UploadRequest(
        scan="",
        photo=("a.jpg",),
        camera=(),
        size=PhotoSettings(paper="a4"),
        settings=RestoreSettings(pages="2", binarize=BinarizeSettings(binarize="none"), render=RenderSettings(dpi=50)),
        units="mm",
        view=False,
        formats=("png",),
        outline=read_outline("400x300 0,0 390,0 390,290"),
    )
    reports = restore_photos(tmp_path, request, lambda stage, share: None)
    assert asked == [("a.jpg", "2", "a4", (300, 400), 255, 0)]
    assert len(reports) == 2
    assert {path.name for path in tmp_path.iterdir()} == {
        *("page-1.png", "page-2.png"),
        *("report-1.json", "report-2.json"),
    }


def test_ground_outside_the_outline_is_black():
    photo = np.full((60, 80, 3), 200, np.uint8)
    shown = photo_sheet.on_dark_ground(photo, read_outline("800x600 0,0 400,0 400,600 0,600").mask())
    assert (shown[:, :40] == 200).all()
    assert (shown[:, 42:] == 0).all()
    with pytest.raises(UsageError, match="different proportions"):
        photo_sheet.on_dark_ground(photo.transpose(1, 0, 2), read_outline("800x600 0,0 400,0 400,600").mask())


def test_photos_of_different_things_fail_with_a_sentence(server, photos, tmp_path):
    paths, useless = photos
    other = next(path for path in paths if path.name == useless[0])
    job = server.send([paths[0], other], view="false")
    told = list(server.events(job))
    assert told[-1]["state"] == "failed"
    assert "photos" in told[-1]["sentence"]


def test_the_cards_can_be_printed(server):
    for paper in ("a4", "letter"):
        answer = server.client.get(f"/api/card-{paper}.pdf", timeout=PATIENCE)
        assert answer.status_code == 200
        assert answer.headers["content-type"] == "application/pdf"
        assert answer.content.startswith(b"%PDF")
    assert server.client.get("/api/card-b5.pdf").status_code == 404
