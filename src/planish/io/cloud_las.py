"""Points from LAS and LAZ, formats of surveyors and of photogrammetry programs: the extra `planish[clouds]`."""

from __future__ import annotations

import io
import struct
from pathlib import Path

import numpy as np

from planish.errors import InputError, MissingExtraError, install_command
from planish.io.filecloud import FileCloud, as_colours, as_grey
from planish.memory import check_memory

_HEADER_BYTES, _HEADER_BYTES_1_4 = 227, 375
_RECORD_BYTES = 54
"""Of the head of a record beside the points (VLR)."""
_PLAUSIBLE_PACKING = 1000
"""LAZ packs points into a tenth of their bytes."""


def read_las(path: Path, data: bytes) -> FileCloud:
    """Read a LAS or LAZ, in metres.

    Raises
    ------
    InputError
        If the file is damaged or cut short.
    MissingExtraError
        If laspy is not installed.
    """
    try:
        import laspy
    except ImportError:
        raise MissingExtraError(f"{path} is a LAS file; to read it: {install_command('clouds')}") from None
    _check_header(path, data)
    try:
        found = laspy.read(io.BytesIO(data))
        points = np.array(found.xyz, np.float64)
        names = set(found.point_format.dimension_names)
        colours = None
        if {"red", "green", "blue"} <= names:
            colours = as_colours([np.asarray(found[name]) for name in ("red", "green", "blue")])
        if colours is None or not colours.any():
            colours = as_grey(np.asarray(found["intensity"]))
    except Exception as problem:  # whatever the library raises on damaged files
        raise InputError(
            f"{path} is a LAS file, but damaged or cut short: {' '.join(str(problem).split())[:200]}"
        ) from None
    if len(points) != found.header.point_count:
        raise InputError(
            f"{path} tells {found.header.point_count:,} points, but {len(points):,} follow; was the file cut short?"
        )
    return FileCloud(points, colours, unit="m")


def _check_header(path: Path, data: bytes) -> None:
    """Refuse a header that promises more than the file can hold: the library would look for it for hours."""
    if len(data) < _HEADER_BYTES:
        raise InputError(f"{path} is a LAS file of {len(data)} bytes, less than its header; was it cut short?")
    records, length, points = struct.unpack_from("<I", data, 100)[0], *struct.unpack_from("<HI", data, 105)
    further = 0
    if data[25] >= 4 and len(data) >= _HEADER_BYTES_1_4:
        further, points = *struct.unpack_from("<I", data, 243), *struct.unpack_from("<Q", data, 247)
    if _RECORD_BYTES * (records + further) > len(data) or points * length > _PLAUSIBLE_PACKING * len(data):
        raise InputError(
            f"{path} is a LAS file of {len(data)} bytes that promises {points:,} points and {records + further:,} "
            "records; is it damaged or cut short?"
        )
    check_memory(3 * points * length, f"{path} with its {points:,} points", "thin it out with the scanner's software")
