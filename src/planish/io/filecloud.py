"""What a reader of one format of point clouds hands over: the points as the file has them, before units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from planish.io.units import Unit
from planish.types import Diagnostic, Floats, Pixels, freeze


@dataclass(frozen=True, eq=False)
class FileCloud:
    """Points in the numbers of their file.

    Attributes
    ----------
    points : (n, 3) float64 [file's unit]
        In the file's order; some may not be finite. Of a range image row after row, the first row on top.
    colours : (n, 3) uint8 or uint16, or None
        Grey where the file has only the strength of the echo.
    normals : (n, 3) float64 or None
        Away from the side that was seen.
    shape_rc : (int, int) or None
        Rows and columns of a range image.
    scanner : (3,) float64 [file's unit] or None
        Where the device stood.
    unit : {"mm", "cm", "m", "in"} or None
        What the file says itself.
    warnings : list of Diagnostic
    """

    points: Floats
    colours: Pixels | None = None
    normals: Floats | None = None
    shape_rc: tuple[int, int] | None = None
    scanner: Floats | None = None
    unit: Unit | None = None
    warnings: list[Diagnostic] = field(default_factory=list)

    def __post_init__(self) -> None:
        freeze(self)


def as_colours(channels: Sequence[NDArray]) -> Pixels:
    """Red, green and blue as one array (n, 3) uint8 or uint16.

    Floating numbers are taken as parts of 1 where they are, else of 255; whole ones of more than 8 bits stay 16 bit
    unless all would fit into 8.

    Examples
    --------
    >>> as_colours([np.array([0.0, 1.0]), np.array([0.5, 1.0]), np.array([1.0, 1.0])]).tolist()
    [[0, 128, 255], [255, 255, 255]]
    """
    rgb = np.stack(channels, axis=1)
    if rgb.dtype.kind == "f":
        rgb = np.nan_to_num(rgb, nan=0.0, posinf=0.0, neginf=0.0)
        top = 255 if rgb.max(initial=0) <= 1 else 1
        return np.clip(np.rint(rgb * top), 0, 255).astype(np.uint8)
    if rgb.dtype.itemsize > 1 and rgb.max(initial=0) > 255:
        return np.clip(rgb, 0, 65535).astype(np.uint16)
    return np.clip(rgb, 0, 255).astype(np.uint8)


def as_grey(strength: NDArray) -> Pixels | None:
    """The strength of echoes as grey, stretched from the 1st to the 99th percentile; None if it tells nothing.

    Examples
    --------
    >>> as_grey(np.linspace(0.2, 0.4, 101))[[0, 50, 100]].tolist()
    [[0, 0, 0], [128, 128, 128], [255, 255, 255]]
    >>> as_grey(np.full(5, 0.5)) is None
    True
    """
    strength = strength.astype(np.float64)
    known = np.isfinite(strength)
    if not known.any():
        return None
    low, high = np.percentile(strength[known], [1, 99])
    if not high > low:
        return None
    grey = np.clip(np.rint(255 * (np.where(known, strength, low) - low) / (high - low)), 0, 255).astype(np.uint8)
    return np.repeat(grey[:, None], 3, axis=1)
