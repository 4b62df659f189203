"""The container of a GLB or glTF: its JSON, read with every value checked, and the numbers in its buffers."""

from __future__ import annotations

import base64
import binascii
import json
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from planish.errors import InputError
from planish.io.files import read_bytes
from planish.io.textures import find_beside
from planish.memory import check_memory
from planish.types import Floats

_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_JSON_CHUNK, _BINARY_CHUNK = 0x4E4F534A, 0x004E4942
MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")
DRACO = "KHR_draco_mesh_compression"
_GEOMETRY = ("KHR_mesh_quantization", DRACO, *MESHOPT)
"""Extensions of the geometry that are read."""
_WITHOUT_GEOMETRY = ("texture", "material", "light", "xmp", "animation", "audio", "variants", "visibility", "image")
"""Words in the names of extensions that change no place of any point."""
_MOST_PACKED = 1000
"""A compressed view that says it holds more times its bytes is damaged: meshopt packs into a tenth at best."""

Json = dict[str, Any]


class Document:
    """The JSON and the buffers of a glTF.

    Parameters
    ----------
    path : Path
    data : bytes
    inside : Path, optional
        The only folder from which buffers and images are read.

    Raises
    ------
    InputError
    """

    def __init__(self, path: Path, data: bytes, inside: Path | None):
        self.path, self.inside = path, inside
        self.tree, self._binary = self._container(data)
        self._buffers: dict[int, bytes] = {}
        self._views: dict[int, memoryview] = {}

    def damaged(self, what: str) -> InputError:
        """The refusal of a file that is no good glTF."""
        return InputError(f"{self.path} is no glTF that can be read ({what}); was the file damaged or cut short?")

    # Values of the JSON

    def entry(self, key: str, number: object) -> Json:
        """The object of that number in a list at the top, such as nodes or accessors."""
        several = self.entries(self.tree, key)
        if isinstance(number, bool) or not isinstance(number, int) or not 0 <= number < len(several):
            raise self.damaged(f"it uses {_shown(number)} of its {key}, of which there are {len(several)}, from 0")
        return several[number]

    def entries(self, owner: Json, key: str) -> list[Json]:
        """A list of objects; empty where there is none."""
        several = owner.get(key, [])
        if not isinstance(several, list) or not all(isinstance(one, dict) for one in several):
            raise self.damaged(f"its {key} {_are(key)} no list of objects")
        return several

    def child(self, owner: Json, *keys: str) -> Json:
        """An object within objects; empty where there is none."""
        for key in keys:
            owner = owner.get(key, {})
            if not isinstance(owner, dict):
                raise self.damaged(f"its {key} is no object")
        return owner

    def integer(self, owner: Json, key: str, default: int | None = None) -> int:
        """A whole number of 0 or more."""
        value: Any = owner.get(key, default)
        whole = isinstance(value, int) or (isinstance(value, float) and value.is_integer())
        if isinstance(value, bool) or not whole or value < 0:
            raise self.damaged(f"its {key} is {_shown(value)}, and no number from 0")
        return int(value)

    def integers(self, owner: Json, key: str) -> list[int]:
        """A list of whole numbers of 0 or more; empty where there is none."""
        values = owner.get(key, [])
        if not isinstance(values, list):
            raise self.damaged(f"its {key} {_are(key)} no list of numbers")
        return [self.integer({key: value}, key) for value in values]

    def numbers(self, owner: Json, key: str, default: Sequence[float]) -> Floats:
        """As many numbers as the default has."""
        values = owner.get(key, default)
        good = isinstance(values, list) and all(isinstance(v, int | float) and not isinstance(v, bool) for v in values)
        if not good or len(values) != len(default):
            raise self.damaged(f"its {key} is {_shown(values)}, where {len(default)} numbers are wanted")
        try:
            return np.array(values, np.float64)
        except OverflowError:
            raise self.damaged(f"its {key} holds a number that is too large") from None

    def word(self, owner: Json, key: str, default: str = "") -> str:
        """A text."""
        value = owner.get(key, default)
        if not isinstance(value, str):
            raise self.damaged(f"its {key} is {_shown(value)}, and no text")
        return value

    # Buffers

    def view(self, number: object) -> memoryview:
        """The bytes of a buffer view, unpacked."""
        view = self.entry("bufferViews", number)
        assert isinstance(number, int)
        if number not in self._views:
            packed = next(
                (view["extensions"][name] for name in MESHOPT if name in self.child(view, "extensions")), None
            )
            self._views[number] = self._slice(view, number) if packed is None else self._unpacked(packed, number)
        return self._views[number]

    def array(self, number: object) -> NDArray:
        """The numbers (count, width) of an accessor."""
        properties = self.entry("accessors", number)
        count, kind, width = (
            self.integer(properties, "count"),
            self._kind(properties),
            _WIDTHS.get(self.word(properties, "type"), 0),
        )
        if not width:
            raise self.damaged(f"its accessor {number} is of type {_shown(properties.get('type'))}")
        if "bufferView" in properties:
            stride = self.entry("bufferViews", properties["bufferView"]).get("byteStride")
            stride = self.integer({"byteStride": stride}, "byteStride") if stride else None
            start = self.integer(properties, "byteOffset", 0)
            numbers = self._numbers(properties["bufferView"], start, count, width, kind, stride)
        elif "sparse" in properties:
            check_memory(count * width * kind.itemsize, f"{self.path} with its {count:,} points", "is it damaged?")
            numbers = np.zeros((count, width), kind)
        else:
            raise self.damaged(f"its accessor {number} has no data")
        if "sparse" in properties:
            numbers = self._with_sparse(numbers.copy(), self.child(properties, "sparse"))
        if properties.get("normalized") is True and kind.kind != "f":
            return np.maximum(numbers / np.iinfo(kind).max, -1.0)
        return numbers

    def uri(self, uri: str) -> bytes:
        """What a URI leads to: data within it, or a file beside the glTF."""
        if uri.startswith("data:"):
            try:
                return base64.b64decode(uri.partition(",")[2])
            except (binascii.Error, ValueError):
                raise self.damaged("data within it is no base64") from None
        found = find_beside(self.path, unquote(uri), self.inside)
        if found is None:
            raise InputError(f"{self.path} names the file {unquote(uri)[:200]}, which does not exist beside it")
        return read_bytes(found)

    def _kind(self, properties: Json) -> np.dtype:
        kind = properties.get("componentType")
        if not isinstance(kind, int) or kind not in _COMPONENTS:
            raise self.damaged(f"its componentType is {_shown(kind)}; 5120 to 5126 are known")
        return np.dtype(_COMPONENTS[kind])

    def _buffer(self, number: object) -> bytes:
        properties = self.entry("buffers", number)
        assert isinstance(number, int)
        if number not in self._buffers:
            if "uri" in properties:
                self._buffers[number] = self.uri(self.word(properties, "uri"))
            elif self._binary is not None:
                self._buffers[number] = self._binary
            else:
                raise self.damaged("a buffer has no data")
        return self._buffers[number]

    def _slice(self, properties: Json, number: int) -> memoryview:
        start, length = self.integer(properties, "byteOffset", 0), self.integer(properties, "byteLength")
        buffer = self._buffer(properties.get("buffer"))
        if start + length > len(buffer):
            raise self.damaged(f"its buffer view {number} ends beyond its buffer")
        return memoryview(buffer)[start : start + length]

    def _unpacked(self, properties: Json, number: int) -> memoryview:
        """A view that is packed by meshopt, as plain bytes."""
        from planish.io.gltf_packed import unpack_meshopt

        packed = self._slice(properties, number)
        count, stride = self.integer(properties, "count"), self.integer(properties, "byteStride")
        if count * stride > _MOST_PACKED * len(packed) + 4096:
            raise self.damaged(f"its buffer view {number} says that it holds {count:,} rows")
        mode, bent = self.word(properties, "mode"), self.word(properties, "filter", "NONE")
        unpacked = unpack_meshopt(self.path, bytes(packed), count, stride, mode, bent)
        if unpacked is None:
            raise self.damaged(f"its buffer view {number} cannot be unpacked")
        return memoryview(unpacked)

    def _numbers(
        self, view: object, start: int, count: int, width: int, kind: np.dtype, stride: int | None = None
    ) -> NDArray:
        data = self.view(view)
        stride = stride or width * kind.itemsize
        if count < 1 or start + (count - 1) * stride + width * kind.itemsize > len(data):
            raise self.damaged(f"{count} rows are wanted of its buffer view {view}, which does not hold so many")
        return np.ndarray((count, width), kind, data, start, (stride, kind.itemsize))

    def _with_sparse(self, numbers: NDArray, sparse: Json) -> NDArray:
        count, index, values = (
            self.integer(sparse, "count"),
            self.child(sparse, "indices"),
            self.child(sparse, "values"),
        )
        start = self.integer(index, "byteOffset", 0)
        rows = self._numbers(index.get("bufferView"), start, count, 1, self._kind(index))[:, 0]
        if rows.dtype.kind not in "u" or rows.max() >= len(numbers):
            raise self.damaged("a sparse accessor changes rows that it does not have")
        start, width = self.integer(values, "byteOffset", 0), numbers.shape[1]
        numbers[rows] = self._numbers(values.get("bufferView"), start, count, width, numbers.dtype)
        return numbers

    # Container

    def _container(self, data: bytes) -> tuple[Json, bytes | None]:
        """The JSON, and the binary chunk of a GLB."""
        text, binary = self._chunks(data) if data.startswith(b"glTF") else (data, None)
        try:
            tree = json.loads(text)
        except (ValueError, RecursionError) as problem:
            raise self.damaged(f"its JSON is broken: {' '.join(str(problem).split())}") from None
        if not isinstance(tree, dict):
            raise self.damaged("its JSON is no object")
        version = str(self.child(tree, "asset").get("version", ""))
        if not version.startswith("2"):
            raise InputError(
                f"{self.path} is no glTF 2.0 (it says version “{version[:20]}”); let the scanner's software write that"
            )
        required = tree.get("extensionsRequired", [])
        for name in required if isinstance(required, list) else []:
            plain = str(name).lower()
            if name not in _GEOMETRY and not any(word in plain for word in _WITHOUT_GEOMETRY):
                raise InputError(f"{self.path} needs the extension {name}, which is not read; export it without that")
        return tree, binary

    def _chunks(self, data: bytes) -> tuple[bytes, bytes | None]:
        if len(data) < 20 or struct.unpack_from("<I", data, 8)[0] > len(data):
            raise InputError(f"{self.path} has {len(data)} bytes and says that it has more; was the file cut short?")
        found: dict[int, bytes] = {}
        at = 12
        while at + 8 <= len(data):
            length, kind = struct.unpack_from("<II", data, at)
            if at + 8 + length > len(data):
                raise self.damaged("a chunk ends beyond the file")
            found.setdefault(kind, data[at + 8 : at + 8 + length])
            at += 8 + length
        if _JSON_CHUNK not in found:
            raise self.damaged("it has no JSON")
        return found[_JSON_CHUNK], found.get(_BINARY_CHUNK)


def _shown(value: object) -> str:
    return "not there" if value is None else f"“{str(value)[:30]}”" if isinstance(value, str) else str(value)[:30]


def _are(key: str) -> str:
    return "are" if key.endswith(("s", "children")) else "is"
