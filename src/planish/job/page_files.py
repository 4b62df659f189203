"""Page files of a restoration: one or two pages, in colour, binarized and as mask, with an optional text layer."""

from __future__ import annotations

from pathlib import Path

from planish.document import split_pages
from planish.errors import OutputError, UsageError
from planish.io import (
    Origin,
    check_ocr,
    check_page_name,
    origin_of,
    page_names,
    text_layer,
    write_page,
    write_pages,
)
from planish.job.job import Outputs
from planish.render import mask_of
from planish.types import Page, Restoration


def page_files(out: Outputs, max_pages: int) -> list[Path]:
    """Names of all page files that may be written if the sheet is split into at most `max_pages` pages."""
    files = [path for path in (out.page, *out.copies, out.binary, out.mask) if path is not None]
    counts = range(1, max_pages + 1)
    return list(dict.fromkeys(name for path in files for count in counts for name in page_names(path, count)))


def check_pages(out: Outputs) -> None:
    """Check names and formats of the page files before any long computation.

    Raises
    ------
    OutputError, UsageError, MissingExtraError
    """
    named = (out.page, *out.copies, out.binary, out.mask)
    suffixes = {path: check_page_name(path) for path in named if path is not None}
    if out.mask is not None and suffixes[out.mask] not in (".png", ".tif", ".tiff"):
        raise OutputError(f"{out.mask}: a mask needs a lossless format; name it .png or .tif")
    for what in [*(["PDF/A"] if out.pdfa else []), *(["an OCR text layer"] if out.ocr is not None else [])]:
        if ".pdf" not in suffixes.values():
            raise UsageError(f"{what} requires a PDF, but the page is {out.page.name}", "name a page that ends in .pdf")
    if out.ocr is not None:
        check_ocr(out.ocr)


def recognize_text(restoration: Restoration, language: str) -> list[bytes]:
    """OCR text layer of each page, as returned by `planish.io.text_layer`."""
    return [text_layer(part, language) for part in _parts(_page(restoration), restoration)]


def write_page_files(out: Outputs, restoration: Restoration, binarized_by: str, text: list[bytes]) -> list[Path]:
    """Write all page files of a restoration.

    Parameters
    ----------
    out : Outputs
    restoration : Restoration
        With a rendered page, and a report that lists the sources.
    binarized_by : str
        Binarization method, for the metadata of the file.
    text : list of bytes
        As returned by `recognize_text`; empty for no text layer.

    Returns
    -------
    list of Path
        The files written.
    """
    page, report = _page(restoration), restoration.report
    written = []
    for path in (out.page, *out.copies):
        written += _write(path, _parts(page, restoration), origin_of(report, report.sources), out.pdfa, text)
    if out.binary is not None:
        assert restoration.binary is not None
        origin = origin_of(report, report.sources, binarized_by)
        written += _write(out.binary, _parts(restoration.binary, restoration), origin, out.pdfa, text)
    if out.mask is not None:
        mask = mask_of(page, restoration.clipped)
        written += _write(out.mask, _parts(mask, restoration), origin_of(report, report.sources), False, [])
    return written


def _page(restoration: Restoration) -> Page:
    page = restoration.page
    assert page is not None
    return page


def _parts(page: Page, restoration: Restoration) -> list[Page]:
    return [page] if restoration.report.spine is None else list(split_pages(page, restoration.report.spine))


def _write(path: Path, pages: list[Page], origin: Origin, pdfa: bool, text: list[bytes]) -> list[Path]:
    """Write pages into one file, or one file per page, as the format allows."""
    names = page_names(path, len(pages))
    if len(names) > 1:
        for name, page in zip(names, pages, strict=True):
            write_page(name, page, origin)
    else:
        is_pdf = path.suffix.lower() == ".pdf"
        write_pages(path, pages, origin, pdfa=pdfa and is_pdf, text=text if is_pdf else ())
    return names
