"""From a photo to a scan: detect text and borders, fit the shape, report its confidence."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from planish.display.one_line import one_line
from planish.errors import InputError, UsageError
from planish.photo.borders import NAMES, Borders, find_borders
from planish.photo.creases import crease_length
from planish.photo.fitted_sheet import (
    AGAINST_TEXT,
    PAGE_OF_TEXT,
    FittedSheet,
    from_borders,
    from_lines,
    letters_residual_px,
)
from planish.photo.gutter import find_gutter, larger_part, part_of_lines, part_of_region
from planish.photo.line_grouping import reject_false_lines, select, without_rule_ends
from planish.photo.lines import TextLines, find_text_lines
from planish.photo.page_extent import kept_share
from planish.photo.polynomial import from_polynomials
from planish.photo.report import photo_report
from planish.photo.shading import from_shading
from planish.photo.sheet_region import sheet_regions
from planish.photo.surface import make_scan, page_rim
from planish.photo.working_image import working_image
from planish.settings import PAPERS_MM, USUAL_SHEET_MM, PhotoSettings
from planish.types import Diagnostic, Floats, PhotoReport, Pixels, Scan

USUAL_FOCAL = 0.8
"""Focal length, in long sides of the photo, if EXIF has none: phones and compact cameras, unzoomed, have 0.7 to
0.85."""
LETTER_MM = 2.0
"""Typical mean height of printed letters in books and correspondence; the page size is guessed from it where borders
are not visible."""
FEWEST_LINES = 3
FEWEST_LETTERS = 25
"""Least lines and letters for fitting a shape without borders."""
CROOKED = 0.09
"""Largest residual of letters from their lines, in letter heights, of real print: fur and leaves have 0.11 to 0.13, the
worst photos of print 0.075."""


@dataclass(frozen=True, eq=False)
class PhotoShape:
    """Shape of the sheet on a photo.

    Attributes
    ----------
    scan : Scan
        Surface mesh with the photo and its camera; input of `planish.restore`.
    report : PhotoReport
    warnings : tuple of Diagnostic
    side : "left", "right" or None
        Which of two facing pages it is, where both were asked for.
    """

    scan: Scan
    report: PhotoReport
    warnings: tuple[Diagnostic, ...]
    side: str | None = None

    __repr__ = one_line


@dataclass(frozen=True, eq=False)
class _Part:
    """What was detected of one page."""

    lines: TextLines | None
    borders: Borders | None
    facing: str | None = None
    """On which side of it another page lies that is left out."""
    side: str | None = None
    """Which of two facing pages it is, where both are to be made."""


def find_shape(
    photo: Pixels, settings: PhotoSettings | None = None, *, focal_px: float | None = None, icc: bytes | None = None
) -> PhotoShape:
    """Find the shape of the sheet on a photo; of facing pages, that of the larger one.

    The sheet is modelled as a generalised cylinder, like a book page, seen by a pinhole camera; the residual is
    absorbed by a smooth 2D warp. One photo determines the shape up to scale.

    Parameters
    ----------
    photo : (rows, cols, 3) uint8 or uint16
        In any orientation.
    settings : PhotoSettings, optional
    focal_px : float, optional [px]
        Focal length; `planish.io.focal_length_px` reads it from EXIF. Default: 0.8 of the long side.
    icc : bytes, optional
        Colour profile, passed on to the page.

    Raises
    ------
    InputError
        If neither text nor sheet borders are found.
    UsageError
        If the paper size is given but not all borders are visible, or two pages are asked for: `find_shapes` has both.

    Examples
    --------
    >>> from planish.gallery import sheet, virtual_scan
    >>> photo = virtual_scan(sheet("book"), points=2000, photo_px=(1600, 1200)).scan.photo
    >>> found = find_shape(photo, PhotoSettings(paper="letter"))
    >>> found.report.shape, found.report.scale
    ('text-lines and borders', 'paper')
    """
    if settings is not None and settings.pages == "2":
        raise UsageError("two pages have two shapes: use find_shapes")
    return find_shapes(photo, settings, focal_px=focal_px, icc=icc)[0]


def find_shapes(
    photo: Pixels, settings: PhotoSettings | None = None, *, focal_px: float | None = None, icc: bytes | None = None
) -> tuple[PhotoShape, ...]:
    """Find the shapes of the pages asked for: two facing ones, from left to right, or one; see `find_shape`.

    Of two pages one may have no shape: then the other comes alone, and a warning of it says why.

    Raises
    ------
    InputError, UsageError
        As `find_shape`; of two pages where neither has a shape, the second one's.
    """
    s = settings or PhotoSettings()
    focal = focal_px or USUAL_FOCAL * max(photo.shape[:2])
    centre = (np.array(photo.shape[1::-1]) - 1) / 2
    shapes: list[PhotoShape] = []
    lost: list[Diagnostic] = []
    parts = _detect(photo, s)
    for part in parts:
        try:
            shapes.append(_shape_of(photo, s, part, focal, centre, "exif" if focal_px else "assumed", icc))
        except InputError as error:
            if part is parts[-1] and not shapes:
                raise
            sentence = f"only one of the two pages was made; the {part.side} one has no shape: {error.sentence}"
            lost.append(Diagnostic("page-not-made", sentence, error.hint))
    return tuple(replace(shape, warnings=(*lost, *shape.warnings)) for shape in shapes)


def _shape_of(
    photo: Pixels, s: PhotoSettings, part: _Part, focal: float, centre: Floats, focal_from: str, icc: bytes | None
) -> PhotoShape:
    lines = None if s.shape in ("borders", "shading") else part.lines
    sheet = _fit_sheet(photo, s, lines, part.borders, focal, centre)
    if lines is not None and s.shape != "polynomial" and (text := _page_of_text(lines)) is not None:
        alone = _fit_sheet(photo, s, text, part.borders, focal, centre)
        if letters_residual_px(sheet, lines) > AGAINST_TEXT * letters_residual_px(alone, text):
            sheet, lines = alone, text
    upright, columns = (lines.upright, lines.columns) if lines else (0.0, False)
    scan = make_scan(sheet.cylinder, sheet.warp, photo, _mm_per_unit(sheet, lines, s), icc, upright, columns=columns)
    scale = "paper" if s.paper != "unknown" else "width" if s.width_mm else "unknown"
    kept = None if part.borders is None else kept_share(part.borders.outline, page_rim(sheet.cylinder, sheet.warp))
    report, warnings = photo_report(sheet, lines, crease_length(photo, sheet, lines), scale, focal_from, kept)
    if s.shape == "polynomial":
        report = replace(report, shape="polynomial")
    return PhotoShape(scan, report, (*_left_out(part), *warnings), part.side)


def _page_of_text(lines: TextLines) -> TextLines | None:
    """The lines of text, where there are rules beside enough of it to judge whether these are level; else None."""
    if not lines.rule.any():
        return None
    text = select(lines, ~lines.rule)
    enough = text is not None and len(text.height) >= FEWEST_LINES and len(text.line) >= PAGE_OF_TEXT
    return replace(text, uprights=()) if text is not None and enough else None


def _detect(photo: Pixels, s: PhotoSettings) -> list[_Part]:
    """Detect text lines and sheet borders of every page to make, as far as requested and present."""
    lines = find_text_lines(working_image(photo))
    lines = _if_enough(reject_false_lines(lines) if lines is not None else None)
    if s.shape == "polynomial" or (s.shape == "text-lines" and s.pages == "1"):
        return [_Part(lines, None)]
    regions = sheet_regions(photo, None if lines is None else without_rule_ends(lines))
    first = next(regions)
    gutter = None
    if lines is not None and s.pages != "1":
        gutter = find_gutter(first, lines, always=s.pages == "2")
    elif s.pages == "2":
        raise InputError("the photo shows no lines of text beside which a gutter could be found")
    if gutter is None:
        borders = None if s.shape == "text-lines" else find_borders(chain([first], regions), _angle(lines))
        return [_Part(lines, borders)]
    wanted = ("left", "right") if s.pages == "2" else (larger_part(first, gutter),)
    both = [first, *regions]
    parts = []
    for which in wanted:
        here = _if_enough(part_of_lines(lines, gutter, which)) if lines is not None else None
        pages = [part_of_region(region, gutter, which) for region in both]
        borders = None if s.shape == "text-lines" else find_borders(pages, _angle(lines), gutter)
        both_made = s.pages == "2"
        facing = None if both_made else "left" if which == "right" else "right"
        parts.append(_Part(here, borders, facing, which if both_made else None))
    return parts


def _if_enough(lines: TextLines | None) -> TextLines | None:
    """Text lines unless they are so few or crooked that they may be none."""
    if lines is not None and (len(lines.line) < FEWEST_LETTERS or lines.straightness > CROOKED):
        return None
    return lines


def _angle(lines: TextLines | None) -> float:
    return 0.0 if lines is None else lines.angle


def _left_out(part: _Part) -> list[Diagnostic]:
    """Warnings of what the page does not show."""
    warnings = []
    if part.facing is not None:
        sentence = f"the photo also shows a facing page, on the {part.facing}, which was left out"
        warnings.append(Diagnostic("facing-page", sentence, "make both with {pages=2}, or no gutter with {pages=1}"))
    if part.borders is not None:
        cut = [name for name, off in zip(NAMES, part.borders.cropped, strict=True) if off]
        if cut:
            sentence = (
                f"the sheet reaches the photo's edge at its {' and '.join(cut)}, or looks like its ground there: "
                "some of it may be missing"
            )
            warnings.append(Diagnostic("sheet-cut", sentence, "photograph the whole sheet"))
    return warnings


def _fit_sheet(
    photo: Pixels, s: PhotoSettings, lines: TextLines | None, borders: Borders | None, focal: float, centre: Floats
) -> FittedSheet:
    whole = borders is not None and all(borders.plain)
    if s.shape == "shading":
        if borders is None or not whole:
            raise InputError(
                "the photo shows no outline of a sheet; shape from shading needs all four sides of a sheet that is "
                "bent in one direction only, under one lamp, on a background of another colour"
            )
        return from_shading(photo, borders, focal, centre)
    if s.paper != "unknown" and not whole:
        raise UsageError(
            "the paper size was given, but the photo does not show all borders of the sheet on a plain background",
            "give {width_mm} for the width of the part that is drawn, or photograph the whole sheet",
        )
    enough = lines is not None and len(lines.height) >= FEWEST_LINES
    if borders is not None and (whole or (enough and any(borders.plain))):
        return from_borders(borders, lines, focal, centre, ratio=_ratio(borders, s))
    if lines is None or not enough:
        found = "" if lines is None else f"; only {len(lines.height)} lines of text were found"
        missing = {
            "text-lines": "no lines of text",
            "polynomial": "no lines of text",
            "borders": "no outline of a sheet",
        }.get(s.shape, "neither lines of text nor the outline of a sheet")
        raise InputError(
            f"the photo shows {missing}{found}; needed are {FEWEST_LINES} sharp lines of print, letters 10 pixels "
            "high, or a whole sheet on a background of another colour"
        )
    if s.shape == "polynomial":
        return from_polynomials(lines, focal, centre)
    return from_lines(lines, borders, focal, centre)


def _ratio(borders: Borders, s: PhotoSettings) -> float | None:
    """Aspect ratio, width / height, of the paper in the orientation on the photo."""
    if s.paper == "unknown":
        return None
    short, long = PAPERS_MM[s.paper]
    top, right, bottom, left = (float(np.linalg.norm(np.diff(side, axis=0), axis=1).sum()) for side in borders.sides)
    return short / long if top + bottom < right + left else long / short


def _mm_per_unit(sheet: FittedSheet, lines: TextLines | None, s: PhotoSettings) -> float:
    """Millimetres per camera distance."""
    width, height = sheet.warp.high - sheet.warp.low
    if s.width_mm is not None:
        return float(s.width_mm / (height if lines is not None and lines.columns else width))
    if s.paper != "unknown":
        return float(PAPERS_MM[s.paper][1] / max(width, height))
    if sheet.bordered or lines is None or lines.rule.all():
        return float(USUAL_SHEET_MM / max(width, height))
    return float(LETTER_MM / lines.letter_height * sheet.cylinder.focal)
