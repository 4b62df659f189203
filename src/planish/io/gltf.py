"""GLB and glTF 2.0: the triangles of all nodes, put in place, each with the image that shows the print.

Read here rather than by trimesh, which takes sparse data for zeros, leaves out that coordinates are stored as whole
numbers (`normalized`), and loses textures without a word.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from planish.color import code_values
from planish.errors import InputError
from planish.io.filemesh import FileMesh, check_faces
from planish.io.gltf_document import DRACO, Document, Json
from planish.io.gltf_packed import unpack_draco
from planish.io.polygons import of_triangles
from planish.io.textures import Image, MeshImages, find_image
from planish.io.uv_charts import without_whole_shifts
from planish.types import Diagnostic, Floats, Pixels

_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_REPEAT = 10497
_IMAGE_EXTENSIONS = ("EXT_texture_webp", "EXT_texture_avif", "KHR_texture_basisu", "MSFT_texture_dds")
"""Where the source of a texture may stand instead of, or beside, the plain one."""


@dataclass(frozen=True, eq=False)
class _Part:
    """One primitive, put in place: points, rows of them, texture coordinates (v up), image, whether that repeats."""

    points: Floats
    corners: NDArray[np.int64]
    uv: Floats | None
    image: int
    repeats: bool
    colours: Floats | None


@np.errstate(invalid="ignore", over="ignore")  # for points that are not finite
def read_gltf(path: Path, data: bytes, inside: Path | None = None) -> FileMesh:
    """Read a GLB or glTF, all meshes of its scene as one, in metres as the standard has it.

    The image of a face is the one of its base colour, else the diffuse one (pbrSpecularGlossiness), else the emissive
    one; normal, occlusion and roughness maps are no photos. Buffers and images come only from within the folder
    `inside`, if one is given.

    Raises
    ------
    InputError
        If it is no glTF 2.0, damaged or cut short, packed in a way that is not read, or holds no surface.
    MissingExtraError
        If it is packed, and the library to unpack it is not installed.
    """
    document = Document(path, data, inside)
    parts = [
        _part(document, primitive, placed)
        for primitive, placed in _placed_primitives(document)
        if primitive.get("mode", _TRIANGLES) in (_TRIANGLES, _STRIP, _FAN)
    ]
    if not parts:
        raise InputError(f"{path} holds no triangles; a triangle mesh of a sheet is wanted")
    first = np.cumsum([0, *(len(part.points) for part in parts)])
    rows = np.concatenate([part.corners + at for part, at in zip(parts, first, strict=False)]).astype(np.int32)
    points = np.concatenate([part.points for part in parts])
    images = _images(document, parts)
    uv, uv_rows = _joined_uv(parts)
    polygons = of_triangles(rows) if uv is None else of_triangles(rows, uv, uv_rows)
    check_faces(path, points, polygons)
    repeats = np.concatenate([np.full(len(part.corners), part.repeats) for part in parts])
    polygons = without_whole_shifts(polygons, repeats)
    return FileMesh(points, polygons, images, _colours(parts), "m", warnings=list(images.warnings))


def _joined_uv(parts: list[_Part]) -> tuple[Floats | None, NDArray[np.int32]]:
    uv, rows, count = [], [], 0
    for part in parts:
        rows.append(np.full_like(part.corners, -1) if part.uv is None else part.corners + count)
        if part.uv is not None:
            uv.append(part.uv)
            count += len(part.uv)
    return (np.concatenate(uv) if uv else None), np.concatenate(rows).astype(np.int32)


def _colours(parts: list[_Part]) -> Pixels | None:
    """COLOR_0 of all points, which is linear light, as 16 bit sRGB; None where a part has none."""
    if any(part.colours is None for part in parts):
        return None
    light = np.concatenate([part.colours for part in parts if part.colours is not None])
    level = np.rint(np.clip(np.nan_to_num(light), 0, 1) * 65535).astype(np.int64)
    return np.asarray(code_values(np.dtype(np.uint16))[level])


# Scene


def _placed_primitives(document: Document) -> Iterator[tuple[Json, Floats]]:
    """Every primitive of the scene and the 4 x 4 matrix that puts it in place."""
    tree = document.tree
    nodes, meshes = document.entries(tree, "nodes"), document.entries(tree, "meshes")
    if not nodes:
        yield from ((one, np.eye(4)) for mesh in meshes for one in document.entries(mesh, "primitives"))
        return
    if document.entries(tree, "scenes"):
        roots = document.integers(document.entry("scenes", document.integer(tree, "scene", 0)), "nodes")
    else:
        children = {child for node in nodes for child in document.integers(node, "children")}
        roots = sorted(set(range(len(nodes))) - children)
    waiting = [(root, np.eye(4)) for root in sorted(roots, reverse=True)]
    seen = set()
    while waiting:
        number, above = waiting.pop()
        node = document.entry("nodes", number)
        if number in seen:
            raise document.damaged(f"its node {number} hangs in two places")
        seen.add(number)
        placed = above @ _placement(document, node)
        if "mesh" in node:
            mesh = document.entry("meshes", node["mesh"])
            yield from ((primitive, placed) for primitive in document.entries(mesh, "primitives"))
        waiting += [(child, placed) for child in reversed(document.integers(node, "children"))]


def _placement(document: Document, node: Json) -> Floats:
    """The node's own matrix, or its translation, rotation (quaternion x y z w) and scale."""
    if "matrix" in node:
        return document.numbers(node, "matrix", [0.0] * 16).reshape(4, 4).T
    placed = np.eye(4)
    quaternion = document.numbers(node, "rotation", [0, 0, 0, 1])
    if np.any(quaternion):  # some programs write 0 0 0 0 for no rotation
        placed[:3, :3] = Rotation.from_quat(quaternion).as_matrix()
    placed[:3, :3] *= document.numbers(node, "scale", [1, 1, 1])
    placed[:3, 3] = document.numbers(node, "translation", [0, 0, 0])
    return placed


def _part(document: Document, primitive: Json, placed: Floats) -> _Part:
    arrays, triangles = _arrays(document, primitive)
    if "POSITION" not in arrays or arrays["POSITION"].shape[1] != 3:
        raise document.damaged("a mesh has no positions of three numbers")
    position = arrays["POSITION"].astype(np.float64)
    corners = _triangles(primitive, np.arange(len(position))) if triangles is None else triangles
    bad = np.flatnonzero((corners >= len(position)).any(axis=1))
    if len(bad):
        raise InputError(
            f"{document.path}: face {bad[0]} uses point {corners[bad[0]].max()}, but its mesh has {len(position)}"
            " points (both counted from 0); was the file cut short?"
        )
    if np.linalg.det(placed[:3, :3]) < 0:  # a mirror turns the faces
        corners = corners[:, ::-1]
    uv, image, repeats = _texture(document, primitive, arrays, len(position))
    return _Part(
        position @ placed[:3, :3].T + placed[:3, 3], corners, uv, image, repeats, _light(arrays, len(position))
    )


def _arrays(document: Document, primitive: Json) -> tuple[dict[str, NDArray], NDArray[np.int64] | None]:
    """The attributes by their names, and the triangles (m, 3); None where all points are taken in turn."""
    attributes = document.child(primitive, "attributes")
    wanted = [name for name in attributes if name == "POSITION" or name.startswith(("TEXCOORD_", "COLOR_0"))]
    packed = document.child(primitive, "extensions").get(DRACO)
    if packed is not None:
        packed = document.child(primitive, "extensions", DRACO)
        properties = document.child(packed, "attributes")
        numbers = {name: document.integer(properties, name) for name in wanted if name in properties}
        triangles, arrays = unpack_draco(document.path, bytes(document.view(packed.get("bufferView"))), numbers)
        return {name: _as_accessor(document, attributes[name], array) for name, array in arrays.items()}, triangles
    arrays = {name: document.array(attributes[name]) for name in wanted}
    if "indices" not in primitive:
        return arrays, None
    index = document.array(primitive["indices"])[:, 0]
    if index.dtype.kind != "u":
        raise document.damaged("its indices are no whole numbers from 0")
    return arrays, _triangles(primitive, index.astype(np.int64))


def _as_accessor(document: Document, number: object, array: NDArray) -> NDArray:
    """What Draco gave, as parts of 1 where the accessor says that its whole numbers are such."""
    normalized = document.entry("accessors", number).get("normalized") is True and array.dtype.kind in "iu"
    return np.maximum(array / np.iinfo(array.dtype).max, -1.0) if normalized else array


def _triangles(primitive: Json, index: NDArray[np.int64]) -> NDArray[np.int64]:
    """Triangles (m, 3) of a list, a strip or a fan."""
    mode = primitive.get("mode", _TRIANGLES)
    if mode == _TRIANGLES:
        return index[: len(index) // 3 * 3].reshape(-1, 3)
    if len(index) < 3:
        return np.zeros((0, 3), np.int64)
    if mode == _FAN:
        return np.stack([np.broadcast_to(index[0], len(index) - 2), index[1:-1], index[2:]], axis=1)
    strip = np.stack([index[:-2], index[1:-1], index[2:]], axis=1)
    strip[1::2] = strip[1::2, [1, 0, 2]]
    return strip


def _light(arrays: dict[str, NDArray], count: int) -> Floats | None:
    """COLOR_0 (count, 3), linear."""
    colour = arrays.get("COLOR_0")
    if colour is None or colour.shape[1] < 3 or len(colour) != count:
        return None
    scale = np.iinfo(colour.dtype).max if colour.dtype.kind in "iu" else 1.0  # not normalized: a slip of the writer
    return np.asarray(colour[:, :3] / scale)


# Texture


def _texture(
    document: Document, primitive: Json, arrays: dict[str, NDArray], count: int
) -> tuple[Floats | None, int, bool]:
    """Texture coordinates (count, 2), v up; the number of the image (-1: none), and whether it repeats."""
    properties = _photo_of_material(document, primitive)
    transform = document.child(properties, "extensions", "KHR_texture_transform")
    number = document.integer(transform, "texCoord", document.integer(properties, "texCoord", 0))
    image, repeats = -1, False
    if "index" in properties:
        texture = document.entry("textures", properties["index"])
        image = _source(document, texture)
        sampler = document.entry("samplers", texture["sampler"]) if "sampler" in texture else {}
        repeats = all(sampler.get(wrap, _REPEAT) == _REPEAT for wrap in ("wrapS", "wrapT"))
    name = f"TEXCOORD_{number}"
    if name not in arrays:
        return None, -1, False
    uv = arrays[name].astype(np.float64)
    if uv.shape != (count, 2):
        raise document.damaged(f"{name} has {len(uv)} rows for {count} points")
    uv = _transformed(document, uv, transform)
    return np.stack([uv[:, 0], 1 - uv[:, 1]], axis=1), image, repeats


def _photo_of_material(document: Document, primitive: Json) -> Json:
    """The texture of a primitive's material that shows the print; empty where none does."""
    if "material" not in primitive:
        return {}
    material = document.entry("materials", primitive["material"])
    old = document.child(material, "extensions", "KHR_materials_pbrSpecularGlossiness")
    places = (
        (document.child(material, "pbrMetallicRoughness"), "baseColorTexture"),
        (old, "diffuseTexture"),
        (material, "emissiveTexture"),
    )
    found = (document.child(owner, key) for owner, key in places)
    return next((properties for properties in found if "index" in properties), {})


def _source(document: Document, texture: Json) -> int:
    """The number of a texture's image; a JPEG or PNG rather than what an extension offers beside it."""
    extensions = document.child(texture, "extensions")
    offers = [texture, *(document.child(extensions, name) for name in _IMAGE_EXTENSIONS)]
    source = next((offer["source"] for offer in offers if "source" in offer), None)
    if source is None:
        return -1
    document.entry("images", source)
    return int(source)


def _transformed(document: Document, uv: Floats, transform: Json) -> Floats:
    """KHR_texture_transform: scaled, turned, moved."""
    angle = float(document.numbers({"rotation": [transform.get("rotation", 0)]}, "rotation", [0.0])[0])
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    scale, offset = (document.numbers(transform, key, value) for key, value in (("scale", [1, 1]), ("offset", [0, 0])))
    return np.asarray((uv * scale) @ turn.T + offset)


def _images(document: Document, parts: list[_Part]) -> MeshImages:
    """The images that faces show; where there are only others, that is said."""
    every = document.entries(document.tree, "images")
    of_face = np.concatenate([np.full(len(part.corners), part.image, np.int32) for part in parts])
    names, files, warnings = [], [], []
    for number, properties in enumerate(every):
        names.append(_image_name(document, number, properties))
        file: Image | None = None
        if (of_face == number).any():
            file, missing = _image(document, properties)
            warnings += missing
        files.append(file)
    if every and not (of_face >= 0).any():
        roles = sorted({role for material in document.entries(document.tree, "materials") for role in _roles(material)})
        said = (
            f"its images are no photos ({', '.join(roles)})" if roles else "none of its faces shows one of its images"
        )
        warnings.append(Diagnostic("image-no-photo", f"{document.path} has no photo: {said}"))
    return MeshImages(tuple(names), tuple(files), of_face, tuple(warnings))


def _roles(material: Json) -> list[str]:
    """What the textures of a material are for, in the words of people."""
    known = {"normalTexture": "normal map", "occlusionTexture": "occlusion map"}
    found = [said for key, said in known.items() if key in material]
    rough = material.get("pbrMetallicRoughness")
    return found + (["roughness map"] if isinstance(rough, dict) and "metallicRoughnessTexture" in rough else [])


def _image_name(document: Document, number: int, properties: Json) -> str:
    uri = document.word(properties, "uri", "data:")
    return document.word(properties, "name") or f"image {number}" if uri.startswith("data:") else unquote(uri)


def _image(document: Document, properties: Json) -> tuple[Image | None, list[Diagnostic]]:
    """The file of an image beside the mesh, or the bytes of one within."""
    if "bufferView" in properties:
        return bytes(document.view(properties["bufferView"])), []
    uri = document.word(properties, "uri")
    if uri.startswith("data:"):
        return document.uri(uri), []
    return find_image(document.path, unquote(uri), document.inside)
