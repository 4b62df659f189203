"""How much memory an item needs, roughly, and how much there is: so that no more run at once than fit."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path

from PIL import Image

from planish.batch.items import Item
from planish.memory import free_bytes

_PROCESS = 0.5e9
_PER_BYTE_OF_TEXT, _PER_BYTE_OF_NUMBERS = 8.0, 25.0
_PER_PHOTO_PIXEL = 20.0
"""Bytes: about twice what benchmarks/batch.py measures, for a mesh as OBJ and as anything else."""
_UNKNOWN_PHOTO_PIXELS = 24e6
_SHARE = 0.8
"""Of what is free now: other programs want some, and needs are estimates."""


def need(item: Item) -> float:
    """Bytes of memory that the restoration of an item takes, from the sizes of its files: an upper guess."""
    photos = item.photo or ((item.near_photo,) if item.near_photo else ())
    pixels = sum(map(_pixels, photos)) if photos else _UNKNOWN_PHOTO_PIXELS
    per_byte = _PER_BYTE_OF_TEXT if item.scan.suffix.lower() == ".obj" else _PER_BYTE_OF_NUMBERS
    return _PROCESS + per_byte * sum(_sizes(item.scan)) + _PER_PHOTO_PIXEL * pixels


def available() -> float:
    """Bytes that all items together may take."""
    return _SHARE * free_bytes()


def _sizes(scan: Path) -> Iterator[int]:
    for path in scan.iterdir() if scan.is_dir() else [scan]:
        try:
            yield path.stat().st_size
        except OSError:  # reading it will say so
            continue


def _pixels(photo: Path) -> float:
    """From the header alone."""
    try:
        with warnings.catch_warnings(action="ignore"), Image.open(photo) as image:
            return float(image.width * image.height)
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError):  # reading it will say so
        return 0.0
