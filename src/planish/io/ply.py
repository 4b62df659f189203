"""PLY, ascii and binary: header, body, and what in it makes a mesh.

Read here rather than by a library: plyfile is under the GPL and slow on lists, trimesh drops the second texture and
takes no faces of mixed sizes.
"""

from __future__ import annotations

import re
import warnings as python_warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from planish.errors import InputError
from planish.io.filecloud import as_colours
from planish.io.filemesh import FileMesh, check_faces
from planish.io.plylists import copy_items, walk_rows
from planish.io.polygons import Polygons
from planish.io.textures import MeshImages, find_image, no_images
from planish.io.units import unit_named_in
from planish.io.uv_charts import without_whole_shifts
from planish.types import Diagnostic, Floats, Ints, Pixels

_KINDS = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4"},
    **{"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4", "float32": "f4"},
    **{"double": "f8", "float64": "f8", "int64": "i8", "uint64": "u8"},
}
_ORDERS = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}
_END = re.compile(rb"(?:\r\n|\n|\r)[ \t]*end_header[ \t]*(?:\r\n|\n|\r)")
_LONGEST_HEADER = 2**20

_TEXTURE_NAMES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"))
_LIST_NAMES = ("texcoord", "texcoords", "texture_coordinates", "uv")
_COLOUR_NAMES = (("red", "green", "blue"), ("diffuse_red", "diffuse_green", "diffuse_blue"), ("r", "g", "b"))
_FACE_NAMES = ("vertex_indices", "vertex_index")


@dataclass(frozen=True)
class Property:
    """A column: its numpy kind, and for a list that of the lists' lengths."""

    name: str
    kind: str
    count_kind: str | None


@dataclass(frozen=True)
class Element:
    """Rows of one kind, as the header announces them."""

    name: str
    rows: int
    properties: list[Property]


@dataclass(frozen=True, eq=False)
class Column:
    """The numbers of a property of all rows, and for a list their count in each row."""

    values: NDArray
    counts: NDArray[np.int64] | None


@np.errstate(invalid="ignore", over="ignore")  # for points that are not finite
def read_ply(path: Path, data: bytes, inside: Path | None = None) -> FileMesh:
    """Read a PLY; its image only from within the folder `inside`, if one is given.

    Texture coordinates are those of the faces (list ``texcoord``, with the number of the image in ``texnumber``),
    else those of the points (s t, u v or texture_u texture_v). The images are named by ``comment TextureFile``.

    Raises
    ------
    InputError
        If the header cannot be understood, the file was cut short, or it holds no surface.
    """
    tables, comments = ply_tables(path, data, {"vertex", "face"})
    points = ply_points(path, tables.get("vertex", {}))
    polygons, image_of_face, notes = _polygons(path, tables)
    check_faces(path, points, polygons)
    names = [_texture_file(line) for line in comments if line.lower().startswith("texturefile ")]
    images = _images(path, polygons, names, image_of_face, inside)
    polygons = without_whole_shifts(polygons, images.of_face >= 0)
    colours = ply_colours(tables.get("vertex", {}))
    warnings = [*notes, *images.warnings]
    return FileMesh(points, polygons, images, colours, unit_named_in("\n".join(comments)), warnings=warnings)


def _images(path: Path, polygons: Polygons, names: list[str], image_of_face: Ints, inside: Path | None) -> MeshImages:
    """The images that the comments name, and which of them each face shows (texnumber; the last where it is higher)."""
    if polygons.uv is None or not names:
        return no_images(len(polygons.sizes))
    files: list[Path | None] = []
    warnings: list[Diagnostic] = []
    for name in names:
        file, missing = find_image(path, name, inside)
        files.append(file)
        warnings += missing
    return MeshImages(tuple(names), tuple(files), np.minimum(image_of_face, len(names) - 1), tuple(warnings))


def ply_tables(path: Path, data: bytes, wanted: set[str]) -> tuple[dict[str, dict[str, Column]], list[str]]:
    """The columns of each element by their names, up to the last one wanted, and the comments with every obj_info.

    Raises
    ------
    InputError
        If the header cannot be understood, or the file was cut short.
    """
    elements, order, comments, start = _header(path, data)
    body: NDArray = np.frombuffer(data, np.uint8)
    if order == "=":
        body, start = _ascii_numbers(path, data[start:]), 0
    tables: dict[str, dict[str, Column]] = {}
    for element in elements:
        if wanted <= tables.keys():
            break  # what follows is not needed
        tables[element.name], start = _read_element(path, element, body, start, order)
    return tables, comments


def _texture_file(comment: str) -> str:
    return comment[len("texturefile ") :].strip()


# Header


def _header(path: Path, data: bytes) -> tuple[list[Element], str, list[str], int]:
    """Elements, byte order ("=" for ascii), comments, and where the body starts."""
    end = _END.search(data, 0, _LONGEST_HEADER)
    if not end:
        raise InputError(f"{path} is no PLY: its header has no end (end_header); was the file cut short?")
    order = None
    elements: list[Element] = []
    comments: list[str] = []
    for line in data[: end.start()].decode("utf-8", "replace").splitlines()[1:]:
        match line.split():
            case []:
                pass
            case ["format", name, "1.0"] if name in _ORDERS:
                order = _ORDERS[name]
            case ["comment" | "obj_info", *_]:
                comments.append(line.split(None, 1)[1].strip() if len(line.split()) > 1 else "")
            case ["element", name, rows] if rows.isascii() and rows.isdigit():
                elements.append(Element(name, int(rows), []))
            case ["property", "list", count_kind, kind, name] if elements and {count_kind, kind} <= _KINDS.keys():
                elements[-1].properties.append(Property(name, _KINDS[kind], _KINDS[count_kind]))
            case ["property", kind, name] if elements and kind in _KINDS:
                elements[-1].properties.append(Property(name, _KINDS[kind], None))
            case _:
                raise InputError(f"{path} is no PLY: its header has the line “{line[:60]}”, which cannot be understood")
    if order is None:
        raise InputError(f"{path} is no PLY: its header does not say “format” with ascii or binary and version 1.0")
    return elements, order, comments, end.end()


# Body


def _ascii_numbers(path: Path, text: bytes) -> Floats:
    """All numbers of an ascii body."""
    try:
        with python_warnings.catch_warnings():
            python_warnings.simplefilter("error")  # numpy's way to say that it met something else
            return np.fromstring(text.decode("ascii"), np.float64, sep=" ")
    except (ValueError, DeprecationWarning):
        number, word = _first_bad_line(text)
        raise InputError(f"{path}: line {number} after the header holds “{word}”, which is no number") from None


def _first_bad_line(text: bytes) -> tuple[int, str]:
    for number, line in enumerate(text.splitlines(), 1):
        for word in line.split():
            try:
                float(word)
            except ValueError:
                return number, word[:40].decode("ascii", "backslashreplace")
    return 0, "?"


def _read_element(path: Path, element: Element, body: NDArray, start: int, order: str) -> tuple[dict[str, Column], int]:
    """The columns of one element, and where the next starts; body holds bytes, or the numbers of an ascii file."""
    cut = InputError(f"{path} ends within its {element.rows} rows of {element.name}; was the file cut short?")
    if not element.properties or not element.rows:
        return {}, start
    ascii_body = order == "="
    sizes = np.array([1 if ascii_body else np.dtype(p.kind).itemsize for p in element.properties])
    counters = [p.count_kind and (1 if ascii_body else np.dtype(p.count_kind).itemsize) for p in element.properties]
    count_sizes = np.array([size or 0 for size in counters])
    least = int(np.where(count_sizes > 0, count_sizes, sizes).sum())
    if element.rows * least > len(body) - start:
        raise cut
    if not count_sizes.any():
        stop = start + element.rows * least
        return _plain_columns(element, body[start:stop], order), stop
    counts, starts, stop = walk_rows(body, start, element.rows, sizes, count_sizes, order != ">")
    if stop < 0:
        raise cut
    columns = {}
    for k, p in enumerate(element.properties):
        values = copy_items(body, starts[:, k], counts[:, k] * sizes[k])
        values = values if ascii_body else values.view(order + p.kind)
        columns[p.name] = Column(values, counts[:, k] if p.count_kind else None)
    return columns, int(stop)


def _plain_columns(element: Element, body: NDArray, order: str) -> dict[str, Column]:
    """The columns of an element without lists."""
    if order == "=":
        table = body.reshape(element.rows, -1)
        return {p.name: Column(table[:, k], None) for k, p in enumerate(element.properties)}
    kind = np.dtype([(f"{k}", order + p.kind) for k, p in enumerate(element.properties)])
    rows = body.view(kind)
    return {p.name: Column(rows[f"{k}"], None) for k, p in enumerate(element.properties)}


# Meaning


def ply_points(path: Path, vertex: dict[str, Column]) -> Floats:
    """The coordinates (n, 3) in the columns of the element vertex."""
    lost = [axis for axis in "xyz" if axis not in vertex or vertex[axis].counts is not None]
    if vertex and lost:
        raise InputError(f"{path} is no mesh: its points have no {lost[0]}; the properties x, y and z are wanted")
    if not vertex:
        return np.zeros((0, 3))
    return np.stack([vertex[axis].values for axis in "xyz"], axis=1).astype(np.float64)


def _polygons(path: Path, tables: dict[str, dict[str, Column]]) -> tuple[Polygons, Ints, list[Diagnostic]]:
    """The faces with at least 3 corners, the number of the image of each (0 where the file does not say), notes."""
    face = tables.get("face", {})
    corners = next((face[name] for name in _FACE_NAMES if name in face and face[name].counts is not None), None)
    if corners is None or corners.counts is None:
        return Polygons(np.zeros(0, np.int32), np.zeros(0, np.int32)), np.zeros(0, np.int32), []
    real = corners.counts >= 3
    sizes = corners.counts[real].astype(np.int32)
    index = _as_index(corners.values[np.repeat(real, corners.counts)])
    image = np.zeros(len(real), np.int32)
    if "texnumber" in face and face["texnumber"].counts is None:
        image = _as_index(face["texnumber"].values)
    uv, uv_corners, notes = _face_texture(path, face, corners.counts, real)
    if uv is None:
        uv = _point_texture(tables["vertex"]) if "vertex" in tables else None
        uv_corners = index if uv is not None else None
    return Polygons(sizes, index, uv, uv_corners), image[real], notes


def _as_index(values: NDArray) -> Ints:
    """Whole numbers that int32 holds, and -1 for all others."""
    if values.dtype.kind == "f":
        good = (values == np.floor(values)) & (np.abs(values) < 2**31)
    else:
        good = (values >= 0) & (values < 2**31)
    return np.where(good, values, -1).astype(np.int32)


def _face_texture(
    path: Path, face: dict[str, Column], sizes: NDArray[np.int64], real: NDArray[np.bool_]
) -> tuple[Floats | None, Ints | None, list[Diagnostic]]:
    """The list of u and v of every corner; a face whose list has another length has none.

    Its usual name is texcoord; under another name a list of floating numbers, two for each corner, is taken for it.
    """
    lists = [name for name, column in face.items() if column.counts is not None and name not in _FACE_NAMES]
    for name in sorted(lists, key=lambda one: one not in _LIST_NAMES):
        column = face[name]
        assert column.counts is not None
        fits = (column.counts == 2 * sizes) & real
        usual = name in _LIST_NAMES
        if not fits.any() or not (usual or (column.values.dtype.kind == "f" and fits[real].all())):
            continue
        uv = column.values[np.repeat(fits, column.counts)].astype(np.float64).reshape(-1, 2)
        fits_corner = np.repeat(fits[real], sizes[real])
        corners = np.where(fits_corner, np.cumsum(fits_corner) - 1, -1).astype(np.int32)
        sentence = f"{path}: the list “{name}” of its faces was taken for texture coordinates"
        return uv, corners, [] if usual else [Diagnostic("texture-guessed", sentence)]
    return None, None, []


def _point_texture(vertex: dict[str, Column]) -> Floats | None:
    for pair in _TEXTURE_NAMES:
        if all(name in vertex and vertex[name].counts is None for name in pair):
            return np.stack([vertex[name].values for name in pair], axis=1).astype(np.float64)
    return None


def ply_colours(vertex: dict[str, Column]) -> Pixels | None:
    """Red, green and blue (n, 3) in the columns of the element vertex, if it has them."""
    for names in _COLOUR_NAMES:
        if all(name in vertex and vertex[name].counts is None for name in names):
            return as_colours([vertex[name].values for name in names])
    return None
