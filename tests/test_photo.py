"""The shape of a sheet from one photo: truth from geometry, and from sheets photographed virtually."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import LinearNDInterpolator

from planish.errors import InputError, UsageError
from planish.gallery import sheet, typeset_page, virtual_scan
from planish.geometry import project
from planish.photo import find_shape
from planish.photo.borders import find_borders
from planish.photo.cylinder import Cylinder, page_to_space, photo_to_page, space_to_photo
from planish.photo.fit import ANGLE_COEFFICIENTS, Observations, fit, start
from planish.photo.residual_warp import ResidualWarp, fit_warp, identity_warp
from planish.photo.sheet_region import sheet_regions
from planish.photo.working_image import WorkingImage, working_image
from planish.settings import PhotoSettings

CENTRE = np.array([999.5, 1499.5])


def bent(turns, *, pitch=0.1, roll=0.05, text_angle=0.0, focal=2400.0):
    return Cylinder(np.array([pitch, roll]), text_angle, np.asarray(turns, float), (-0.35, 0.35), focal, CENTRE)


@given(
    st.lists(st.floats(-0.6, 0.6), min_size=ANGLE_COEFFICIENTS, max_size=ANGLE_COEFFICIENTS),
    st.floats(-0.3, 0.3),
    st.floats(-3.0, 3.0),
    st.floats(-1.6, 1.6),
)
def test_what_is_put_on_the_photo_is_seen_there(turns, pitch, roll, text_angle):
    cylinder = bent(turns, pitch=pitch, roll=roll, text_angle=text_angle)
    page = np.random.default_rng(0).uniform(-0.2, 0.2, (50, 2))
    seen, good = photo_to_page(cylinder, space_to_photo(cylinder, page_to_space(cylinder, page)))
    assert good.all()
    # 3 um on a page 0.5 m away: both ways go over one polygon, but their straight pieces meet in different places
    assert np.abs(seen - page).max() < 1e-5


def test_the_profile_keeps_lengths():
    cylinder = bent(np.linspace(-0.8, 0.9, ANGLE_COEFFICIENTS))
    along = np.stack([np.linspace(-0.3, 0.3, 4001), np.zeros(4001)], axis=1)
    steps = np.linalg.norm(np.diff(page_to_space(cylinder, along), axis=0), axis=1)
    assert steps.sum() == pytest.approx(0.6, rel=1e-4)  # chords over 1/250 of the page


def lined(cylinder, rng, noise_px):
    """Places on 25 level lines with a margin on either side, as a photo shows them."""
    x, y = np.linspace(-0.28, 0.28, 40), np.linspace(-0.38, 0.38, 25)
    level = [np.stack([x, np.full_like(x, v)], axis=1) for v in y]
    sides = [np.stack([np.full_like(y, u), y], axis=1) for u in (-0.28, 0.28)]
    groups = [*level, *sides]
    page = np.concatenate(groups)
    seen = space_to_photo(cylinder, page_to_space(cylinder, page)) + rng.normal(0, noise_px, page.shape)
    group = np.repeat(np.arange(len(groups), dtype=np.int32), [len(g) for g in groups])
    upright = np.arange(len(groups)) >= len(level)
    return page, Observations(seen, group, upright, np.full(len(groups), max(noise_px, 0.5)))


def off_similar(got, true):
    """Rms distance after the best turn, shift and scale, in parts of the page's height."""
    a, b = got - got.mean(0), true - true.mean(0)
    u, s, vt = np.linalg.svd(a.T @ b)
    return np.sqrt(((a @ u @ vt * (s.sum() / (a**2).sum()) - b) ** 2).sum(1).mean()) / np.ptp(true[:, 1])


@pytest.mark.parametrize("roll", [0.0, 0.4, -1.5])
def test_a_bent_sheet_is_found_from_its_lines(roll):
    cylinder = bent([-1.0, -0.7, -0.3, 0.0, 0.2, 0.3, 0.3, 0.2, 0.1], roll=roll)
    page, observations = lined(cylinder, np.random.default_rng(1), noise_px=0.5)
    found = fit(start(observations, roll, cylinder.focal, CENTRE, across=False), observations)
    flat = off_similar(observations.photo_xy, page)
    assert flat > 0.012  # the photo itself: 4 mm on a letter
    assert off_similar(found.page, page) < 0.001  # 0.3 mm; half a pixel of noise is 0.1 mm there
    assert np.sqrt(np.mean(found.residual_px**2)) < 0.6  # the noise itself


def test_lines_that_are_wrong_do_not_count():
    cylinder = bent([-0.5, -0.3, -0.1, 0.0, 0.1, 0.1, 0.2, 0.2, 0.3])
    page, observations = lined(cylinder, np.random.default_rng(1), noise_px=0.5)
    wrong = observations.photo_xy.copy()
    wrong[::15] += [0, 60]
    found = fit(
        start(observations, 0.05, cylinder.focal, CENTRE, across=False),
        Observations(wrong, observations.group, observations.upright, observations.sigma_px),
    )
    good = np.arange(len(page)) % 15 != 0
    assert off_similar(found.page[good], page[good]) < 0.006
    level = ~observations.upright[observations.group]  # moved down, places of a margin stay on it
    assert found.weight[~good & level].max() < 0.1


def test_a_shift_is_found_and_undone():
    rng = np.random.default_rng(2)
    low, high = np.array([-1.0, -1.4]), np.array([1.0, 1.4])
    page = rng.uniform(low, high, (800, 2))
    wanted = 0.02 * np.sin(2 * page[:, 0]) * np.cos(page[:, 1])
    axis = np.ones(len(page), int)
    warp = fit_warp(identity_warp(low, high), page, wanted, np.ones(len(page)), axis, 1e-3)
    assert np.abs(warp(page)[:, 1] - wanted).max() < 0.1 * 0.02
    assert np.abs(warp(page)[:, 0]).max() == 0
    inside = page[(np.abs(page) < [0.9, 1.3]).all(axis=1)]
    back = warp.inverse(inside)
    assert np.abs(back + warp(back) - inside).max() < 1e-9


def test_no_shift_moves_nothing():
    warp = identity_warp(np.zeros(2), np.ones(2))
    assert isinstance(warp, ResidualWarp)
    assert np.abs(warp(np.random.default_rng(0).uniform(-1, 2, (20, 2)))).max() == 0


def test_a_rotated_working_image_maps_back_to_the_photo():
    photo = np.zeros((300, 400, 3), np.uint8)
    photo[100:103, 250:253] = 255
    image = working_image(photo).rotated(0.7)
    row, col = np.unravel_index(image.grey.argmax(), image.grey.shape)
    assert np.abs(image.to_photo_xy(np.array([[col, row]])) - [251, 101]).max() < 1.5  # the spot is 3 pixels wide


def photo_of(name, **options):
    return virtual_scan(sheet(name), points=3000, photo_px=(2000, 1500), **options)


def mm_off(made, found, margin_mm=12.0):
    """Rms distance [mm] of the page that was found from the true one, after the best turn, shift and scale."""
    width, height = made.sheet.width_mm, made.sheet.height_mm
    x, y = np.meshgrid(np.linspace(margin_mm, width - margin_mm, 30), np.linspace(margin_mm, height - margin_mm, 40))
    true = np.stack([x.ravel(), y.ravel()], axis=1)
    seen = project(made.scan.camera, made.sheet.bend(true))
    rows, cols = made.scan.photo.shape[:2]
    true, seen = (a[((seen > 0) & (seen < [cols - 1, rows - 1])).all(axis=1)] for a in (true, seen))
    mesh = found.scan.mesh
    flat = flat_of(mesh)
    got = LinearNDInterpolator(found.scan.photo_xy, flat)(seen)
    inside = np.isfinite(got).all(axis=1)
    assert inside.mean() > 0.8
    return off_similar(got[inside], true[inside]) * np.ptp(true[inside][:, 1])


def flat_of(mesh):
    """Place on the page of every point of a mesh in rows, from lengths along its first row and column."""
    cols = int(mesh.faces[0, 1])  # the point below the first
    grid = mesh.points.reshape(-1, cols, 3)
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(grid[0], axis=0), axis=1))])
    down = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(grid[:, 0], axis=0), axis=1))])
    return np.stack(np.meshgrid(along, down), axis=-1).reshape(-1, 2)


@pytest.fixture(scope="module")
def book():
    return photo_of("book", tilt_deg=8.0)


@pytest.mark.slow
def test_a_book_page_from_its_text_and_borders(book):
    found = find_shape(book.scan.photo, focal_px=float(book.scan.camera.matrix[0, 0]))
    assert found.report.shape == "text-lines and borders"
    assert found.report.focal_from == "exif"
    assert mm_off(book, found) < 0.8  # half a pixel of misplaced letters is 0.1 mm, and depth magnifies it a few times
    assert found.report.straightness < 0.1
    assert found.report.confidence.endswith("extrapolated.")


@pytest.mark.slow
def test_a_book_page_from_its_text_alone(book):
    found = find_shape(book.scan.photo, PhotoSettings(shape="text-lines"))
    assert found.report.shape == "text-lines"
    assert found.report.lines > 20
    mesh = found.scan.mesh
    assert (np.ptp(found.scan.photo_xy, axis=0) < np.array(book.scan.photo.shape[1::-1])).all()
    assert np.isfinite(mesh.points).all()


@pytest.mark.slow
@pytest.mark.parametrize("quarters", [1, 2])
def test_text_is_found_any_way_round(book, quarters):
    rotated = np.ascontiguousarray(np.rot90(book.scan.photo, quarters))
    found = find_shape(rotated)
    first, across = found.scan.photo_xy[0], found.scan.photo_xy[int(found.scan.mesh.faces[0, 1]) - 1]
    way = (across - first) / np.linalg.norm(across - first)
    along = {1: [0, -1], 2: [-1, 0]}[quarters]  # where the page's rows run after so many turns to the left
    assert way @ along > 0.95


@pytest.mark.slow
def test_the_page_of_a_turned_photo_stands_upright(book):
    upside_down = np.ascontiguousarray(np.rot90(book.scan.photo, 2))
    found = find_shape(upside_down)
    assert found.scan.upright > 1
    top = found.scan.mesh.points[:, 1] > np.quantile(found.scan.mesh.points[:, 1], 0.9)
    assert found.scan.photo_xy[top, 1].mean() > found.scan.photo_xy[~top, 1].mean()


@pytest.mark.slow
def test_known_paper_puts_size_and_proportions_right(book):
    found = find_shape(book.scan.photo, PhotoSettings(paper="letter"))
    size = np.ptp(flat_of(found.scan.mesh), axis=0)
    assert size == pytest.approx([215.9, 279.4], rel=0.005)
    assert found.report.scale == "paper"
    assert not any(warning.code == "size-unknown" for warning in found.warnings)


@pytest.mark.slow
def test_a_known_width_sets_the_scale(book):
    found = find_shape(book.scan.photo, PhotoSettings(width_mm=100))
    assert np.ptp(flat_of(found.scan.mesh), axis=0)[0] == pytest.approx(100, rel=0.002)
    assert found.report.scale == "width"


@pytest.mark.slow
def test_without_either_the_scale_is_unknown(book):
    found = find_shape(book.scan.photo)
    assert found.report.scale == "unknown"
    assert any(warning.code == "size-unknown" for warning in found.warnings)


@pytest.mark.slow
def test_a_crumpled_sheet_is_warned_about():
    found = find_shape(photo_of("crumpled").scan.photo)
    assert any("folded or crumpled" in warning.sentence for warning in found.warnings)


@pytest.mark.slow
def test_a_flat_sheet_is_not_warned_about():
    found = find_shape(photo_of("flat", tilt_deg=15.0).scan.photo, PhotoSettings(paper="letter"))
    assert found.warnings == ()


def sheet_on_a_table(light, *, rules=(), tint=None):
    """A blank A4 sheet seen squarely, 3 pixels a millimetre, its brightness as `light` has it, on a dark table."""
    rows, cols = np.mgrid[:891, :630].astype(np.float32)
    paper = np.repeat((230 * light(cols / 630, rows / 891))[..., None], 3, axis=2)
    for row in rules:
        paper[row : row + 2, 60:570] *= 0.9
    if tint is not None:
        paper[200:600, 100:500] *= tint
    photo = np.full((1100, 840, 3), 40, np.float32)
    photo[100:991, 105:735] = paper + np.random.default_rng(0).normal(0, 2, paper.shape)
    return np.clip(photo, 0, 255).astype(np.uint8)


def step(x, over):
    return 1 - 0.05 * np.clip(0.5 + (x - 0.45) / over, 0, 1)


FOLDS = {
    "one": (lambda x, y: step(x, 0.002), 1.25, 1.45),  # from top to bottom without the rims, in widths
    "askew": (lambda x, y: step(x + 0.3 * y - 0.15, 0.002), 1.2, 1.55),
    "across": (lambda x, y: step(y, 0.002), 0.85, 1.05),
}


@pytest.mark.slow
@pytest.mark.parametrize("fold", FOLDS)
def test_the_length_of_a_fold_is_seen_in_the_shade_of_its_paper(fold):
    light, least, most = FOLDS[fold]
    found = find_shape(sheet_on_a_table(light))
    assert least < found.report.creases < most
    assert any("folded or crumpled" in warning.sentence for warning in found.warnings)


def even(x, y):
    return np.ones_like(x)


NO_FOLDS = {
    "even": (even, {}),
    "curled": (lambda x, y: 0.75 + 0.25 * np.cos(5 * x), {}),
    "a hand's shadow": (lambda x, y: step(x, 0.06), {}),
    "ruled": (even, {"rules": range(90, 800, 60)}),
    "tinted": (even, {"tint": np.array([1.0, 0.98, 0.85])}),
}


@pytest.mark.slow
@pytest.mark.parametrize("what", NO_FOLDS)
def test_what_is_no_fold_is_not_taken_for_one(what):
    light, how = NO_FOLDS[what]
    found = find_shape(sheet_on_a_table(light, **how))
    assert found.report.creases == 0
    assert not any("folded or crumpled" in warning.sentence for warning in found.warnings)


def cat(rng):
    """Fur: strokes of many directions and greys."""
    picture = np.full((900, 1200, 3), 120, np.uint8)
    for _ in range(4000):
        x, y, angle, grey = rng.uniform(0, 1200), rng.uniform(0, 900), rng.uniform(0, 2 * np.pi), rng.integers(40, 220)
        end = (int(x + 25 * np.cos(angle)), int(y + 25 * np.sin(angle)))
        cv2.line(picture, (int(x), int(y)), end, (int(grey), int(0.8 * grey), int(0.6 * grey)), 2)
    return picture


NO_PAGES = {
    "wall": lambda rng: np.full((900, 1200, 3), 201, np.uint8),
    "dark": lambda rng: np.zeros((600, 800, 3), np.uint8),
    "noise": lambda rng: rng.integers(0, 256, (900, 1200, 3), np.uint8),
    "grain": lambda rng: np.clip(rng.normal(180, 6, (900, 1200, 3)), 0, 255).astype(np.uint8),
    "slope": lambda rng: np.tile(np.linspace(20, 230, 1200, dtype=np.uint8)[:, None], (900, 1, 3)),
    "cat": cat,
    "tiny": lambda rng: np.full((8, 8, 3), 255, np.uint8),
}


@pytest.mark.parametrize("what", NO_PAGES)
def test_what_is_no_page_is_refused_in_a_sentence(what):
    with pytest.raises(InputError, match="neither lines of text nor the outline of a sheet"):
        find_shape(NO_PAGES[what](np.random.default_rng(0)))


@pytest.mark.slow
def test_a_blank_sheet_on_a_table_is_found_by_its_borders():
    photo = np.full((1200, 900, 3), 60, np.uint8)
    cv2.fillConvexPoly(photo, np.array([[150, 180], [700, 120], [780, 1000], [120, 1080]]), (235, 235, 230))
    found = find_shape(photo)
    assert found.report.shape == "borders"
    assert found.report.straightness is None
    corners = np.array([[150, 180], [700, 120], [780, 1000], [120, 1080]])
    cols = int(found.scan.mesh.faces[0, 1])
    grid = found.scan.photo_xy.reshape(-1, cols, 2)
    got = np.array([grid[0, 0], grid[0, -1], grid[-1, -1], grid[-1, 0]])
    assert np.abs(got - corners).max() < 6  # three pixels of the small picture that borders are sought in


def test_a_sheet_with_a_corner_at_the_rim_of_the_photo_is_seen_whole():
    photo = np.full((1600, 1200, 3), 90, np.uint8)
    corners = np.array([[470, 12], [1185, 330], [760, 1585], [-4, 1240]])
    cv2.fillConvexPoly(photo, corners.astype(np.int32), (225, 225, 222))
    found = find_borders(sheet_regions(photo, None), 0.0)
    assert found is not None
    begins = np.array([side[0] for side in found.sides])
    away = np.linalg.norm(begins[:, None] - corners[None], axis=2).min(axis=1)
    assert away.max() < 0.05 * 1400  # sides leave out 3 % at their ends


@pytest.mark.slow
def test_paper_size_without_borders_is_refused(book):
    inner = book.scan.photo[400:1500, 300:1200]
    with pytest.raises(UsageError, match="does not show all borders"):
        find_shape(inner, PhotoSettings(paper="a4"))


def test_width_and_paper_contradict_each_other():
    with pytest.raises(UsageError, match="give one of"):
        PhotoSettings(width_mm=100, paper="a4")
    with pytest.raises(UsageError, match="width_mm"):
        PhotoSettings(width_mm=0)


@pytest.mark.slow
def test_sixteen_bit_photos_give_the_same_shape(book):
    eight = find_shape(book.scan.photo)
    sixteen = find_shape(book.scan.photo.astype(np.uint16) * 257)
    assert np.abs(eight.scan.photo_xy - sixteen.scan.photo_xy).max() < 1e-6
    assert sixteen.scan.photo.dtype == np.uint16


def test_the_working_image_is_small():
    image = working_image(np.zeros((6000, 8000, 3), np.uint8))
    assert isinstance(image, WorkingImage)
    assert max(image.grey.shape) <= 1700 * 1.5
    assert image.pixel_size == pytest.approx(5.0)


def profile_off_mm(made, found):
    """Rms distance [mm] of the bent sheet's middle section from the true one, after the best turn, shift and scale."""
    x = np.linspace(5, made.sheet.width_mm - 5, 60)
    true = made.sheet.bend(np.stack([x, np.full_like(x, made.sheet.height_mm / 2)], axis=1))
    got = LinearNDInterpolator(found.scan.photo_xy, found.scan.mesh.points)(project(made.scan.camera, true))
    a, b = got - got.mean(0), true - true.mean(0)
    u, s, vt = np.linalg.svd(a.T @ b)
    turn = np.diag([1, 1, np.sign(np.linalg.det(u @ vt))])
    scale = (s * np.diag(turn)).sum() / (a**2).sum()
    return np.sqrt(((a @ u @ turn @ vt * scale - b) ** 2).sum(1).mean())


@pytest.mark.slow
@pytest.mark.parametrize("picture", [False, True])
def test_the_profile_of_a_book_from_its_shade(picture):
    shape = sheet("book")
    printed = typeset_page(shape.width_mm, shape.height_mm, 150, picture=picture, drawing=picture)
    made = photo_of("book", printed=printed)
    found = find_shape(made.scan.photo, PhotoSettings(shape="shading"), focal_px=float(made.scan.camera.matrix[0, 0]))
    assert found.report.shape == "shading"
    assert np.ptp(made.sheet.bend(np.stack([np.linspace(0, 215, 50), np.zeros(50)], axis=1))[:, 2]) > 25
    assert profile_off_mm(made, found) < 1.5  # of 27 mm; nine numbers follow the steep rise at the spine to 0.7 mm
    assert "brightness fits" in found.report.confidence


@pytest.mark.slow
def test_a_folded_letter_is_refused_to_shading():
    with pytest.raises(InputError, match=r"folded|blank paper"):
        find_shape(photo_of("letter").scan.photo, PhotoSettings(shape="shading"))


@pytest.mark.slow
def test_shading_needs_the_whole_sheet(book):
    with pytest.raises(InputError, match="no outline of a sheet"):
        find_shape(book.scan.photo[400:1500, 300:1200], PhotoSettings(shape="shading"))


@pytest.mark.slow
def test_polynomials_straighten_lines_and_nothing_more(book):
    photo, focal = book.scan.photo, float(book.scan.camera.matrix[0, 0])
    by_polynomials = find_shape(photo, PhotoSettings(shape="polynomial"), focal_px=focal)
    by_bending = find_shape(photo, PhotoSettings(shape="text-lines"), focal_px=focal)
    assert by_polynomials.report.shape == "polynomial"
    assert by_polynomials.report.straightness < 0.1
    assert by_polynomials.report.straightness < 0.5 * by_polynomials.report.bent_one_way
    # lines are as straight, but the paper's length along them is not made good
    assert mm_off(book, by_polynomials) > 3 * mm_off(book, by_bending)
