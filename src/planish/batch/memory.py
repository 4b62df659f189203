"""Estimated memory of an item and memory available, to limit the number of concurrent items."""

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
"""Bytes of memory; about twice the values measured by benchmarks/batch.py."""
_UNKNOWN_PHOTO_PIXELS = 24e6
_FREE_MEMORY_FRACTION = 0.8
"""Fraction of the free memory that is used; the rest is for other programs and estimation errors."""


def estimate_memory(item: Item) -> float:
    """Upper estimate of the memory in bytes that an item needs, from its file sizes."""
    photos = item.photo or ((item.nearby_photo,) if item.nearby_photo else ())
    pixels = sum(map(_pixels, photos)) if photos else _UNKNOWN_PHOTO_PIXELS
    per_byte = _BYTES_PER_TEXT_BYTE if item.scan.suffix.lower() == ".obj" else _BYTES_PER_BINARY_BYTE
    return _BYTES_PER_PROCESS + per_byte * sum(_sizes(item.scan)) + _BYTES_PER_PHOTO_PIXEL * pixels


def memory_budget() -> float:
    """Memory in bytes for all concurrent items together."""
    return _FREE_MEMORY_FRACTION * free_bytes()


def _sizes(scan: Path) -> Iterator[int]:
    for path in scan.iterdir() if scan.is_dir() else [scan]:
        try:
            yield path.stat().st_size
        except OSError:  # reported when the file is read
            continue


def _pixels(photo: Path) -> float:
    """Number of pixels, read from the header only."""
    try:
        with warnings.catch_warnings(action="ignore"), Image.open(photo) as image:
            return float(image.width * image.height)
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError):  # reported when the file is read
        return 0.0
