"""How much memory an item needs, roughly, and how much there is: so that no more run at once than fit."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path

from PIL import Image

from planish.batch.items import Item
from planish.memory import free_bytes

_BYTES_PER_PROCESS = 0.5e9
_BYTES_PER_TEXT_BYTE, _BYTES_PER_BINARY_BYTE = 8.0, 25.0
_BYTES_PER_PHOTO_PIXEL = 20.0
"""Bytes: about twice what benchmarks/batch.py measures, for a mesh as OBJ and as anything else."""
_UNKNOWN_PHOTO_PIXELS = 24e6
_FREE_MEMORY_FRACTION = 0.8
"""Of what is free now: other programs want some, and needs are estimates."""


def estimate_memory(item: Item) -> float:
    """Bytes of memory that the restoration of an item takes, from the sizes of its files: an upper guess."""
    photos = item.photo or ((item.nearby_photo,) if item.nearby_photo else ())
    pixels = sum(map(_pixels, photos)) if photos else _UNKNOWN_PHOTO_PIXELS
    per_byte = _BYTES_PER_TEXT_BYTE if item.scan.suffix.lower() == ".obj" else _BYTES_PER_BINARY_BYTE
    return _BYTES_PER_PROCESS + per_byte * sum(_sizes(item.scan)) + _BYTES_PER_PHOTO_PIXEL * pixels


def memory_budget() -> float:
    """Bytes that all items together may take."""
    return _FREE_MEMORY_FRACTION * free_bytes()


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
