"""The whole walk, from Python: what a page must be, and what must not change it."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

import planish
from planish.errors import InputError
from planish.gallery import sheet, sheet_mesh, virtual_scan
from planish.settings import BinarizeSettings, FlattenSettings, RenderSettings, RestoreSettings
from planish.types import Mesh, Scan
from shapes import rigid_rms

pytestmark = pytest.mark.slow

SMALL = {"points": 6000, "photo_px": (1200, 900)}
DRAFT = RestoreSettings(render=RenderSettings(dpi=100.0))


@pytest.fixture(scope="module")
def book():
    return virtual_scan(sheet("book"), **SMALL)


@pytest.fixture(scope="module")
def restored(book):
    return planish.restore(book.scan, DRAFT)


def picture_distance(a, b):
    """Mean difference of two pages, of 255, over what both have."""
    rows, cols = (min(n) for n in zip(a.shape[:2], b.shape[:2], strict=True))
    return np.abs(a[:rows, :cols].astype(float) - b[:rows, :cols].astype(float)).mean()


def test_the_page_has_its_true_size_and_place(book, restored):
    assert restored.report.settled
    assert restored.flattening.size_mm == pytest.approx((book.sheet.width_mm, book.sheet.height_mm), rel=0.003)
    assert rigid_rms(restored.flattening.page_xy, book.truth_xy) < 0.1  # chords of the 3 mm mesh, not of 1,000 points
    assert restored.rendered.dpi == 100
    assert restored.binary.pixels.dtype == bool
    assert restored.report.page.known_fraction > 0.95


def test_the_page_shows_what_was_printed(book, restored):
    """Ink of the restored page lies where the true page has ink, up to a pixel of 0.25 mm."""
    import cv2

    rows, cols = restored.rendered.pixels.shape[:2]
    true = cv2.resize(np.asarray(book.page.pixels), (cols, rows), interpolation=cv2.INTER_AREA).astype(float)
    true = true.mean(axis=2) if true.ndim == 3 else true
    got = restored.rendered.pixels.mean(axis=2)
    even = got / cv2.GaussianBlur(got, (0, 0), 15)  # the light is not this test's matter
    assert np.corrcoef(even[20:-20, 20:-20].ravel(), true[20:-20, 20:-20].ravel())[0, 1] > 0.8


@pytest.mark.parametrize(
    "how",
    [{"frame": "camera"}, {"tilt_deg": 40.0}, {"reverse_faces": True}, {"turn_deg": 175.0}],
    ids=["camera frame", "tilted", "winding reversed", "photographed upside down"],
)
def test_the_scanner_may_stand_as_it_likes(book, restored, how):
    made = virtual_scan(sheet("book"), **SMALL, **how)
    done = planish.restore(made.scan, DRAFT)
    assert done.flattening.size_mm == pytest.approx(restored.flattening.size_mm, abs=0.5)
    page = done.flattening.page_xy
    assert rigid_rms(page, made.truth_xy) < 0.1  # rigid: a mirror image would be centimetres off
    assert np.abs(page - made.truth_xy).mean() < 1  # upright, since its text says so


def test_a_spread_is_not_stood_on_end():
    made = virtual_scan(sheet("spread"), points=20_000, photo_px=(2400, 1800), turn_deg=90.0)
    done = planish.restore(made.scan, RestoreSettings(render=RenderSettings(dpi=150.0)))
    assert np.abs(done.flattening.page_xy - made.truth_xy).mean() < 2
    asked = planish.restore(made.scan, RestoreSettings(render=RenderSettings(dpi=150.0), rotate="0"))
    assert asked.flattening.size_mm[0] < asked.flattening.size_mm[1]


def test_a_mirrored_scan_gives_the_mirrored_page(book, restored):
    mesh, xy = book.scan.mesh, book.scan.photo_xy
    cols = book.scan.photo.shape[1]
    mirrored = replace(
        book.scan,
        mesh=Mesh(mesh.points * [-1, 1, 1], mesh.faces[:, ::-1]),
        photo=book.scan.photo[:, ::-1],
        photo_xy=xy * [-1, 1] + [cols - 1, 0],
        camera=None,
    )
    done = planish.restore(mirrored, DRAFT)
    assert picture_distance(done.rendered.pixels[:, ::-1], restored.rendered.pixels) < 6  # half a pixel of shift


def test_renumbering_points_moves_no_pixel_by_much(book, restored):
    order = np.random.default_rng(0).permutation(len(book.scan.mesh.points))
    back = np.argsort(order).astype(np.int32)
    mesh = Mesh(book.scan.mesh.points[order], back[book.scan.mesh.faces])
    done = planish.restore(replace(book.scan, mesh=mesh, photo_xy=book.scan.photo_xy[order]), DRAFT)
    assert rigid_rms(done.flattening.page_xy[back], restored.flattening.page_xy) < 0.05  # other points are kept
    assert picture_distance(done.rendered.pixels, restored.rendered.pixels) < 6  # those 0.05 mm are a fifth of a pixel


def test_photo_places_may_come_per_corner_or_from_the_camera(book, restored):
    corners = replace(book.scan, photo_xy=book.scan.photo_xy[book.scan.mesh.faces], camera=None)
    assert picture_distance(planish.restore(corners, DRAFT).rendered.pixels, restored.rendered.pixels) < 1
    camera_only = replace(book.scan, photo_xy=None)
    assert picture_distance(planish.restore(camera_only, DRAFT).rendered.pixels, restored.rendered.pixels) < 1


def test_a_scan_without_photo_gives_the_geometry(book):
    done = planish.restore(Scan(book.scan.mesh))
    assert (done.rendered, done.binary) == (None, None)
    assert done.report.page.dpi is None
    assert done.report.page.width_mm == pytest.approx(book.sheet.width_mm, rel=0.003)


def test_a_page_nearly_as_large_as_its_paper_is_as_large(book, restored):
    size = restored.flattening.size_mm
    for paper in ((size[0] - 0.3, size[1] - 0.4), (size[1] + 0.2, size[0] - 0.1)):  # given upright and lying
        done = planish.restore(replace(book.scan, paper_mm=paper), DRAFT)
        assert sorted(done.flattening.size_mm) == sorted(paper)
        shift = done.flattening.page_xy - restored.flattening.page_xy
        beyond = np.subtract(size, done.flattening.size_mm)  # half of it on each side; nothing is scaled
        np.testing.assert_allclose(shift, np.broadcast_to(-beyond / 2, shift.shape), atol=1e-9)
        assert done.rendered.pixels.shape[:2] == tuple(round(s / 25.4 * 100) for s in done.flattening.size_mm[::-1])
    other = planish.restore(replace(book.scan, paper_mm=(size[0] - 3, size[1])), DRAFT)
    assert other.flattening.size_mm == size


def test_binarizing_can_be_left_out(book):
    plain = RestoreSettings(render=RenderSettings(dpi=50.0), binarize=BinarizeSettings(binarize="none"))
    assert planish.restore(book.scan, plain).binary is None


def test_flatten_takes_plain_arrays(book):
    flat = planish.flatten(book.scan.mesh.points, book.scan.mesh.faces)
    assert rigid_rms(flat.page_xy, book.truth_xy) < 0.1
    with pytest.raises(InputError, match="no faces"):
        planish.flatten(book.scan.mesh.points)


def test_every_point_of_the_file_gets_a_finite_place(book):
    points = np.r_[book.scan.mesh.points, [[0, 0, 50], [np.nan, 0, 0]]]
    flat = planish.flatten(points, book.scan.mesh.faces)
    assert flat.page_xy.shape == (len(points), 2)
    assert np.isfinite(flat.page_xy).all()
    assert any("belong to no face" in w.sentence for w in flat.warnings)


def test_progress_names_every_stage(book):
    told = []
    sharper = replace(DRAFT, render=replace(DRAFT.render, sharpen=1.0))
    done = planish.restore(book.scan, sharper, lambda name, share: told.append((name, share)))
    names = list(dict.fromkeys(name for name, _ in told))
    assert names == ["clean", "flatten", "turn", "render", "unshade", "sharpen", "measure"]
    assert np.asarray(done.page.pixels).std() > np.asarray(planish.restore(book.scan, DRAFT).page.pixels).std()
    assert all(0 <= share <= 1 for _, share in told)


def test_the_paper_keeps_a_thousand_points_and_the_report_says_so():
    mesh, _ = sheet_mesh(sheet("book"), points=20_000)
    done = planish.restore(Scan(mesh), RestoreSettings(flatten=FlattenSettings(method="verlet")))
    assert done.report.flatten.points == pytest.approx(1000, rel=0.1)
    assert done.report.scan.points == len(mesh.points)


def test_two_threads_at_once_give_the_bytes_of_one_after_the_other(book):
    """Kernels share no state: neither the thread pool, nor caches, nor files of the process."""
    letter = virtual_scan(sheet("letter"), **SMALL)
    alone = [planish.restore(made.scan, DRAFT) for made in (book, letter)]
    with ThreadPoolExecutor(2) as pool:
        together = list(pool.map(lambda made: planish.restore(made.scan, DRAFT), (book, letter)))
    for one, other in zip(alone, together, strict=True):
        np.testing.assert_array_equal(one.flattening.page_xy, other.flattening.page_xy)
        np.testing.assert_array_equal(one.rendered.pixels, other.rendered.pixels)
        np.testing.assert_array_equal(one.unshaded.pixels, other.unshaded.pixels)
