"""File writers shared by the virtual devices."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from planish.types import Camera

SHEETS = {"book": "book", "folded": "letter", "curl": "curl", "crumpled": "crumpled"}
"""Sheets of the gallery by the names that commands have for them."""

BOARD_MM = 18.0
"""Side of a square of the calibration boards."""


def write_images(folder: Path, images: Iterable[NDArray], name: str = "{:03d}.png") -> None:
    """Write PNG files, numbered from 0, into a folder that is created if it does not exist."""
    from planish.io import make_folder
    from planish.io.files import write_bytes
    from planish.io.pages import png_bytes

    make_folder(folder)
    for k, image in enumerate(images):
        write_bytes(folder / name.format(k), png_bytes(image))


def write_camera(path: Path, camera: Camera) -> None:
    """Write a camera as JSON."""
    from planish.io import write_json
    from planish.io.cameras import camera_as_json

    write_json(path, camera_as_json(camera))
