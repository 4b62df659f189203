"""From a photo to a scan: what there is to tell the shape, the shape found from it, and how far it can be trusted."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from planish.errors import InputError, UsageError
from planish.photo.bent import Bent, from_borders, from_lines
from planish.photo.borders import Borders, borders_in
from planish.photo.creases import crease_length
from planish.photo.lines import TextLines, text_lines
from planish.photo.look import look_at
from planish.photo.polynomial import from_polynomials
from planish.photo.report import account_of
from planish.photo.rows import believable
from planish.photo.shading import from_shading
from planish.photo.surface import as_scan
from planish.settings import PhotoSettings
from planish.types import Diagnostic, Floats, PhotoReport, Pixels, Scan

USUAL_FOCAL = 0.8
"""Of the photo's long side, where the photo does not say: phones and small cameras, not zoomed, have 0.7 to 0.85."""
LETTER_MM = 2.0
"""Usual height of a printed letter, the mean of small ones and tall ones, in books and letters: the size of the page
is guessed from it where its borders are not seen."""
SHEET_MM = 297.0
"""The long side of a whole sheet is guessed to be that of the commonest."""
PAPERS_MM = {
    "a3": (297.0, 420.0),
    "a4": (210.0, 297.0),
    "a5": (148.0, 210.0),
    "letter": (215.9, 279.4),
    "legal": (215.9, 355.6),
}
FEWEST_LINES = 3
FEWEST_LETTERS = 25
"""Of text that the shape can be found from without borders."""
CROOKED = 0.09
"""What is taken for letters is off its lines by so much of their height, or it is no print: fur and leaves have 0.11 to
0.13, the worst photos of print 0.075."""


@dataclass(frozen=True, eq=False)
class PhotoShape:
    """The sheet on a photo.

    Attributes
    ----------
    scan : Scan
        Its surface as a mesh, with the photo and its camera; `planish.restore` makes the page of it.
    report : PhotoReport
    warnings : tuple of Diagnostic
    """

    scan: Scan
    report: PhotoReport
    warnings: tuple[Diagnostic, ...]


def find_shape(
    photo: Pixels, settings: PhotoSettings | None = None, *, focal_px: float | None = None, icc: bytes | None = None
) -> PhotoShape:
    """Find the shape of the sheet on a photo.

    The sheet is taken to be bent in one direction, like a book's page, and seen through a pinhole; what that leaves
    over is made good by a smooth shift. One photo tells the shape up to its size.

    Parameters
    ----------
    photo : (rows, cols, 3) uint8 or uint16
        Any way round.
    settings : PhotoSettings, optional
    focal_px : float, optional [px]
        Focal length; `planish.io.focal_length_px` reads it from a file. Without it 0.8 of the long side is assumed.
    icc : bytes, optional
        Colour profile, handed on to the page.

    Raises
    ------
    InputError
        Where neither text nor a sheet's borders are found.
    UsageError
        Where the paper's size was given, but not all of its borders are seen.

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
    lines, borders = _seen(photo, s)
    bent = _bent(photo, s, lines, borders, focal, centre)
    scan = as_scan(bent.sheet, bent.shift, photo, _mm_per_unit(bent, lines, s), icc, lines.upright if lines else 0.0)
    scale = "paper" if s.paper != "unknown" else "width" if s.width_mm else "unknown"
    report, warnings = account_of(bent, lines, crease_length(photo, bent), scale, "exif" if focal_px else "assumed")
    if s.shape == "polynomial":
        report = replace(report, shape="polynomial")
    return PhotoShape(scan, report, warnings)


def _seen(photo: Pixels, s: PhotoSettings) -> tuple[TextLines | None, Borders | None]:
    """Lines of text and the sheet's borders, as far as they are there and asked for."""
    lines = text_lines(look_at(photo))
    lines = believable(lines) if lines is not None else None
    if lines is not None and (len(lines.line) < FEWEST_LETTERS or lines.straightness > CROOKED):
        lines = None
    borders = None if s.shape in ("text-lines", "polynomial") else borders_in(photo, lines)
    return (None if s.shape in ("borders", "shading") else lines), borders


def _bent(
    photo: Pixels, s: PhotoSettings, lines: TextLines | None, borders: Borders | None, focal: float, centre: Floats
) -> Bent:
    if s.shape == "shading":
        if borders is None:
            raise InputError(
                "the photo shows no outline of a sheet; to tell the shape from shade it must show all four sides of a "
                "sheet, bent in one direction only, under one lamp, on a ground of another colour"
            )
        return from_shading(photo, borders, focal, centre)
    if borders is not None:
        return from_borders(borders, lines, focal, centre, ratio=_ratio(borders, s))
    if s.paper != "unknown":
        raise UsageError(
            "the size of the paper was given, but the photo does not show all borders of the sheet on a plain ground",
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
            f"the photo shows {missing}{found}; to tell the shape it must show {FEWEST_LINES} lines of print, sharp "
            "and 10 pixels high, or a whole sheet on a ground of another colour"
        )
    return (from_polynomials if s.shape == "polynomial" else from_lines)(lines, focal, centre)


def _ratio(borders: Borders, s: PhotoSettings) -> float | None:
    """Width against height of the paper, lying or upright as the photo shows it."""
    if s.paper == "unknown":
        return None
    short, long = PAPERS_MM[s.paper]
    top, right, bottom, left = (float(np.linalg.norm(np.diff(side, axis=0), axis=1).sum()) for side in borders.sides)
    return short / long if top + bottom < right + left else long / short


def _mm_per_unit(bent: Bent, lines: TextLines | None, s: PhotoSettings) -> float:
    """Millimetres in a distance of the camera."""
    width, height = bent.shift.high - bent.shift.low
    if s.width_mm is not None:
        return float(s.width_mm / width)
    if s.paper != "unknown":
        return float(PAPERS_MM[s.paper][1] / max(width, height))
    if bent.bordered or lines is None:
        return float(SHEET_MM / max(width, height))
    return float(LETTER_MM / np.median(lines.height) * bent.sheet.focal)
