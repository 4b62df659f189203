"""Typeset test pages: title, running head, justified columns, table, drawing, picture, colour chart and stamp."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageChops, ImageDraw, ImageFont

from planish.dpi import mm_to_px
from planish.gallery import prose
from planish.gallery.artwork import colour_chart, hills, line_drawing, stamp_print
from planish.gallery.sheets import Sheet
from planish.types import Page

Font = ImageFont.FreeTypeFont
Painter = Callable[[Image.Image, float, float], None]

LEADING = 1.42
"""Baseline distance, in type sizes."""


@dataclass(frozen=True)
class _Row:
    """One unbreakable strip of a column.

    Attributes
    ----------
    height : float [px]
        Height of the strip.
    paint : callable
        (image, x, y of the strip's upper left corner [px]).
    text : str
    with_next : float [px]
        Space required below it, to keep a heading with its paragraph.
    """

    height: float
    paint: Painter
    text: str = ""
    with_next: float = 0.0


def typeset_page(
    width_mm: float = 215.9,
    height_mm: float = 279.4,
    dpi: float = 300.0,
    *,
    columns: int = 1,
    point_size: float = 10.5,
    page_number: int = 17,
    title: str | None = prose.TITLE,
    story: Sequence[str] = prose.STORY,
    table: bool = True,
    drawing: bool = False,
    picture: bool = False,
    chart: bool = False,
    stamp: bool = False,
) -> tuple[Page, str]:
    """Typeset one page of a book.

    Parameters
    ----------
    width_mm, height_mm : float
    dpi : float
        Resolution; text is anti-aliased.
    columns : int
    point_size : float
        Type size, in points of 1/72 inch.
    page_number : int
        Printed at the outer edge: left on even pages.
    title : str or None
    story : sequence of str
        Paragraphs, and headings that begin with "#"; overflow is dropped.
    table, drawing : bool
        Within the text: the drawing after the first part, the table after the third.
    picture : bool
        A grey picture in the upper half of the page.
    chart : bool
        A colour chart of 24 patches below it.
    stamp : bool
        A red stamp at the bottom of the page.

    Returns
    -------
    page : Page
        (rows, cols, 3) uint8, white paper, black ink.
    text : str
        Printed text in reading order, without the stamp.

    Examples
    --------
    >>> page, text = typeset_page(105, 148, dpi=100, point_size=8)
    >>> page.pixels.shape
    (583, 413, 3)
    >>> text.splitlines()[0]
    'On paper that will not lie flat 17'
    """
    px = mm_to_px(1, dpi)
    image = Image.new("RGB", (round(width_mm * px), round(height_mm * px)), "white")
    left, right, head = 0.115 * width_mm * px, 0.885 * width_mm * px, 0.07 * height_mm * px
    top, bottom = 0.11 * height_mm * px, 0.93 * height_mm * px
    size = point_size / 72 * dpi
    font = _font(size)

    texts = [_running_head(image, font, page_number, left, right, head)]
    first = _heading(title, 1.7 * size) if title else []
    if picture:
        first += _figure(
            Image.fromarray(hills(round(right - left), round(0.42 * (bottom - top)))), prose.PICTURE_CAPTION, font
        )
    if chart:
        art = colour_chart(round(right - left), round(0.36 * (bottom - top)))
        first += _figure(Image.fromarray(art), prose.CHART_CAPTION, font)
    top += sum(row.height for row in first)
    texts += _fill_columns(image, first, [(left, top - sum(row.height for row in first), bottom)])
    if stamp:
        bottom = _stamp(image, size, right, bottom)

    gap = 2 * size if columns > 1 else 0.0
    width = (right - left - gap * (columns - 1)) / columns
    rows = [row for block in _blocks(story, width, font, table, drawing) for row in block]
    texts += _fill_columns(image, rows, [(left + k * (width + gap), top, bottom) for k in range(columns)])
    pixels = np.asarray(image)
    return Page(pixels, np.ones(pixels.shape[:2], bool), dpi), "\n".join(texts)


def typeset_sheet(sheet: Sheet, dpi: float = 300.0) -> tuple[Page, str]:
    """Typeset the print of a sheet: one page, or two side by side on a sheet wider than high.

    Returns
    -------
    page : Page
    text : str
        Text of the left page, then of the right one.
    """
    if sheet.width_mm <= sheet.height_mm:
        return typeset_page(sheet.width_mm, sheet.height_mm, dpi)
    leaf = (sheet.width_mm / 2, sheet.height_mm, dpi)
    left, left_text = typeset_page(*leaf, point_size=9.5, page_number=16, story=prose.STORY[:7], table=False)
    right, right_text = typeset_page(*leaf, point_size=9.5, page_number=17, title=None, story=prose.STORY[7:])
    pixels = np.concatenate([left.pixels, right.pixels], axis=1)
    return Page(pixels, np.ones(pixels.shape[:2], bool), dpi), f"{left_text}\n{right_text}"


def _blocks(story: Sequence[str], width: float, font: Font, table: bool, drawing: bool) -> Iterator[Sequence[_Row]]:
    """Typeset the story to rows, with table and drawing in between."""
    for k, part in enumerate(story):
        if table and k == 3:
            yield _table(prose.TABLE, width, font)
        if drawing and k == 1:
            yield _figure(line_drawing(round(width), round(0.45 * width)), prose.DRAWING_CAPTION, font)
        yield _heading(part[2:], 1.15 * font.size) if part.startswith("# ") else _paragraph(part, width, font)


def _fill_columns(image: Image.Image, rows: Sequence[_Row], columns: Sequence[tuple[float, float, float]]) -> list[str]:
    """Fill columns (left, top, bottom) with rows until either is exhausted; return the placed text."""
    texts: list[str] = []
    positions = iter(columns)
    left, y, bottom = next(positions)
    for row in rows:
        while y + row.height + row.with_next > bottom + 0.5:
            place = next(positions, None)
            if place is None:
                return texts
            left, y, bottom = place
        row.paint(image, left, y)
        y += row.height
        if row.text:
            texts.append(row.text)
    return texts


def _font(size: float) -> Font:
    """Pillow's built-in font: needs no font file."""
    font = ImageFont.load_default(size)
    assert isinstance(font, Font)
    return font


def _running_head(image: Image.Image, font: Font, page_number: int, left: float, right: float, base: float) -> str:
    """Draw book title and page number above a fine rule; return their text."""
    number = str(page_number)
    texts = [prose.HEAD, number] if page_number % 2 else [number, prose.HEAD]
    _write(texts[0], font, 0, 0)(image, left, base)
    _write(texts[1], font, -font.getlength(texts[1]), 0)(image, right, base)
    _rule(image, left, right, base + 0.5 * font.size, font.size / 24)
    return " ".join(texts)


def _heading(text: str, size: float) -> list[_Row]:
    font = _font(size)
    paint = _write(text, font, 0, 1.55 * size, bold=max(1, round(size / 40)))
    return [_Row(2.0 * size, paint, text, with_next=2 * LEADING * size)]


def _paragraph(text: str, width: float, font: Font) -> list[_Row]:
    """Typeset a justified paragraph: first line indented, last line ragged."""
    words = text.split()
    widths = np.array([font.getlength(word) for word in words])
    space, indent = font.getlength(" "), 1.2 * font.size
    starts = _line_starts(widths, space, width, indent)
    rows = []
    for k, (first, last) in enumerate(zip(starts, [*starts[1:], len(words)], strict=True)):
        x = indent if k == 0 else 0.0
        gaps = last - first - 1
        stretched = gaps and last < len(words)
        step = (width - x - widths[first:last].sum()) / gaps if stretched else space
        positions = x + np.concatenate([[0], np.cumsum(widths[first:last] + step)[:-1]])
        painters = [_write(word, font, at, font.size) for word, at in zip(words[first:last], positions, strict=True)]
        rows.append(_Row(LEADING * font.size, _all(painters), " ".join(words[first:last])))
    return rows


def _line_starts(widths: NDArray[np.float64], space: float, width: float, indent: float) -> list[int]:
    """Optimal line breaks by least squared stretch (Knuth and Plass 1981, without hyphenation)."""
    count = len(widths)
    cost, start = np.full(count + 1, np.inf), np.zeros(count + 1, int)
    cost[0] = 0.0
    for last in range(1, count + 1):
        for first in range(last - 1, -1, -1):
            room = width - (indent if first == 0 else 0.0)
            gaps = last - first - 1
            slack = room - widths[first:last].sum() - gaps * space
            if slack < -0.15 * space * gaps and gaps:
                break
            loose = 0.0 if last == count else (slack / (space * max(gaps, 1))) ** 2
            if cost[first] + loose < cost[last]:
                cost[last], start[last] = cost[first] + loose, first
    starts = [count]
    while starts[0] > 0:
        starts.insert(0, int(start[starts[0]]))
    return starts[:-1]


def _table(lines: Sequence[Sequence[str]], width: float, font: Font) -> list[_Row]:
    """Typeset a table between rules: first column left-aligned, the others right-aligned."""
    pitch = 1.35 * font.size
    ends = np.linspace(0.5, 1, len(lines[0]))[1:] * width
    painters: list[Painter] = [partial(_rule_row, width=width, y=0.6 * pitch, thickness=font.size / 12)]
    for k, line in enumerate(lines):
        base = (1.6 + k + 0.25 * (k > 0)) * pitch
        painters.append(_write(line[0], font, 0, base))
        painters += [_write(cell, font, x - font.getlength(cell), base) for cell, x in zip(line[1:], ends, strict=True)]
    painters.append(partial(_rule_row, width=width, y=1.95 * pitch, thickness=font.size / 24))
    painters.append(partial(_rule_row, width=width, y=(len(lines) + 1.25) * pitch, thickness=font.size / 12))
    return [_Row((len(lines) + 2.2) * pitch, _all(painters), "\n".join(" ".join(line) for line in lines))]


def _figure(art: Image.Image, caption: str, font: Font) -> list[_Row]:
    """Place a picture with its caption below."""
    small = _font(0.9 * font.size)
    above = 0.6 * font.size
    base = above + art.height + 1.3 * font.size

    def paint(image: Image.Image, left: float, top: float) -> None:
        image.paste(art, (round(left), round(top + above)))
        _write(caption, small, 0, base)(image, left, top)

    return [_Row(base + 1.2 * font.size, paint, caption)]


def _stamp(image: Image.Image, size: float, right: float, bottom: float) -> float:
    """Draw the stamp at the bottom right; return the new bottom of the text area."""
    mark = stamp_print(prose.STAMP, 1.5 * size)
    place = (round(right) - mark.width, round(bottom) - mark.height)
    image.paste(ImageChops.multiply(image.crop((*place, place[0] + mark.width, place[1] + mark.height)), mark), place)
    return bottom - mark.height - 0.5 * size


def _write(text: str, font: Font, x: float, base: float, bold: int = 0) -> Painter:
    """Write a string at a position within its row; `bold` [px] is the stroke width."""

    def paint(image: Image.Image, left: float, top: float) -> None:
        ImageDraw.Draw(image).text((left + x, top + base), text, "black", font, anchor="ls", stroke_width=bold)

    return paint


def _rule_row(image: Image.Image, left: float, top: float, *, width: float, y: float, thickness: float) -> None:
    _rule(image, left, left + width, top + y, thickness)


def _rule(image: Image.Image, left: float, right: float, y: float, thickness: float) -> None:
    lowest = round(y) + max(1, round(thickness)) - 1
    ImageDraw.Draw(image).rectangle((round(left), round(y), round(right), lowest), fill="black")


def _all(painters: Sequence[Painter]) -> Painter:
    """Combine painters of one row."""

    def paint(image: Image.Image, left: float, top: float) -> None:
        for piece in painters:
            piece(image, left, top)

    return paint
