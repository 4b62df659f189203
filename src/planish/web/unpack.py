"""A zip file, unpacked with suspicion."""

from __future__ import annotations

import lzma
import re
import stat
import struct
import zipfile
import zlib
from pathlib import Path, PurePosixPath

from planish.settings import ServeSettings
from planish.web.form import plain_name
from planish.web.problems import HTTPProblem

_END, _END_64, _TAIL = b"PK\x05\x06", b"PK\x06\x07", 22 + 65535
_MAX_BYTES_PER_ENTRY = 1000
"""That an entry of the list of files may take: its name, and some more."""
_MAX_COMPRESSION_RATIO = 200
"""How much smaller than its content a zip file may be: meshes as text come to a fifth, blank images to a hundredth."""
_CHUNK_BYTES = 1 << 20
_IGNORED_NAMES = {"__MACOSX", "Thumbs.db", "desktop.ini"}
_ZIP_ERRORS = (
    zipfile.BadZipFile,
    zlib.error,
    lzma.LZMAError,
    EOFError,
    OSError,
    RuntimeError,
    ValueError,
    struct.error,
)
"""What zipfile raises on damaged files, and on those that are packed in a way it does not know."""


def unpack(path: Path, folder: Path, limits: ServeSettings) -> list[Path]:
    """Write the files of a zip into a folder, those of its folders beside each other.

    Parameters
    ----------
    path : Path
        The zip.
    folder : Path
        Only plain files are made, only in here.
    limits : ServeSettings

    Returns
    -------
    list of Path

    Raises
    ------
    HTTPProblem
        413 for what is too large, or would be when unpacked; 422 for damaged files, names that lead elsewhere, links,
        passwords, a zip in a zip.
    """
    name = path.name
    _check_directory_size(path, limits)
    try:
        with zipfile.ZipFile(path) as archive:
            entries = [entry for entry in archive.infolist() if not entry.is_dir() and not _is_ignored(entry)]
            for entry in entries:
                _check_entry(name, entry)
            _check_total(path, entries, limits)
            return [_write(archive, entry, folder) for entry in entries]
    except _ZIP_ERRORS as problem:
        reason = " ".join(str(problem).split())
        raise HTTPProblem(422, f"{name} is a damaged zip file ({reason[:100]!a}); pack it again") from None


def _check_directory_size(path: Path, limits: ServeSettings) -> None:
    """Refuse a list of files that is long, before it is read into memory."""
    size = path.stat().st_size
    with path.open("rb") as file:
        file.seek(max(0, size - _TAIL - 20))
        tail = file.read()
    if _END_64 in tail:
        raise HTTPProblem(413, f"{path.name} is a zip file of the kind for more than 4 GB or 65,535 files; send less")
    for match in re.finditer(re.escape(_END), tail):
        if match.start() + 22 > len(tail):
            continue
        (length,) = struct.unpack_from("<I", tail, match.start() + 12)
        if length > 2 * limits.files * _MAX_BYTES_PER_ENTRY:
            raise HTTPProblem(413, f"{path.name} holds more than {limits.files} files; pack the scan alone")


def _is_ignored(entry: zipfile.ZipInfo) -> bool:
    parts = PurePosixPath(entry.filename).parts
    return bool(parts) and (bool(_IGNORED_NAMES & {parts[0], parts[-1]}) or parts[-1].startswith("."))


def _check_entry(name: str, entry: zipfile.ZipInfo) -> None:
    name_in_zip = entry.orig_filename
    parts = name_in_zip.split("/")
    shown = ascii(name_in_zip[:60])
    if (
        any(part in ("", ".", "..") for part in parts)
        or not name_in_zip.isprintable()
        or "\\" in name_in_zip
        or ":" in name_in_zip
    ):
        raise HTTPProblem(
            422, f"{name} holds a file called {shown}, which leads out of it; pack it again with plain names"
        )
    kind = stat.S_IFMT(entry.external_attr >> 16)
    if kind not in (0, stat.S_IFREG):
        raise HTTPProblem(422, f"{name} holds {shown}, which is a link or a device; pack plain files")
    if entry.flag_bits & 1:
        raise HTTPProblem(422, f"{name} is locked with a password; pack it without one")
    if name_in_zip.lower().endswith(".zip"):
        raise HTTPProblem(422, f"{name} holds another zip file, {shown}; send that one")


def _check_total(path: Path, entries: list[zipfile.ZipInfo], limits: ServeSettings) -> None:
    if not entries:
        raise HTTPProblem(422, f"{path.name} holds no file")
    if len(entries) > limits.files:
        raise HTTPProblem(413, f"{path.name} holds {len(entries)} files; at most {limits.files} are taken")
    total = sum(entry.file_size for entry in entries)
    if total > limits.unpacked_mb * 1e6:
        raise HTTPProblem(413, f"{path.name} holds {total / 1e6:.0f} MB; at most {limits.unpacked_mb:g} are taken")
    if total > _MAX_COMPRESSION_RATIO * path.stat().st_size:
        raise HTTPProblem(
            413,
            f"{path.name} has a compression ratio above {_MAX_COMPRESSION_RATIO} ({total / 1e6:.1f} MB unpacked), "
            "which no scan has",
        )


def _write(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, folder: Path) -> Path:
    target = folder / plain_name(PurePosixPath(entry.filename).name)
    remaining = entry.file_size
    try:
        with archive.open(entry) as source, target.open("xb") as file:
            while chunk := source.read(_CHUNK_BYTES):
                remaining -= len(chunk)
                if remaining < 0:
                    raise zipfile.BadZipFile("a file is larger than it says")
                file.write(chunk)
    except FileExistsError:
        raise HTTPProblem(422, f"two files in the zip are called {target.name!a}; pack one scan alone") from None
    return target
