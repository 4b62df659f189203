"""Quality certificate: one A4 sheet with the figures and maps of a restoration."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planish.color import LUMINANCE
from planish.dpi import MM_PER_INCH
from planish.report.drawing import AMBER, FAINT, GREEN, INK, RED, SOFT, Sheet, length, wrapped
from planish.report.heat import TOP, coloured, over_page, round_above, round_span
from planish.types import Criterion, Floats, Restoration

DPI = 200.0
WIDTH, HEIGHT = 1654, 2339
"""Pixels of A4 paper."""
MARGIN = 120
TITLE, HEADING, TEXT, SMALL, TINY = 66.0, 31.0, 27.0, 23.0, 20.0
INNER = WIDTH - 2 * MARGIN
GAP = 42
THUMB = (520, 660)
MAP_HEIGHT = 430
CLIPPED = np.array([226, 62, 87], np.uint8)
"""Colour on the map of light where the photo is clipped."""
MOST_WARNINGS = 6
"""Lines of notes that the sheet has room for."""


def certificate(done: Restoration, name: str = "") -> NDArray[np.uint8]:
    """Draw the certificate of a restoration: A4 at 200 dpi.

    The page, its figures, maps of strain, of the expected error, of the photo's resolution and of its light, the
    limits of the FADGI guidelines that these figures can be held against, and the notes.

    Parameters
    ----------
    done : Restoration
        With a page.
    name : str
        Name of the scan, for the title.

    Returns
    -------
    (2339, 1654, 3) uint8
    """
    sheet = Sheet(WIDTH, HEIGHT)
    _head(sheet, done, name)
    top = 330.0
    page = done.page
    assert page is not None
    sheet.picture(page.pixels, (MARGIN, top, *THUMB))
    _figures(sheet, done, MARGIN + THUMB[0] + 60, top)
    y = _maps(sheet, done, top + THUMB[1] + 72)
    y = _guideline(sheet, done, y + 62)
    _notes(sheet, done, y + 66)
    return sheet.pixels


def _head(sheet: Sheet, done: Restoration, name: str) -> None:
    report = done.report
    sheet.words((MARGIN, 150), "Quality certificate", TITLE)
    sheet.words((WIDTH - MARGIN, 150), f"planish {report.version}", TEXT, SOFT, "rs")
    if name:
        sheet.words((MARGIN, 206), _shortened(name, HEADING, INNER), HEADING, SOFT)
    sheet.rule(MARGIN, 234, INNER, INK, 3)
    verdict = report.verdict
    sheet.dot(MARGIN + 11, 275, 11, {"good": GREEN, "look at it": AMBER, "not good": RED}[verdict.word])
    first = f": {verdict.reasons[0].sentence}" if verdict.reasons else f". {report.outcome}"
    line = wrapped(f"{verdict.word.capitalize()}{first}", TEXT, INNER - 38)
    sheet.words((MARGIN + 38, 284), line[0] + (" ..." if len(line) > 1 else ""), TEXT)


def _shortened(text: str, size: float, width: float) -> str:
    """Shorten a text to fit a line, keeping its end."""
    while length(text, size) > width:
        text = "..." + text[4:]
    return text


def _figures(sheet: Sheet, done: Restoration, x: float, y: float) -> None:
    """Draw groups of figures under their headings."""
    right = WIDTH - MARGIN
    y += 16
    for heading, rows in _groups(done):
        sheet.words((x, y), heading, SMALL, SOFT)
        sheet.rule(x, y + 12, right - x)
        y += 49
        for what, how_much in rows:
            sheet.words((x, y), what, TEXT)
            sheet.words((right, y), how_much, TEXT, INK, "rs")
            y += 36
        y += 22


def _groups(done: Restoration) -> list[tuple[str, list[tuple[str, str]]]]:
    report = done.report
    page, flat, light = report.page, report.flatten, report.shading
    width, height = page.width_mm, page.height_mm
    noise = "" if report.scan.noise_mm is None else f"noise {report.scan.noise_mm:.3f} mm"
    groups = [
        (
            "PAGE",
            [
                ("size", f"{width:.1f} x {height:.1f} mm ({width / MM_PER_INCH:.2f} x {height / MM_PER_INCH:.2f} in)"),
                ("drawn at", f"{page.dpi or 0:g} dpi"),
                ("the photo has", f"{page.effective_ppi_median or 0:.0f} ppi (median)"),
                ("over nine tenths at least", f"{page.effective_ppi_p10 or 0:.0f} ppi"),
                ("seen by the photo", f"{100 * (page.known_fraction or 0):.1f} % of the page"),
            ],
        ),
        (
            "GEOMETRY",
            [
                ("scan", ", ".join(filter(None, [f"{report.scan.points:,} points", noise]))),
                ("expected error", f"{flat.expected_error_mm:.3f} mm (rms)"),
                ("strain", f"{100 * flat.strain_rms:.3f} % (rms), {100 * flat.strain_max:.2g} % at most"),
                ("faces turned over, overlapping", f"{flat.flipped_faces:,}, {flat.overlaps:,}"),
            ],
        ),
    ]
    if light is not None:
        groups.append(
            (
                "LIGHT",
                [
                    ("shade taken off by", light.method),
                    (
                        "paper even to",
                        f"{100 * light.unevenness:.1f} % (before: {100 * light.unevenness_before:.0f} %)",
                    ),
                    ("fitted on", f"{100 * light.paper_share:.0f} % of the page"),
                    ("clipped in the photo", f"{100 * light.clipped_share:.1f} % of the page"),
                ],
            )
        )
    return groups


def _maps(sheet: Sheet, done: Restoration, y: float) -> float:
    """Draw four maps of the page with their colour scales; returns the y below them."""
    flat = done.flattening
    width = (INNER - 3 * GAP) / 4
    height = min(MAP_HEIGHT, width * flat.size_mm[1] / flat.size_mm[0])
    both = np.c_[100 * flat.local_strain, flat.error_mm]
    strain, error = np.moveaxis(
        over_page(flat.page_xy, done.prepared.source.mesh.faces, both, flat.size_mm, round(height)), 2, 0
    )
    boxes = [(MARGIN + k * (width + GAP), y, width, height) for k in range(4)]
    _map(sheet, boxes[0], "Strain", "%", strain, 0.0, round_above(np.nanquantile(strain, TOP)))
    _map(sheet, boxes[1], "Expected error", "mm", error, 0.0, round_above(np.nanquantile(error, TOP)))
    if done.ppi is not None:
        _map(sheet, boxes[2], "Resolution of the photo", "ppi", done.ppi.astype(np.float64), *round_span(done.ppi, 20))
    if done.light is not None:
        light, clipped = _light_of_paper(done)
        _map(sheet, boxes[3], "Light on blank paper", "% of white", light, *round_span(light, 10), marked=clipped)
    return y + height + 150


def _light_of_paper(done: Restoration) -> tuple[Floats, NDArray[np.bool_]]:
    """Brightness of blank paper in the photo [% of the code values], and the mask of clipped pixels."""
    import cv2

    assert done.light is not None
    light = 100 * np.clip(done.light @ LUMINANCE, 0, 1).astype(np.float64) ** (1 / 2.2)
    rows, cols = light.shape
    if done.clipped is None:
        return light, np.zeros((rows, cols), bool)
    share = cv2.resize(np.asarray(done.clipped, np.float32), (cols, rows), interpolation=cv2.INTER_AREA)
    return light, share > 0.5


def _map(
    sheet: Sheet,
    box: tuple[float, float, float, float],
    title: str,
    unit: str,
    values: Floats,
    low: float,
    high: float,
    marked: NDArray[np.bool_] | None = None,
) -> None:
    """Draw one map in its box (left, top, width, height), with title and colour scale."""
    x, y, width, height = box
    sheet.words((x, y), title, TEXT)
    picture = coloured(values, low, high)
    if marked is not None:
        picture[marked] = CLIPPED
    sheet.picture(picture, (x, y + 22, width, height))
    y += height + 40
    bar = coloured(np.tile(np.linspace(low, high, round(width)), (18, 1)), low, high)
    sheet.picture(bar, (x, y, width, 18), framed=False)
    for share, anchor in ((0.0, "ls"), (0.5, "ms"), (1.0, "rs")):
        sheet.words((x + share * width, y + 46), f"{low + share * (high - low):.3g}", SMALL, INK, anchor)
    clipped = ", red: clipped" if marked is not None and marked.any() else ""
    sheet.words((x + width / 2, y + 76), unit + clipped, SMALL, SOFT, "ms")


def _guideline(sheet: Sheet, done: Restoration, y: float) -> float:
    """Draw the table of the guidelines; returns the y below it."""
    found = done.report.guideline
    if found is None:
        return y
    columns = [MARGIN + 560, *(MARGIN + 760 + 132 * k for k in range(4))]
    sheet.words((MARGIN, y), "Beside the FADGI guidelines", HEADING)
    for k, x in enumerate(columns[1:]):
        sheet.words((x, y), f"{k + 1} star{'s' if k else ''}", SMALL, SOFT, "rs")
    sheet.words((columns[0], y), "this page", SMALL, SOFT, "rs")
    sheet.words((WIDTH - MARGIN, y), "reached", SMALL, SOFT, "rs")
    sheet.rule(MARGIN, y + 16, INNER)
    y += 56
    for criterion in found.criteria:
        _criterion(sheet, criterion, columns, y)
        y += 44
    sheet.rule(MARGIN, y - 26, INNER)
    explanation = (
        f"{found.name}. Not graded, as they need a reference target in the photo: {', '.join(found.not_graded)}. "
        "These are figures of one page, no certification of a studio."
    )
    return sheet.lines((MARGIN, y + 6), explanation, TINY, INNER, SOFT)


def _criterion(sheet: Sheet, criterion: Criterion, columns: list[int], y: float) -> None:
    sheet.words((MARGIN, y), criterion.name.capitalize(), TEXT)
    sheet.words((columns[0], y), f"{criterion.value:.3g} {criterion.unit}", TEXT, INK, "rs")
    sign = "at least" if criterion.limits[-1] > criterion.limits[0] else "below"
    for k, (x, limit) in enumerate(zip(columns[1:], criterion.limits, strict=True)):
        sheet.words((x, y), f"{sign} {limit:g}", TINY, INK if k < criterion.stars else FAINT, "rs")
    for k in range(4):
        sheet.star(WIDTH - MARGIN - 14 - 34 * (3 - k), y - 9, 14, filled=k < criterion.stars)


def _notes(sheet: Sheet, done: Restoration, y: float) -> None:
    """Draw as many reasons and notes as fit, and a line that explains the figures."""
    warnings = [*done.report.verdict.reasons, *done.report.notes]
    sheet.words((MARGIN, y), "Notes" if warnings else "No warnings", HEADING)
    sheet.rule(MARGIN, y + 16, INNER)
    y += 52
    lines = [(k == 0, line) for warning in warnings for k, line in enumerate(wrapped(str(warning), SMALL, INNER - 30))]
    for first, line in lines[:MOST_WARNINGS]:
        if first:
            sheet.dot(MARGIN + 8, y - 8, 4, SOFT)
        sheet.words((MARGIN + 26, y), line, SMALL)
        y += 32
    if len(lines) > MOST_WARNINGS:
        sheet.words((MARGIN + 26, y), "More in the report.", SMALL, SOFT)
    explanation = (
        "Expected error: rms distance of a point from its true place on the page, as far as strain and the scan's own "
        "noise tell. Strain: how far the flat sheet's lengths are from the paper's."
    )
    sheet.lines((MARGIN, HEIGHT - 84), explanation, TINY, INNER, SOFT)
