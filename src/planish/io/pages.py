"""Pages to their files: true dpi, colour profile, metadata, as many bits as the format holds."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from planish.errors import OutputError, UsageError
from planish.io.encode import jpeg_bytes, png_bytes, tiff_bytes
from planish.io.files import write_bytes
from planish.io.metadata import Origin
from planish.io.pdf import pdf_bytes
from planish.types import Page

SUFFIXES = (".tif", ".tiff", ".png", ".jpg", ".jpeg", ".pdf")
OF_MANY_PAGES = (".tif", ".tiff", ".pdf")

_LONGEST_JPEG = 65_500


def write_page(path: str | Path, page: Page, origin: Origin | None = None) -> None:
    """Write a page as TIFF, PNG, JPEG or PDF, by the suffix, with its true dpi and colour profile.

    | kind of pixels | TIFF | PNG | JPEG | PDF |
    |---|---|---|---|---|
    | bool | CCITT G4, 1 bit | 1 bit | grey | CCITT G4 |
    | 8 bit | Deflate | 8 bit | quality 95 | JPEG, quality 95 |
    | 16 bit | Deflate | 16 bit | rounded to 8 bit | JPEG, rounded to 8 bit |

    Parameters
    ----------
    path : str or Path
        .tif, .tiff, .png, .jpg, .jpeg or .pdf.
    page : Page
    origin : Origin, optional
        What the file shall say about how the page was made.

    Raises
    ------
    OutputError
        If the suffix is another, the format cannot hold so many pixels, or the file cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> from PIL import Image
    >>> page = Page(np.full((30, 20), 255, np.uint8), np.ones((30, 20), bool), dpi=300.0)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_page(f"{folder}/page.tif", page)
    ...     with Image.open(f"{folder}/page.tif") as image:
    ...         image.info["dpi"]
    (300.0, 300.0)
    """
    write_pages(path, [page], origin)


def write_pages(
    path: str | Path,
    pages: Sequence[Page],
    origin: Origin | None = None,
    *,
    pdfa: bool = False,
    text: Sequence[bytes] = (),
) -> None:
    """Write several pages into one TIFF or PDF (one page: also PNG or JPEG). As `write_page`.

    Parameters
    ----------
    path : str or Path
    pages : sequence of Page
    origin : Origin, optional
    pdfa : bool
        Make the PDF one for archives: PDF/A-2b.
    text : sequence of bytes
        For each page of a PDF what `planish.io.text_layer` read on it: text that can be searched and copied.
    """
    path = Path(path)
    suffix = check_page_name(path)
    if suffix != ".pdf" and (pdfa or text):
        raise UsageError(f"{path}: only a PDF can hold text or be for archives (PDF/A); name the page NAME.pdf")
    if not pages:
        raise OutputError(f"{path} was not written: there is no page to write")
    if len(pages) > 1 and suffix not in OF_MANY_PAGES:
        raise OutputError(f"{path} cannot hold {len(pages)} pages; .tif and .pdf can")
    if suffix == ".pdf":
        data = pdf_bytes(path, pages, origin, pdfa=pdfa, text=text)
    elif suffix in OF_MANY_PAGES:
        data = tiff_bytes(pages, origin)
    else:
        page = pages[0]
        if suffix != ".png":
            _check_jpeg_size(path, page)
        data = (png_bytes if suffix == ".png" else jpeg_bytes)(page.pixels, page.dpi, page.icc, origin)
    write_bytes(path, data)


def check_page_name(path: str | Path) -> str:
    """Refuse a name whose suffix is no kind of page, before long work; the suffix in small letters.

    Raises
    ------
    OutputError
        If it is not .tif, .tiff, .png, .jpg, .jpeg or .pdf.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise OutputError(
            f"{path}: a page is written as {', '.join(SUFFIXES)}; {suffix or 'no suffix'} is none of them"
        )
    return suffix


def page_names(path: str | Path, count: int) -> list[Path]:
    """Names of the files for so many pages: one for all that hold several, else NAME-1, NAME-2 and so on.

    Examples
    --------
    >>> [name.name for name in page_names("out/book.png", 2)]
    ['book-1.png', 'book-2.png']
    >>> [name.name for name in page_names("out/book.tif", 2)]
    ['book.tif']
    """
    path = Path(path)
    if count == 1 or path.suffix.lower() in OF_MANY_PAGES:
        return [path]
    return [path.with_name(f"{path.stem}-{k}{path.suffix}") for k in range(1, count + 1)]


def _check_jpeg_size(path: Path, page: Page) -> None:
    rows, cols = page.pixels.shape[:2]
    if max(rows, cols) > _LONGEST_JPEG:
        raise OutputError(
            f"{path}: the page has {cols} x {rows} pixels, and a JPEG at most {_LONGEST_JPEG} a side; write .tif"
        )
