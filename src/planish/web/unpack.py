"""Unpack untrusted zip files."""

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
"""Maximum bytes of an entry of the central directory: name and metadata."""
_MAX_COMPRESSION_RATIO = 200
"""Maximum compression ratio, against zip bombs: text meshes reach 5, blank images 100."""
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
"""Exceptions of zipfile on damaged files and on unsupported compression methods."""


def unpack(path: Path, folder: Path, limits: ServeSettings) -> list[Path]:
    """Extract the files of a zip into one folder, without its folder structure.

    Parameters
    ----------
    path : Path
        The zip file.
    folder : Path
        Destination; only regular files are created, only directly in it.
    limits : ServeSettings

    Returns
    -------
    list of Path

    Raises
    ------
    HTTPProblem
        413 if a limit is exceeded, also by unpacked sizes; 422 for damaged files, paths outside the folder, links,
        encryption, nested zip files.
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
        raise HTTPProblem(422, f"{name} is a damaged zip file ({reason[:100]!a}); create it again") from None


def _check_directory_size(path: Path, limits: ServeSettings) -> None:
    """Refuse a large central directory before it is read into memory."""
    size = path.stat().st_size
    with path.open("rb") as file:
        file.seek(max(0, size - _TAIL - 20))
        tail = file.read()
    if _END_64 in tail:
        raise HTTPProblem(413, f"{path.name} is a ZIP64 file (more than 4 GB or 65,535 files); send less")
    for match in re.finditer(re.escape(_END), tail):
        if match.start() + 22 > len(tail):
            continue
        (length,) = struct.unpack_from("<I", tail, match.start() + 12)
        if length > 2 * limits.files * _MAX_BYTES_PER_ENTRY:
            raise HTTPProblem(413, f"{path.name} contains more than {limits.files} files; include the scan only")


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
        raise HTTPProblem(422, f"{name} contains {shown}, a path outside of it; create it again with plain names")
    kind = stat.S_IFMT(entry.external_attr >> 16)
    if kind not in (0, stat.S_IFREG):
        raise HTTPProblem(422, f"{name} contains {shown}, a link or device; include regular files only")
    if entry.flag_bits & 1:
        raise HTTPProblem(422, f"{name} is encrypted; create it without a password")
    if name_in_zip.lower().endswith(".zip"):
        raise HTTPProblem(422, f"{name} contains another zip file, {shown}; send that one")


def _check_total(path: Path, entries: list[zipfile.ZipInfo], limits: ServeSettings) -> None:
    if not entries:
        raise HTTPProblem(422, f"{path.name} contains no file")
    if len(entries) > limits.files:
        raise HTTPProblem(413, f"{path.name} contains {len(entries)} files; the limit is {limits.files}")
    total = sum(entry.file_size for entry in entries)
    if total > limits.unpacked_mb * 1e6:
        raise HTTPProblem(413, f"{path.name} contains {total / 1e6:.0f} MB; the limit is {limits.unpacked_mb:g}")
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
                    raise zipfile.BadZipFile("a file is larger than declared")
                file.write(chunk)
    except FileExistsError:
        raise HTTPProblem(422, f"two files in the zip are called {target.name!a}; include one scan only") from None
    return target
