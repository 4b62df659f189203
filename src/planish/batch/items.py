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
LONGEST_PART = 200
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
    near_photo, near_camera : Path or None
        That lie beside the scan; they are used where the scan's file has no photo of its own.
    units : {"auto", "mm", "cm", "m", "in"}
    """

    name: str
    scan: Path
    photo: tuple[Path, ...] = ()
    camera: tuple[Path, ...] = ()
    near_photo: Path | None = None
    near_camera: Path | None = None
    units: Units = "auto"


@dataclass(frozen=True)
class Found:
    """The items in the order of their names, what a user should know of the search, and the folder searched, if any."""

    items: list[Item]
    notes: list[str] = field(default_factory=list)
    folder: Path | None = None


def find_items(folder: Path) -> Found:
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
    found: list[tuple[Item, str]] = []  # with the name by its whole path
    for entries, scans, images in _folders(folder, notes):
        for scan in scans:
            whole = scan.relative_to(folder)
            alone = len(scans) == 1 and scan.parent != folder and not scan.is_dir()
            short = whole.parent if alone else whole.with_suffix("")
            photos = [image for image in images if image.stem == scan.stem] or (images if len(scans) == 1 else [])
            cameras = [scan.parent / name for name in (f"{scan.stem}_camera.json", "camera.json") if name in entries]
            item = Item(
                name=safe_name(whole if str(short) in RESERVED else short),
                scan=scan,
                near_photo=photos[0] if len(photos) == 1 else None,
                near_camera=cameras[0] if cameras else None,
            )
            found.append((item, safe_name(whole)))
    if not found:
        raise InputError(
            f"{folder} holds no scan: OBJ, PLY, GLB or glTF files or tifxyz folders are wanted in it or below it"
            + "".join(f"; {note}" for note in notes)
        )
    return Found(sorted(_named_apart(found), key=lambda item: item.name), notes, folder)


def safe_name(path: Path | str) -> str:
    """A name that every system can hold; two paths never get the same one.

    Examples
    --------
    >>> safe_name("box 1/a:b."), safe_name("100%")
    ('box 1/a%3Ab%2E', '100%25')
    """
    return "/".join(_safe_part(part) for part in PurePosixPath(path).parts)


def clashes(names: Iterable[str]) -> set[str]:
    """Names that stand there twice, or that are a folder of another one.

    Examples
    --------
    >>> sorted(clashes(["a", "a/b", "c", "d", "d"]))
    ['a', 'a/b', 'd']
    """
    every = list(names)
    known = Counter(every)
    bad = {name for name, times in known.items() if times > 1}
    for name in known:
        for above in PurePosixPath(name).parents:
            if str(above) in known:
                bad |= {name, str(above)}
    return bad


def _safe_part(part: str) -> str:
    def marked(unsafe: re.Match[str]) -> str:
        return "".join(f"%{byte:02X}" for byte in os.fsencode(unsafe[0]))

    safe = _UNSAFE.sub(marked, part)
    if len(safe.encode()) <= LONGEST_PART:
        return safe
    return safe.encode()[: LONGEST_PART - 20].decode(errors="ignore") + "~" + sha256(os.fsencode(part)).hexdigest()[:16]


def _named_apart(found: list[tuple[Item, str]]) -> list[Item]:
    """The items by their short names, those that clash by their whole ones."""
    items = [item for item, _ in found]
    while bad := clashes(item.name for item in items):
        items = [
            replace(item, name=whole) if item.name in bad else item
            for item, (_, whole) in zip(items, found, strict=True)
        ]
    return items


def _folders(top: Path, notes: list[str]) -> Iterator[tuple[set[str], list[Path], list[Path]]]:
    """Of every folder: the names in it, the scans and the images."""
    waiting: list[tuple[Path, frozenset[tuple[int, int]]]] = [(top, frozenset())]
    while waiting:
        folder, above = waiting.pop()
        try:
            entries = sorted((e for e in os.scandir(folder) if not e.name.startswith(".")), key=lambda e: e.name)
            here = folder.stat()
        except FileNotFoundError:
            raise InputError(f"{folder}: there is no such folder") from None
        except OSError as problem:
            notes.append(f"{folder} was left out, as it cannot be read: {problem.strerror}")
            continue
        mark = (here.st_dev, here.st_ino)
        if mark in above:
            notes.append(f"{folder} was left out: it is a link to a folder that it lies in")
            continue
        scans, images = [], []
        for entry in entries:
            path = Path(entry.path)
            if entry.is_dir():
                if is_tifxyz(path):
                    scans.append(path)
                else:
                    waiting.append((path, above | {mark}))
            elif path.suffix.lower() in SCANS and (entry.is_file() or entry.is_symlink()):
                scans.append(path)
            elif path.suffix.lower() in IMAGES and entry.is_file():
                images.append(path)
        yield {entry.name for entry in entries}, scans, images
