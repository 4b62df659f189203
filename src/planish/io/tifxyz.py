"""tifxyz, the folder in which the Vesuvius Challenge keeps a segmented sheet: a grid of points in space.

x.tif, y.tif and z.tif hold the coordinates, meta.json the grid's points per unit (`scale`); where all three are -1
there is no surface, nor where mask.tif (if there is one) is below 255.
"""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planish.errors import InputError, OutputError
from planish.io.filemesh import FileMesh, check_faces
from planish.io.files import is_tifxyz, read_bytes, writing_folder
from planish.io.images import decode_grid
from planish.io.polygons import Polygons
from planish.types import Bools, Diagnostic, Floats

_NO_SURFACE = -1.0
_KEEP = 255
FAR_CELLS = 10.0
"""A tear or a steep flank stretches steps up to some 5 times; runaway points lie hundreds of steps off."""


@np.errstate(invalid="ignore", over="ignore")  # for points that are not finite
def read_tifxyz(path: Path) -> FileMesh:
    """Read a tifxyz folder; every cell whose four corners hold points is a face.

    The faces run counter-clockwise where the grid is seen as an image, row 0 on top; texture coordinates are the
    places in that image.

    Raises
    ------
    InputError
        If a file is missing or damaged, the grids differ in size, or hold no surface.
    """
    if not is_tifxyz(path):
        raise InputError(f"{path} is a folder, and no tifxyz: it lacks meta.json, x.tif, y.tif or z.tif")
    _check_meta(path / "meta.json")
    xyz = [_coordinates(path / f"{axis}.tif") for axis in "xyz"]
    for axis, grid in zip("yz", xyz[1:], strict=True):
        if grid.shape != xyz[0].shape:
            raise InputError(f"{path}: x.tif has {_size(xyz[0])} points, but {axis}.tif {_size(grid)}")
    stack = np.stack(xyz)
    known = np.isfinite(stack).all(0) & (stack[2] != _NO_SURFACE) & stack.any(0)
    warnings = []
    if (path / "mask.tif").is_file():
        keep = _mask(path / "mask.tif", known.shape)
        if keep is None:
            sentence = f"{path / 'mask.tif'} is no whole multiple of the grid in size; it was left out"
            warnings.append(Diagnostic("mask-unusable", sentence))
        else:
            known &= keep
    lone = _lone_points(stack, known)
    if lone.any():
        known &= ~lone
        sentence = f"{path}: {int(lone.sum())} points lie more than {FAR_CELLS:.0f} cells from all their neighbours"
        warnings.append(Diagnostic("points-far-off", f"{sentence} and were left out"))
    points = np.stack([grid[known] for grid in xyz], axis=1)
    polygons = _cells(known)
    check_faces(path, points, polygons)
    return FileMesh(points, polygons, warnings=warnings)


def _lone_points(stack: Floats, known: Bools) -> Bools:
    """(rows, cols) points that are farther from all their neighbours in the grid than `FAR_CELLS` typical steps."""
    rows, cols = known.shape
    nearest, steps = np.full((rows, cols), np.inf), []
    for down, right in ((0, 1), (1, 0), (1, 1), (1, -1)):
        a = (slice(0, rows - down), slice(max(0, -right), cols - max(0, right)))
        b = (slice(down, rows), slice(max(0, right), cols + min(0, right)))
        apart = np.where(known[a] & known[b], np.linalg.norm(stack[:, *a] - stack[:, *b], axis=0), np.inf)
        nearest[a], nearest[b] = np.minimum(nearest[a], apart), np.minimum(nearest[b], apart)
        steps.append(apart[np.isfinite(apart)])
    every = np.concatenate(steps)
    if not len(every):
        return np.zeros((rows, cols), bool)
    return np.asarray(known & np.isfinite(nearest) & (nearest > FAR_CELLS * np.median(every)))


def _size(grid: NDArray) -> str:
    return f"{grid.shape[1]} x {grid.shape[0]}"


def _coordinates(path: Path) -> Floats:
    grid = decode_grid(str(path), read_bytes(path))
    if grid.ndim != 2:
        raise InputError(f"{path} has {grid.shape[2]} numbers a point; one is wanted")
    return grid.astype(np.float64)


def _check_meta(path: Path) -> None:
    data = read_bytes(path)
    try:
        meta = json.loads(data)
    except (ValueError, RecursionError) as problem:
        raise InputError(f"{path} is no JSON file: {problem}") from None
    if not isinstance(meta, dict) or meta.get("format", "tifxyz") != "tifxyz":
        raise InputError(f"{path} does not say “format”: “tifxyz”; is this another kind of segment?")


def _mask(path: Path, shape_rc: tuple[int, int]) -> Bools | None:
    """Which points a mask keeps: all its pixels over the point must be set. None where its size does not fit."""
    mask = decode_grid(str(path), read_bytes(path))
    mask = mask[..., 0] if mask.ndim == 3 else mask
    (rows, cols), (down, right) = shape_rc, (mask.shape[0] // shape_rc[0], mask.shape[1] // shape_rc[1])
    if mask.shape != (rows * down, cols * right) or not down * right:
        return None
    return np.asarray((mask.reshape(rows, down, cols, right) >= _KEEP).all((1, 3)))


def _cells(known: Bools) -> Polygons:
    number = np.where(known, np.cumsum(known).reshape(known.shape) - 1, -1)
    quads = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=-1)
    quads = quads[(quads >= 0).all(-1)]
    row, col = np.nonzero(known)
    uv = np.stack([(col + 0.5) / known.shape[1], 1 - (row + 0.5) / known.shape[0]], axis=1)
    corners = quads.astype(np.int32).reshape(-1)
    return Polygons(np.full(len(quads), 4, np.int32), corners, uv, corners)


def write_tifxyz(path: Path, xyz: Floats, per_unit: float) -> None:
    """Write a grid of points.

    Parameters
    ----------
    path : Path
        The folder; made, or put in place of another tifxyz.
    xyz : (rows, cols, 3) float64
        NaN where there is no surface.
    per_unit : float
        Grid points per unit of length.

    Raises
    ------
    OutputError
        If a point has z at or below 0, which scroll readers take for no surface, and as for every file.
    """
    known = np.isfinite(xyz).all(-1)
    lowest = xyz[known, 2].min(initial=np.inf)
    if lowest <= 0:
        raise OutputError(
            f"{path}: a tifxyz folder cannot hold points with z at or below 0; the lowest has {lowest:.4g}. Write .ply"
        )
    box = [xyz[known].min(0).tolist(), xyz[known].max(0).tolist()] if known.any() else [[_NO_SURFACE] * 3] * 2
    meta: dict[str, Any] = {"format": "tifxyz", "type": "seg", "uuid": path.name, "bbox": box}
    meta["scale"] = [per_unit, per_unit]
    with writing_folder(path) as folder:
        for k, axis in enumerate("xyz"):
            (folder / f"{axis}.tif").write_bytes(_float_tiff(np.where(known, xyz[..., k], _NO_SURFACE)))
        (folder / "meta.json").write_text(json.dumps(meta, indent=2) + "\n")


def _float_tiff(grid: Floats) -> bytes:
    import tifffile

    file = io.BytesIO()
    tifffile.imwrite(file, grid.astype(np.float32), compression="zlib", compressionargs={"level": 1}, metadata=None)
    return file.getvalue()
