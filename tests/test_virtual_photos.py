"""`planish acquire virtual photos`: files as a phone's, and the true cameras beside them; `planish demo photos`."""

import json
from importlib import import_module

import numpy as np
import pytest
from PIL import Image

from planish.acquire.photos import surface
from planish.acquire.photos.markers import corners_of, find_markers
from planish.cli.acquire import virtual_photos
from planish.cli.main import run
from planish.io import focal_length_px, read_camera, read_photo
from test_photos_scan import COARSE


@pytest.mark.slow
def test_photos_and_their_cameras(tmp_path, monkeypatch):
    monkeypatch.setattr(virtual_photos, "COUNT", 2)
    assert run(["acquire", "virtual", "photos", "-o", str(tmp_path), "--sheet", "folded", "--small", "-q"]) == 0
    with Image.open(tmp_path / "page.png") as page:
        assert page.size == (2550, 3300)
    corners = []
    for name in ("IMG_0.jpg", "IMG_1.jpg"):
        path = tmp_path / "photos" / name
        camera = read_camera(tmp_path / "cameras.json", name)
        assert focal_length_px(path) == pytest.approx(camera.matrix[0, 0], rel=0.012)  # whole millimetres of 42
        markers = find_markers(read_photo(path).pixels)
        assert len(markers.ids) == 1
        corners.append((camera, corners_of(markers, camera)[0]))
    (first, a), (second, b) = corners
    lens = [c.matrix @ np.column_stack([c.rotation, c.translation]) for c in (first, second)]
    points = [
        np.linalg.lstsq(rows[:, :3], -rows[:, 3], rcond=None)[0]
        for rows in (
            np.concatenate([xy[:, None] * p[2] - p[:2] for xy, p in zip(pair, lens, strict=True)])
            for pair in zip(a, b, strict=True)
        )
    ]
    sides = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
    assert sides == pytest.approx(40.0, abs=0.1)  # two photos at half the resolution
    assert np.abs(np.array(points)[:, 2]).max() < 0.5  # on the table


@pytest.mark.slow
def test_the_demo_of_photos(tmp_path, monkeypatch, capsys):
    """With five photos of 2 megapixels instead of ten of 7 and a coarse surface, for it to be done in half a minute."""
    monkeypatch.setattr(surface, "LEVELS", COARSE)
    monkeypatch.setattr(virtual_photos, "COUNT", 5)
    monkeypatch.setattr(import_module("planish.gallery.photo_shoot"), "PHOTO_PX", virtual_photos.SMALL_PX)
    assert run(["demo", "photos", "-o", str(tmp_path)]) == 0
    assert "215.9 x 279.4 mm" in capsys.readouterr().out
    assert {"photos", "cameras.json", "truth.png", "page.tif", "page-binary.png", "report.json", "stages"} == {
        path.name for path in tmp_path.iterdir()
    }
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["photos"]["used"] == 5
    assert report["page"]["width_mm"] == pytest.approx(215.9, rel=0.01)  # borders are good to a millimetre at 2 MP
    assert report["page"]["height_mm"] == pytest.approx(279.4, rel=0.01)
