"""What a camera wrote beside its photo: the focal length."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, BinaryIO

from PIL import Image

from planish.dpi import MM_PER_INCH
from planish.io.suppress_stderr import suppress_stderr

_EXIF = 0x8769
_FOCAL_LENGTH, _FOCAL_LENGTH_35_MM = 0x920A, 0xA405
_PLANE_X_RESOLUTION, _PLANE_UNIT = 0xA20E, 0xA210
_UNIT_MM = {2: MM_PER_INCH, 3: 10.0, 4: 1.0}
_DIAGONAL_35_MM = math.hypot(36, 24)
_SENSORS = (4 / 3, 3 / 2)
"""Ratios of sides that cameras' sensors have; other pictures were cropped, and their focal length is not known."""
_CROPPED = 0.003
_BLOCK = 4
"""Sides of sensors are multiples of this; sides of crops seldom are."""


def focal_length_px(file: str | Path | BinaryIO) -> float | None:
    """Focal length in pixels, from the EXIF of an image file; None where it does not say, or the photo was cropped.

    Parameters
    ----------
    file : str, Path or file opened for reading bytes

    Examples
    --------
    >>> import io
    >>> file = io.BytesIO()
    >>> exif = Image.Exif()
    >>> exif.get_ifd(0x8769)[0xA405] = 26
    >>> Image.new("L", (400, 300)).save(file, "JPEG", exif=exif)
    >>> round(focal_length_px(file), 1)
    300.5
    """
    try:
        with suppress_stderr(), Image.open(file) as image:
            width, height = image.size
            said: dict[int, Any] = dict(image.getexif().get_ifd(_EXIF))
    except Exception:  # decoders raise nearly every class there is on damaged files; without EXIF we go on
        return None
    ratio = max(width, height) / min(width, height)
    if width % _BLOCK or height % _BLOCK or all(abs(ratio / usual - 1) > _CROPPED for usual in _SENSORS):
        return None
    equivalent = _number(said.get(_FOCAL_LENGTH_35_MM))
    if equivalent:
        return equivalent / _DIAGONAL_35_MM * math.hypot(width, height)
    focal_mm, resolution = _number(said.get(_FOCAL_LENGTH)), _number(said.get(_PLANE_X_RESOLUTION))
    unit = _UNIT_MM.get(said.get(_PLANE_UNIT, 0))
    return focal_mm * resolution / unit if focal_mm and resolution and unit else None


def _number(value: Any) -> float:
    """The value, or 0 where it is none that can be used."""
    try:
        number = float(value)
    except (TypeError, ValueError, ZeroDivisionError):
        return 0.0
    return number if math.isfinite(number) and number > 0 else 0.0
