"""Photos of one scene under different light, as one stack of grey images."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planish.color import luma
from planish.errors import InputError
from planish.io.files import files_in, is_folder
from planish.io.images import read_photo
from planish.types import Diagnostic, Pixels

SUFFIXES = {".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".webp"}


FEWEST_FRAMES = 6
"""Two pairs of patterns, white and black: fewer photos are no Gray code."""


class Captures(NamedTuple):
    """Grey frames (n, rows, cols) uint8 or uint16, the last but one in colour (rows, cols, 3), and the files."""

    frames: NDArray[np.uint8] | NDArray[np.uint16]
    photo: Pixels
    paths: list[Path]
    warnings: list[Diagnostic] = []  # noqa: RUF012  # never changed


def image_files(paths: Iterable[str | Path]) -> list[Path]:
    """The files themselves, a folder standing for the images in it; numbers in names count as numbers.

    Raises
    ------
    InputError
        If there is none.
    """
    found: list[Path] = []
    for path in map(Path, paths):
        if is_folder(path):
            inside = files_in(path, SUFFIXES)
            if not inside:
                raise InputError(f"{path} holds no image; photos are wanted in it")
            found += sorted(inside, key=_by_number)
        else:
            found.append(path)
    if not found:
        raise InputError("no photo was given; files or a folder are wanted")
    return found


def read_captures(paths: Iterable[str | Path]) -> Captures:
    """Read photos that one camera took of one scene; a folder stands for the images in it.

    Parameters
    ----------
    paths : iterable of str or Path
        In their order; those of a folder by name.

    Raises
    ------
    InputError
        If a file is missing or damaged, or is not of the size or kind of the first.
    """
    files = image_files(paths)
    frames: NDArray | None = None
    photo: Pixels | None = None
    for k, path in enumerate(files):
        pixels = read_photo(path).pixels
        if frames is None:
            frames = np.empty((len(files), *pixels.shape[:2]), pixels.dtype)
        if pixels.shape[:2] != frames.shape[1:] or pixels.dtype != frames.dtype:
            raise InputError(
                f"{path} has {pixels.shape[1]} x {pixels.shape[0]} pixels of {8 * pixels.dtype.itemsize} bits, but "
                f"{files[0]} has {frames.shape[2]} x {frames.shape[1]} of {8 * frames.dtype.itemsize}; give photos of "
                "one camera, taken alike"
            )
        frames[k] = luma(pixels)
        if k == max(0, len(files) - 2):
            photo = pixels
    assert frames is not None
    assert photo is not None
    order = _white_and_black_last(frames)
    if order is None:
        return Captures(frames, photo, files)
    sentence = "white and black come first in the photos; they were taken as the last two"
    again = read_photo(files[order[-2]]).pixels
    return Captures(frames[order], again, [files[k] for k in order], [Diagnostic("white-black-first", sentence)])


def _white_and_black_last(frames: NDArray) -> list[int] | None:
    """The order of photos in which white and black are the last two, where they come first; else None.

    White is the brightest and black the darkest of all: every pattern lights about half of the view.
    """
    if len(frames) < FEWEST_FRAMES:
        return None
    levels = frames[:, ::4, ::4].mean(axis=(1, 2), dtype=np.float64)
    white, black = int(levels.argmax()), int(levels.argmin())
    if {white, black} != {0, 1}:
        return None
    return [*range(2, len(frames)), white, black]


def _by_number(path: Path) -> list[tuple[int, str]]:
    return [(int(part) if part.isdecimal() else -1, part) for part in re.split(r"(\d+)", path.name)]
