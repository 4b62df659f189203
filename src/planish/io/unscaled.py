"""Pages whose size is not known, to files that do not say any."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from PIL import Image

from planish.io.encode import jpeg_bytes, png_bytes
from planish.io.files import write_bytes
from planish.io.pages import check_page_name, write_page
from planish.types import Page


def write_unscaled_page(path: str | Path, page: Page) -> None:
    """Write a page as TIFF, PNG or JPEG without any dpi; a PDF, which cannot do without a size, gets the guessed one.

    Parameters
    ----------
    path : str or Path
        .tif, .tiff, .png, .jpg, .jpeg or .pdf.
    page : Page

    Raises
    ------
    OutputError
        If the suffix is another, or the file cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> page = Page(np.full((30, 20), 255, np.uint8), np.ones((30, 20), bool), dpi=300.0)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_unscaled_page(f"{folder}/page.png", page)
    ...     with Image.open(f"{folder}/page.png") as image:
    ...         image.info.get("dpi")
    """
    suffix = check_page_name(path)
    if suffix == ".pdf":
        write_page(path, page)
    elif suffix == ".png":
        write_bytes(Path(path), png_bytes(page.pixels, None, page.icc))
    elif suffix in (".jpg", ".jpeg"):
        write_bytes(Path(path), jpeg_bytes(page.pixels, None, page.icc))
    else:
        write_bytes(Path(path), _tiff(page))


def _tiff(page: Page) -> bytes:
    if page.pixels.dtype == bool:
        file = io.BytesIO()
        Image.fromarray(np.asarray(page.pixels)).save(file, "TIFF", compression="group4")
        return file.getvalue()
    import tifffile

    file = io.BytesIO()
    tifffile.imwrite(
        file,
        np.asarray(page.pixels),
        photometric="rgb" if page.pixels.ndim == 3 else "minisblack",
        compression="zlib",
        compressionargs={"level": 1},
        predictor=True,
        rowsperstrip=64,
        resolution=(1, 1),
        resolutionunit="NONE",
        iccprofile=page.icc,
        metadata=None,
    )
    return file.getvalue()
