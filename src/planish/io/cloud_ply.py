"""Points from PLY: a cloud as it is, a Stanford range grid, or the organised clouds of the Point Cloud Library."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from planish.errors import InputError
from planish.io.filecloud import FileCloud, as_colours, as_grey
from planish.io.ply import Column, ply_colours, ply_points, ply_tables
from planish.io.units import unit_named_in
from planish.types import Floats, Pixels

_STRENGTHS = ("intensity", "scalar_intensity", "reflectance", "confidence")
_SIZE = re.compile(r"^(num_cols|num_rows|width|height)\s*[:=]?\s*(\d+)\s*$", re.IGNORECASE | re.MULTILINE)


@np.errstate(invalid="ignore", over="ignore")  # for points that are not finite
def read_ply_cloud(path: Path, data: bytes) -> FileCloud:
    """Read the points of a PLY, and the rows and columns of their range image where it tells them.

    They are told by the element ``range_grid`` with ``obj_info num_cols`` and ``num_rows``, by ``comment width`` and
    ``height``, or by ``viewportx`` and ``viewporty`` of the element ``camera``. A mesh's points are read without its
    faces.

    Raises
    ------
    InputError
        If the file is damaged or contradicts itself.
    """
    tables, comments = ply_tables(path, data, {"vertex", "range_grid", "camera"})
    vertex = tables.get("vertex", {})
    points, colours, normals = ply_points(path, vertex), _colours(vertex), _columns(vertex, ("nx", "ny", "nz"))
    comment_text = "\n".join(comments)
    sizes = {name.lower(): int(number) for name, number in _SIZE.findall(comment_text)}
    shape_rc = _shape(sizes, tables.get("camera", {}), len(points))
    if "range_grid" in tables:
        shape_rc = sizes.get("num_rows", 0), sizes.get("num_cols", 0)
        row = _grid(path, tables["range_grid"], shape_rc, len(points))
        points = np.vstack([points, [np.nan] * 3])[row]  # row -1: nothing was seen
        colours = None if colours is None else as_colours([np.append(channel, 0)[row] for channel in colours.T])
        normals = None if normals is None else np.vstack([normals, np.zeros_like(normals[:1])])[row]
    return FileCloud(points, colours, normals, shape_rc, unit=unit_named_in(comment_text))


def _columns(vertex: dict[str, Column], names: tuple[str, ...]) -> Floats | None:
    if any(name not in vertex or vertex[name].counts is not None for name in names):
        return None
    return np.stack([vertex[name].values for name in names], axis=1).astype(np.float64)


def _colours(vertex: dict[str, Column]) -> Pixels | None:
    colours = ply_colours(vertex)
    if colours is not None:
        return colours
    strength = next((vertex[name] for name in _STRENGTHS if name in vertex and vertex[name].counts is None), None)
    return None if strength is None else as_grey(strength.values)


def _shape(sizes: dict[str, int], camera: dict[str, Column], count: int) -> tuple[int, int] | None:
    """Rows and columns, where all points of the file fill them."""
    claims = [(sizes.get("num_rows", 0), sizes.get("num_cols", 0)), (sizes.get("height", 0), sizes.get("width", 0))]
    if {"viewportx", "viewporty"} <= camera.keys():
        claims.append((int(camera["viewporty"].values[0]), int(camera["viewportx"].values[0])))
    return next((claim for claim in claims if min(claim) > 1 and claim[0] * claim[1] == count), None)


def _grid(path: Path, grid: dict[str, Column], shape_rc: tuple[int, int], count: int) -> NDArray[np.int64]:
    """The point of each pixel, -1 where there is none."""
    lists = next((column for column in grid.values() if column.counts is not None), None)
    if lists is None or lists.counts is None:
        raise InputError(f"{path}: its range_grid has no list of points; it cannot be understood")
    rows, cols = shape_rc
    if rows * cols != len(lists.counts):
        raise InputError(
            f"{path}: its range_grid has {len(lists.counts)} pixels, but obj_info tells {cols} columns and {rows} rows;"
            " num_cols times num_rows must be the number of pixels"
        )
    start = np.cumsum(lists.counts) - lists.counts
    seen = lists.counts > 0
    index = np.full(rows * cols, -1, np.int64)
    index[seen] = lists.values[start[seen]]
    bad = np.flatnonzero(seen & ((index < 0) | (index >= count)))
    if len(bad):
        raise InputError(
            f"{path}: pixel {bad[0]} of its range_grid holds point {index[bad[0]]}, but there are {count} points; was"
            " the file cut short?"
        )
    return index
