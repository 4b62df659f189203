"""STL and OFF: points and faces, no more."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from planish.errors import InputError
from planish.io.filecloud import as_colours
from planish.io.filemesh import FileMesh, check_faces
from planish.io.polygons import Polygons, of_triangles
from planish.io.units import unit_named_in
from planish.types import Floats, Ints

_STL_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_STL_HEAD = 84
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|nan|[-+]?inf"


def is_binary_stl(data: bytes) -> bool:
    """Whether the number of triangles after the head is the one that the file's size tells."""
    if len(data) < _STL_HEAD:
        return False
    count = int(np.frombuffer(data, "<u4", 1, 80)[0])
    return count > 0 and len(data) - _STL_HEAD - count * _STL_RECORD.itemsize in range(_STL_RECORD.itemsize)


def read_stl(path: Path, data: bytes) -> FileMesh:
    """Read an STL, binary or text; corners in the very same place become one point, in the order of their first use.

    Raises
    ------
    InputError
        If it is damaged, or holds no surface.
    """
    if is_binary_stl(data):
        count = int(np.frombuffer(data, "<u4", 1, 80)[0])
        corners = np.frombuffer(data, _STL_RECORD, count, _STL_HEAD)["corners"].reshape(-1, 3).astype(np.float64)
        comment = data[:80].decode("ascii", "replace")
    else:
        text = data.decode("ascii", "replace")
        found = re.findall(rf"vertex\s+({_NUMBER})\s+({_NUMBER})\s+({_NUMBER})(?=\s)", text, re.IGNORECASE)
        corners = np.array(found, np.float64).reshape(-1, 3)
        said = len(re.findall(r"\bvertex\b", text, re.IGNORECASE))
        if said != len(corners) or len(corners) % 3 or (len(corners) and "endsolid" not in text[-4096:].lower()):
            raise InputError(f"{path} is an STL with {said} corners, {len(corners)} of them whole; was it cut short?")
        comment = text[:200].splitlines()[0] if text else ""
    points, faces = _joined(corners)
    polygons = of_triangles(faces)
    check_faces(path, points, polygons)
    return FileMesh(points, polygons, unit=unit_named_in(comment))


def _joined(corners: Floats) -> tuple[Floats, Ints]:
    if not len(corners):
        return corners, np.zeros((0, 3), np.int32)
    _, first, group = np.unique(corners, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first, kind="stable")
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(len(order))
    return corners[first[order]], rank[group.reshape(-1)].reshape(-1, 3).astype(np.int32)


def read_off(path: Path, data: bytes) -> FileMesh:
    """Read an OFF or COFF as text: points, perhaps with colours, and polygons.

    Raises
    ------
    InputError
        If it is damaged, cut short, or holds no surface.
    """
    text = data.decode("utf-8", "replace")
    comments = "\n".join(re.findall(r"#[^\n]*", text))
    rows = [line.split() for line in re.sub(r"#[^\n]*", "", text).splitlines() if line.strip()]
    head = re.fullmatch(r"(ST)?(C)?(N)?OFF", rows[0][0]) if rows else None
    if head is None or (len(rows[0]) > 1 and rows[0][1].upper() == "BINARY"):
        raise InputError(f"{path} is no OFF of text that can be read; write it as text, or as OBJ or PLY")
    rows[0] = rows[0][1:]
    rows = rows if rows[0] else rows[1:]
    try:
        points_count, faces_count = (int(word) for word in rows[0][:2])
        numbers = np.array([[float(x) for x in row[:3]] for row in rows[1 : 1 + points_count]]).reshape(-1, 3)
        more = [[float(x) for x in row[3:6]] for row in rows[1 : 1 + points_count]]
        faces = [[int(x) for x in row] for row in rows[1 + points_count : 1 + points_count + faces_count]]
        faces = [row for row in ([row[0], *row[1 : 1 + row[0]]] for row in faces) if row[0] >= 3]
    except (ValueError, IndexError):
        raise InputError(f"{path} is an OFF with a line that holds no numbers; was it damaged or cut short?") from None
    if len(numbers) < points_count or len(rows) < 1 + points_count + faces_count:
        raise InputError(
            f"{path} tells {points_count} points and {faces_count} faces and ends before; was it cut short?"
        )
    if any(len(row) != row[0] + 1 for row in faces):
        raise InputError(f"{path}: a face has fewer corners than it says; was the file damaged?")
    sizes = np.array([row[0] for row in faces], np.int32)
    corners = np.array([i if -1 < i < 2**31 else -1 for row in faces for i in row[1:]], np.int32)
    polygons = Polygons(sizes, corners)
    check_faces(path, numbers, polygons)
    colours = None
    if head[2] and not head[3] and more and all(len(row) == 3 for row in more):
        colours = as_colours(list(np.array(more).T))
    return FileMesh(numbers, polygons, colours=colours, unit=unit_named_in(comments))
