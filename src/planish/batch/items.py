"""The items of a batch: scans found in a folder, each under a name that stays the same from run to run."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from hashlib import sha256
from pathlib import Path, PurePosixPath

from planish.errors import InputError
from planish.io.files import is_tifxyz
from planish.settings import Units

SCANS = {".obj", ".ply", ".glb", ".gltf"}
IMAGES = {".jpg", ".jpeg", ".png", ".tif", ".tiff", ".webp", ".bmp", ".jp2", ".ppm"}
RESERVED = ("summary.html", "summary.csv", "summary.jsonl")
"""Names in the output that no item can have."""
MAX_NAME_BYTES = 200
"""Bytes of one part of a name: file systems take 255, and something is put before and after it."""

_UNSAFE = re.compile(r'[\x00-\x1f\x7f\ud800-\udfff%\\:*?"<>|]|^[. ]|[. ]$')
"""What some file system, shell or spreadsheet trips over, and % itself, which marks the others."""


@dataclass(frozen=True, kw_only=True)
class Item:
    """One scan of a batch.

    Attributes
    ----------
    name : str
        Of its folder below the output; parts with / between them.
    scan : Path
    photo, camera : tuple of Path
        Given by the user: they come before what the scan's file names.
    nearby_photo, nearby_camera : Path or None
        That lie beside the scan; they are used where the scan's file has no photo of its own.
    units : {"auto", "mm", "cm", "m", "in"}
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
    """The items in the order of their names, what a user should know of the search, and the folder searched, if any."""

    items: list[Item]
    notes: list[str] = field(default_factory=list)
    folder: Path | None = None


def find_items(folder: Path) -> ScanList:
    """Find every scan in a folder and all folders below it.

    A scan is named by its path without the suffix; a scan that is alone in its folder, by that folder. Where two names
    would be the same, or one folder lie in the other, these scans are named by their whole path, which is unique.

    Parameters
    ----------
    folder : Path
        Hidden files and folders in it are passed over, links to folders are followed.

    Raises
    ------
    InputError
        Where it is no folder, or there is no scan in it.

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
        raise InputError(f"{folder} is one scan; a folder of scans is wanted here, and planish restore takes this")
    folder = folder.absolute()  # workers elsewhere stand in other folders
    notes: list[str] = []
    named_scans: list[tuple[Item, str]] = []  # with the name by its whole path
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
            f"{folder} holds no scan: OBJ, PLY, GLB or glTF files or tifxyz folders are wanted in it or below it"
            + "".join(f"; {note}" for note in notes)
        )
    return ScanList(sorted(_resolve_name_conflicts(named_scans), key=lambda item: item.name), notes, folder)


def safe_name(path: Path | str) -> str:
    """A name that every system can hold; two paths never get the same one.

    Examples
    --------
    >>> safe_name("box 1/a:b."), safe_name("100%")
    ('box 1/a%3Ab%2E', '100%25')
    """
    return "/".join(_safe_component(part) for part in PurePosixPath(path).parts)


def conflicting_names(names: Iterable[str]) -> set[str]:
    """Names that stand there twice, or that are a folder of another one.

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
    if len(safe.encode()) <= MAX_NAME_BYTES:
        return safe
    return (
        safe.encode()[: MAX_NAME_BYTES - 20].decode(errors="ignore") + "~" + sha256(os.fsencode(part)).hexdigest()[:16]
    )


def _resolve_name_conflicts(named_scans: list[tuple[Item, str]]) -> list[Item]:
    """The items by their short names, those that clash by their whole ones."""
    items = [item for item, _ in named_scans]
    while conflicts := conflicting_names(item.name for item in items):
        items = [
            replace(item, name=full_path) if item.name in conflicts else item
            for item, (_, full_path) in zip(items, named_scans, strict=True)
        ]
    return items


def _walk_folders(top: Path, notes: list[str]) -> Iterator[tuple[set[str], list[Path], list[Path]]]:
    """Of every folder: the names in it, the scans and the images."""
    pending: list[tuple[Path, frozenset[tuple[int, int]]]] = [(top, frozenset())]
    while pending:
        folder, ancestors = pending.pop()
        try:
            entries = sorted((e for e in os.scandir(folder) if not e.name.startswith(".")), key=lambda e: e.name)
            here = folder.stat()
        except FileNotFoundError:
            raise InputError(f"{folder}: there is no such folder") from None
        except OSError as problem:
            notes.append(f"{folder} was left out, as it cannot be read: {problem.strerror}")
            continue
        folder_id = (here.st_dev, here.st_ino)
        if folder_id in ancestors:
            notes.append(f"{folder} was left out: it is a link to a folder that it lies in")
            continue
        scans, images = [], []
        for entry in entries:
            path = Path(entry.path)
            if entry.is_dir():
                if is_tifxyz(path):
                    scans.append(path)
                else:
                    pending.append((path, ancestors | {folder_id}))
            elif path.suffix.lower() in SCANS and (entry.is_file() or entry.is_symlink()):
                scans.append(path)
            elif path.suffix.lower() in IMAGES and entry.is_file():
                images.append(path)
        yield {entry.name for entry in entries}, scans, images
