"""Distortion of a flattening to its files: figures as JSON, and the numbers of each triangle as NumPy arrays."""

from __future__ import annotations

from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planish.errors import OutputError
from planish.io.files import write_bytes, write_json


def distortion_files(path: str | Path) -> list[Path]:
    """The two files that are written: the named one, and beside it the same name with .npz.

    Raises
    ------
    OutputError
        If the name does not end in .json.
    """
    path = Path(path)
    if path.suffix.lower() != ".json":
        raise OutputError(f"{path}: distortion is written as .json, and beside it as .npz; give a name with .json")
    return [path, path.with_suffix(".npz")]


def write_distortion(path: str | Path, figures: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write the figures of a page, and its arrays by name.

    Raises
    ------
    OutputError
        If the name does not end in .json, or a file cannot be written.
    """
    json_file, numpy_file = distortion_files(path)
    write_json(json_file, figures)
    packed = BytesIO()
    np.savez(packed, **arrays)  # type: ignore[arg-type]
    write_bytes(numpy_file, packed.getvalue())
