"""Points from PCD, the Point Cloud Library's format: the extra `planish[clouds]`."""

from __future__ import annotations

import io
import warnings as python_warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from planish.errors import InputError, MissingExtraError, install_command
from planish.io.filecloud import FileCloud, as_colours, as_grey
from planish.io.units import unit_named_in
from planish.types import Floats, Pixels

_HERE = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
"""The VIEWPOINT that is written where none is known."""


def read_pcd(path: Path, data: bytes) -> FileCloud:
    """Read a PCD: ascii, binary or binary_compressed; a HEIGHT above 1 tells a range image.

    In metres, as the Point Cloud Library and the robots' world around it (ROS, REP 103) have it, unless a comment
    names another unit. `decide_unit` takes them for millimetres where metres make no sheet.

    Raises
    ------
    InputError
        If the file is damaged or cut short.
    MissingExtraError
        If pypcd4 is not installed.
    """
    try:
        from pypcd4 import PointCloud
    except ImportError:
        raise MissingExtraError(f"{path} is a PCD; to read it: {install_command('clouds')}") from None
    try:
        with python_warnings.catch_warnings():
            python_warnings.simplefilter("ignore")
            found = PointCloud.from_fileobj(io.BytesIO(data))
    except Exception as problem:  # whatever its many parts raise on damaged files
        reason = " ".join(str(problem).split())[:200] or type(problem).__name__
        raise InputError(f"{path} is a PCD, but damaged or cut short: {reason}") from None
    head, table = found.metadata, np.atleast_1d(found.pc_data)
    if len(table) != head.points or head.width * head.height not in (0, head.points):
        raise InputError(
            f"{path} tells {head.points} points and {head.width} x {head.height} pixels, but {len(table)} points"
            " follow; was the file cut short?"
        )
    points = _columns(table, ("x", "y", "z"))
    if points is None:
        raise InputError(f"{path} has the fields {', '.join(table.dtype.names or ())}; x, y and z are wanted")
    shape_rc = (head.height, head.width) if min(head.height, head.width) > 1 else None
    scanner = np.array(head.viewpoint[:3]) if tuple(head.viewpoint) != _HERE else None
    comments = "\n".join(line for line in data[:4096].decode("ascii", "replace").splitlines() if line.startswith("#"))
    normals = _columns(table, ("normal_x", "normal_y", "normal_z"))
    return FileCloud(points, _colours(table), normals, shape_rc, scanner, unit_named_in(comments) or "m")


def _columns(table: NDArray, names: tuple[str, ...]) -> Floats | None:
    if not set(names) <= set(table.dtype.names or ()):
        return None
    return np.stack([table[name] for name in names], axis=1).astype(np.float64)


def _colours(table: NDArray) -> Pixels | None:
    names = table.dtype.names or ()
    packed = next((name for name in ("rgb", "rgba") if name in names), None)
    if packed is not None and table[packed].dtype.itemsize == 4:
        word = table[packed]
        bits = np.ascontiguousarray(word).view(np.uint32) if word.dtype.kind == "f" else word.astype(np.uint32)
        return np.stack([bits >> 16 & 255, bits >> 8 & 255, bits & 255], axis=1).astype(np.uint8)
    if {"r", "g", "b"} <= set(names):
        return as_colours([table[name] for name in "rgb"])
    return as_grey(table["intensity"]) if "intensity" in names else None
