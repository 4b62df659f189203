"""Items of a batch: scans found in a folder, each with a name that is stable from run to run."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from hashlib import sha256
from pathlib import Path, PurePath, PurePosixPath

from planish.errors import InputError
from planish.io.files import is_tifxyz
from planish.settings import MESH_SUFFIXES, Units
from planish.system import is_device_name

IMAGES = {".jpg", ".jpeg", ".png", ".tif", ".tiff", ".webp", ".bmp", ".jp2", ".ppm", ".heic", ".avif", ".dng"}
RESERVED = ("summary.html", "summary.csv", "summary.jsonl")
"""File names in the output folder that no item may take."""
MAX_NAME_BYTES = 200
"""Maximum bytes of one path component: file systems allow 255, and temporary names add a prefix and suffix."""

_UNSAFE = re.compile(r'[\x00-\x1f\x7f\ud800-\udfff%\\:*?"<>|]|^[. ]|[. ]$')
"""Characters that are unsafe in some file system, shell or spreadsheet, and % itself, the escape character."""


@dataclass(frozen=True, kw_only=True)
class Item:
    """One scan of a batch.

    Attributes
    ----------
    name : str
        Name of its folder in the output; components separated by /.
    scan : Path
    photo, camera : tuple of Path
        Given by the user; they take precedence over files that the scan references.
    nearby_photo, nearby_camera : Path or None
        Found beside the scan; used if the scan references no photo.
    units : str
    """

    name: str
    scan: Path
    photo: tuple[Path, ...] = ()
    camera: tuple[Path, ...] = ()
    nearby_photo: Path | None = None
    nearby_camera: Path | None = None
    units: Units = "auto"


@dataclass(frozen=True)
class ScanList:
    """Items in the order of their names, notes for the user, and the folder that was searched, if any."""

    items: list[Item]
    notes: list[str] = field(default_factory=list)
    folder: Path | None = None


def find_items(folder: Path) -> ScanList:
    """Find all scans in a folder and its subfolders.

    A scan is named by its path without suffix; a scan that is alone in its folder, by that folder. If two names are
    equal, or one is a parent folder of another, these scans are named by their full path, which is unique.

    Parameters
    ----------
    folder : Path
        Hidden files and folders are ignored, links to folders are followed.

    Raises
    ------
    InputError
        If it is not a folder, or contains no scan.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as made:
    ...     for name in ("a.obj", "b.ply", "c/scan.glb", "c/photo.jpg", "d/1.obj", "d/2.obj", "d/2.ply"):
    ...         path = Path(made) / name
    ...         path.parent.mkdir(exist_ok=True)
    ...         path.touch()
    ...     [item.name for item in find_items(Path(made)).items]
    ['a', 'b', 'c', 'd/1', 'd/2.obj', 'd/2.ply']
    """
    if is_tifxyz(folder):
        raise InputError(f"{folder} is a single scan, not a folder of scans; use planish restore for it")
    folder = folder.absolute()  # workers may have another working directory
    notes: list[str] = []
    named_scans: list[tuple[Item, str]] = []  # with the name from the full path
    for entries, scans, images in _walk_folders(folder, notes):
        for scan in scans:
            full_path = scan.relative_to(folder)
            is_only_scan = len(scans) == 1 and scan.parent != folder and not scan.is_dir()
            short_path = full_path.parent if is_only_scan else full_path.with_suffix("")
            photos = [image for image in images if image.stem == scan.stem] or (images if len(scans) == 1 else [])
            cameras = [scan.parent / name for name in (f"{scan.stem}_camera.json", "camera.json") if name in entries]
            item = Item(
                name=safe_name(full_path if str(short_path) in RESERVED else short_path),
                scan=scan,
                nearby_photo=photos[0] if len(photos) == 1 else None,
                nearby_camera=cameras[0] if cameras else None,
            )
            named_scans.append((item, safe_name(full_path)))
    if not named_scans:
        raise InputError(
            f"{folder} contains no scan: expected meshes (OBJ, PLY, GLB, glTF, STL, ...) or tifxyz folders"
            + "".join(f"; {note}" for note in notes)
        )
    return ScanList(sorted(_resolve_name_conflicts(named_scans), key=lambda item: item.name), notes, folder)


def safe_name(path: PurePath | str) -> str:
    """Escape a relative path so that it is valid on every file system; distinct paths stay distinct.

    Examples
    --------
    >>> safe_name("box 1/a:b."), safe_name("100%"), safe_name("box 2/aux.left")
    ('box 1/a%3Ab%2E', '100%25', 'box 2/%61ux.left')
    """
    parts = path.parts if isinstance(path, PurePath) else PurePosixPath(path).parts
    return "/".join(_safe_component(part) for part in parts)


def conflicting_names(names: Iterable[str]) -> set[str]:
    """Names that occur twice, or that are a parent folder of another name.

    Examples
    --------
    >>> sorted(conflicting_names(["a", "a/b", "c", "d", "d"]))
    ['a', 'a/b', 'd']
    """
    all_names = list(names)
    counts = Counter(all_names)
    conflicts = {name for name, times in counts.items() if times > 1}
    for name in counts:
        for ancestors in PurePosixPath(name).parents:
            if str(ancestors) in counts:
                conflicts |= {name, str(ancestors)}
    return conflicts


def _safe_component(part: str) -> str:
    def percent_encoded(unsafe: re.Match[str]) -> str:
        return "".join(f"%{byte:02X}" for byte in os.fsencode(unsafe[0]))

    safe = _UNSAFE.sub(percent_encoded, part)
    if is_device_name(part):
        safe = f"%{ord(part[0]):02X}{safe[1:]}"
    if len(safe.encode()) <= MAX_NAME_BYTES:
        return safe
    return (
        safe.encode()[: MAX_NAME_BYTES - 20].decode(errors="ignore") + "~" + sha256(os.fsencode(part)).hexdigest()[:16]
    )


def _resolve_name_conflicts(named_scans: list[tuple[Item, str]]) -> list[Item]:
    """Use short names, and full paths for those that conflict."""
    items = [item for item, _ in named_scans]
    while conflicts := conflicting_names(item.name for item in items):
        items = [
            replace(item, name=full_path) if item.name in conflicts else item
            for item, (_, full_path) in zip(items, named_scans, strict=True)
        ]
    return items


def _walk_folders(top: Path, notes: list[str]) -> Iterator[tuple[set[str], list[Path], list[Path]]]:
    """Walk all folders; yield entry names, scans and images of each."""
    pending: list[tuple[Path, frozenset[tuple[int, int]]]] = [(top, frozenset())]
    while pending:
        folder, ancestors = pending.pop()
        try:
            entries = sorted((e for e in os.scandir(folder) if not e.name.startswith(".")), key=lambda e: e.name)
            here = folder.stat()
        except FileNotFoundError:
            raise InputError(f"{folder}: there is no such folder") from None
        except OSError as problem:
            notes.append(f"{folder} was skipped because it cannot be read: {problem.strerror}")
            continue
        folder_id = (here.st_dev, here.st_ino)
        if folder_id in ancestors:
            notes.append(f"{folder} was skipped: it is a link to one of its parent folders")
            continue
        scans, images = [], []
        for entry in entries:
            path = Path(entry.path)
            if entry.is_dir():
                if is_tifxyz(path):
                    scans.append(path)
                else:
                    pending.append((path, ancestors | {folder_id}))
            elif path.suffix.lower() in MESH_SUFFIXES and (entry.is_file() or entry.is_symlink()):
                scans.append(path)
            elif path.suffix.lower() in IMAGES and entry.is_file():
                images.append(path)
        yield {entry.name for entry in entries}, scans, images
