"""The files of the page: one or two of them, in colour and in black and white, with text and mask if so asked."""

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


def page_files(out: Outputs, most: int) -> list[Path]:
    """All files of the page that may be written, where the sheet may be split into as many as `most` pages."""
    wanted = [path for path in (out.page, *out.copies, out.binary, out.mask) if path is not None]
    counts = range(1, most + 1)
    return list(dict.fromkeys(name for path in wanted for count in counts for name in page_names(path, count)))


def check_pages(out: Outputs) -> None:
    """Refuse what could not be written, before long work.

    Raises
    ------
    OutputError, UsageError, MissingExtraError
    """
    named = (out.page, *out.copies, out.binary, out.mask)
    suffixes = {path: check_page_name(path) for path in named if path is not None}
    if out.mask is not None and suffixes[out.mask] not in (".png", ".tif", ".tiff"):
        raise OutputError(f"{out.mask}: a mask is written as .png or .tif, where no pixel changes")
    for flag in [*(["--pdfa"] if out.pdfa else []), *(["--ocr"] if out.ocr is not None else [])]:
        if ".pdf" not in suffixes.values():
            raise UsageError(f"{flag} is for PDF; name the page with -o NAME.pdf, not {out.page.name}")
    if out.ocr is not None:
        check_ocr(out.ocr)


def read_text(done: Restoration, language: str) -> list[bytes]:
    """The text of each page, as `planish.io.text_layer` gives it."""
    return [text_layer(part, language) for part in _parts(_page(done), done)]


def write_page_files(out: Outputs, done: Restoration, binarized_by: str, text: list[bytes]) -> list[Path]:
    """Write the pages of a restoration, one file after the other.

    Parameters
    ----------
    out : Outputs
    done : Restoration
        With a page; its report with the sources.
    binarized_by : str
        The method, for what the file says about itself.
    text : list of bytes
        As `read_text` gives it; empty where there shall be none.

    Returns
    -------
    list of Path
        The files written.
    """
    page, report = _page(done), done.report
    written = []
    for path in (out.page, *out.copies):
        written += _write(path, _parts(page, done), origin_of(report, report.sources), out.pdfa, text)
    if out.binary is not None:
        assert done.binary is not None
        origin = origin_of(report, report.sources, binarized_by)
        written += _write(out.binary, _parts(done.binary, done), origin, out.pdfa, text)
    if out.mask is not None:
        mask = mask_of(page, done.clipped)
        written += _write(out.mask, _parts(mask, done), origin_of(report, report.sources), False, [])
    return written


def _page(done: Restoration) -> Page:
    page = done.unshaded or done.rendered
    assert page is not None
    return page


def _parts(page: Page, done: Restoration) -> list[Page]:
    return [page] if done.report.spine is None else list(split_pages(page, done.report.spine))


def _write(path: Path, pages: list[Page], origin: Origin, pdfa: bool, text: list[bytes]) -> list[Path]:
    """Into one file, or one for each page."""
    names = page_names(path, len(pages))
    if len(names) > 1:
        for name, page in zip(names, pages, strict=True):
            write_page(name, page, origin)
    else:
        is_pdf = path.suffix.lower() == ".pdf"
        write_pages(path, pages, origin, pdfa=pdfa and is_pdf, text=text if is_pdf else ())
    return names
