"""A mesh file of any kind to a `FileMesh`: told by what it holds, not by its suffix."""

from __future__ import annotations

import re
from pathlib import Path

from planish.errors import InputError
from planish.io.filemesh import FileMesh
from planish.io.files import is_folder, read_bytes
from planish.io.text import as_utf8
from planish.memory import check_memory

_WANTED = "OBJ, PLY, GLB, glTF, STL, OFF, 3MF, DAE, X3D, VRML, USDZ or a tifxyz folder"
_OTHERS = ((b"Kaydara FBX", "an FBX"), (b"BLENDER", "a Blender file"), (b"Rhino", "a Rhino file"), (b"MMM", "a 3DS"))

_CLOUDS = {".e57", ".las", ".laz", ".xyz", ".pcd", ".ptx", ".asc"}

_TIMES_ITS_SIZE = 3.0
"""What a mesh takes beside the bytes of its file while it is read."""


def read_mesh(path: Path, inside: Path | None = None) -> FileMesh:
    """Read a mesh.

    Parameters
    ----------
    path : Path
        A file of OBJ, PLY, GLB, glTF, STL, OFF, 3MF, DAE, X3D, VRML or USDZ, or a tifxyz folder.
    inside : Path, optional
        The only folder from which files are read that the mesh names.

    Raises
    ------
    InputError
        If it is no mesh, damaged or cut short.
    """
    if is_folder(path):
        from planish.io.tifxyz import read_tifxyz

        return read_tifxyz(path)
    data = as_utf8(read_bytes(path))
    check_memory(_TIMES_ITS_SIZE * len(data), f"the mesh {path}", "let the scanner's software reduce it")
    if re.match(rb"ply[ \t]*[\r\n]", data):
        from planish.io.ply import read_ply

        return read_ply(path, data, inside)
    if data.startswith(b"glTF") or re.match(rb"(?:\xef\xbb\xbf)?\s*\{", data):
        from planish.io.gltf import read_gltf

        return read_gltf(path, data, inside)
    further = _read_further(path, data, inside)
    if further is not None:
        return further
    if path.suffix.lower() in _CLOUDS:
        raise InputError(
            f"{path} is a point cloud, and a mesh is wanted: `planish acquire grid` makes one of a range image,"
            " `planish acquire points` of other points"
        )
    other = next((said for start, said in _OTHERS if data.startswith(start)), None)
    if b"\0" in data[:65536] or other or path.suffix.lower() == ".fbx":
        kind = f"{other}, which planish does not read" if other else "no mesh that planish reads"
        raise InputError(f"{path} is {kind}; {_WANTED} is wanted")
    from planish.io.obj import read_obj

    return read_obj(path, data, inside)


def _read_further(path: Path, data: bytes, inside: Path | None) -> FileMesh | None:
    """The mesh of one of the rarer formats; None for all others."""
    start = data[:4096].lstrip().removeprefix(b"\xef\xbb\xbf")
    if start.startswith((b"#VRML V2.0", b"#X3D V")):
        from planish.io.vrml import read_vrml

        return read_vrml(path, data, inside)
    if start.startswith((b"PXR-USDC", b"#usda")) or (start.startswith(b"PK\3\4") and b".usd" in data):
        from planish.io.usd import read_usd

        return read_usd(path, data, inside)
    if start.startswith(b"PK\3\4"):
        from planish.io.xml_meshes import read_3mf

        return read_3mf(path, data)
    if start.startswith(b"<"):
        from planish.io.vrml import read_x3d
        from planish.io.xml_meshes import read_dae

        return read_dae(path, data, inside) if b"COLLADA" in start else read_x3d(path, data, inside)
    from planish.io.plain_meshes import is_binary_stl, read_off, read_stl

    if is_binary_stl(data) or (start.startswith(b"solid") and b"facet" in data[:65536]):
        return read_stl(path, data)
    if re.match(rb"(?:#[^\n]*\n)*\s*(?:ST)?C?N?OFF\b", start):
        return read_off(path, data)
    return None
