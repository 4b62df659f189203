"""Text read on the flat page by Tesseract, and which way up it thinks the page is: the extra `planish[ocr]`."""

from __future__ import annotations

from typing import Any

from PIL import Image

from planish.color import to_grey
from planish.errors import MissingExtraError, OutputError, UsageError, install_command
from planish.types import Page

SURE_OF_WAY = 5.0
"""Tesseract's own confidence in the way up, below which it is not listened to. Pages of print in mixed case have 10 to
22; on print in capitals it is wrong as often as not, with up to 3.6."""


def check_ocr(language: str) -> None:
    """Refuse, before long work, what `text_layer` could not do.

    Parameters
    ----------
    language : str
        As Tesseract names it: eng, deu, eng+fra.

    Raises
    ------
    MissingExtraError
        If the extra or the program Tesseract is not installed.
    UsageError
        If Tesseract lacks the language.
    """
    known = _tesseract().get_languages()
    missing = [name for name in language.split("+") if name not in known]
    if missing:
        raise UsageError(
            f"Tesseract has no language {' or '.join(missing)}, only {', '.join(sorted(known))}",
            "install its language data (on Debian: tesseract-ocr-LANGUAGE), or name another with {ocr}",
        )


def text_layer(page: Page, language: str) -> bytes:
    """Read the text of a page: a PDF of one page with that text in its places, invisible, and nothing else.

    Raises
    ------
    MissingExtraError
        If the extra or the program Tesseract is not installed.
    OutputError
        If Tesseract gives up.
    """
    program = _tesseract()
    try:
        found = program.image_to_pdf_or_hocr(
            _grey_image(page), lang=language, config=f"{_dpi(page)} -c textonly_pdf=1", extension="pdf"
        )
    except program.TesseractError as problem:
        raise OutputError(f"Tesseract could not read the page: {problem.message}", "leave out {ocr}") from None
    return bytes(found)


def way_up(page: Page) -> int | None:
    """By how many degrees the page must be turned clockwise to stand upright, as Tesseract sees it.

    Returns
    -------
    int or None
        0, 90, 180 or 270; None where Tesseract is not there or not sure.
    """
    try:
        program = _tesseract()
    except MissingExtraError:
        return None
    try:
        told = program.image_to_osd(_grey_image(page), config=_dpi(page), output_type=program.Output.DICT)
    except program.TesseractError:  # too few letters, or no data for it
        return None
    return int(told["rotate"]) if told["orientation_conf"] >= SURE_OF_WAY else None


def _tesseract() -> Any:
    try:
        import pytesseract
    except ImportError:
        raise MissingExtraError(f"reading text needs the extra: {install_command('ocr')}") from None
    try:
        pytesseract.get_tesseract_version()
    except pytesseract.TesseractNotFoundError:
        raise MissingExtraError(
            "reading text needs the program tesseract, which is not installed or not on the PATH; install it (on "
            "Debian: apt install tesseract-ocr)"
        ) from None
    return pytesseract


def _dpi(page: Page) -> str:
    return f"--dpi {max(70, round(page.dpi))}"  # less is not believed


def _grey_image(page: Page) -> Image.Image:
    return Image.fromarray(to_grey(page.pixels))
