"""Depth maps from their files, in millimetres."""

from __future__ import annotations

import io
from collections.abc import Iterable
from pathlib import Path
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from planish.errors import InputError, UsageError
from planish.io.exr import EXR, read_exr
from planish.io.files import files_in, is_folder, read_bytes
from planish.io.images import decode_grid
from planish.types import Diagnostic, Floats

DepthScale = Literal["auto", "realsense", "kinect", "azure", "redwood", "d405", "l515", "tum", "sun", "mm", "m"]

PER_METRE: dict[str, float] = {
    **dict.fromkeys(("realsense", "kinect", "azure", "redwood", "sun", "mm"), 1000.0),
    **{"d405": 10_000.0, "l515": 4000.0, "tum": 5000.0, "m": 1.0},
}
"""Numbers of the file that make a metre; those of SUN RGB-D after their bits were moved back."""

_SUN_BITS = 3
"""SUN RGB-D keeps depths turned by so many bits to the left (its toolbox: bitor(bitshift(d, -3), bitshift(d, 13)))."""

SUFFIXES = (".png", ".tif", ".tiff", ".exr", ".npy")

_FARTHEST_METRES = 20.0
"""Floating numbers below it are metres: nobody measures a sheet 20 mm away."""


def read_depths(paths: Iterable[str | Path], scale: float | str = "auto") -> tuple[list[Floats], list[Diagnostic]]:
    """Read depth maps, each a frame of the same scene; a folder stands for the maps in it, by name.

    Parameters
    ----------
    paths : iterable of str or Path
        16-bit PNG or TIFF, float TIFF, EXR, or .npy: (rows, cols), or (frames, rows, cols) in a .npy.
    scale : float or a name of `DepthScale`
        How many of the file's numbers make a metre; "sun" also moves back the bits of SUN RGB-D. auto: 1000 for
        whole numbers; floats are metres where they are below 20, else millimetres.

    Returns
    -------
    frames : list of (rows, cols) float64 [mm]
        0 or NaN where there is no depth.
    warnings : list of Diagnostic

    Raises
    ------
    InputError
        If a file is missing, damaged, or no depth map.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     np.save(f"{folder}/depth.npy", np.full((3, 4), 0.65))
    ...     read_depths([f"{folder}/depth.npy"])[0][0][0].tolist()
    [650.0, 650.0, 650.0, 650.0]
    """
    if isinstance(scale, str) and scale not in get_args(DepthScale):
        raise UsageError(f"there is no depth scale {scale!r}; give a number per metre, or {', '.join(PER_METRE)}")
    if not isinstance(scale, str) and not (scale > 0 and np.isfinite(scale)):
        raise UsageError(f"the depth scale is {scale:g}; give how many of the file's numbers make a metre, above 0")
    frames: list[Floats] = []
    warnings: list[Diagnostic] = []
    for path in _files(paths):
        numbers = _numbers(path)
        if scale == "sun":
            numbers = _without_turn(path, numbers)
        per_metre = PER_METRE.get(scale, 0.0) if isinstance(scale, str) else float(scale)
        if not per_metre:
            per_metre, guessed = _guessed(numbers)
            warnings += [guessed] if guessed and guessed not in warnings else []
        depth = numbers.astype(np.float64) * (1000.0 / per_metre)
        frames += list(depth) if depth.ndim == 3 else [depth]
    return frames, warnings


def _files(paths: Iterable[str | Path]) -> list[Path]:
    found: list[Path] = []
    for path in map(Path, paths):
        inside = files_in(path, SUFFIXES) if is_folder(path) else [path]
        if not inside:
            raise InputError(f"{path} holds no depth map; {', '.join(SUFFIXES)} are wanted")
        found += inside
    if not found:
        raise InputError("no depth map was given; at least one file is wanted")
    return found


def _numbers(path: Path) -> NDArray:
    """The numbers of one file, (rows, cols) or (frames, rows, cols)."""
    data = read_bytes(path)
    if data.startswith(b"\x93NUMPY"):
        numbers = _from_npy(path, data)
    elif data.startswith(EXR):
        numbers = read_exr(path)
    else:
        numbers = decode_grid(str(path), data, "TIFF" if data[:4] in (b"II*\0", b"MM\0*") else "PNG")
    if numbers.dtype.kind not in "fu" and not np.issubdtype(numbers.dtype, np.integer):
        raise InputError(f"{path} holds {numbers.dtype}; a depth map has whole or floating numbers")
    if numbers.dtype.itemsize == 1:
        raise InputError(f"{path} has 8 bits a pixel: a picture of the depth, too coarse to measure; save 16 bits")
    if numbers.ndim not in ((2, 3) if path.suffix == ".npy" else (2,)) or min(numbers.shape) < 1:
        raise InputError(f"{path} has numbers of shape {numbers.shape}; one number a pixel is wanted")
    return numbers


def _from_npy(path: Path, data: bytes) -> NDArray:
    try:
        return np.asarray(np.load(io.BytesIO(data), allow_pickle=False))
    except MemoryError:
        raise InputError(f"{path} says that it holds more numbers than fit into the memory; is it damaged?") from None
    except Exception as problem:  # numpy's reader of headers raises what Python's own parser raises
        reason = " ".join(str(problem).split()) or type(problem).__name__
        raise InputError(f"{path} is damaged or was cut short: {reason}") from None


def _without_turn(path: Path, numbers: NDArray) -> NDArray:
    if numbers.dtype != np.uint16:
        raise InputError(f"{path} holds {numbers.dtype}; depths of SUN RGB-D are whole numbers of 16 bits")
    return (numbers >> _SUN_BITS) | (numbers << (16 - _SUN_BITS))


def _guessed(numbers: NDArray) -> tuple[float, Diagnostic | None]:
    """How many of the numbers make a metre, and a warning where that is a guess."""
    if numbers.dtype.kind != "f":
        return 1000.0, None
    seen = numbers[np.isfinite(numbers) & (numbers > 0)]
    if len(seen) and np.median(seen) < _FARTHEST_METRES:
        sentence = "the depths are floating numbers below 20 and were taken as metres"
        return 1.0, Diagnostic("depth-scale-guessed", sentence, "set {scale} if that is wrong")
    return 1000.0, None
