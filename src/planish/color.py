"""Colour of images, in one place: 8 bit, grey, and linear light of sRGB."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

MIDDLE_OF_257 = 128 * 255 + 255
"""With it, (255 v + MIDDLE_OF_257) >> 16 is v / 257 rounded to the nearest whole number for every 16-bit v."""

LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)
"""Weights of linear red, green and blue in the luminance (ITU-R BT.709, the primaries of sRGB)."""


def to_uint8(pixels: NDArray[Any]) -> NDArray[np.uint8]:
    """Convert an image of 1, 8 or 16 bits to 8 bits.

    16 bits are rounded to the nearest level, v / 257, so that 0 and 65535 become 0 and 255; False and True become 0
    and 255; 8 bits are returned as they are, without a copy.

    Parameters
    ----------
    pixels : bool, uint8 or uint16, of any shape

    Examples
    --------
    >>> to_uint8(np.array([0, 128, 129, 65535], np.uint16))
    array([  0,   0,   1, 255], dtype=uint8)
    >>> to_uint8(np.array([False, True]))
    array([  0, 255], dtype=uint8)
    """
    if pixels.dtype == np.uint8:
        return pixels
    if pixels.dtype == bool:
        return pixels.astype(np.uint8) * np.uint8(255)
    assert pixels.dtype == np.uint16, pixels.dtype
    wide = pixels.astype(np.uint32)
    wide *= 255
    wide += MIDDLE_OF_257
    wide >>= 16
    return wide.astype(np.uint8)


def to_grey(pixels: NDArray[Any]) -> NDArray[np.uint8]:
    """Convert an image to 8-bit grey: the luma of its code values (ITU-R BT.601), as OCR and thresholds expect it.

    Parameters
    ----------
    pixels : (rows, cols) or (rows, cols, 3) bool, uint8 or uint16

    Returns
    -------
    (rows, cols) uint8, contiguous

    Examples
    --------
    >>> to_grey(np.array([[[255, 0, 0], [0, 255, 0], [0, 0, 255]]], np.uint8))
    array([[ 76, 150,  29]], dtype=uint8)
    """
    return np.ascontiguousarray(luma(to_uint8(pixels)), np.uint8)


def luma(pixels: NDArray[Any]) -> NDArray[Any]:
    """Compute the luma of the code values of an RGB image, of its own type; grey images are returned as they are."""
    if pixels.ndim == 2:
        return pixels
    import cv2

    return np.asarray(cv2.cvtColor(np.ascontiguousarray(pixels), cv2.COLOR_RGB2GRAY))


def linear_light(levels: int) -> NDArray[np.float32]:
    """Linear light, 0 to 1, of each code value of an sRGB image of so many levels (IEC 61966-2-1)."""
    code = np.arange(levels) / (levels - 1)
    light = np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)
    return light.astype(np.float32)


def code_values(dtype: np.dtype[Any]) -> NDArray[Any]:
    """Code value of linear light 0, 1 / 65535 ... 1: (65536,) of the given unsigned integer type."""
    light = np.linspace(0, 1, 65536)
    code = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    return np.asarray(np.rint(code * np.iinfo(dtype).max).astype(dtype))
