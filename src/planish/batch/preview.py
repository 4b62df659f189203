"""Thumbnail of a page for the summary."""

from __future__ import annotations

import io
from pathlib import Path

from PIL import Image, ImageOps

from planish.io.files import write_bytes

LONG_SIDE_PX = 480


def write_preview(path: Path, page: Path) -> None:
    """Write a small JPEG of the first page of a page file."""
    limit, Image.MAX_IMAGE_PIXELS = Image.MAX_IMAGE_PIXELS, None  # a trusted file of any size
    try:
        small = _small_of_pdf(page) if page.suffix.lower() == ".pdf" else _small(Image.open(page))
    finally:
        Image.MAX_IMAGE_PIXELS = limit
    file = io.BytesIO()
    small.save(file, "JPEG", quality=80)
    write_bytes(path, file.getvalue())


def _small_of_pdf(page: Path) -> Image.Image:
    import pikepdf

    with pikepdf.open(page) as pdf:
        return _small(pikepdf.PdfImage(next(iter(pdf.pages[0].images.values()))).as_pil_image())


def _small(image: Image.Image) -> Image.Image:
    image.draft("RGB", (LONG_SIDE_PX, LONG_SIDE_PX))
    small = image.reduce(max(1, max(image.size) // (2 * LONG_SIDE_PX)))
    return ImageOps.contain(small.convert("RGB"), (LONG_SIDE_PX, LONG_SIDE_PX))
