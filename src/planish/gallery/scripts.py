"""Test pages whose lines are not Latin text: Arabic, Hindi, Japanese in columns, and sheet music.

The scripts are typeset with a font of the machine; music is drawn without one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont, features

from planish.dpi import mm_to_px
from planish.errors import UsageError
from planish.types import Page

Font = ImageFont.FreeTypeFont

MARGIN = 0.115
"""Width of the margins, as a share of the page's width; above and below as a share of its height."""
POINTS_PER_INCH = 72
HALF_HEIGHT = "、。"
"""Characters that take half the height of the others in a column."""


@dataclass(frozen=True)
class Script:
    """A script and how it is typeset.

    Attributes
    ----------
    text : str
        A paragraph, repeated to fill the page.
    fonts : tuple of str
        Font files that have its letters, the first that is found is used.
    leading : float
        Distance of lines or columns, in type sizes.
    shaped : bool
        Whether letters change their shapes with their neighbours.
    direction : str
        "ltr", "rtl" or "ttb": along the line.
    """

    text: str
    fonts: tuple[str, ...]
    leading: float
    shaped: bool
    direction: str


SCRIPTS = {
    "arabic": Script(
        "الورق ينثني بسهولة ولا يتمدد إلا قليلا. من يشد الورقة بيديه يمزقها قبل أن تطول، ومن يضغطها تنحن على خط "
        "مستقيم. لذلك تحفظ الصفحة المنحنية سر أطوالها، ويمكن أن تعود مستوية كما طبعت أول مرة.",
        ("Amiri-Regular.ttf", "NotoNaskhArabic-Regular.ttf", "DejaVuSans.ttf"),
        1.75,
        True,
        "rtl",
    ),
    "hindi": Script(
        "काग़ज़ आसानी से मुड़ता है पर लगभग बिल्कुल नहीं खिंचता। दोनों हाथों से खींचने पर वह बढ़ने से पहले फट जाता है, और दबाने "
        "पर एक सीधी रेखा पर मुड़ जाता है। इसलिए मुड़ा हुआ पन्ना अपनी लंबाइयाँ याद रखता है और उसे फिर से सीधा बिछाया जा सकता है।",
        ("NotoSansDevanagari-Regular.ttf", "NotoSerifDevanagari-Regular.ttf", "Lohit-Devanagari.ttf"),
        1.7,
        True,
        "ltr",
    ),
    "japanese": Script(
        "紙はたやすく曲がるが、ほとんど伸びない。両手で引けば伸びる前に破れ、押せばまっすぐな線に沿って曲がる。だから曲がった頁は"
        "長さの秘密を守り、もとの平らな頁に戻すことができる。",
        ("NotoSerifCJK-Regular.ttc", "NotoSansCJK-Regular.ttc", "DroidSansFallbackFull.ttf"),
        1.7,
        False,
        "ttb",
    ),
}


def script_page(
    script: str,
    width_mm: float = 215.9,
    height_mm: float = 279.4,
    dpi: float = 300.0,
    *,
    point_size: float = 12.0,
    font: str | Path | None = None,
) -> tuple[Page, str]:
    """Typeset a page of a script that is not Latin.

    Parameters
    ----------
    script : str
        "arabic", "hindi" or "japanese"; Japanese runs in columns from top to bottom.
    width_mm, height_mm : float
    dpi : float
    point_size : float
    font : path, optional
        Font file. Default: one that is installed on this machine, see `SCRIPTS`.

    Returns
    -------
    page : Page
    text : str
        Printed text in reading order.

    Raises
    ------
    UsageError
        If the machine has no font for the script, or Pillow cannot shape its letters.
    """
    how = SCRIPTS[script]
    if how.shaped and not features.check("raqm"):
        raise UsageError(
            f"a page in {script} needs Pillow with Raqm, which joins letters, and this one is without",
            "install Pillow from PyPI and FriBidi (Debian: libfribidi0)",
        )
    px = mm_to_px(1, dpi)
    image = Image.new("RGB", (round(width_mm * px), round(height_mm * px)), "white")
    face = _find_font(script, how.fonts if font is None else (str(font),), point_size / POINTS_PER_INCH * dpi)
    typeset: Callable[[Image.Image, Script, Font], list[str]] = _columns if how.direction == "ttb" else _lines
    text = "\n".join(typeset(image, how, face))
    return _page(image, dpi), text


def music_page(
    width_mm: float = 215.9, height_mm: float = 279.4, dpi: float = 300.0, *, staff_mm: float = 1.75, seed: int = 0
) -> tuple[Page, str]:
    """Draw a page of piano music without words: systems of two staves with bars, notes, stems, beams and slurs.

    Parameters
    ----------
    width_mm, height_mm : float
    dpi : float
    staff_mm : float
        Distance of the lines of a staff.
    seed : int
        Of the notes.

    Returns
    -------
    page : Page
    text : str
        Empty.

    Examples
    --------
    >>> page, _ = music_page(105, 148, dpi=100)
    >>> page.pixels.shape
    (583, 413, 3)
    """
    rng = np.random.default_rng(seed)
    px = mm_to_px(1, dpi)
    image = Image.new("RGB", (round(width_mm * px), round(height_mm * px)), "white")
    draw, space = ImageDraw.Draw(image), staff_mm * px
    left, right = MARGIN * image.width, (1 - MARGIN) * image.width
    system = 28 * space
    for top in np.arange(MARGIN * image.height, (1 - MARGIN) * image.height - 16 * space, system):
        for staff in (top, top + 11 * space):
            for k in range(5):
                _stroke(draw, (left, staff + k * space), (right, staff + k * space), 0.12 * space)
            _notes(draw, rng, left, right, staff, space)
        for x in np.linspace(left, right, 5):
            _stroke(draw, (x, top), (x, top + 15 * space), 0.15 * space)
    return _page(image, dpi), ""


def _page(image: Image.Image, dpi: float) -> Page:
    pixels = np.asarray(image)
    return Page(pixels, np.ones(pixels.shape[:2], bool), dpi)


def _find_font(script: str, names: tuple[str, ...], size: float) -> Font:
    for name in names:
        try:
            return ImageFont.truetype(name, size)
        except OSError:
            continue
    raise UsageError(
        f"no font for {script} was found on this machine; looked for {', '.join(names)}",
        "install one of them (Debian: fonts-hosny-amiri, fonts-noto-core, fonts-noto-cjk), or give the file as font=",
    )


def _lines(image: Image.Image, how: Script, font: Font) -> list[str]:
    """Typeset justified lines of words; return them."""
    draw = ImageDraw.Draw(image)
    left, width = MARGIN * image.width, (1 - 2 * MARGIN) * image.width
    words = cycle(how.text.split())
    texts = []
    base = MARGIN * image.height + font.size
    while base < (1 - MARGIN) * image.height:
        row = _row(words, width, font)
        lengths = np.array([font.getlength(word) for word in row])
        gap = (width - lengths.sum()) / max(len(row) - 1, 1)
        x = np.concatenate([[0], np.cumsum(lengths[:-1] + gap)])
        if how.direction == "rtl":
            x = width - x - lengths
        for word, at in zip(row, x, strict=True):
            draw.text((left + at, base), word, "black", font, anchor="ls", direction=how.direction)
        texts.append(" ".join(row))
        base += how.leading * font.size
    return texts


def _row(words: Iterator[str], width: float, font: Font) -> list[str]:
    """As many words as fill a line to nine tenths or more."""
    row: list[str] = []
    while font.getlength(" ".join(row)) < 0.9 * width:
        row.append(next(words))
    return row if font.getlength(" ".join(row)) < 1.02 * width else row[:-1]


def _columns(image: Image.Image, how: Script, font: Font) -> list[str]:
    """Typeset justified columns of characters, from right to left; return them."""
    draw = ImageDraw.Draw(image)
    top, height = MARGIN * image.height, (1 - 2 * MARGIN) * image.height
    letters = cycle(how.text)
    texts = []
    for x in np.arange((1 - MARGIN) * image.width - font.size, MARGIN * image.width, -how.leading * font.size):
        column, steps = "", [0.0]
        while sum(steps) < height - font.size:
            column += next(letters)
            steps.append(font.size * (0.5 if column[-1] in HALF_HEIGHT else 1.0))
        y = np.cumsum(steps[:-1]) * (height - font.size) / sum(steps[:-1])
        for at, letter in zip(top + y, column, strict=True):
            draw.text((x, at), letter, "black", font)
        texts.append(column)
    return texts


def _notes(
    draw: ImageDraw.ImageDraw, rng: np.random.Generator, left: float, right: float, staff: float, space: float
) -> None:
    """Draw groups of up to four notes on a staff, with stems and a beam, and now and then a slur."""
    x = left + 6 * space
    while x < right - 14 * space:
        count = int(rng.integers(1, 5))
        xs = x + 3 * space * np.arange(count)
        ys = staff + space / 2 * (rng.integers(0, 5) + np.clip(np.cumsum(rng.integers(-1, 2, count)), -2, 2) + 2)
        top = ys.min() - 3.5 * space
        for at, y in zip(xs, ys, strict=True):
            draw.ellipse((at - 0.62 * space, y - 0.45 * space, at + 0.62 * space, y + 0.45 * space), "black")
            _stroke(draw, (at + 0.57 * space, y), (at + 0.57 * space, top), 0.12 * space)
        if count > 1:
            beam = (xs[0] + 0.5 * space, top, xs[-1] + 0.63 * space, top + 0.5 * space)
            draw.rectangle(beam, "black")
            if rng.random() < 0.4:
                low = ys.max() + space
                draw.arc((xs[0], low - space, xs[-1], low + space), 20, 160, "black", max(1, round(0.15 * space)))
        x += 3 * space * count + 2.5 * space


def _stroke(draw: ImageDraw.ImageDraw, begin: tuple[float, float], end: tuple[float, float], width: float) -> None:
    draw.line((*begin, *end), "black", max(1, round(width)))
