"""A mesh file of any kind to a `FileMesh`: told by what it holds, not by its suffix."""

from __future__ import annotations

import re
from pathlib import Path

from planish.errors import InputError
from planish.io.filemesh import FileMesh
from planish.io.files import is_folder, read_bytes
from planish.io.text import as_utf8
from planish.memory import check_memory

_OTHER_SUFFIXES = {
    ".stl",
    ".off",
    ".3mf",
    ".fbx",
    ".dae",
    ".usdz",
    ".usd",
}

_CLOUDS = {".e57", ".las", ".laz", ".xyz", ".pcd", ".ptx", ".asc"}

_TIMES_ITS_SIZE = 3.0
"""What a mesh takes beside the bytes of its file while it is read."""


def read_mesh(path: Path, inside: Path | None = None) -> FileMesh:
    """Read a mesh.

    Parameters
    ----------
    path : Path
        An OBJ, PLY, GLB or glTF file, or a tifxyz folder.
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
    if path.suffix.lower() in _CLOUDS:
        raise InputError(
            f"{path} is a point cloud, and a mesh is wanted: `planish acquire grid` makes one of a range image,"
            " `planish acquire points` of other points"
        )
    if b"\0" in data or path.suffix.lower() in _OTHER_SUFFIXES:
        raise InputError(f"{path} is no mesh that planish reads: OBJ, PLY, GLB, glTF or a tifxyz folder is wanted")
    from planish.io.obj import read_obj

    return read_obj(path, data, inside)
