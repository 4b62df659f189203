"""Colour maps of values over the page, with a colour scale."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planish.geometry.guards import TINY, TINY_MM, TINY_SHARE
from planish.mesh import rasterize
from planish.types import Floats, Ints

ROWS = 600
"""Of a map: values change over centimetres, so more would show nothing more."""
TOP = 0.995
"""Quantile of the values at which a scale ends: the last few points would leave the rest in one colour."""


def over_page(page_xy: Floats, faces: Ints, values: Floats, size_mm: tuple[float, float], rows: int = ROWS) -> Floats:
    """Interpolate values at points over the page.

    Parameters
    ----------
    page_xy : (n, 2) float64 [mm]
    faces : (m, 3) int32
    values : (n,) or (n, k) float64
    size_mm : (float, float)
        Width and height of the page.
    rows : int

    Returns
    -------
    (rows, cols) or (rows, cols, k) float64
        Linear over each face; NaN where there is none.
    """
    width, height = size_mm
    px_per_mm = rows / max(height, TINY_MM)
    face, w = rasterize(page_xy * px_per_mm - 0.5, faces, (rows, max(1, round(width * px_per_mm))))
    weights = np.concatenate([1 - w.sum(axis=2, keepdims=True), w], axis=2)
    value = np.einsum("rck,rck...->rc...", weights, values[faces[np.maximum(face, 0)]])
    value[face < 0] = np.nan
    return np.asarray(value)


def heat_map(
    page_xy: Floats, faces: Ints, values: Floats, size_mm: tuple[float, float], title: str
) -> NDArray[np.uint8]:
    """Draw values at points as a colour map of the page.

    Parameters
    ----------
    page_xy : (n, 2) float64 [mm]
    faces : (m, 3) int32
    values : (n,) float64
        Not negative. The scale runs from 0 to their 99.5 % quantile.
    size_mm : (float, float)
        Width and height of the page.
    title : str
        What the values are, with their unit.

    Returns
    -------
    (rows, cols, 3) uint8
    """
    top = float(np.quantile(values, TOP)) or 1.0
    return _with_scale(coloured(over_page(page_xy, faces, values, size_mm), 0.0, top), top, title)


def coloured(values: Floats, low: float, high: float) -> NDArray[np.uint8]:
    """Map values to colours, from dark blue at `low` to yellow at `high`; NaN to white."""
    import cv2

    share = np.clip((values - low) / max(high - low, TINY), 0, 1)
    eight = (np.nan_to_num(share) * 255).astype(np.uint8)
    picture = np.array(cv2.applyColorMap(eight, cv2.COLORMAP_VIRIDIS)[..., ::-1])
    picture[np.isnan(values)] = 255
    return picture


def round_above(value: float) -> float:
    """Next round number whose half is round as well."""
    power = 10.0 ** np.floor(np.log10(max(value, TINY_SHARE)))
    return float(next(step * power for step in (1, 1.2, 1.6, 2, 3, 4, 5, 6, 8, 10) if step * power >= value * 0.999))


def round_span(values: Floats | NDArray[np.float32], step: float) -> tuple[float, float]:
    """Rounded limits of a colour scale that covers nearly all values."""
    low, high = (float(np.nanquantile(values, share)) / step for share in (1 - TOP, TOP))
    return step * float(np.floor(low)), step * float(max(np.ceil(high), np.floor(low) + 1))


def _with_scale(picture: NDArray[np.uint8], top: float, title: str) -> NDArray[np.uint8]:
    """Add a colour bar from 0 to `top` below the picture, with its title."""
    from PIL import Image, ImageDraw, ImageFont

    rows, cols = picture.shape[:2]
    wide = max(cols, 360)
    sheet = Image.new("RGB", (wide + 40, rows + 90), "white")
    sheet.paste(Image.fromarray(picture), ((wide - cols) // 2 + 20, 20))
    bar = coloured(np.tile(np.linspace(0, 1, wide), (16, 1)), 0.0, 1.0)
    sheet.paste(Image.fromarray(bar), (20, rows + 34))
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(15)
    draw.text((20, rows + 54), "0", "black", font)
    draw.text((wide + 20, rows + 54), f"{top:.3g}", "black", font, anchor="ra")
    draw.text((wide / 2 + 20, rows + 54), title, "black", font, anchor="ma")
    return np.asarray(sheet)
