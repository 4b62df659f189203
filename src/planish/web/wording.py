"""Warnings and errors in the words of the page in the browser: its controls instead of flags. No web framework here."""

from __future__ import annotations

from planish.errors import PlanishError
from planish.hints import as_field, with_hint
from planish.types import Diagnostic

LABELS = {
    "units": "the unit of the scan (under Settings)",
    "dpi": "the resolution (under Settings)",
    "method": "the method (under Settings)",
    "points": "points in the scan",
    "binarize": "the black and white page (under Settings)",
    "paper": "its paper",
    "width_mm": "its width",
    "marker_mm": "the side of a printed marker",
    "distance_mm": "a marked distance",
    "photo": "the photo",
    "camera": "the camera file",
    "pages": "the number of pages (under Settings)",
    "shape": "the shape",
}
"""What the page calls its controls."""

HINTS = {
    "surroundings-doubtful": "if so, draw the sheet's outline on the photo and restore it once more",
    "sheets-several": "draw the outline of another one on the photo to get that",
    "box-face": "draw the outline of another face on the photo to get that",
    "hand-left-out": "draw the sheet's outline on the photo if that is wrong",
    "outline-doubtful": "compare its sides with the original, or draw it once more, with more corners along bent sides",
    "surroundings-left-out": "draw the sheet's outline on the photo if that is wrong",
    "unit-guessed": "choose the unit of the scan under Settings if that is wrong",
    "unit-overruled": "choose the unit of the scan under Settings if that is wrong",
    "size-unusual": "choose the unit of the scan under Settings if that is wrong",
    "size-unknown": "choose its paper, or type its width",
    "page-huge": "choose the unit of the scan under Settings if so",
    "scale-unknown": "lay a printed card beside the sheet, choose its paper, mark a distance, or type its width",
}
"""Hints of warnings that the page has a better way for."""

_TERMINAL = ("`planish", "{overwrite}", "{as_=", "{ocr}", "{scale}", "{mask")
"""What marks a hint that helps in a terminal only."""


def in_browser(found: Diagnostic | PlanishError) -> str:
    """Sentence and hint of a warning or an error, as the page says it.

    Examples
    --------
    >>> in_browser(Diagnostic("unit-guessed", "the numbers were taken as cm", "set {units} if that is wrong"))
    'the numbers were taken as cm; choose the unit of the scan under Settings if that is wrong'
    >>> in_browser(PlanishError("it has no photo", "give {photo}, or use `planish flatten` for the geometry alone"))
    'it has no photo; give the photo'
    """
    code = found.code if isinstance(found, Diagnostic) else ""
    hint = HINTS.get(code, found.hint) if found.hint else ""
    parts = hint.split(", or ")
    kept = [part for part in parts if not any(mark in part for mark in _TERMINAL)]
    return with_hint(found.sentence, ", or ".join(kept), as_label)


def as_label(name: str, value: str | None = None) -> str:
    """Name a setting as the page does; one that it has no control for as the field of the HTTP API.

    Examples
    --------
    >>> as_label("units"), as_label("verlet.self_collision")
    ('the unit of the scan (under Settings)', 'the field verlet.self-collision')
    """
    if name not in LABELS:
        return as_field(name, value)
    return LABELS[name] if value is None else f"{LABELS[name]}: {value}"
