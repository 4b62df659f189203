"""Photos from around: the truth that comes with them is what they show."""

import cv2
import numpy as np
import pytest

from planish.errors import UsageError
from planish.gallery import photo_shoot, sheet, typeset_sheet
from planish.gallery.table_top import table_top
from planish.geometry import depths, project

SMALL = (1200, 900)

pytestmark = pytest.mark.slow


def shoot_of(bent, count=2, **options):
    bent = sheet(bent) if isinstance(bent, str) else bent
    return photo_shoot(bent, typeset_sheet(bent, 150)[0], count, rng=5, photo_px=SMALL, **options)


def test_cards_are_found_where_the_truth_has_them():
    shoot = shoot_of("wave", 3, cards=2)
    detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50))
    for photo, camera in zip(shoot.photos, shoot.cameras, strict=True):
        corners, numbers, _ = detector.detectMarkers(photo)
        assert sorted(np.ravel(numbers)) == sorted(card.number for card in shoot.cards)
        for number, found in zip(np.ravel(numbers), corners, strict=True):
            true = next(card for card in shoot.cards if card.number == number)
            off = np.reshape(found, (4, 2)) - project(camera, true.corners)
            assert np.abs(off).max() < 1.5  # px; OpenCV's corners are whole pixels here
            assert np.abs(off.mean(axis=0)).max() < 0.5  # which even out


def test_the_print_is_where_the_truth_has_it():
    """Blank and inked places of the page are bright and dark in every photo, by the cameras and `bend` alone."""
    shoot = shoot_of("book", 3)
    page = shoot.page.pixels[..., 0].astype(float)
    density = shoot.page.dpi / 25.4
    size = cv2.erode(page, np.ones((9, 9))), cv2.dilate(page, np.ones((9, 9)))  # 1.5 mm of one tone around
    x, y = np.meshgrid(np.linspace(2, 210, 300), np.linspace(2, 275, 400))
    page_xy = np.stack([x.ravel(), y.ravel()], axis=1)
    col, row = np.minimum((page_xy * density).astype(int), np.array(page.shape[::-1]) - 1).T
    blank, inked = size[0][row, col] > 250, page[row, col] < 30
    points = shoot.sheet.bend(page_xy)
    for photo, camera in zip(shoot.photos, shoot.cameras, strict=True):
        u, v = np.rint(project(camera, points)).astype(int).T
        grey = photo[v, u, 1].astype(float)
        assert np.percentile(grey[blank], 2) > 150  # the darkest of the paper, by the gutter
        assert np.median(grey[inked]) < 0.7 * np.median(grey[blank])  # thin strokes of a 1 MP photo are blurred


def test_a_curl_hides_what_lies_behind_it():
    """The page under the overhanging corner is not seen from above, and the back is blank paper."""
    shoot = shoot_of(sheet("curl", turn_deg=160), 1)
    camera = shoot.cameras[0]
    eye = -camera.rotation.T @ camera.translation
    points, normals = shoot.mesh.points, _normals(shoot)
    backwards = np.einsum("ij,ij->i", eye - points, normals) < 0
    assert 0.005 < backwards.mean() < 0.2  # the corner turns by 160 degrees
    u, v = np.rint(project(camera, points[backwards])).astype(int).T
    assert np.percentile(shoot.photos[0][v, u, 1], 10) > 60  # no ink there


def test_the_light_stands_still():
    """Blank paper has one brightness in all photos, but for the exposure of each (0.92 to 1.05 of the light)."""
    shoot = shoot_of("letter", 4)
    points = shoot.sheet.bend(np.array([[8.0, y] for y in (20, 60, 100, 150, 200, 260)]))
    seen = []
    for photo, camera in zip(shoot.photos, shoot.cameras, strict=True):
        u, v = np.rint(project(camera, points)).astype(int).T
        block = [photo[b - 1 : b + 2, a - 1 : a + 2, 1].mean() for a, b in zip(u, v, strict=True)]
        seen.append(np.array(block))
    ratios = np.array(seen) / np.array(seen).mean(axis=1, keepdims=True)
    assert np.ptp(ratios, axis=0).max() < 0.02  # levels of 255 are whole, noise of 1.5 is averaged over nine
    assert np.ptp(ratios[0]) > 0.05  # and the panels differ


def test_everything_is_in_every_photo_and_the_views_are_from_around():
    shoot = shoot_of("spread", 8, out_of_focus=1, other_subjects=1, table="white")
    assert len(shoot.photos) == 10
    assert sum(shoot.useful) == 8
    assert sum(camera is None for camera in shoot.cameras) == 1
    eyes = []
    for camera, useful in zip(shoot.cameras, shoot.useful, strict=True):
        if useful:
            xy = project(camera, shoot.rim)
            assert (xy > 0).all()
            assert (xy < np.array(SMALL) - 1).all()
            assert (depths(camera, shoot.rim) > 0).all()
            eyes.append(-camera.rotation.T @ camera.translation)
    tilt = np.degrees(np.arctan2(np.linalg.norm(np.array(eyes)[:, :2], axis=1), np.array(eyes)[:, 2]))
    assert tilt[0] < 8
    assert (tilt[1:] > 13).all()  # 15 to 38, but for the hand's aim
    assert (tilt[1:] < 40).all()
    azimuth = np.sort(np.degrees(np.arctan2(*np.array(eyes)[1:, 1::-1].T)))
    assert np.diff(np.append(azimuth, azimuth[0] + 360)).max() < 90


def test_photos_out_of_focus_are_blurred():
    shoot = shoot_of("flat", 2, out_of_focus=2)
    sharp = [cv2.Laplacian(photo[..., 1], cv2.CV_64F).std() for photo in shoot.photos]
    assert max(s for s, ok in zip(sharp, shoot.useful, strict=True) if not ok) < 0.5 * min(
        s for s, ok in zip(sharp, shoot.useful, strict=True) if ok
    )


def test_places_on_the_sheet_are_located_to_a_hundredth_of_a_millimetre():
    shoot = shoot_of("crumpled", 1)
    rng = np.random.default_rng(1)
    page_xy = rng.uniform([2, 2], [213, 277], (500, 2))
    points = shoot.sheet.bend(page_xy)
    found, distance = shoot.locate(points + 0.2 * np.array([0, 0, 1.0]))
    assert np.median(np.linalg.norm(found - page_xy, axis=1)) < 0.15  # 0.2 mm off a slope of up to 50 degrees
    assert np.percentile(distance, 99) < 0.21
    found, distance = shoot.locate(points)
    assert np.percentile(np.linalg.norm(found - page_xy, axis=1), 99) < 0.01
    assert np.percentile(distance, 99) < 0.01


@pytest.mark.parametrize("kind", ["wood", "plain", "white"])
def test_tables(kind):
    top = table_top(kind, 60.0, 0.5, np.random.default_rng(0))
    assert top.shape == (240, 240, 3)
    assert 0 <= top.min() <= top.max() <= 1
    assert (top.std() > 0.03) == (kind == "wood")


@pytest.mark.parametrize(
    ("options", "why"), [({"count": 0}, "at least one"), ({"cards": 5}, "up to four"), ({"table": "glass"}, "glass")]
)
def test_refusals(options, why):
    with pytest.raises(UsageError, match=why):
        shoot_of("flat", **options)


def _normals(shoot):
    from planish.gallery.sheets import normals

    return normals(shoot.sheet, shoot.mesh.page_xy)
