import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planish.binarize import binarize
from planish.errors import UsageError
from planish.gallery import typeset_page
from planish.settings import BinarizeSettings
from planish.types import Page

METHODS = ("nick", "sauvola", "wolf", "trsingh", "bataineh", "su", "otsu")
FOR_EVEN_LIGHT = {"otsu": 1.0, "su": 0.6}
"""How dark the shaded page may get at its right side for each method; the others manage a quarter of the light."""


@pytest.fixture(scope="module")
def printed():
    page, _ = typeset_page(80, 60, dpi=300, point_size=9)
    return page


def shaded(page, darkest, contrast=1.0):
    """The page under light that falls off to the right, its ink no darker than 1 - contrast."""
    bright = np.linspace(1, darkest, page.pixels.shape[1])[:, None]
    pixels = (255 * (1 - contrast) + contrast * np.asarray(page.pixels)) * bright * 0.9
    return Page(np.rint(pixels).astype(np.uint8), page.known, page.dpi)


def f1(page, truth):
    """Of ink."""
    found, true = ~page.pixels, np.asarray(truth.pixels)[..., 0] < 128
    return 2 * (found & true).sum() / (found.sum() + true.sum())


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_text_under_uneven_light(printed, method):
    # a threshold half a grey ramp off moves each edge of a stroke (4 px wide) by less than half a pixel: F1 > 0.85
    found = binarize(shaded(printed, FOR_EVEN_LIGHT.get(method, 0.25)), BinarizeSettings(binarize=method))
    assert f1(found, printed) > 0.85


def test_faint_print_is_kept_by_the_default(printed):
    # ink at 0.65 of the paper: Sauvola's threshold falls to 0.66 where there is little of it and cuts the strokes open
    faint = shaded(printed, 0.6, contrast=0.35)
    by_sauvola = binarize(faint, BinarizeSettings(binarize="sauvola"))
    assert f1(binarize(faint), printed) > 0.9
    assert f1(binarize(faint), printed) > f1(by_sauvola, printed) + 0.1


@pytest.mark.parametrize("dpi", [150, 300, 600])
def test_window_follows_the_resolution(dpi):
    """A black square of 4 mm: a 6 mm window reaches paper from everywhere in it, a 2 mm window does not."""
    side = round(4 / 25.4 * dpi)
    pixels = np.full((4 * side, 4 * side), 230, np.uint8)
    pixels[side : 2 * side, side : 2 * side] = 20
    page = Page(pixels, np.ones(pixels.shape, bool), float(dpi))
    assert (~binarize(page, BinarizeSettings(window_mm=8)).pixels == (pixels == 20)).all()
    assert binarize(page, BinarizeSettings(window_mm=2)).pixels[3 * side // 2, 3 * side // 2]


def test_k_thins_strokes(printed):
    page = shaded(printed, 1.0)
    ink = [(~binarize(page, BinarizeSettings(k=k)).pixels).sum() for k in (0.1, 0.2, 0.4)]
    assert ink[0] > ink[1] > ink[2] > 0


def test_unknown_parts_are_paper(printed):
    known = np.ones(printed.pixels.shape[:2], bool)
    known[:, 300:500] = False
    pixels = np.array(printed.pixels)
    pixels[:, 300:500] = 0
    found = binarize(Page(pixels, known, 300.0))
    assert found.pixels[:, 300:500].all()
    assert not found.pixels[:, :300].all()
    assert (found.known == known).all()


def test_sixteen_bit_grey_and_colour_agree(printed):
    page = shaded(printed, 0.5)
    grey = np.asarray(page.pixels)[..., 1]
    wide = grey.astype(np.uint16) * 257
    found = [binarize(Page(p, page.known, 300.0)).pixels for p in (np.asarray(page.pixels), grey, wide)]
    assert (found[0] == found[1]).all()
    assert (found[1] == found[2]).all()


@given(
    st.tuples(st.integers(1, 40), st.integers(1, 40)),
    st.sampled_from(METHODS),
    st.sampled_from([0.1, 6.0, 1000.0]),
    st.integers(0, 2),
)
def test_any_page_comes_through(shape, method, window_mm, kind):
    pixels = np.random.default_rng(0).integers(0, 256, shape, np.uint8) if kind == 2 else np.full(shape, 255 * kind)
    page = Page(pixels.astype(np.uint8), np.ones(shape, bool), 300.0)
    found = binarize(page, BinarizeSettings(binarize=method, window_mm=window_mm))
    assert found.pixels.shape == shape
    assert kind == 2 or found.pixels.all()  # where there is one grey there is no ink


def test_refusals():
    page = Page(np.zeros((4, 4), np.uint8), np.ones((4, 4), bool), 300.0)
    with pytest.raises(UsageError, match="choose a method"):
        binarize(page, BinarizeSettings(binarize="none"))
    with pytest.raises(UsageError, match="window_mm must be between"):
        BinarizeSettings(window_mm=0)
    with pytest.raises(UsageError, match="k must be between 0 and 1"):
        BinarizeSettings(k=1.0)
    assert BinarizeSettings(k=0.3, window_mm=10).k == 0.3
