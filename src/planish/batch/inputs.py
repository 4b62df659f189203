"""Input files of a batch item and their fingerprints, which decide whether the item must be restored again."""

from __future__ import annotations

import json
import os
import re
import struct
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from hashlib import sha256
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from planish.batch.items import IMAGES, Item
from planish.errors import InputError
from planish.io.files import is_tifxyz
from planish.io.metadata import fingerprints
from planish.io.textures import find_beside

Content = bytes | mmap

_TIFXYZ = ("meta.json", "x.tif", "y.tif", "z.tif", "mask.tif")
_MTL_IMAGE = re.compile(rb"(?im)^[ \t]*(?:map_\w+|bump|disp|decal|refl|norm)[ \t]+([^\r\n]*)")


@dataclass(frozen=True)
class FileStamp:
    """State of one file on disk, by which a later change is detected without reading it.

    Attributes
    ----------
    path : str
    size, changed_ns : int
        Size in bytes, and inode change time (ctime) in ns. -1 for a missing file.
    sha256 : str
        Hexadecimal; empty for a missing file.
    """

    path: str
    size: int
    changed_ns: int
    sha256: str

    def is_current(self) -> bool:
        """Whether size and ctime are unchanged."""
        return _file_state(self.path) == (self.size, self.changed_ns)


@dataclass(frozen=True)
class Inputs:
    """Input files of an item.

    Attributes
    ----------
    file_stamps : tuple of FileStamp
        The scan, all files that it references (also missing ones), photos and cameras.
    photo, camera : tuple of Path
        To be passed along with the scan.
    """

    file_stamps: tuple[FileStamp, ...]
    photo: tuple[Path, ...]
    camera: tuple[Path, ...]

    def fingerprint(self) -> str:
        """Digest of file names and contents; independent of folder and modification times."""
        plain = json.dumps([[Path(stamp.path).name, stamp.sha256] for stamp in self.file_stamps])
        return sha256(plain.encode()).hexdigest()


def find_inputs(item: Item) -> Inputs:
    """Find and hash all files of an item; photo and camera beside the scan are used if the scan references no photo."""
    named = _referenced_files(item.scan)
    photo, camera = item.photo, item.camera
    has_own = any(path is not None and path.suffix.lower() in IMAGES for _, path in named) or _has_embedded_images(
        item.scan
    )
    if not photo and item.nearby_photo is not None and not has_own:
        photo = (item.nearby_photo,)
        camera = camera or (() if item.nearby_camera is None else (item.nearby_camera,))
    own = [item.scan / name for name in _TIFXYZ] if is_tifxyz(item.scan) else [item.scan]
    paths = [*own, *(path or item.scan.parent / name for name, path in named), *photo, *camera]
    return Inputs(tuple(_make_stamp(path) for path in dict.fromkeys(paths)), photo, camera)


def _make_stamp(path: Path) -> FileStamp:
    size, changed_ns = _file_state(path)  # before hashing, so that a concurrent change is detected by the next run
    try:
        digest = fingerprints([path]).popitem()[1] if size >= 0 and path.is_file() else ""
    except InputError:  # reported when the file is actually needed
        digest = "unreadable"
    return FileStamp(os.fspath(path), size, changed_ns, digest)


def _file_state(path: str | Path) -> tuple[int, int]:
    """Size and ctime; not mtime, which copying and unpacking preserve."""
    try:
        existing = Path(path).stat()
    except (OSError, ValueError):
        return -1, -1
    return existing.st_size, existing.st_ctime_ns


def _referenced_files(scan: Path) -> list[tuple[str, Path | None]]:
    """Names referenced by a mesh file, each with its path if the file exists.

    Errs on the side of too many: an extra name costs a hash, a missed one would hide a change.
    """
    with _map_file(scan) as data:
        if data[:4] == b"glTF" or data[:1] == b"{" or scan.suffix.lower() == ".gltf":
            names = _gltf_uris(data)
        elif re.match(rb"ply[ \t]*[\r\n]", data):
            header = data[: data.find(b"end_header")]
            names = [
                _decode_name(name) for name in re.findall(rb"(?im)^comment[ \t]+texturefile[ \t]+([^\r\n]*)", header)
            ]
        else:
            return _obj_references(scan, data)
    return [(name, find_beside(scan, name)) for name in dict.fromkeys(names) if _is_valid_name(name)]


@contextmanager
def _map_file(file: Path) -> Iterator[Content]:
    """Memory-map a file; empty if it cannot be read."""
    with ExitStack() as stack:
        content: Content = b""
        with suppress(OSError, ValueError):  # ValueError: the file is empty
            open_output_dir = stack.enter_context(file.open("rb"))
            content = stack.enter_context(mmap(open_output_dir.fileno(), 0, access=ACCESS_READ))
        yield content


def _obj_references(scan: Path, data: Content) -> list[tuple[str, Path | None]]:
    named: dict[str, Path | None] = {}
    for line in re.findall(rb"mtllib[ \t]+([^\r\n]*)", data):
        material = find_beside(scan, name) if _is_valid_name(name := _decode_name(line)) else None
        named[name] = material
        if material is None:
            continue
        try:
            images = [_decode_name(name) for name in _MTL_IMAGE.findall(material.read_bytes())]
        except OSError:
            continue
        for image in images:  # MTL options may precede the name, and the name may contain spaces
            candidates = {
                name: find_beside(scan, name) for name in (image, image.split(" ")[-1]) if _is_valid_name(name)
            }
            existing = {name: path for name, path in candidates.items() if path is not None}
            named |= existing or candidates
    return list(named.items())


def _gltf_uris(data: Content) -> list[str]:
    """URIs of a glTF's external buffers and images."""
    tree = _gltf_tree(data)
    parts = [part for key in ("buffers", "images") for part in tree.get(key) or [] if isinstance(part, dict)]
    uris = [part["uri"] for part in parts if isinstance(part.get("uri"), str)]
    return [unquote(uri) for uri in uris if not uri.startswith("data:")]


def _gltf_tree(data: Content) -> dict[str, Any]:
    binary = data[:4] == b"glTF" and len(data) >= 20
    try:
        tree = json.loads(data[20 : 20 + struct.unpack_from("<I", data, 12)[0]] if binary else data[:])
    except (ValueError, RecursionError):
        return {}
    return tree if isinstance(tree, dict) else {}


def _has_embedded_images(scan: Path) -> bool:
    """Whether a GLB or glTF has embedded images."""
    if scan.suffix.lower() not in (".glb", ".gltf"):
        return False
    with _map_file(scan) as data:
        return bool(_gltf_tree(data).get("images"))


def _decode_name(name: bytes) -> str:
    return name.strip().decode("utf-8", "replace")


def _is_valid_name(name: str) -> bool:
    return bool(name) and "\0" not in name
