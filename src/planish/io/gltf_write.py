"""GLB 2.0 from a mesh in mm."""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planish.types import Bools, Floats, Ints

_MM_PER_METRE = 1000.0
_FLOAT, _UNSIGNED = 5126, 5125
_VERTICES, _INDICES = 34962, 34963

_CLAMP_TO_EDGE = 33071


def glb_bytes(
    points: Floats, faces: Ints, uv: Floats | None = None, image: bytes | None = None, *, software: str = "planish"
) -> bytes:
    """A GLB with one triangle mesh, positions in metres as float32.

    Parameters
    ----------
    points : (n, 3) float64 [mm]
    faces : (m, 3) int32
    uv : (n, 2) float64, optional
        Texture coordinates per point, v up.
    image : bytes, optional
        A whole JPEG or PNG.
    software : str
        Named as the generator.
    """
    parts: list[bytes] = []
    views: list[dict[str, int]] = []
    accessors: list[dict[str, Any]] = []

    def view(data: bytes, target: int | None = None) -> int:
        start = sum(map(len, parts))
        views.append(
            {"buffer": 0, "byteOffset": start, "byteLength": len(data), **({"target": target} if target else {})}
        )
        parts.append(data + bytes(-len(data) % 4))
        return len(views) - 1

    def accessor(array: NDArray, kind: str, target: int, **more: Any) -> int:
        component = _FLOAT if array.dtype == np.float32 else _UNSIGNED
        number = view(array.tobytes(), target)
        accessors.append({"bufferView": number, "componentType": component, "count": len(array), "type": kind, **more})
        return len(accessors) - 1

    position = (points / _MM_PER_METRE).astype("<f4")
    finite = position[np.isfinite(position).all(1)]
    box = {"min": finite.min(0).tolist(), "max": finite.max(0).tolist()} if len(finite) else {}
    attributes = {"POSITION": accessor(position, "VEC3", _VERTICES, **box)}
    if uv is not None:
        down = np.stack([uv[:, 0], 1 - uv[:, 1]], axis=1).astype("<f4")
        attributes["TEXCOORD_0"] = accessor(down, "VEC2", _VERTICES)
    indices = accessor(faces.astype("<u4").reshape(-1), "SCALAR", _INDICES)
    tree: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": software},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": attributes, "indices": indices, "material": 0}]}],
        "materials": [{"doubleSided": True, "pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 1}}],
    }
    if image is not None:
        mime = "image/png" if image.startswith(b"\x89PNG") else "image/jpeg"
        tree |= {"images": [{"bufferView": view(image), "mimeType": mime}], "textures": [{"source": 0, "sampler": 0}]}
        tree["samplers"] = [{"wrapS": _CLAMP_TO_EDGE, "wrapT": _CLAMP_TO_EDGE}]  # what lies outside is not on the photo
        tree["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = {"index": 0}
    tree |= {"accessors": accessors, "bufferViews": views, "buffers": [{"byteLength": sum(map(len, parts))}]}
    return _container(json.dumps(tree).encode(), b"".join(parts))


def _container(text: bytes, binary: bytes) -> bytes:
    text += b" " * (-len(text) % 4)
    total = 12 + 8 + len(text) + 8 + len(binary)
    head = struct.pack("<4sII", b"glTF", 2, total)
    return head + struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary


def one_uv_per_point(count: int, faces: Ints, uv: Floats, uv_faces: Ints) -> tuple[Ints, NDArray[np.int64], Floats]:
    """Repeat points so that each has one texture coordinate, as glTF wants it.

    The n = `count` points stay as they are; further copies come after them.

    Returns
    -------
    faces : (m, 3) int32
        Rows of the repeated points.
    source : (n + k,) int64
        The point that each of them is.
    point_uv : (n + k, 2) float64
        Outside the image (-1) where there is none.
    """
    pair = faces.reshape(-1).astype(np.int64) * (len(uv) + 1) + uv_faces.reshape(-1) + 1
    _, first, which = np.unique(pair, return_index=True, return_inverse=True)
    point = faces.reshape(-1)[first]
    again: Bools = np.r_[False, point[1:] == point[:-1]]
    place = np.where(again, count + np.cumsum(again) - 1, point)
    source = np.concatenate([np.arange(count), point[again]])
    point_uv = np.full((len(source), 2), -1.0)
    point_uv[place] = np.vstack([uv, [-1.0, -1.0]])[uv_faces.reshape(-1)[first]]
    return place[which].reshape(-1, 3).astype(np.int32), source, point_uv
