"""GLB and glTF 2.0: the triangles of all nodes, put in place, with the image that most of them show.

Read here rather than by trimesh, which takes sparse data for zeros, leaves out that coordinates are stored as whole
numbers (`normalized`), and loses textures without a word.
"""

from __future__ import annotations

import base64
import json
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from planish.errors import InputError
from planish.io.filemesh import FileMesh, check_faces
from planish.io.files import read_bytes
from planish.io.polygons import of_triangles
from planish.io.textures import find_beside, find_image, use_one_image
from planish.types import Diagnostic, Floats

_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_JSON_CHUNK, _BINARY_CHUNK = 0x4E4F534A, 0x004E4942
_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_KNOWN_EXTENSIONS = ("KHR_mesh_quantization", "KHR_texture_transform", "KHR_materials_", "EXT_texture_webp")

Json = dict[str, Any]


class _Document:
    """The JSON and its buffers."""

    def __init__(self, path: Path, tree: Json, binary: bytes | None, inside: Path | None):
        self.path, self.inside = path, inside
        self.tree = tree
        self.buffers = [_buffer(path, buffer, binary, inside) for buffer in tree.get("buffers", [])]

    def view(self, number: int) -> memoryview:
        """The bytes of a buffer view."""
        view = self.tree["bufferViews"][number]
        start, length = int(view.get("byteOffset", 0)), int(view["byteLength"])
        buffer = self.buffers[view["buffer"]]
        if not 0 <= start <= start + length <= len(buffer):
            raise ValueError(f"buffer view {number} ends beyond its buffer")
        return memoryview(buffer)[start : start + length]

    def array(self, number: int) -> NDArray:
        """The numbers (count, width) of an accessor."""
        told = self.tree["accessors"][number]
        count, width, kind = int(told["count"]), _WIDTHS[told["type"]], np.dtype(_COMPONENTS[told["componentType"]])
        if "bufferView" in told:
            stride = self.tree["bufferViews"][told["bufferView"]].get("byteStride")
            numbers = self._numbers(told["bufferView"], told.get("byteOffset", 0), count, width, kind, stride)
        elif "sparse" in told:
            numbers = np.zeros((count, width), kind)
        else:
            raise ValueError(f"accessor {number} has no data")
        if "sparse" in told:
            numbers = self._with_sparse(numbers.copy(), told["sparse"])
        if told.get("normalized"):
            return np.maximum(numbers / np.iinfo(kind).max, -1.0)
        return numbers

    def _numbers(
        self, view: int, start: int, count: int, width: int, kind: np.dtype, stride: int | None = None
    ) -> NDArray:
        data = self.view(view)
        stride = stride or width * kind.itemsize
        if count < 1 or start < 0 or start + (count - 1) * stride + width * kind.itemsize > len(data):
            raise ValueError(f"{count} rows are wanted of buffer view {view}, which does not hold so many")
        return np.ndarray((count, width), kind, data, start, (stride, kind.itemsize))

    def _with_sparse(self, numbers: NDArray, sparse: Json) -> NDArray:
        count, index, values = int(sparse["count"]), sparse["indices"], sparse["values"]
        kind = np.dtype(_COMPONENTS[index["componentType"]])
        rows = self._numbers(index["bufferView"], index.get("byteOffset", 0), count, 1, kind)[:, 0]
        width = numbers.shape[1]
        numbers[rows] = self._numbers(values["bufferView"], values.get("byteOffset", 0), count, width, numbers.dtype)
        return numbers


@np.errstate(invalid="ignore", over="ignore")  # for points that are not finite
def read_gltf(path: Path, data: bytes, inside: Path | None = None) -> FileMesh:
    """Read a GLB or glTF, all meshes of its scene as one, in metres as the standard has it.

    Buffers and image come only from within the folder `inside`, if one is given.

    Raises
    ------
    InputError
        If it is no glTF 2.0, damaged or cut short, packed in a way that is not read, or holds no surface.
    """
    try:
        return _read(path, data, inside)
    except InputError:
        raise
    except (
        ArithmeticError,
        AttributeError,
        LookupError,
        MemoryError,
        RecursionError,
        TypeError,
        ValueError,
    ) as problem:
        reason = " ".join(str(problem).split()) or type(problem).__name__
        kind = type(problem).__name__ if isinstance(problem, LookupError | TypeError | AttributeError) else ""
        raise InputError(
            f"{path} is no glTF that can be read ({f'{kind}: ' if kind else ''}{reason}); was the file damaged or cut"
            " short?"
        ) from problem


def _read(path: Path, data: bytes, inside: Path | None) -> FileMesh:
    document = _Document(path, *_container(path, data), inside)
    points, faces, uv, uv_faces, images = [], [], [], [], []
    point_count = uv_count = 0
    for primitive, placed in _placed_primitives(document.tree):
        if primitive.get("mode", _TRIANGLES) not in (_TRIANGLES, _STRIP, _FAN):
            continue
        corners = _triangles(document, primitive)
        if np.linalg.det(placed[:3, :3]) < 0:  # a mirror turns the faces
            corners = corners[:, ::-1]
        position = document.array(primitive["attributes"]["POSITION"]).astype(np.float64)
        image, places = _texture(document, primitive, len(position))
        points.append(position @ placed[:3, :3].T + placed[:3, 3])
        faces.append(np.where((corners >= 0) & (corners < len(position)), corners + point_count, 2**31 - 1))
        uv_faces.append(corners + uv_count if places is not None else np.full_like(corners, -1))
        images.append(np.full(len(corners), image))
        point_count += len(position)
        if places is not None:
            uv.append(places)
            uv_count += len(places)
    if not points:
        raise InputError(f"{path} holds no triangles; a triangle mesh of a sheet is wanted")
    rows = np.concatenate(faces)
    all_points = np.concatenate(points)
    if not uv:
        polygons = of_triangles(rows.astype(np.int32))
    else:
        polygons = of_triangles(rows.astype(np.int32), np.concatenate(uv), np.concatenate(uv_faces).astype(np.int32))
    check_faces(path, all_points, polygons)
    names = [_image_name(k, image) for k, image in enumerate(document.tree.get("images", []))]
    polygons, chosen, warnings = use_one_image(path, polygons, names, np.concatenate(images))
    texture = None
    if chosen is not None:
        texture, missing = _image(document, document.tree["images"][chosen])
        warnings += missing
    return FileMesh(all_points, polygons, texture, "m", warnings=warnings)


# Container


def _container(path: Path, data: bytes) -> tuple[Json, bytes | None]:
    """The JSON, and the binary chunk of a GLB."""
    text, binary = data, None
    if data.startswith(b"glTF"):
        text, binary = _chunks(path, data)
    tree = json.loads(text)
    version = str(tree.get("asset", {}).get("version", "")) if isinstance(tree, dict) else ""
    if not version.startswith("2"):
        raise InputError(f"{path} is no glTF 2.0 (it says version “{version}”); let the scanner's software write that")
    for name in tree.get("extensionsRequired", []):
        if not name.startswith(_KNOWN_EXTENSIONS):
            raise InputError(f"{path} is packed with {name}, which is not read; write it without compression")
    return tree, binary


def _chunks(path: Path, data: bytes) -> tuple[bytes, bytes | None]:
    if len(data) < 20 or struct.unpack_from("<I", data, 8)[0] > len(data):
        raise InputError(f"{path} has {len(data)} bytes and says that it has more; was the file cut short?")
    found: dict[int, bytes] = {}
    at = 12
    while at + 8 <= len(data):
        length, kind = struct.unpack_from("<II", data, at)
        if at + 8 + length > len(data):
            raise ValueError("a chunk ends beyond the file")
        found.setdefault(kind, data[at + 8 : at + 8 + length])
        at += 8 + length
    if _JSON_CHUNK not in found:
        raise ValueError("it has no JSON")
    return found[_JSON_CHUNK], found.get(_BINARY_CHUNK)


def _buffer(path: Path, told: Json, binary: bytes | None, inside: Path | None) -> bytes:
    if "uri" not in told:
        if binary is None:
            raise ValueError("a buffer has no data")
        return binary
    return _at_uri(path, told["uri"], inside)


def _at_uri(path: Path, uri: str, inside: Path | None) -> bytes:
    if uri.startswith("data:"):
        return base64.b64decode(uri.partition(",")[2])
    found = find_beside(path, unquote(uri), inside)
    if found is None:
        raise InputError(f"{path} names the file {unquote(uri)}, which does not exist beside it")
    return read_bytes(found)


# Scene


def _placed_primitives(tree: Json) -> Iterator[tuple[Json, Floats]]:
    """Every primitive of the scene and the 4 x 4 matrix that puts it in place."""
    nodes, meshes = tree.get("nodes", []), tree.get("meshes", [])
    if not nodes:
        yield from ((primitive, np.eye(4)) for mesh in meshes for primitive in mesh["primitives"])
        return
    scenes = tree.get("scenes")
    children = {child for node in nodes for child in node.get("children", [])}
    roots = scenes[tree.get("scene", 0)].get("nodes", []) if scenes else set(range(len(nodes))) - children
    waiting = [(root, np.eye(4)) for root in sorted(roots, reverse=True)]
    seen = set()
    while waiting:
        number, above = waiting.pop()
        if number in seen:
            raise ValueError(f"node {number} hangs in two places")
        seen.add(number)
        node = nodes[number]
        placed = above @ _placement(node)
        if "mesh" in node:
            yield from ((primitive, placed) for primitive in meshes[node["mesh"]]["primitives"])
        waiting += [(child, placed) for child in reversed(node.get("children", []))]


def _placement(node: Json) -> Floats:
    """The node's own matrix, or its translation, rotation (quaternion x y z w) and scale."""
    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T
    placed = np.eye(4)
    x, y, z, w = np.array(node.get("rotation", [0, 0, 0, 1]), np.float64)
    placed[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    placed[:3, :3] *= np.array(node.get("scale", [1, 1, 1]), np.float64).reshape(3)
    placed[:3, 3] = node.get("translation", [0, 0, 0])
    return placed


def _triangles(document: _Document, primitive: Json) -> NDArray[np.int64]:
    """Triangles (m, 3), rows of the primitive's positions."""
    extensions = primitive.get("extensions", {})
    if "KHR_draco_mesh_compression" in extensions:
        raise InputError(f"{document.path} is packed with Draco, which is not read; write it without compression")
    if "indices" in primitive:
        index = document.array(primitive["indices"])[:, 0].astype(np.int64)
    else:
        index = np.arange(int(document.tree["accessors"][primitive["attributes"]["POSITION"]]["count"]))
    mode = primitive.get("mode", _TRIANGLES)
    if mode == _TRIANGLES:
        return index[: len(index) // 3 * 3].reshape(-1, 3)
    if mode == _FAN:
        return np.stack([np.broadcast_to(index[0], len(index) - 2), index[1:-1], index[2:]], axis=1)
    strip = np.stack([index[:-2], index[1:-1], index[2:]], axis=1)
    strip[1::2] = strip[1::2, [1, 0, 2]]
    return strip


# Texture


def _texture(document: _Document, primitive: Json, count: int) -> tuple[int, Floats | None]:
    """Number of the primitive's image (-1: none), and its texture coordinates (count, 2), v up."""
    told = {}
    if "material" in primitive:
        material = document.tree["materials"][primitive["material"]]
        told = material.get("pbrMetallicRoughness", {}).get("baseColorTexture", {})
    extensions = told.get("extensions", {})
    transform = extensions.get("KHR_texture_transform", {})
    name = f"TEXCOORD_{transform.get('texCoord', told.get('texCoord', 0))}"
    image = -1
    if "index" in told:
        texture = document.tree["textures"][told["index"]]
        image = texture.get("extensions", {}).get("EXT_texture_webp", texture).get("source", -1)
        if image != -1:
            document.tree["images"][image]
    if name not in primitive["attributes"]:
        return -1, None
    uv = document.array(primitive["attributes"][name]).astype(np.float64)
    if uv.shape != (count, 2):
        raise ValueError(f"{name} has {len(uv)} rows for {count} points")
    uv = _transformed(uv, transform)
    return image, np.stack([uv[:, 0], 1 - uv[:, 1]], axis=1)


def _transformed(uv: Floats, transform: Json) -> Floats:
    """KHR_texture_transform: scaled, turned, moved."""
    angle = float(transform.get("rotation", 0))
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    scale, offset = (
        np.array(transform.get(key, value), np.float64) for key, value in (("scale", [1, 1]), ("offset", [0, 0]))
    )
    return np.asarray((uv * scale) @ turn.T + offset)


def _image_name(number: int, told: Json) -> str:
    uri = told.get("uri", "data:")
    return told.get("name") or f"image {number}" if uri.startswith("data:") else unquote(uri)


def _image(document: _Document, told: Json) -> tuple[Path | bytes | None, list[Diagnostic]]:
    """The file of an image beside the mesh, or the bytes of one within."""
    if "bufferView" in told:
        return bytes(document.view(told["bufferView"])), []
    if told["uri"].startswith("data:"):
        return _at_uri(document.path, told["uri"], document.inside), []
    return find_image(document.path, unquote(told["uri"]), document.inside)
