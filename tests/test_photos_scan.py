"""Several photos of one sheet: measured, at true size, or refused with one sentence."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from planish.acquire.photos import surface
from planish.acquire.photos.guidance import what_next
from planish.acquire.photos.scan import PhotosScan, SourcePhoto, _of_one_sheet, from_photos
from planish.errors import InputError, UsageError
from planish.gallery import sheet, typeset_sheet
from planish.gallery.photo_shoot import photo_shoot
from planish.pipeline import flatten
from planish.settings import PhotoSettings

pytest.importorskip("pycolmap")

COARSE = tuple(
    replace(level, cells=cells, rounds=1) for level, cells in zip(surface.LEVELS[:2], (60, 100), strict=True)
)
"""A surface of a quarter of the points in a third of the time; its sheet is as large to 0.1 %."""


@pytest.fixture(scope="module")
def shoot():
    letter = sheet("letter")
    return photo_shoot(letter, typeset_sheet(letter, 200)[0], 6, rng=4, photo_px=(1600, 1200), other_subjects=1)


@pytest.fixture(scope="module")
def sources(shoot):
    return [SourcePhoto(f"IMG_{k}.jpg", photo) for k, photo in enumerate(shoot.photos)]


@pytest.fixture(scope="module")
def found(sources) -> PhotosScan:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(surface, "LEVELS", COARSE)
        return from_photos(sources, PhotoSettings(marker_mm=40.0))


@pytest.mark.slow
def test_six_photos_of_a_phone_give_the_page_at_true_size(found):
    assert found.report.scale == "marker"
    page = flatten(found.acquired.scan.mesh)
    width, height = sorted(page.size_mm)
    # A photo of 2 megapixels has pixels of 0.27 mm; outline and card are each good to about one of them.
    assert width == pytest.approx(215.9, rel=0.006)
    assert height == pytest.approx(279.4, rel=0.006)
    assert found.report.measured_fraction > 0.5


@pytest.mark.slow
def test_the_photo_of_another_subject_is_named(found, shoot):
    other = [f"IMG_{k}.jpg" for k, useful in enumerate(shoot.useful) if not useful]
    assert found.report.left_out == other
    assert "photos-left-out" in [note.code for note in found.acquired.warnings]


@pytest.mark.slow
def test_the_scan_carries_all_photos_and_their_cameras(found, sources):
    scan = found.acquired.scan
    assert len(scan.others) == found.report.used - 1
    assert all(view.camera.shape_rc == view.photo.shape[:2] for view in scan.others)
    assert len(found.views) == len(scan.mesh.points) == len(found.acquired.confidence)


@pytest.mark.slow
def test_scaled_changes_mesh_and_cameras_alike(found):
    from planish.geometry import project

    twice = found.scaled(2.0, "width", 0.001)
    before, after = found.acquired.scan, twice.acquired.scan
    assert project(after.camera, after.mesh.points[:50]) == pytest.approx(before.photo_xy[:50], abs=1e-6)
    assert twice.report.surface_error_mm == pytest.approx(2 * found.report.surface_error_mm)


def test_colmap_leaves_sigterm_to_the_program():
    code = (
        "import os, signal\n"
        "from planish.acquire.photos.camera_poses import import_pycolmap\n"
        "signal.signal(signal.SIGTERM, lambda *_: print('ours'))\n"
        "import_pycolmap()\n"
        "os.kill(os.getpid(), signal.SIGTERM)\n"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "ours\n", "")


def test_one_photo_is_no_set(sources):
    with pytest.raises(UsageError, match="several photos are needed"):
        from_photos(sources[:1])


@pytest.mark.slow
def test_photos_from_one_place_are_refused(sources):
    rng = np.random.default_rng(0)
    again = [
        SourcePhoto(f"{k}.jpg", np.clip(sources[0].pixels + rng.normal(0, 2, (1200, 1600, 1)), 0, 255).astype(np.uint8))
        for k in range(3)
    ]
    with pytest.raises(InputError, match=r"same place|in common"):
        from_photos(again)


def test_blank_photos_have_nothing_in_common():
    blank = [SourcePhoto(f"{k}.jpg", np.full((600, 800, 3), 200 + k, np.uint8)) for k in range(3)]
    with pytest.raises(InputError, match="no places in common"):
        from_photos(blank)


def test_photos_of_another_sheet_are_named_and_left_out():
    names = ["a.jpg", "b.jpg", "c.jpg", "d.jpg"]
    assert _of_one_sheet(np.array([0.97, 1, 0.99, 1]), names) == ([0, 1, 2, 3], [])
    alike, (note,) = _of_one_sheet(np.array([0.97, 0.08, 0.99, 1]), names)
    assert alike == [0, 2, 3]
    assert note.code == "photos-unlike"
    assert note.sentence.startswith("b.jpg shows the same as the other photos at only 8 % of the places of print")


def test_a_set_of_two_sheets_is_refused():
    with pytest.raises(InputError, match=r"different sheets, .* a\.jpg, c\.jpg show the same .* at only 28 to 70 %"):
        _of_one_sheet(np.array([0.28, 0.9, 0.7, 0.95]), ["a.jpg", "b.jpg", "c.jpg", "d.jpg"])


@pytest.mark.slow
def test_what_few_photos_saw_is_named(found):
    page = flatten(found.acquired.scan.mesh)
    corner = (page.page_xy[:, 0] < page.size_mm[0] / 3) & (page.page_xy[:, 1] > 2 * page.size_mm[1] / 3)
    short = replace(found, views=np.where(corner, 1, 5).astype(np.int32))
    notes = what_next(short, page.page_xy, page.size_mm)
    assert notes[0].code == "photos-missing"
    assert "the lower left corner of the page was seen by one photo" in notes[0].sentence
