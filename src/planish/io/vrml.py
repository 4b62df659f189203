"""VRML 97 and X3D: the indexed face sets of a scene, in metres as the standards have it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from planish.color import to_uint8
from planish.errors import InputError
from planish.io.filemesh import FileMesh
from planish.io.scene import Part, joined
from planish.io.textures import Image, find_image
from planish.io.xml_meshes import Element, numbers_in, parse_xml
from planish.types import Diagnostic, Floats

Node = dict[str, Any]
"""Fields of a node by their names; "" is its type, "children" a list of nodes."""

_TOKEN = re.compile(r'"(?:[^"\\]|\\.)*"|[\[\]{}]|[^\s,\[\]{}"#]+|#[^\n]*')
_DEEPEST = 100


def read_x3d(path: Path, data: bytes, inside: Path | None = None) -> FileMesh:
    """Read an X3D in XML. As `read_vrml`."""
    root = parse_xml(path, data)
    named: dict[str, Node] = {}
    scene = root.find("Scene")
    return _read(path, [_from_xml(one, named, 0) for one in (root if scene is None else scene)], inside)


def read_vrml(path: Path, data: bytes, inside: Path | None = None) -> FileMesh:
    """Read a VRML 97 or X3D in classic form: IndexedFaceSet with coordinates, texture coordinates and colours.

    Raises
    ------
    InputError
        If it is damaged, or holds no surface.
    """
    text = data.decode("utf-8", "replace")
    tokens = [token for token in _TOKEN.findall(text.partition("\n")[2]) if not token.startswith("#")]
    reader = _Tokens(path, tokens)
    return _read(path, reader.nodes(), inside)


class _Tokens:
    """The words of a VRML one after the other."""

    def __init__(self, path: Path, tokens: list[str]):
        self.path, self.tokens, self.at = path, tokens, 0
        self.named: dict[str, Node] = {}

    def peek(self) -> str:
        return self.tokens[self.at] if self.at < len(self.tokens) else ""

    def take(self) -> str:
        token = self.peek()
        if not token:
            raise InputError(f"{self.path} ends within a node; was the file cut short?")
        self.at += 1
        return token

    def nodes(self, depth: int = 0) -> list[Node]:
        """Nodes up to a closing bracket or the end."""
        found = []
        while self.peek() not in ("", "]", "}"):
            if self.peek() in ("ROUTE", "PROFILE", "COMPONENT", "META", "NavigationInfo", "PROTO", "EXTERNPROTO"):
                self.skip_statement()
                continue
            found.append(self.node(depth))
        return found

    def skip_statement(self) -> None:
        words = {"ROUTE": 4, "PROFILE": 2, "COMPONENT": 2, "META": 3}.get(self.peek())
        if words is None:
            self.take()
            while self.peek() not in ("{", "["):
                self.take()
            self.skip_block()
            while self.peek() in ("{", "["):
                self.skip_block()
            return
        for _ in range(words):
            self.take()

    def skip_block(self) -> None:
        depth = 0
        while True:
            token = self.take()
            depth += token in ("{", "[")
            depth -= token in ("}", "]")
            if depth <= 0:
                return

    def node(self, depth: int) -> Node:
        if depth > _DEEPEST:
            raise InputError(f"{self.path}: its nodes lie in one another without end")
        name = ""
        if self.peek() == "USE":
            self.take()
            return self.named.get(self.take(), {"": "", "children": []})
        if self.peek() == "DEF":
            self.take()
            name = self.take()
        node: Node = {"": self.take(), "children": []}
        if self.peek() != "{":
            return node  # a word that begins no node, such as NULL or TRUE
        self.take()
        while self.peek() != "}":
            self.field(node, self.take(), depth)
        self.take()
        if name:
            self.named[name] = node
        return node

    def field(self, node: Node, key: str, depth: int) -> None:
        following = self.peek()
        if following == "[":
            self.take()
            if self.is_node():
                node["children"] += self.nodes(depth + 1)
            else:
                values = []
                while self.peek() != "]":
                    values.append(self.take())
                _store(node, key, values)
            self.take()
        elif self.is_node():
            node["children"].append(self.node(depth + 1))
        else:
            values = []
            while _is_value(self.peek()):
                values.append(self.take())
            _store(node, key, values)  # without a value the next word is a field again

    def is_node(self) -> bool:
        token = self.peek()
        ahead = self.tokens[self.at + 1] if self.at + 1 < len(self.tokens) else ""
        return token in ("DEF", "USE") or (ahead == "{" and token not in ("{", "}", "[", "]"))


def _store(node: Node, key: str, values: list[str]) -> None:
    if key not in ("", "children"):  # ours, not fields
        node[key] = values


def _is_value(token: str) -> bool:
    return bool(re.fullmatch(r'"(?:.|\n)*"|[-+.\d].*|TRUE|FALSE|NULL', token))


def _from_xml(element: Element, named: dict[str, Node], depth: int) -> Node:
    if element.get("USE"):
        return named.get(element.get("USE", ""), {"": "", "children": []})
    node: Node = {"": element.tag, "children": []}
    if depth > _DEEPEST:
        return node
    for key, value in element.attrib.items():
        _store(node, key, re.findall(r'"[^"]*"|[^\s,"]+', value))
    for child in element:
        inner = _from_xml(child, named, depth + 1)
        node["children"].append(inner)
    if element.get("DEF"):
        named[element.get("DEF", "")] = node
    return node


# Meaning


def _read(path: Path, nodes: list[Node], inside: Path | None) -> FileMesh:
    warnings: list[Diagnostic] = []
    parts = [
        _part(path, shape, geometry, placed, inside, warnings)
        for shape, geometry, placed in _shapes(path, nodes, np.eye(4), 0)
    ]
    repeats = True
    return joined(path, parts, "m", warnings, repeats=repeats)


def _shapes(path: Path, nodes: list[Node], above: Floats, depth: int) -> Iterator[tuple[Node, Node, Floats]]:
    """Every shape with an indexed face set, that set, and where it is put."""
    for node in nodes if depth < _DEEPEST else []:
        placed = above @ _placed(path, node) if node[""] in ("Transform", "MatrixTransform") else above
        if node[""] == "Shape":
            sets = ("IndexedFaceSet", "IndexedTriangleSet", "TriangleSet")
            for geometry in (one for one in node["children"] if one[""] in sets):
                yield node, geometry, placed
        else:
            yield from _shapes(path, node["children"], placed, depth + 1)


def _numbers(path: Path, node: Node, key: str, width: int = 1) -> Floats:
    return numbers_in(path, " ".join(_words(node, key)), width)


def _words(node: Node, key: str) -> list[str]:
    """The words of a field; none where it is not there, or holds a node."""
    value = node.get(key, [])
    return value if isinstance(value, list) else []


def _placed(path: Path, node: Node) -> Floats:
    from scipy.spatial.transform import Rotation

    def vector(key: str, default: list[float]) -> Floats:
        numbers = _numbers(path, node, key).ravel()
        return numbers if len(numbers) == len(default) else np.array(default)

    def turn(key: str) -> Floats:
        numbers = vector(key, [0.0, 0, 1, 0])
        length = float(np.linalg.norm(numbers[:3]))
        axis = numbers[:3] / length if length > 0 else np.array([0.0, 0, 1])
        return Rotation.from_rotvec(numbers[3] * axis).as_matrix()

    centre, way = vector("center", [0.0] * 3), turn("scaleOrientation")
    linear = turn("rotation") @ way @ np.diag(vector("scale", [1.0] * 3)) @ way.T
    placed = np.eye(4)
    placed[:3, :3] = linear
    placed[:3, 3] = vector("translation", [0.0] * 3) + centre - linear @ centre
    return placed


def _child(node: Node, *types: str) -> Node | None:
    return next((one for one in node["children"] if one[""] in types), None)


def _part(
    path: Path, shape: Node, geometry: Node, placed: Floats, inside: Path | None, warnings: list[Diagnostic]
) -> Part:
    coordinates, texture = _child(geometry, "Coordinate", "CoordinateDouble"), _child(geometry, "TextureCoordinate")
    points = np.zeros((0, 3)) if coordinates is None else _numbers(path, coordinates, "point", 3)
    if geometry[""] == "IndexedFaceSet":
        index = _numbers(path, geometry, "coordIndex").ravel().astype(np.int64)
    else:
        indexed = geometry[""] == "IndexedTriangleSet"
        plain = _numbers(path, geometry, "index").ravel() if indexed else np.arange(len(points), dtype=np.float64)
        three = plain[: len(plain) // 3 * 3].reshape(-1, 3)
        index = np.c_[three, np.full(len(three), -1)].ravel().astype(np.int64)
    sizes, corners = _polygons(index)
    if [word.strip('"').upper() for word in _words(geometry, "ccw")] == ["FALSE"]:
        first = np.repeat(np.cumsum(sizes) - sizes, sizes)
        corners = corners[2 * first + np.repeat(sizes, sizes) - 1 - np.arange(len(corners))]
    uv = uv_corners = None
    if texture is not None:
        uv = _numbers(path, texture, "point", 2)
        index = _numbers(path, geometry, "texCoordIndex").ravel().astype(np.int64)
        uv_corners = _polygons(index)[1] if len(index) else corners
        if len(uv_corners) != len(corners):
            raise InputError(f"{path} has {len(uv_corners)} texture coordinates for {len(corners)} corners")
    name, image = "", None
    appearance = _child(shape, "Appearance")
    picture = None if appearance is None else _child(appearance, "ImageTexture")
    if picture is not None and _words(picture, "url"):
        name = _words(picture, "url")[0].strip('"')
        found: Image | None
        found, missing = find_image(path, name, inside)
        image = found
        warnings += [one for one in missing if one not in warnings]
    colour = _child(geometry, "Color", "ColorRGBA")
    colours = None
    if colour is not None and not _words(geometry, "colorIndex"):
        rgb = _numbers(path, colour, "color", 4 if colour[""] == "ColorRGBA" else 3)[:, :3]
        if len(rgb) == len(points):
            colours = to_uint8(np.rint(np.clip(np.nan_to_num(rgb), 0, 1) * 65535).astype(np.uint16))
    in_place = points @ placed[:3, :3].T + placed[:3, 3]
    return Part(in_place, sizes, corners, uv, uv_corners, image, name, colours)


def _polygons(index: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sizes and corners of polygons that -1 parts."""
    ends = np.flatnonzero(index < 0)
    if not len(ends) or ends[-1] != len(index) - 1:
        ends = np.append(ends, len(index))
    return np.diff(np.append(-1, ends)) - 1, index[index >= 0]
