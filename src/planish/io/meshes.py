"""A mesh file of any kind to a `FileMesh`: told by what it holds, not by its suffix."""

from __future__ import annotations

import re
from pathlib import Path

from planish.errors import InputError
from planish.io.filemesh import FileMesh
from planish.io.files import read_bytes

_OTHER_SUFFIXES = {
    ".stl",
    ".off",
    ".3mf",
    ".fbx",
    ".dae",
    ".usdz",
    ".usd",
    ".e57",
    ".las",
    ".laz",
    ".xyz",
    ".pcd",
    ".asc",
}


def read_mesh(path: Path) -> FileMesh:
    """Read a mesh.

    Parameters
    ----------
    path : Path
        An OBJ, PLY, GLB or glTF file, or a tifxyz folder.

    Raises
    ------
    InputError
        If it is no mesh, damaged or cut short.
    """
    if path.is_dir():
        from planish.io.tifxyz import read_tifxyz

        return read_tifxyz(path)
    data = read_bytes(path)
    if re.match(rb"ply[ \t]*[\r\n]", data):
        from planish.io.ply import read_ply

        return read_ply(path, data)
    if data.startswith(b"glTF") or re.match(rb"(?:\xef\xbb\xbf)?\s*\{", data):
        from planish.io.gltf import read_gltf

        return read_gltf(path, data)
    if b"\0" in data or path.suffix.lower() in _OTHER_SUFFIXES:
        raise InputError(f"{path} is no mesh that planish reads: OBJ, PLY, GLB, glTF or a tifxyz folder is wanted")
    from planish.io.obj import read_obj

    return read_obj(path, data)
