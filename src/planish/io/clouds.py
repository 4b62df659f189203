"""A file of points of any kind to a `FileCloud`: told by what it holds, not by its suffix."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from planish.errors import InputError
from planish.io.filecloud import FileCloud
from planish.io.files import read_bytes
from planish.io.text import as_utf8
from planish.memory import check_memory

_TIMES_ITS_SIZE = 6.0
"""What a cloud takes beside the bytes of its file while it is read: a text the most."""

_WANTED = "PLY, PCD, E57, LAS, LAZ, PTX or a text with x y z in each line is wanted"


def read_cloud(path: str | Path) -> FileCloud:
    r"""Read a point cloud, organised as a range image or not.

    Parameters
    ----------
    path : str or Path
        PLY (with a range grid or without), PCD, E57, LAS, LAZ, PTX, or a text with three numbers or more in each line.

    Raises
    ------
    InputError
        If it is none, damaged or cut short, or holds no point.
    MissingExtraError
        If the format needs a library that is not installed.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(f"{folder}/points.xyz").write_text("0 0 400\n1 0 400\n")
    ...     read_cloud(f"{folder}/points.xyz").points.tolist()
    [[0.0, 0.0, 400.0], [1.0, 0.0, 400.0]]
    """
    path = Path(path)
    data = as_utf8(read_bytes(path))
    check_memory(_TIMES_ITS_SIZE * len(data), f"the point cloud {path}", "let the scanner's software thin it out")
    cloud = _read(path, data)
    if not len(cloud.points):
        raise InputError(f"{path} holds no points; is it empty, or was the scan not exported?")
    if not np.isfinite(cloud.points).all(axis=1).any():
        raise InputError(f"{path}: none of its {len(cloud.points):,} points has three finite coordinates")
    return cloud


def _read(path: Path, data: bytes) -> FileCloud:
    if re.match(rb"ply[ \t]*[\r\n]", data):
        from planish.io.cloud_ply import read_ply_cloud

        return read_ply_cloud(path, data)
    if data.startswith(b"ASTM-E57"):
        from planish.io.cloud_e57 import read_e57

        return read_e57(path)
    if data.startswith(b"LASF"):
        from planish.io.cloud_las import read_las

        return read_las(path, data)
    if re.match(rb"(?:#[^\n]*\n|\s)*VERSION\s+\.?[0-9]", data[:4096]):
        from planish.io.cloud_pcd import read_pcd

        return read_pcd(path, data)
    if b"\0" in data[:65536]:
        raise InputError(f"{path} is no point cloud that planish reads; {_WANTED}")
    from planish.io.cloud_text import read_ptx, read_xyz

    return read_ptx(path, data) if re.match(rb"\s*\d+\s*\n\s*\d+\s*\n", data) else read_xyz(path, data)
