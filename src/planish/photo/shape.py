"""From a photo to a scan: detect text and borders, fit the shape, report its confidence."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from planish.display.one_line import one_line
from planish.errors import InputError, UsageError
from planish.photo.borders import Borders, find_borders
from planish.photo.creases import crease_length
from planish.photo.fitted_sheet import FittedSheet, from_borders, from_lines
from planish.photo.line_grouping import reject_false_lines
from planish.photo.lines import TextLines, find_text_lines
from planish.photo.polynomial import from_polynomials
from planish.photo.report import photo_report
from planish.photo.shading import from_shading
from planish.photo.surface import make_scan
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
    """

    scan: Scan
    report: PhotoReport
    warnings: tuple[Diagnostic, ...]

    __repr__ = one_line


def find_shape(
    photo: Pixels, settings: PhotoSettings | None = None, *, focal_px: float | None = None, icc: bytes | None = None
) -> PhotoShape:
    """Find the shape of the sheet on a photo.

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
        If the paper size is given but not all borders are visible.

    Examples
    --------
    >>> from planish.gallery import sheet, virtual_scan
    >>> photo = virtual_scan(sheet("book"), points=2000, photo_px=(1600, 1200)).scan.photo
    >>> found = find_shape(photo, PhotoSettings(paper="letter"))
    >>> found.report.shape, found.report.scale
    ('text-lines and borders', 'paper')
    """
    s = settings or PhotoSettings()
    focal = focal_px or USUAL_FOCAL * max(photo.shape[:2])
    centre = (np.array(photo.shape[1::-1]) - 1) / 2
    lines, borders = _detect(photo, s)
    sheet = _fit_sheet(photo, s, lines, borders, focal, centre)
    scan = make_scan(
        sheet.cylinder, sheet.warp, photo, _mm_per_unit(sheet, lines, s), icc, lines.upright if lines else 0.0
    )
    scale = "paper" if s.paper != "unknown" else "width" if s.width_mm else "unknown"
    report, warnings = photo_report(sheet, lines, crease_length(photo, sheet), scale, "exif" if focal_px else "assumed")
    if s.shape == "polynomial":
        report = replace(report, shape="polynomial")
    return PhotoShape(scan, report, warnings)


def _detect(photo: Pixels, s: PhotoSettings) -> tuple[TextLines | None, Borders | None]:
    """Detect text lines and sheet borders, as far as requested and present."""
    lines = find_text_lines(working_image(photo))
    lines = reject_false_lines(lines) if lines is not None else None
    if lines is not None and (len(lines.line) < FEWEST_LETTERS or lines.straightness > CROOKED):
        lines = None
    borders = None if s.shape in ("text-lines", "polynomial") else find_borders(photo, lines)
    return (None if s.shape in ("borders", "shading") else lines), borders


def _fit_sheet(
    photo: Pixels, s: PhotoSettings, lines: TextLines | None, borders: Borders | None, focal: float, centre: Floats
) -> FittedSheet:
    if s.shape == "shading":
        if borders is None:
            raise InputError(
                "the photo shows no outline of a sheet; shape from shading needs all four sides of a sheet that is "
                "bent in one direction only, under one lamp, on a background of another colour"
            )
        return from_shading(photo, borders, focal, centre)
    if borders is not None:
        return from_borders(borders, lines, focal, centre, ratio=_ratio(borders, s))
    if s.paper != "unknown":
        raise UsageError(
            "the paper size was given, but the photo does not show all borders of the sheet on a plain background",
            "give {width_mm} for the width of the part that is drawn, or photograph the whole sheet",
        )
    if lines is None or len(lines.height) < FEWEST_LINES:
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
    return (from_polynomials if s.shape == "polynomial" else from_lines)(lines, focal, centre)


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
        return float(s.width_mm / width)
    if s.paper != "unknown":
        return float(PAPERS_MM[s.paper][1] / max(width, height))
    if sheet.bordered or lines is None:
        return float(USUAL_SHEET_MM / max(width, height))
    return float(LETTER_MM / np.median(lines.height) * sheet.cylinder.focal)
