"""Artwork for the test pages: a grey landscape, a colour chart, a line drawing and a rubber stamp."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from planish.gallery.sheets import sheet

SUPERSAMPLE = 4
"""Supersampling factor for anti-aliased lines."""


def hills(width: int, height: int, seed: int = 3) -> NDArray[np.uint8]:
    """Draw misty hills under a bright sky in continuous tones.

    Returns
    -------
    (height, width) uint8

    Examples
    --------
    >>> hills(60, 40).shape
    (40, 60)
    """
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[0:height, 0:width] / height
    sun = np.hypot(x - 0.68 * width / height, y - 0.3)
    grey = 205 - 70 * y + 45 * np.exp(-((sun / 0.32) ** 2))
    grey = np.where(sun < 0.055, 250, grey)
    ridges = 6
    for k in range(ridges):
        octaves = 2.0 ** np.arange(7)
        waves = np.sin(x[0][:, None] * octaves * 3.1 + rng.uniform(0, 2 * np.pi, 7)) * (0.07 / octaves**0.9)
        level, flatter = 0.42 + 0.1 * k, 1 - 0.08 * k
        mist = np.exp(-np.clip(y - level - flatter * waves[:, :2].sum(axis=1), -0.02, None) / 0.16)
        tone = 150 - 24 * k + 55 * mist * (1 - k / ridges)
        below = (y - level - flatter * waves.sum(axis=1)) * height
        cover = np.clip(below + 0.5, 0, 1)  # half a pixel of blending smooths the crest
        grey = grey * (1 - cover) + tone * cover
    grain = rng.normal(0, 2.0, grey.shape)
    return np.clip(grey + grain, 0, 255).astype(np.uint8)


CHART_ROWS, CHART_COLUMNS = 4, 6
CHART_CODES = np.array(
    [
        *((115, 82, 68), (194, 150, 130), (98, 122, 157), (87, 108, 67), (133, 128, 177), (103, 189, 170)),
        *((214, 126, 44), (80, 91, 166), (193, 90, 99), (94, 60, 108), (157, 188, 64), (224, 163, 46)),
        *((56, 61, 150), (70, 148, 73), (175, 54, 60), (231, 199, 31), (187, 86, 149), (8, 133, 161)),
        *((243, 243, 242), (200, 200, 200), (160, 160, 160), (122, 122, 121), (85, 85, 85), (52, 52, 52)),
    ],
    np.uint8,
)
"""sRGB values of a colour rendition chart (McCamy, Marcus and Davidson 1976), row by row: (24, 3)."""


def colour_chart(width: int, height: int, gap: float = 0.08) -> NDArray[np.uint8]:
    """Draw the patches of `CHART_CODES`, four rows of six, on white.

    Parameters
    ----------
    width, height : int
    gap : float
        White between the patches, in sides of a patch; 0: they touch.

    Returns
    -------
    (height, width, 3) uint8

    Examples
    --------
    >>> colour_chart(60, 40, gap=0)[5, 5].tolist()
    [115, 82, 68]
    """
    chart = np.full((height, width, 3), 255, np.uint8)
    down, across = (n / (count + gap * (count - 1)) for n, count in ((height, CHART_ROWS), (width, CHART_COLUMNS)))
    for k, code in enumerate(CHART_CODES):
        top, left = (k // CHART_COLUMNS) * (1 + gap) * down, (k % CHART_COLUMNS) * (1 + gap) * across
        chart[round(top) : round(top + down), round(left) : round(left + across)] = code
    return chart


def line_drawing(width: int, height: int) -> Image.Image:
    """Draw the wave sheet as a grid of fine lines in oblique projection."""
    wave = sheet("wave", steepness_deg=55.0, waves=1.5)
    across, down = np.linspace(0, wave.width_mm, 25), np.linspace(0, wave.height_mm, 33)
    lines = [np.stack([np.full(200, x), np.linspace(0, wave.height_mm, 200)], axis=1) for x in across]
    lines += [np.stack([np.linspace(0, wave.width_mm, 200), np.full(200, y)], axis=1) for y in down]
    drawn = [_oblique(wave.bend(line)) for line in lines]
    everything = np.concatenate(drawn)
    low, span = everything.min(axis=0), np.ptp(everything, axis=0)
    scale = 0.94 * SUPERSAMPLE * min(width / span[0], height / span[1])
    margin = (SUPERSAMPLE * np.array([width, height]) - scale * span) / 2
    image = Image.new("L", (width * SUPERSAMPLE, height * SUPERSAMPLE), 255)
    pen = ImageDraw.Draw(image)
    for line in drawn:
        pen.line(((line - low) * scale + margin).ravel().tolist(), fill=0, width=max(1, width * SUPERSAMPLE // 700))
    return image.resize((width, height), Image.Resampling.BOX)


def stamp_print(lines: Sequence[str], size: float) -> Image.Image:
    """Draw a slightly rotated red rubber stamp on white."""
    big = size * SUPERSAMPLE
    font = ImageFont.load_default(big)
    width = max(font.getlength(line) for line in lines) + 1.4 * big
    height = (1.3 * len(lines) + 0.9) * big
    image = Image.new("RGB", (round(width), round(height)), "white")
    pen = ImageDraw.Draw(image)
    inset = 0.12 * big
    for k, line in enumerate(lines):
        pen.text((width / 2, (1.1 + 1.3 * k) * big), line, RED, font, anchor="mm", stroke_width=round(big / 30))
    frame = (inset, inset, width - inset, height - inset)
    pen.rounded_rectangle(frame, radius=0.4 * big, outline=RED, width=round(0.12 * big))
    rotated = image.rotate(6, Image.Resampling.BICUBIC, expand=True, fillcolor="white")
    return rotated.resize([n // SUPERSAMPLE for n in rotated.size], Image.Resampling.BOX)


RED = (196, 30, 46)


def _oblique(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Oblique projection, y down, from the front right and above."""
    turn, rise = np.radians(35), np.radians(38)
    x = points[:, 0] * np.cos(turn) - points[:, 1] * np.sin(turn)
    depth = points[:, 0] * np.sin(turn) + points[:, 1] * np.cos(turn)
    return np.stack([x, -depth * np.sin(rise) - points[:, 2] * np.cos(rise)], axis=1)
