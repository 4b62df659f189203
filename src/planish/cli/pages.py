"""The files of the page: one or two of them, in colour and in black and white, with text and mask if so asked."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from planish.errors import OutputError, UsageError
from planish.types import Page, Restoration

if TYPE_CHECKING:
    from planish.io import Origin


@dataclass(frozen=True, kw_only=True)
class PageFiles:
    """What is to be written of the page.

    Attributes
    ----------
    output : Path
    binary, mask : Path or None
    most_pages : int
        That the sheet may be split into.
    pdfa : bool
        PDFs are for archives.
    ocr : str or None
        Language of the text to be read for PDFs.
    """

    output: Path
    binary: Path | None
    mask: Path | None
    most_pages: int
    pdfa: bool
    ocr: str | None

    def names(self) -> list[Path]:
        """All that may be written."""
        from planish.io import page_names

        wanted = [path for path in (self.output, self.binary, self.mask) if path is not None]
        counts = range(1, self.most_pages + 1)
        return list(dict.fromkeys(name for path in wanted for count in counts for name in page_names(path, count)))


def check_page_files(files: PageFiles) -> None:
    """Refuse what could not be written, before long work.

    Raises
    ------
    OutputError, UsageError, MissingExtraError
    """
    from planish.io import check_ocr, check_page_name

    suffixes = {path: check_page_name(path) for path in (files.output, files.binary, files.mask) if path is not None}
    if files.mask is not None and suffixes[files.mask] not in (".png", ".tif", ".tiff"):
        raise OutputError(f"{files.mask}: a mask is written as .png or .tif, where no pixel changes")
    for flag in [*(["--pdfa"] if files.pdfa else []), *(["--ocr"] if files.ocr is not None else [])]:
        if ".pdf" not in (suffixes[files.output], suffixes.get(files.binary or Path())):
            raise UsageError(f"{flag} is for PDF; name the page with -o NAME.pdf, not {files.output.name}")
    if files.ocr is not None:
        check_ocr(files.ocr)


def read_text(done: Restoration, language: str) -> list[bytes]:
    """The text of each page, as `planish.io.text_layer` gives it."""
    from planish.io import text_layer

    return [text_layer(part, language) for part in _parts(_page(done), done)]


def write_page_files(files: PageFiles, done: Restoration, binarized_by: str, text: list[bytes]) -> list[Path]:
    """Write the pages of a restoration, one file after the other.

    Parameters
    ----------
    files : PageFiles
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
    from planish.io import origin_of
    from planish.render import mask_of

    page, report = _page(done), done.report
    written = _write(files.output, _parts(page, done), origin_of(report, report.sources), files.pdfa, text)
    if files.binary is not None:
        assert done.binary is not None
        origin = origin_of(report, report.sources, binarized_by)
        written += _write(files.binary, _parts(done.binary, done), origin, files.pdfa, text)
    if files.mask is not None:
        mask = mask_of(page, done.clipped)
        written += _write(files.mask, _parts(mask, done), origin_of(report, report.sources), False, [])
    return written


def _page(done: Restoration) -> Page:
    page = done.unshaded or done.rendered
    assert page is not None
    return page


def _parts(page: Page, done: Restoration) -> list[Page]:
    from planish.render import split

    return [page] if done.report.spine is None else list(split(page, done.report.spine))


def _write(path: Path, pages: list[Page], origin: Origin, pdfa: bool, text: list[bytes]) -> list[Path]:
    """Into one file, or one for each page."""
    from planish.io import page_names, write_page, write_pages

    names = page_names(path, len(pages))
    if len(names) > 1:
        for name, page in zip(names, pages, strict=True):
            write_page(name, page, origin)
    else:
        is_pdf = path.suffix.lower() == ".pdf"
        write_pages(path, pages, origin, pdfa=pdfa and is_pdf, text=text if is_pdf else ())
    return names
