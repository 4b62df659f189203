"""Drawing of text, lines, stars and images on a white page."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from planish.color import to_uint8
from planish.types import Bools, Pixels

INK, SOFT, FAINT = "#1d2327", "#5f6b73", "#c9d0d4"
GOLD, RED, GREEN, AMBER = "#c99a2e", "#b3322b", "#2f7d4f", "#b07a12"


class Sheet:
    """A white page to draw on; coordinates are pixels from the top left corner.

    Attributes
    ----------
    image : PIL.Image.Image
    """

    def __init__(self, width: int, height: int, ground: str = "white") -> None:
        self.image = Image.new("RGB", (width, height), ground)
        self._draw = ImageDraw.Draw(self.image)

    def words(self, xy: tuple[float, float], text: str, size: float, colour: str = INK, anchor: str = "ls") -> None:
        """Draw one line of text; anchors as in Pillow (ls: left end of the baseline)."""
        self._draw.text(xy, text, colour, _font(size), anchor)

    def lines(self, xy: tuple[float, float], text: str, size: float, width: float, colour: str = INK) -> float:
        """Draw wrapped text; returns the y of the next baseline."""
        x, y = xy
        for line in wrapped(text, size, width):
            self.words((x, y), line, size, colour)
            y += 1.4 * size
        return y

    def rule(self, x: float, y: float, width: float, colour: str = FAINT, thickness: int = 2) -> None:
        """Draw a horizontal line."""
        self._draw.rectangle((x, y, x + width, y + thickness - 1), colour)

    def dot(self, x: float, y: float, radius: float, colour: str) -> None:
        """Draw a filled circle."""
        self._draw.ellipse((x - radius, y - radius, x + radius, y + radius), colour)

    def star(self, x: float, y: float, radius: float, *, filled: bool) -> None:
        """Draw a five-pointed star around a centre."""
        turn = np.pi * np.arange(10) / 5 - np.pi / 2
        reach = np.where(np.arange(10) % 2, 0.42, 1.0) * radius
        outline = [(float(x + r * np.cos(t)), float(y + r * np.sin(t))) for r, t in zip(reach, turn, strict=True)]
        self._draw.polygon(outline, GOLD if filled else "white", GOLD if filled else FAINT)

    def picture(
        self, pixels: Pixels | Bools, box: tuple[float, float, float, float], *, framed: bool = True
    ) -> tuple[int, int, int, int]:
        """Fit an image into a box (left, top, width, height), top centre; returns the box it fills."""
        small = fitted(rgb_uint8(pixels), box[2], box[3])
        rows, cols = small.shape[:2]
        left, top = round(box[0] + (box[2] - cols) / 2), round(box[1])
        self.image.paste(Image.fromarray(small), (left, top))
        if framed:
            self._draw.rectangle((left - 1, top - 1, left + cols, top + rows), outline=FAINT)
        return left, top, cols, rows

    @property
    def pixels(self) -> NDArray[np.uint8]:
        """The drawing as (rows, cols, 3) uint8."""
        return np.asarray(self.image)


def wrapped(text: str, size: float, width: float) -> list[str]:
    """Wrap a text at spaces to lines of at most `width` pixels."""
    font, lines = _font(size), [""]
    for word in text.split():
        longer = f"{lines[-1]} {word}".strip()
        if lines[-1] and font.getlength(longer) > width:
            lines.append(word)
        else:
            lines[-1] = longer
    return lines


def length(text: str, size: float) -> float:
    """Width of a line of text [px]."""
    return float(_font(size).getlength(text))


def fitted(picture: NDArray[np.uint8], width: float, height: float) -> NDArray[np.uint8]:
    """Resize an image to the largest size within a box, keeping its aspect ratio."""
    import cv2

    rows, cols = picture.shape[:2]
    scale = min(width / cols, height / rows)
    size = (max(1, round(cols * scale)), max(1, round(rows * scale)))
    return np.asarray(
        cv2.resize(picture, size, interpolation=cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC), np.uint8
    )


def rgb_uint8(picture: Pixels | Bools) -> NDArray[np.uint8]:
    """Convert an image of any kind to (rows, cols, 3) uint8."""
    eight = to_uint8(picture)
    return eight if eight.ndim == 3 else np.repeat(eight[..., None], 3, axis=2)


@lru_cache
def _font(size: float) -> ImageFont.FreeTypeFont:
    """Pillow's own font, so that no font file is needed."""
    font = ImageFont.load_default(size)
    assert isinstance(font, ImageFont.FreeTypeFont)
    return font
