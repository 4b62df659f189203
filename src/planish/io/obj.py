"""Wavefront OBJ with its MTL: read by tinyobjloader, after every line has been checked; written line by line.

tinyobjloader takes much for an OBJ that is none: a number that is not one reads as 0, a missing coordinate too, a
face of two corners vanishes, an index wraps at 2**32. So each line must first match the grammar below.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import tinyobjloader
from numpy.lib.stride_tricks import as_strided
from numpy.typing import NDArray

from planish.errors import InputError
from planish.io.filecloud import as_colours
from planish.io.filemesh import FileMesh, check_faces
from planish.io.mtl import Map, read_mtl
from planish.io.polygons import Polygons
from planish.io.text import as_text
from planish.io.textures import MeshImages, find_beside, find_image, transformed_uv
from planish.io.units import Unit, unit_named_in
from planish.io.uv_charts import without_whole_shifts
from planish.types import Diagnostic, Floats, Ints, Pixels

_NUMBER = rb"[ \t]++[-+]?+(?:[0-9]++\.?+[0-9]*+|\.[0-9]++)(?:[eE][-+]?+[0-9]++)?+"
_INDEX = rb"-?+[0-9]{1,9}+"
_CORNER = rb"[ \t]++" + _INDEX + rb"(?:/" + _INDEX + rb"|//" + _INDEX + rb")?+(?:/" + _INDEX + rb")?+"
_LINES = re.compile(
    rb"(?:(?:"
    rb"v(?:" + _NUMBER + rb"){3,7}+"
    rb"|vt(?:" + _NUMBER + rb"){1,3}+"
    rb"|vn(?:" + _NUMBER + rb"){3}+"
    rb"|f(?:" + _CORNER + rb"){3,}+"
    rb"|\#[^\n]*+"
    rb"|(?:[gospl]|vp|mg|deg|end|lod|[a-z_0-9]{4,})(?:[ \t][^\n]*+)?+"
    rb"|)[ \t\r]*+\n)*+"
)
_DATA_LINE = re.compile(rb"^[ \t]*((?:v|vt|vn|f)[ \t][^#\n]*)(?:#[^\n]*)?", re.MULTILINE)
_NOT_FINITE = re.compile(
    rb"(?<=[ \t])[-+]?(?:1\.\#)?(?:nan|inf(?:inity)?|ind|qnan|snan)(?:\([^)]*\)|[0-9]*)(?=[ \t\r\n])", re.I
)
_EMPTY_INDEX = re.compile(rb"/+(?=[ \t\n]|\Z)")
_HEAD = 1 << 16
"""Bytes in which the first point is looked for: a longer comment at the head is not known to exist."""
_BEYOND = b"9e999"  # reads as infinite
_LONGEST_PATH, _MOST_WORDS = 4096, 32
"""Characters of a line that names files (no system opens longer paths), and blanks in a name that are thinkable: every
length of every name is looked for on the disk."""

_LOST_POINTS = 0.1
"""More points than this part without a face, and the file may have been cut short."""


def read_obj(path: Path, data: bytes, inside: Path | None = None) -> FileMesh:
    """Read an OBJ, all its groups as one mesh; MTL and image only from within the folder `inside`, if one is given.

    Raises
    ------
    InputError
        If a line cannot be understood, the file was cut short, or it holds no surface.
    """
    whole = data.endswith((b"\n", b"\r"))
    data = _checked(path, data if whole else data + b"\n", whole)
    maps, warnings = _libraries(path, data, inside)
    data, used = _numbered_materials(data)
    reader = tinyobjloader.ObjReader()
    config = tinyobjloader.ObjReaderConfig()
    config.triangulate = False
    if not reader.ParseFromString(data, "".join(f"newmtl m{k}\n" for k in range(len(used))), config):
        raise InputError(f"{path} is no OBJ that can be read: {_first_line(reader.Error())}; was the file cut short?")
    points = _dense(reader.GetAttrib().numpy_vertices()).reshape(-1, 3)
    polygons, materials = _polygons(reader)
    check_faces(path, points, polygons)
    told = _check_complete(path, points, polygons, whole)
    colours = _colours(reader, data, len(points))
    polygons, images = _images(path, polygons, materials, used, maps, warnings, inside)
    return FileMesh(points, polygons, images, colours, _unit(data), warnings=[*told, *images.warnings])


def _checked(path: Path, data: bytes, whole: bool) -> bytes:
    """The file's bytes once every line is known to be good OBJ, in its plain form where need be."""
    if _LINES.fullmatch(data):
        return data
    data = _normalized(data)
    good = _LINES.match(data)
    stop = good.end() if good else 0
    if stop == len(data):
        return data
    line = data[stop : data.index(b"\n", stop)]
    number = data.count(b"\n", 0, stop) + 1
    shown = line[:60].decode("ascii", "backslashreplace")
    if not re.match(rb"(?:v|vt|vn|f)[ \t]", line):
        raise InputError(f"{path} is no OBJ: its line {number} reads “{shown}”; a mesh of v, vt and f lines is wanted")
    if not whole and data.find(b"\n", stop) == len(data) - 1:
        raise InputError(f"{path} ends within its last line, {number}, “{shown}”; was the file cut short?")
    raise InputError(
        f"{path}: line {number} reads “{shown}”, which is no point or face of an OBJ; was the file damaged?"
    )


def _normalized(data: bytes) -> bytes:
    """The rarer ways to write the same: line ends of old Macs, continued lines, comments after data, 1/ for 1, NaN."""
    data = data.removeprefix(b"\xef\xbb\xbf").replace(b"\r\n", b"\n").replace(b"\r", b"\n").replace(b"\\\n", b" ")
    if re.search(rb"nan|inf|ind", data, re.IGNORECASE):
        data = re.sub(rb"(?m)^[ \t]*v[^\n]*\n", lambda line: _NOT_FINITE.sub(_BEYOND, line[0]), data)
    data = _DATA_LINE.sub(rb"\1", data)
    data = re.sub(rb"(?m)^[ \t]*f[^\n]*/[ \t\n][^\n]*", lambda line: _EMPTY_INDEX.sub(b"", line[0]), data)
    return data if data.endswith(b"\n") else data + b"\n"


def _dense(array: NDArray) -> NDArray:
    """Undo a fault of the bindings: made for numpy 1, they give stride 0 under numpy 2 (the memory itself is whole)."""
    return as_strided(array, strides=(array.itemsize,)).copy()


def _polygons(reader: tinyobjloader.ObjReader) -> tuple[Polygons, Ints]:
    """All faces of all groups, and the material of each (-1 for none)."""
    meshes = [shape.mesh for shape in reader.GetShapes()]
    none = np.zeros(0, np.int32)
    index = np.concatenate([none, *(_dense(mesh.numpy_indices()) for mesh in meshes)]).reshape(-1, 3)
    # not numpy_num_face_vertices, which takes the numbers of four bytes for bytes
    sizes = np.concatenate([none, *(np.array(mesh.num_face_vertices, np.int32) for mesh in meshes)])
    materials = np.concatenate([none, *(_dense(mesh.numpy_material_ids()) for mesh in meshes)])
    uv = _dense(reader.GetAttrib().numpy_texcoords()).reshape(-1, 2)
    uv_corners = np.where(index[:, 2] < len(uv), index[:, 2], -1).astype(np.int32)
    if not len(uv) or (uv_corners < 0).all():
        return Polygons(sizes, index[:, 0]), materials
    return Polygons(sizes, index[:, 0], uv, uv_corners), materials


def _check_complete(path: Path, points: Floats, polygons: Polygons, whole: bool) -> list[Diagnostic]:
    """Notice a file that was cut between two faces: points are left over, and the last line has no end."""
    used = np.zeros(len(points), bool)
    used[polygons.corners] = True
    lost = len(points) - int(used.sum())
    if lost and not whole:
        raise InputError(
            f"{path} has no line end at its end, and {lost} of its {len(points)} points belong to no face; was the file"
            " cut short? If it is complete, add a line end"
        )
    if lost > _LOST_POINTS * len(points):
        sentence = f"{lost} of the {len(points)} points belong to no face; was the file cut short?"
        return [Diagnostic("points-unused", sentence)]
    return []


def _unit(data: bytes) -> Unit | None:
    comments = re.findall(rb"^\#[^\n]*", data[:4096], re.MULTILINE)
    return unit_named_in(b"\n".join(comments).decode("ascii", "replace"))


def _first_line(text: str) -> str:
    lines = text.strip().splitlines()
    return lines[0].rstrip(". ") if lines else "no reason is known"


# Materials


def _numbered_materials(data: bytes) -> tuple[bytes, list[str]]:
    """The OBJ with materials m0, m1 ... and their names: tinyobjloader ends a name at its first blank."""
    names: list[str] = []
    number: dict[str, int] = {}
    parts, at = [b"mtllib m\n"], 0
    for line in re.finditer(rb"(?:usemtl|mtllib)[ \t]+([^\n]*)", data):  # not ^, which is ten times as slow to find
        if not _begins_its_line(data, line.start()):
            continue
        parts.append(data[at : line.start()])
        at = line.end()
        if line[0].startswith(b"usemtl"):
            name = as_text(line[1].strip())
            if name not in number:
                number[name] = len(names)
                names.append(name)
            parts.append(b"usemtl m%d" % number[name])
    return (b"".join([*parts, data[at:]]) if names else data), names


def _begins_its_line(data: bytes, at: int) -> bool:
    """Whether only blanks stand before a place: otherwise it is in a comment, or part of another word."""
    return not data[data.rfind(b"\n", 0, at) + 1 : at].strip()


def _libraries(path: Path, data: bytes, inside: Path | None) -> tuple[dict[str, Map | None], list[Diagnostic]]:
    """The maps of all MTL files that the OBJ names, and a sentence on each that is missing."""
    maps: dict[str, Map | None] = {}
    warnings: list[Diagnostic] = []
    for line in re.finditer(rb"mtllib[ \t]+([^\n]*)", data):
        if not _begins_its_line(data, line.start()):
            continue
        for name, found in _library_files(path, as_text(line[1].strip()), inside):
            if found is None:
                sentence = f"{path} names the material file {name}, which does not exist"
                warnings.append(Diagnostic("material-file-missing", sentence))
                continue
            try:
                text = found.read_bytes()
            except OSError as problem:
                warnings.append(Diagnostic("material-file-unreadable", f"{found} cannot be read: {problem.strerror}"))
                continue
            for material, image in read_mtl(as_text(text)).items():
                maps.setdefault(material, image)
    return maps, list(dict.fromkeys(warnings))


def _library_files(path: Path, rest: str, inside: Path | None) -> list[tuple[str, Path | None]]:
    """The files of a mtllib line: names are parted by blanks, and may hold blanks; the longest that exists counts."""
    words = rest[:_LONGEST_PATH].split(" ")
    found: list[tuple[str, Path | None]] = []
    lost: list[str] = []
    start = 0
    while start < len(words):
        for stop in range(min(start + _MOST_WORDS, len(words)), start, -1):
            name = " ".join(words[start:stop]).strip().strip('"')
            file = find_beside(path, name, inside) if name else None
            if file is not None:
                found += [(" ".join(lost), None)] if lost else []
                found.append((name, file))
                lost = []
                break
        else:
            lost += [words[start]] if words[start] else []
        start = stop
    return [*found, (" ".join(lost), None)] if lost else found


def _images(
    path: Path,
    polygons: Polygons,
    materials: Ints,
    used: list[str],
    maps: dict[str, Map | None],
    warnings: list[Diagnostic],
    inside: Path | None,
) -> tuple[Polygons, MeshImages]:
    """The image of each face by its material; with scale, offset and repeats of the map taken out of the coordinates.

    Where no face names a material, the first one with an image is meant for all.
    """
    of_material = [maps.get(name) for name in used]
    if not used:
        of_material = [next((image for image in maps.values() if image), None)]
        materials = np.zeros(len(materials), np.int32)
    elif maps and not any(of_material) and any(maps.values()):
        named = ", ".join(f"“{name}”" for name in [name for name in used if name not in maps][:3])
        if named:
            sentence = f"{path} uses the material {named}, which its material file does not have"
            warnings = [*warnings, Diagnostic("material-missing", sentence)]
    names = sorted({image.name for image in of_material if image})
    if not names or polygons.uv_corners is None:
        return polygons, MeshImages((), (), np.full(len(polygons.sizes), -1, np.int32), tuple(warnings))
    index = np.array([names.index(image.name) if image else -1 for image in of_material] + [-1], np.int32)
    for k, image in enumerate(of_material):
        if image and image.moves and (materials == k).any():
            polygons = transformed_uv(polygons, np.flatnonzero(materials == k), image.scale, image.offset)
    repeats = np.array([bool(image and not image.clamp) for image in of_material] + [False])
    polygons = without_whole_shifts(polygons, repeats[materials])
    files = []
    for name in names:
        file, missing = find_image(path, name, inside)
        files.append(file)
        warnings = [*warnings, *missing]
    return polygons, MeshImages(tuple(names), tuple(files), index[materials], tuple(warnings))


def _colours(reader: tinyobjloader.ObjReader, data: bytes, count: int) -> Pixels | None:
    """Red, green and blue that follow x, y, z, as MeshLab and others write them: 0 to 1, or 0 to 255."""
    if not re.search(rb"(?m)^[ \t]*v(?:" + _NUMBER + rb"){6,7}[ \t\r]*\n", data[:_HEAD]):
        return None
    rgb = _dense(reader.GetAttrib().numpy_colors())
    return as_colours(list(rgb.reshape(-1, 3).T)) if len(rgb) == 3 * count else None


# Writing

_LINES_AT_ONCE = 100_000


def obj_parts(
    points: Floats,
    polygons: Polygons,
    *,
    material: tuple[str, str] | None = None,
    material_of_face: Sequence[str] | None = None,
    comment: str = "",
    digits: int = 6,
) -> Iterator[bytes]:
    """Write an OBJ in parts; texture coordinates to 8 digits after the point (6 where they go far beyond 0 to 1).

    Parameters
    ----------
    points : (n, 3) float64
    polygons : Polygons
    material : (str, str), optional
        Name of the MTL file and of the material in it, which is that of the first faces.
    material_of_face : sequence of str, optional
        The material of each face, where there are several.
    comment : str
        Lines of it go first.
    digits : int
        Of the points, after the decimal point.
    """
    yield "".join(f"# {line}\n" for line in comment.splitlines()).encode()
    if material:
        yield f"mtllib {material[0]}\nusemtl {material[1]}\n".encode()
    flat = not points[:, 2].any()
    number = f"%.{digits}f"
    yield from _rows(f"v {number} {number} {'0' if flat else number}\n", points[:, :2] if flat else points)
    if polygons.uv is not None and len(polygons.uv):
        yield from _rows("vt %.6f %.6f\n" if np.nanmax(np.abs(polygons.uv)) > 10 else "vt %.8f %.8f\n", polygons.uv)
    yield from _face_parts(polygons, material_of_face)


def _rows(line: str, numbers: NDArray) -> Iterator[bytes]:
    for start in range(0, len(numbers), _LINES_AT_ONCE):
        part = numbers[start : start + _LINES_AT_ONCE]
        yield (line * len(part) % tuple(part.ravel().tolist())).encode()


def _face_parts(polygons: Polygons, materials: Sequence[str] | None) -> Iterator[bytes]:
    """The f lines in the polygons' order; a face that lacks the texture coordinates of a corner is written without."""
    first = np.cumsum(polygons.sizes) - polygons.sizes
    uv_corners = polygons.uv_corners
    bare = np.ones(len(first), bool) if uv_corners is None else np.minimum.reduceat(uv_corners, first) < 0
    pairs = np.stack([polygons.corners, polygons.corners if uv_corners is None else uv_corners], axis=1) + 1
    for start in range(0, len(first), _LINES_AT_ONCE):
        part = slice(start, start + _LINES_AT_ONCE)
        sizes, without = polygons.sizes[part], bare[part]
        lines = [
            ("f" + (" %d" if plain else " %d/%d") * size)
            for size, plain in zip(sizes.tolist(), without.tolist(), strict=True)
        ]
        if materials is not None:
            for k in range(start, start + len(lines)):
                if k == 0 or materials[k] != materials[k - 1]:
                    lines[k - start] = f"usemtl {materials[k]}\n{lines[k - start]}"
        numbers = pairs[first[start] : first[start] + int(sizes.sum())]
        written = np.stack([np.ones(len(numbers), bool), ~np.repeat(without, sizes)], axis=1)
        yield ("\n".join(lines) % tuple(numbers[written].tolist()) + "\n").encode()
