"""Light and code values of sRGB images: what drawing and shading removal share."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from planish.types import Pixels

LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)
"""Of linear red, green and blue."""


def linear_light(levels: int) -> NDArray[np.float32]:
    """Light of each code value of an sRGB image of so many levels, 0 to 1 (IEC 61966-2-1)."""
    code = np.arange(levels) / (levels - 1)
    light = np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)
    return light.astype(np.float32)


def code_values(dtype: np.dtype[Any]) -> Pixels:
    """Code value for light 0, 1 / 65535 ... 1: (65536,) of the given whole-number type."""
    light = np.linspace(0, 1, 65536)
    code = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    return np.asarray(np.rint(code * np.iinfo(dtype).max).astype(dtype))
