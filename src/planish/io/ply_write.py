"""PLY, binary: points as double, faces of any size, texture coordinates, columns of further numbers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from planish.io.polygons import Polygons
from planish.types import Floats

_PLY_NAMES = {"f4": "float", "f8": "double", "u1": "uchar", "i4": "int", "u4": "uint"}


def ply_parts(
    points: Floats,
    polygons: Polygons,
    *,
    point_uv: Floats | None = None,
    point_columns: Mapping[str, NDArray] | None = None,
    face_columns: Mapping[str, NDArray] | None = None,
    texture: str | None = None,
    comments: list[str] | None = None,
) -> Iterator[bytes]:
    """Write a binary PLY in parts.

    Parameters
    ----------
    points : (n, 3) float64
    polygons : Polygons
        Their texture coordinates are written per face (list texcoord), unless `point_uv` is given.
    point_uv : (n, 2) float64, optional
        One texture coordinate per point, written as s and t.
    point_columns, face_columns : mapping of str to (n,) or (p,), optional
        uint8 as uchar, all else as float.
    texture : str, optional
        Name of the image file.
    comments : list of str, optional
    """
    columns: dict[str, NDArray] = {axis: points[:, k].astype("<f8") for k, axis in enumerate("xyz")}
    if point_uv is not None:
        columns |= {"s": point_uv[:, 0].astype("<f4"), "t": point_uv[:, 1].astype("<f4")}
        polygons = Polygons(polygons.sizes, polygons.corners)
    columns |= {name: _stored(values) for name, values in (point_columns or {}).items()}
    extra = {name: _stored(values) for name, values in (face_columns or {}).items()}
    count = "u1" if polygons.sizes.max(initial=3) < 128 else "u4"  # texcoord has two numbers a corner
    lines = ["ply", "format binary_little_endian 1.0", *(f"comment {line}" for line in comments or [])]
    lines += [f"comment TextureFile {texture}"] if texture else []
    lines += [f"element vertex {len(points)}", *map(_property, columns, columns.values())]
    lines += [f"element face {len(polygons.sizes)}", f"property list {_PLY_NAMES[count]} int vertex_indices"]
    lines += [f"property list {_PLY_NAMES[count]} float texcoord"] if polygons.uv is not None else []
    lines += [*map(_property, extra, extra.values()), "end_header", ""]
    yield "\n".join(lines).encode()
    yield _table(columns).tobytes()
    yield _face_rows(polygons, count, extra)


def _stored(values: NDArray) -> NDArray:
    return values if values.dtype == np.uint8 else values.astype("<f4")


def _property(name: str, values: NDArray) -> str:
    return f"property {_PLY_NAMES[values.dtype.str[1:]]} {name}"


def _table(columns: Mapping[str, NDArray]) -> NDArray:
    """The columns side by side, row after row."""
    rows = np.empty(len(next(iter(columns.values()))), [(name, values.dtype) for name, values in columns.items()])
    for name, values in columns.items():
        rows[name] = values
    return rows


def _face_rows(polygons: Polygons, count: str, extra: Mapping[str, NDArray]) -> bytes:
    """All faces; those of one kind (corners, with texture or without) have rows of one form and are made at once."""
    first = np.cumsum(polygons.sizes, dtype=np.int64) - polygons.sizes
    textured = polygons.uv is not None
    bare = np.zeros(len(first), bool)
    if polygons.uv_corners is not None and len(first):
        bare = np.minimum.reduceat(polygons.uv_corners, first) < 0
    kinds, kind = np.unique(polygons.sizes * 2 + bare, return_inverse=True)
    tables = []
    for number, code in enumerate(kinds):
        which = np.flatnonzero(kind == number)
        corners = first[which, None] + np.arange(code // 2)
        tables.append((which, _faces_of_one_kind(polygons, corners, textured, bool(code % 2), count, extra, which)))
    if len(tables) == 1:
        return tables[0][1].tobytes()
    return _interleaved(tables, len(first))


def _faces_of_one_kind(
    polygons: Polygons,
    corners: NDArray[np.int64],
    textured: bool,
    bare: bool,
    count: str,
    extra: Mapping[str, NDArray],
    which: NDArray[np.int64],
) -> NDArray:
    size = corners.shape[1]
    form: list[tuple] = [("n", f"<{count}"), ("v", "<i4", (size,))]
    if textured:
        form += [("m", f"<{count}"), ("t", "<f4", (0 if bare else 2 * size,))]
    rows = np.empty(len(corners), form + [(f"extra {name}", values.dtype) for name, values in extra.items()])
    rows["n"], rows["v"] = size, polygons.corners[corners]
    if textured:
        rows["m"] = 0 if bare else 2 * size
        if not bare:
            assert polygons.uv is not None
            assert polygons.uv_corners is not None
            rows["t"] = polygons.uv[polygons.uv_corners[corners]].reshape(len(corners), -1)
    for name, values in extra.items():
        rows[f"extra {name}"] = values[which]
    return rows


def _interleaved(tables: list[tuple[NDArray[np.int64], NDArray]], count: int) -> bytes:
    """Rows of different lengths in the order of their numbers."""
    lengths = np.zeros(count, np.int64)
    for which, rows in tables:
        lengths[which] = rows.dtype.itemsize
    starts = np.cumsum(lengths) - lengths
    out = np.empty(int(lengths.sum()), np.uint8)
    for which, rows in tables:
        out[starts[which, None] + np.arange(rows.dtype.itemsize)] = rows.view(np.uint8).reshape(len(rows), -1)
    return out.tobytes()
