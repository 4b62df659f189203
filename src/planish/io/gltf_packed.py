"""Geometry of a glTF that Draco or meshopt packed: the extras `planish[packed]` and `planish[meshopt]`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planish.errors import InputError, MissingExtraError, install_command


def unpack_draco(path: Path, data: bytes, attributes: dict[str, Any]) -> tuple[NDArray[np.int64], dict[str, NDArray]]:
    """Unpack a primitive: its triangles (m, 3) and the arrays of its attributes by their names in glTF.

    Parameters
    ----------
    path : Path
        Of the file, for messages.
    data : bytes
    attributes : dict
        Draco's number of each attribute, by its name in glTF.

    Raises
    ------
    InputError
        If the data is damaged.
    MissingExtraError
        If DracoPy is not installed.
    """
    try:
        import DracoPy
    except ImportError:
        raise MissingExtraError(f"{path} is packed with Draco; to read it: {install_command('packed')}") from None
    try:
        found = DracoPy.decode(data)
        triangles = np.asarray(found.faces, np.int64).reshape(-1, 3)
        arrays = {}
        for name, number in attributes.items():
            one = found.get_attribute_by_unique_id(number)
            if one is not None:
                arrays[name] = np.asarray(one["data"]).reshape(len(found.points), -1)
    except Exception as problem:  # whatever the library raises on damaged data
        raise InputError(
            f"{path} is packed with Draco, but damaged: {' '.join(str(problem).split())[:100]}; export it again"
        ) from None
    return triangles, arrays


def unpack_meshopt(path: Path, data: bytes, count: int, stride: int, mode: str, bent: str) -> bytes | None:
    """Unpack a buffer view (EXT_meshopt_compression); None where its data is damaged.

    Parameters
    ----------
    path : Path
        Of the file, for messages.
    data : bytes
    count, stride : int
        Rows, and bytes of each.
    mode : {"ATTRIBUTES", "TRIANGLES", "INDICES"}
    bent : {"NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL"}
        The filter that was laid over the rows.

    Raises
    ------
    MissingExtraError
        If meshoptimizer is not installed.
    """
    try:
        import meshoptimizer
    except ImportError:
        raise MissingExtraError(f"{path} is packed with meshopt; to read it: {install_command('meshopt')}") from None
    filters = {
        "OCTAHEDRAL": meshoptimizer.decode_filter_oct,
        "QUATERNION": meshoptimizer.decode_filter_quat,
        "EXPONENTIAL": meshoptimizer.decode_filter_exp,
    }
    if not _is_sound(count, stride, mode, bent):
        return None
    try:
        if mode == "ATTRIBUTES":
            rows = meshoptimizer.decode_vertex_buffer(count, stride, data)
        elif mode in ("TRIANGLES", "INDICES") and stride in (2, 4):
            decode = meshoptimizer.decode_index_buffer if mode == "TRIANGLES" else meshoptimizer.decode_index_sequence
            rows = decode(count, stride, data)
        else:
            return None
        rows = rows.reshape(-1).view(np.uint8)[: count * stride]
        if bent in filters:
            rows = filters[bent](rows, count, stride)
    except (ValueError, RuntimeError):
        return None
    return rows.tobytes()


_STRIDES = {"OCTAHEDRAL": (4, 8), "QUATERNION": (8,)}
"""Bytes of the rows that a filter works on; of the exponential one and of others a multiple of 4."""


def _is_sound(count: int, stride: int, mode: str, bent: str) -> bool:
    """Whether the extension allows these numbers: with others the library writes beyond its memory."""
    if not count or not stride:
        return False
    if mode == "ATTRIBUTES":
        return stride % 4 == 0 and stride <= 256 and stride in _STRIDES.get(bent, (stride,))
    return bent == "NONE" and (mode != "TRIANGLES" or count % 3 == 0)
