"""USD and USDZ, which phones export: the extra `planish[usd]`."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from planish.errors import InputError, MissingExtraError, install_command
from planish.io.filemesh import FileMesh
from planish.io.scene import Part, joined
from planish.io.suppress_stderr import suppress_stderr
from planish.io.textures import Image, find_image
from planish.io.zipped import Zip

_ROLES = ("diffuseColor", "emissiveColor")


def read_usd(path: Path, data: bytes, inside: Path | None = None) -> FileMesh:
    """Read the meshes of a USDZ, USDC or USDA, put in place, with the diffuse image of their material.

    Raises
    ------
    InputError
        If it is damaged, or holds no surface.
    MissingExtraError
        If usd-core is not installed.
    """
    try:
        from pxr import Tf, Usd, UsdGeom, UsdShade
    except ImportError:
        raise MissingExtraError(f"{path} is a USD file; to read it: {install_command('usd')}") from None
    archive = Zip(path, data) if data.startswith(b"PK") else None
    suffix = ".usdz" if archive else ".usdc" if data.startswith(b"PXR-USDC") else ".usda"
    with (
        tempfile.NamedTemporaryFile(suffix=suffix) as file,
        suppress_stderr(),
    ):  # the library reads files by their suffix
        file.write(data)
        file.flush()
        try:
            stage = Usd.Stage.Open(file.name)
            if stage is None:
                raise InputError(f"{path} is a USD file, but damaged or cut short")
            _check_layers(path, stage, file.name, inside)
            per_unit = UsdGeom.GetStageMetersPerUnit(stage)
            parts = [
                _part(path, archive, inside, prim, UsdGeom, UsdShade)
                for prim in stage.Traverse()
                if prim.IsA(UsdGeom.Mesh) and UsdGeom.Imageable(prim).ComputePurpose() in ("default", "render")
            ]
        except InputError:
            raise
        except (Tf.ErrorException, RuntimeError, ValueError, TypeError, IndexError) as problem:
            raise InputError(f"{path} is a USD file, but damaged or cut short{_reason(problem)}") from problem
    plain = {1.0: "m", 0.01: "cm", 0.001: "mm", 0.0254: "in"}.get(round(per_unit, 9), f"{per_unit:.9g}m")
    return joined(path, [part for part in parts if part is not None], plain)


def _check_layers(path: Path, stage: Any, opened: str, inside: Path | None) -> None:
    """Refuse a scan from strangers whose layers name further ones outside of its folder."""
    for layer in stage.GetUsedLayers():
        place = str(layer.realPath)
        if inside is None or not place or place.split("[")[0] == str(Path(opened).resolve()):
            continue
        if not Path(place.split("[")[0]).resolve().is_relative_to(inside.resolve()):
            raise InputError(f"{path} names the layer {place}, which lies outside of the folder of the scan")


def _reason(problem: Exception) -> str:
    try:
        return ": " + " ".join(str(problem).split())[:100]
    except UnicodeDecodeError:  # the library quotes the damaged bytes
        return ""


def _part(path: Path, archive: Zip | None, inside: Path | None, prim: Any, geom: Any, shade: Any) -> Part | None:
    mesh = geom.Mesh(prim)
    points, sizes, corners = (
        np.array(attribute.Get() or [])
        for attribute in (mesh.GetPointsAttr(), mesh.GetFaceVertexCountsAttr(), mesh.GetFaceVertexIndicesAttr())
    )
    if not len(points) or not len(sizes):
        return None
    if (sizes < 0).any() or sizes.sum() != len(corners):
        raise InputError(f"{path}: its faces want {sizes.sum()} corners, but {len(corners)} follow; was it damaged?")
    placed = np.array(geom.Xformable(prim).ComputeLocalToWorldTransform(0.0)).T
    if str(mesh.GetOrientationAttr().Get()) == "leftHanded":
        first = np.repeat(np.cumsum(sizes) - sizes, sizes)
        turned = 2 * first + np.repeat(sizes, sizes) - 1 - np.arange(len(corners))
    else:
        turned = np.arange(len(corners))
    uv = uv_corners = None
    primvars = geom.PrimvarsAPI(prim)
    names = ["st", "UVMap", "st0", "uv", "Texture_uv"]
    found = next((one for one in (primvars.GetPrimvar(name) for name in names) if one and one.HasValue()), None)
    if found is not None:
        uv = np.array(found.ComputeFlattened(), np.float64).reshape(-1, 2)
        each = str(found.GetInterpolation())
        uv_corners = np.arange(len(corners)) if each == "faceVarying" else corners
        uv_corners = uv_corners[turned]
    name = _image_name(prim, shade)
    image: Image | None = None
    if name and archive is not None:
        packed = archive.find(name)
        image = archive.read(packed) if packed else None
    elif name:
        image = find_image(path, name, inside)[0]
    in_place = points.astype(np.float64).reshape(-1, 3) @ placed[:3, :3].T + placed[:3, 3]
    return Part(in_place, sizes, corners[turned], uv, uv_corners, image, name)


def _image_name(prim: Any, shade: Any) -> str:
    """The file that the surface shader of a prim takes its colour from; empty where there is none."""
    material, _ = shade.MaterialBindingAPI(prim).ComputeBoundMaterial()
    if not material:
        return ""
    surface = material.ComputeSurfaceSource()[0]
    for role in _ROLES if surface else ():
        value = surface.GetInput(role)
        source = value.GetConnectedSource() if value and value.HasConnectedSource() else None
        if source is None:
            continue
        file = shade.Shader(source[0].GetPrim()).GetInput("file")
        asset = file.Get() if file else None
        if asset:
            return str(asset.path)
    return ""
