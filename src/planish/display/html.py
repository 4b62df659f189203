"""How a page and its report look in a notebook."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from html import escape
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from planish.color import to_uint8

if TYPE_CHECKING:
    from PIL.Image import Image

SIDE = 640
"""Longest side of a picture in a notebook [px]: a page beside its figures on a usual screen."""
JPEG_QUALITY = 85


def as_image(pixels: NDArray[Any]) -> Image:
    """Pixels as a Pillow image: mode 1, L or RGB; 16 bits are rounded to 8, since Pillow has no colours of 16."""
    from PIL import Image

    return Image.fromarray(to_uint8(pixels) if pixels.dtype == np.uint16 else pixels)


def small_png(pixels: NDArray[Any]) -> bytes:
    """A picture for a notebook, as the bytes of a PNG."""
    return _encoded(_small(pixels), "PNG")


def small_jpeg(pixels: NDArray[Any]) -> bytes:
    """A picture for a notebook that is stored with its figures, as the bytes of a JPEG."""
    return _encoded(_small(pixels), "JPEG", quality=JPEG_QUALITY)


def html_table(rows: Sequence[tuple[str, str]]) -> str:
    """Rows (what, how much) as a table."""
    cells = "".join(
        f'<tr><th style="text-align:left">{escape(what)}</th><td style="text-align:left">{escape(how_much)}</td></tr>'
        for what, how_much in rows
    )
    return f"<table>{cells}</table>"


def html_picture(jpeg: bytes, meaning: str) -> str:
    """A picture that is part of the page."""
    code = b64encode(jpeg).decode()
    return f'<img src="data:image/jpeg;base64,{code}" alt="{escape(meaning)}" style="border:1px solid #ccc">'


def _small(pixels: NDArray[Any]) -> Image:
    image = as_image(pixels)
    image = image if image.mode == "RGB" else image.convert("L")
    image.thumbnail((SIDE, SIDE))
    return image


def _encoded(image: Image, suffix: str, **choices: int) -> bytes:
    file = BytesIO()
    image.save(file, suffix, **choices)
    return file.getvalue()
