"""Values over the page as a picture in colours, with a scale that says what they mean."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planish.mesh import rasterise
from planish.types import Floats, Ints

PIXELS_PER_PAGE = 600
"""Rows of the map: values change over centimetres, so more would show nothing more."""


def heat_map(
    page_xy: Floats, faces: Ints, values: Floats, size_mm: tuple[float, float], title: str
) -> NDArray[np.uint8]:
    """Draw a value at every point as a map over the page.

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
    width, height = size_mm
    px_per_mm = PIXELS_PER_PAGE / max(height, 1e-9)
    shape = PIXELS_PER_PAGE, max(1, round(width * px_per_mm))
    face, w = rasterise(page_xy * px_per_mm - 0.5, faces, shape)
    corners = values[faces[np.maximum(face, 0)]]
    value = corners[..., 0] * (1 - w.sum(axis=2)) + corners[..., 1] * w[..., 0] + corners[..., 2] * w[..., 1]
    top = float(np.quantile(values, 0.995)) or 1.0
    picture = _coloured(value / top)
    picture[face < 0] = 255
    return _with_scale(picture, top, title)


def _coloured(share: Floats) -> NDArray[np.uint8]:
    import cv2

    eight = (np.clip(share, 0, 1) * 255).astype(np.uint8)
    return np.asarray(cv2.applyColorMap(eight, cv2.COLORMAP_VIRIDIS)[..., ::-1], np.uint8)


def _with_scale(picture: NDArray[np.uint8], top: float, title: str) -> NDArray[np.uint8]:
    """The picture over a bar from 0 to the top of the scale, with the title between its ends."""
    from PIL import Image, ImageDraw, ImageFont

    rows, cols = picture.shape[:2]
    wide = max(cols, 360)
    sheet = Image.new("RGB", (wide + 40, rows + 90), "white")
    sheet.paste(Image.fromarray(picture), ((wide - cols) // 2 + 20, 20))
    bar = _coloured(np.tile(np.linspace(0, 1, wide), (16, 1)))
    sheet.paste(Image.fromarray(bar), (20, rows + 34))
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(15)
    draw.text((20, rows + 54), "0", "black", font)
    draw.text((wide + 20, rows + 54), f"{top:.3g}", "black", font, anchor="ra")
    draw.text((wide / 2 + 20, rows + 54), title, "black", font, anchor="ma")
    return np.asarray(sheet)
