"""3MF and COLLADA (DAE): meshes in XML."""

from __future__ import annotations

from pathlib import Path
from urllib.parse import unquote
from xml.etree import ElementTree

import numpy as np

from planish.errors import InputError
from planish.io.filemesh import FileMesh
from planish.io.scene import Part, joined
from planish.io.textures import Image, find_image
from planish.io.units import is_unit
from planish.io.zipped import Zip
from planish.types import Diagnostic, Floats

Element = ElementTree.Element

_UNITS_3MF = {"micron": "um", "millimeter": "mm", "centimeter": "cm", "inch": "in", "foot": "ft", "meter": "m"}
_DEEPEST = 50
"""Parts within parts: deeper ones go round in a circle."""


def parse_xml(path: Path, data: bytes) -> Element:
    """The root, with all names freed of their namespaces.

    Raises
    ------
    InputError
        If it is broken.
    """
    try:
        root = ElementTree.fromstring(data)
    except (ElementTree.ParseError, ValueError, LookupError) as problem:
        raise InputError(f"{path} is broken XML ({problem}); was it damaged or cut short?") from None
    for element in root.iter():
        element.tag = str(element.tag).rpartition("}")[2]
    return root


def numbers_in(path: Path, text: str | None, width: int = 1) -> Floats:
    """The numbers of a text, (n, width)."""
    try:
        numbers = np.array((text or "").replace(",", " ").split(), np.float64)
    except ValueError:
        raise InputError(f"{path} holds a word where numbers are wanted; was it damaged?") from None
    return numbers[: len(numbers) // width * width].reshape(-1, width)


def _attributes(path: Path, elements: list[Element], *names: str) -> Floats:
    try:
        return np.array([[float(one.get(name, "")) for name in names] for one in elements]).reshape(-1, len(names))
    except ValueError:
        raise InputError(f"{path} has a point or a face without its {', '.join(names)}; was it damaged?") from None


# 3MF


def read_3mf(path: Path, data: bytes) -> FileMesh:
    """Read a 3MF: all objects that its build names, in the unit that it says; with a texture, if it has one.

    Raises
    ------
    InputError
        If it is damaged, or holds no surface.
    """
    archive = Zip(path, data)
    models = [name for name in archive.names if name.lower().endswith(".model")]
    if not models:
        raise InputError(f"{path} is a ZIP without a 3D model in it, so no 3MF")
    main = archive.find("3D/3dmodel.model") or models[0]
    root = parse_xml(path, archive.read(main))
    objects = {one.get("id"): one for one in root.iter("object")}
    textures = {one.get("id"): one.get("path", "") for one in root.iter("texture2d")}
    groups = {one.get("id"): one for one in root.iter("texture2dgroup")}
    parts: list[Part] = []

    def add(number: str | None, placed: Floats, depth: int) -> None:
        one = objects.get(number)
        if one is None or depth > _DEEPEST:
            raise InputError(f"{path} names the part {number}, which it does not hold")
        mesh = one.find("mesh")
        if mesh is not None:
            parts.append(_part_3mf(path, archive, one, mesh, placed, groups, textures))
        for component in one.findall("components/component"):
            add(component.get("objectid"), placed @ _placed_3mf(path, component.get("transform")), depth + 1)

    items = root.findall("build/item")
    for item in items:
        add(item.get("objectid"), _placed_3mf(path, item.get("transform")), 0)
    if not items:
        for number in objects:
            add(number, np.eye(4), 0)
    return joined(path, parts, _UNITS_3MF.get(root.get("unit", "millimeter"), "mm"))


def _placed_3mf(path: Path, transform: str | None) -> Floats:
    placed = np.eye(4)
    if transform:
        numbers = numbers_in(path, transform).ravel()
        if len(numbers) != 12:
            raise InputError(f"{path}: a transform has {len(numbers)} numbers; 12 are wanted")
        placed[:3] = numbers.reshape(4, 3).T
    return placed


def _part_3mf(
    path: Path,
    archive: Zip,
    owner: Element,
    mesh: Element,
    placed: Floats,
    groups: dict[str | None, Element],
    textures: dict[str | None, str],
) -> Part:
    points = _attributes(path, mesh.findall("vertices/vertex"), "x", "y", "z")
    triangles = mesh.findall("triangles/triangle")
    corners = _attributes(path, triangles, "v1", "v2", "v3").astype(np.int64)
    uv = uv_corners = image = None
    name = ""
    group = groups.get(owner.get("pid")) or next(
        (groups[t.get("pid")] for t in triangles if t.get("pid") in groups), None
    )
    if group is not None:
        number = group.get("id")
        uv = _attributes(path, group.findall("tex2coord"), "u", "v")
        rows = []
        for triangle in triangles:
            own = triangle.get("pid", owner.get("pid")) == number
            first = triangle.get("p1", owner.get("pindex", "-1"))
            rows.append([first, triangle.get("p2", first), triangle.get("p3", first)] if own else ["-1"] * 3)
        uv_corners = numbers_in(path, " ".join(word for row in rows for word in row)).astype(np.int64).ravel()
        name = textures.get(group.get("texid"), "")
        found = archive.find(name) if name else None
        image = archive.read(found) if found else None
    sizes = np.full(len(corners), 3, np.int32)
    in_place = points @ placed[:3, :3].T + placed[:3, 3]
    return Part(in_place, sizes, corners.ravel(), uv, uv_corners, image, name)


# COLLADA


def read_dae(path: Path, data: bytes, inside: Path | None = None) -> FileMesh:
    """Read a COLLADA file: all geometries of its scene, put in place, with the diffuse image of each material.

    Raises
    ------
    InputError
        If it is damaged, or holds no surface.
    """
    root = parse_xml(path, data)
    by_id = {one.get("id"): one for one in root.iter() if one.get("id")}
    warnings: list[Diagnostic] = []
    parts: list[Part] = []

    def add(node: Element, above: Floats, depth: int) -> None:
        if depth > _DEEPEST:
            raise InputError(f"{path}: its nodes lie in one another without end")
        placed = above @ _placed_dae(path, node)
        for instance in node.findall("instance_geometry"):
            geometry = by_id.get(_target(instance))
            if geometry is not None:
                materials = {
                    one.get("symbol"): one.get("target", "").lstrip("#") for one in instance.iter("instance_material")
                }
                parts.extend(_parts_dae(path, by_id, geometry, placed, materials, inside, warnings))
        for child in node.findall("node"):
            add(child, placed, depth + 1)
        for instance in node.findall("instance_node"):
            other = by_id.get(_target(instance))
            if other is not None:
                add(other, placed, depth + 1)

    scene = root.find("scene/instance_visual_scene")
    visual = by_id.get(_target(scene)) if scene is not None else root.find("library_visual_scenes/visual_scene")
    for node in visual.findall("node") if visual is not None else []:
        add(node, np.eye(4), 0)
    if not parts:
        for geometry in root.iter("geometry"):
            parts += _parts_dae(path, by_id, geometry, np.eye(4), {}, inside, warnings)
    unit = root.find("asset/unit")
    metre = f"{unit.get('meter', '1')}m" if unit is not None else "m"
    plain = {"1m": "m", "1.0m": "m", "0.001m": "mm", "0.01m": "cm", "0.0254m": "in"}.get(metre, metre)
    return joined(path, parts, plain if is_unit(plain) else None, warnings)


def _target(element: Element) -> str:
    return element.get("url", element.get("source", "")).lstrip("#")


def _placed_dae(path: Path, node: Element) -> Floats:
    from scipy.spatial.transform import Rotation

    placed = np.eye(4)
    for step in node:
        numbers = (
            numbers_in(path, step.text).ravel() if step.tag in ("matrix", "translate", "rotate", "scale") else None
        )
        here = np.eye(4)
        if numbers is None:
            continue
        if len(numbers) != {"matrix": 16, "translate": 3, "rotate": 4, "scale": 3}[step.tag]:
            raise InputError(f"{path}: a {step.tag} has {len(numbers)} numbers")
        if step.tag == "matrix":
            here = numbers.reshape(4, 4)
        elif step.tag == "translate":
            here[:3, 3] = numbers
        elif step.tag == "scale":
            here[:3, :3] = np.diag(numbers)
        elif np.linalg.norm(numbers[:3]) > 0:
            axis = numbers[:3] / np.linalg.norm(numbers[:3])
            here[:3, :3] = Rotation.from_rotvec(np.radians(numbers[3]) * axis).as_matrix()
        placed = placed @ here
    return placed


def _parts_dae(
    path: Path,
    by_id: dict[str | None, Element],
    geometry: Element,
    placed: Floats,
    materials: dict[str | None, str],
    inside: Path | None,
    warnings: list[Diagnostic],
) -> list[Part]:
    parts = []
    for primitive in [one for one in geometry.findall("mesh/*") if one.tag in ("triangles", "polylist", "polygons")]:
        inputs = {(one.get("semantic"), one.get("set", "0")): one for one in primitive.findall("input")}
        try:
            width = 1 + max(int(one.get("offset", "0")) for one in inputs.values())
            offsets = {key: int(one.get("offset", "0")) for key, one in inputs.items()}
        except ValueError:
            raise InputError(f"{path}: a mesh says no offsets of its numbers; was it damaged?") from None
        vertex = next((key for key in inputs if key[0] == "VERTEX"), None)
        vertices = by_id.get(_target(inputs[vertex])) if vertex else None
        source = None if vertices is None else vertices.find("input[@semantic='POSITION']")
        if vertex is None or source is None:
            continue
        points = _source(path, by_id, _target(source), 3)
        table = np.concatenate([numbers_in(path, p.text, width).astype(np.int64) for p in primitive.findall("p")])
        if primitive.tag == "triangles":
            sizes = np.full(len(table) // 3, 3, np.int64)
        elif primitive.tag == "polylist":
            sizes = numbers_in(path, getattr(primitive.find("vcount"), "text", "")).astype(np.int64).ravel()
        else:
            sizes = np.array([len(numbers_in(path, p.text, width)) for p in primitive.findall("p")], np.int64)
        if (sizes < 0).any() or sizes.sum() != len(table):
            raise InputError(f"{path}: its faces want {sizes.sum()} corners, and {len(table)} follow; was it cut?")
        texture = next((key for key in sorted(inputs, key=str) if key[0] == "TEXCOORD"), None)
        uv = None if texture is None else _source(path, by_id, _target(inputs[texture]), 2)
        uv_corners = None if texture is None else table[:, offsets[texture]]
        material = by_id.get(materials.get(primitive.get("material"), primitive.get("material")))
        name = "" if material is None else _image_dae(by_id, material)
        image: Image | None = None
        if name:
            image, missing = find_image(path, name, inside)
            warnings += [one for one in missing if one not in warnings]
        in_place = points @ placed[:3, :3].T + placed[:3, 3]
        parts.append(Part(in_place, sizes, table[:, offsets[vertex]], uv, uv_corners, image, name))
    return parts


def _source(path: Path, by_id: dict[str | None, Element], name: str, width: int) -> Floats:
    source = by_id.get(name)
    array = None if source is None else source.find("float_array")
    if source is None or array is None:
        raise InputError(f"{path} names the numbers {name[:40]}, which it does not hold")
    accessor = source.find("technique_common/accessor")
    stride = accessor.get("stride", str(width)) if accessor is not None else str(width)
    wide = int(stride) if stride.isdigit() and int(stride) >= width else width
    return numbers_in(path, array.text, wide)[:, :width]


def _image_dae(by_id: dict[str | None, Element], material: Element) -> str:
    """The file name of a material's diffuse image; empty where it has none."""
    instance = material.find("instance_effect")
    effect = by_id.get(_target(instance)) if instance is not None else None
    if effect is None:
        return ""
    inner = {one.get("sid"): one for one in effect.iter("newparam")}
    for role in ("diffuse", "emission", "ambient"):
        texture = next((t for one in effect.iter(role) for t in one.findall("texture")), None)
        if texture is None:
            continue
        name = texture.get("texture", "")
        for _ in range(3):  # sampler, surface, image
            step = inner.get(name)
            found = None if step is None else next((e for e in step.iter() if e.tag in ("source", "init_from")), None)
            if found is None or not found.text:
                break
            name = found.text.strip()
        image = by_id.get(name)
        if image is not None:
            file_name = next(
                (e.text for e in image.iter() if e.tag in ("init_from", "ref") and e.text and e.text.strip()), ""
            )
            return unquote(file_name.strip().removeprefix("file:///").removeprefix("file://")) if file_name else ""
    return ""
