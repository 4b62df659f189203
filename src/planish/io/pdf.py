"""Pages to a PDF: true size, lossless placement, searchable text, and PDF/A-2b for archives."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from planish.dpi import MM_PER_INCH
from planish.errors import OutputError
from planish.io.encode import jpeg_bytes, tiff_bytes
from planish.io.metadata import SOFTWARE, Origin, creation_date, xmp_packet
from planish.types import Page

_POINTS_PER_INCH = 72.0
_PDF_POINTS = (3.0, 14_400.0)
"""Sides of a PDF page that viewers show."""
_ICC_DATE = slice(24, 36)
_SOME_DATE = bytes([0x07, 0xD0, 0, 1, 0, 1, 0, 0, 0, 0, 0, 0])
"""The first of January 2000, which a profile must have and which says nothing."""


def pdf_bytes(
    path: Path,
    pages: Sequence[Page],
    origin: Origin | None = None,
    *,
    pdfa: bool = False,
    text: Sequence[bytes] = (),
) -> bytes:
    """Make a PDF of pages: JPEG, or CCITT G4 for those of 1 bit, with the text that was read on them laid underneath.

    Parameters
    ----------
    path : Path
        For messages.
    pages : sequence of Page
    origin : Origin, optional
    pdfa : bool
        Meet ISO 19005-2, level B: colours of the pages defined by their profiles or as sRGB, XMP, a file identifier,
        everything inside the file.
    text : sequence of bytes
        For each page a PDF of one page with invisible text alone.

    Raises
    ------
    OutputError
        If a page is smaller or larger than a PDF page can be.
    """
    import pikepdf

    for page in pages:
        _check_pdf_size(path, page)
    with pikepdf.open(io.BytesIO(_images(pages))) as pdf:
        for page, layer in zip(pdf.pages, text, strict=False):
            with pikepdf.open(io.BytesIO(layer)) as words:
                box = pikepdf.Rectangle(page.mediabox)
                page.add_underlay(words.pages[0], box, shrink=True, expand=True)
        _describe(pdf, origin, pdfa)
        if pdfa:
            _define_colours(pdf)
        if "/ID" in pdf.trailer:
            del pdf.trailer["/ID"]  # img2pdf's depends on the time of day with pikepdf 10; the saving makes its own
        file = io.BytesIO()
        pdf.save(file, deterministic_id=True, min_version="1.7" if pdfa else "")
    return file.getvalue()


def _images(pages: Sequence[Page]) -> bytes:
    """The pages as img2pdf puts them in, their pixels as they are."""
    import img2pdf

    parts = [
        tiff_bytes([page]) if page.pixels.dtype == bool else jpeg_bytes(page.pixels, page.dpi, page.icc)
        for page in pages
    ]
    sizes = iter(pages)

    def layout(width_px: int, height_px: int, dpi: object) -> tuple[float, float, float, float]:
        points = _POINTS_PER_INCH / next(sizes).dpi  # the file's own dpi may be rounded
        return (width_px * points, height_px * points) * 2

    return bytes(img2pdf.convert(parts, layout_fun=layout, nodate=True))


def _describe(pdf: Any, origin: Origin | None, pdfa: bool) -> None:
    """Who made it, how and from what: in the XMP, and in the older dictionary where viewers look."""
    import pikepdf

    for name in list(pdf.docinfo):
        del pdf.docinfo[name]
    pdf.docinfo.Creator = pdf.docinfo.Producer = SOFTWARE
    if origin:
        pdf.docinfo.Subject = origin.method
    if date := creation_date():
        pdf.docinfo.CreationDate = pdf.docinfo.ModDate = date.strftime("D:%Y%m%d%H%M%SZ")
    packet = pikepdf.Stream(pdf, xmp_packet(origin=origin, pdfa=pdfa))
    packet.Type, packet.Subtype = pikepdf.Name.Metadata, pikepdf.Name.XML
    pdf.Root.Metadata = packet


def _define_colours(pdf: Any) -> None:
    """State that colours without a profile of their own are sRGB."""
    import pikepdf
    from PIL import ImageCms

    profile = bytearray(ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes())
    profile[_ICC_DATE] = _SOME_DATE
    stream = pikepdf.Stream(pdf, bytes(profile))
    stream.N, stream.Alternate = 3, pikepdf.Name.DeviceRGB
    intent = pikepdf.Dictionary(
        Type=pikepdf.Name.OutputIntent,
        S=pikepdf.Name.GTS_PDFA1,
        OutputConditionIdentifier="sRGB IEC61966-2.1",
        Info="sRGB IEC61966-2.1",
        RegistryName="http://www.color.org",
        DestOutputProfile=stream,
    )
    pdf.Root.OutputIntents = pikepdf.Array([pdf.make_indirect(intent)])


def _check_pdf_size(path: Path, page: Page) -> None:
    rows, cols = page.pixels.shape[:2]
    width, height = (n / page.dpi * MM_PER_INCH for n in (cols, rows))
    smallest, largest = (points / _POINTS_PER_INCH * MM_PER_INCH for points in _PDF_POINTS)
    if not smallest <= min(width, height) <= max(width, height) <= largest:
        raise OutputError(
            f"{path}: the page is {width:.3g} x {height:.3g} mm, a PDF page {smallest:.1f} to {largest:.0f} mm a side;"
            " write .tif"
        )
