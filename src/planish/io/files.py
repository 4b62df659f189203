"""Bytes to and from the disk: a finished file or none, and every failure as one sentence."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import shutil
from collections.abc import Callable, Container, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import asdict, is_dataclass
from pathlib import Path
from threading import RLock
from typing import Any

import numpy as np

from planish.errors import InputError, OutputError
from planish.io.atomic import AtomicFile
from planish.io.pipes import is_stream, read_by_somebody
from planish.memory import check_memory
from planish.types import Report

_REASONS = {
    errno.ENOSPC: "there is no room left on the disk; free some, or write elsewhere",
    errno.EDQUOT: "your disk quota is used up; free some room, or write elsewhere",
    errno.EFBIG: "the file would be larger than this system allows",
    errno.EACCES: "writing there is not permitted; choose another folder",
    errno.EPERM: "writing there is not permitted; choose another folder",
    errno.EROFS: "the file system is read-only; choose another folder",
    errno.ENAMETOOLONG: "its name is too long",
}


_PART = 1 << 26
"""Bytes that are read at a time where a file's size is not known."""

_WAITING: ContextVar[list[tuple[AtomicFile, Path]] | None] = ContextVar("_WAITING", default=None)
"""Finished files and the names that they shall get, inside `all_or_nothing`."""


_DIGESTS: ContextVar[dict[Path, str] | None] = ContextVar("_DIGESTS", default=None)
"""SHA-256 of the files read inside `recording_digests`."""

_STREAMS: ContextVar[dict[Path, bytes] | None] = ContextVar("_STREAMS", default=None)
"""What came out of pipes inside `recording_digests`: they give it but once."""

_UNFINISHED: dict[int, Callable[[], None]] = {}
"""What takes away the files that are being written just now."""

_PLACING = RLock()
"""Held while files take their places together, so that no signal comes between them."""


def drop_unfinished() -> None:
    """Take away all that is half-written, for a process that is about to end in the middle of it."""
    with _PLACING:
        for cleanup in list(_UNFINISHED.values()):
            cleanup()


@contextmanager
def cleanup_on_exit(cleanup: Callable[[], None]) -> Iterator[None]:
    """Tidy at the end of the block, or when the process ends within."""
    _UNFINISHED[id(cleanup)] = cleanup
    try:
        yield
    finally:
        cleanup()
        del _UNFINISHED[id(cleanup)]


@contextmanager
def recording_digests() -> Iterator[dict[Path, str]]:
    """Record the SHA-256 of every file that `read_bytes` reads in the block, of the very bytes that are used.

    A pipe may be read more than once in the block, though it gives its bytes but once.
    """
    digests: dict[Path, str] = {}
    token, streams = _DIGESTS.set(digests), _STREAMS.set({})
    try:
        yield digests
    finally:
        _DIGESTS.reset(token)
        _STREAMS.reset(streams)


def read_bytes(path: str | Path) -> bytes:
    """Read a whole file that must hold something.

    Raises
    ------
    InputError
        If there is no such file, it is a folder, it is empty, it does not fit into the memory, or the system refuses.
    """
    path, streams = Path(path), _STREAMS.get()
    if streams is not None and path in streams:
        return streams[path]
    with _reading(path), path.open("rb") as file:
        size = os.fstat(file.fileno()).st_size
        check_memory(size, f"reading {path}", "close other programs, or give a smaller file")
        parts = [file.read(size)]
        while part := file.read(_PART):  # of a pipe or a device, whose size is not known
            parts.append(part)
            size += len(part)
            check_memory(size, f"reading {path}, which has no end so far,", "is it the right file?")
    data = parts[0] if len(parts) == 1 else b"".join(parts)
    if not data:
        raise InputError(f"{path} is empty (0 bytes); was it copied or downloaded to its end?")
    if (digests := _DIGESTS.get()) is not None:
        digests[path] = hashlib.sha256(data).hexdigest()
    if streams is not None and is_stream(path):
        streams[path] = data
    return data


def is_folder(path: Path) -> bool:
    """Whether there is a folder of this name.

    Raises
    ------
    InputError
        If the system does not tell: the name is too long, or looking there is not permitted.
    """
    with _reading(path):
        return path.is_dir()


def files_in(folder: Path, suffixes: Container[str]) -> list[Path]:
    """The files in a folder that have one of these suffixes, in small letters, and are not hidden; by name.

    Raises
    ------
    InputError
        If the folder cannot be read.
    """
    with _reading(folder):
        return sorted(p for p in folder.iterdir() if p.suffix.lower() in suffixes and not p.name.startswith("."))


@contextmanager
def _reading(path: Path) -> Iterator[None]:
    """Turn the system's errors into sentences."""
    try:
        yield
    except FileNotFoundError:
        raise InputError(f"{path}: there is no such file") from None
    except IsADirectoryError:
        raise InputError(f"{path} is a folder; the name of a file in it is wanted") from None
    except (OSError, ValueError) as problem:  # ValueError: a null byte in the name
        raise InputError(f"{path} cannot be read: {getattr(problem, 'strerror', None) or problem}") from None


def check_writable(path: str | Path, *, overwrite: bool = True) -> None:
    """Refuse now what `writing` would refuse after long work.

    Raises
    ------
    OutputError
        If the folder does not exist or cannot be written to, the name is a folder's, or the file exists and
        `overwrite` is false.
    """
    path = Path(path)
    with translate_os_errors(path):
        _check_writable(path, overwrite)


def _check_writable(path: Path, overwrite: bool) -> None:
    if not path.name:
        raise OutputError(f"{path} is a folder; the name of a file to write is wanted")
    folder = path.resolve().parent
    if not folder.exists():
        raise OutputError(f"{path} cannot be written: there is no folder {folder}; make it first")
    if not folder.is_dir():
        raise OutputError(f"{path} cannot be written: {folder} is a file, not a folder")
    if path.is_dir() and not is_tifxyz(path):
        raise OutputError(f"{path} is a folder; the name of a file to write is wanted")
    if path.exists() and not overwrite:
        raise OutputError(f"{path} exists already", "give another name, or allow overwriting with {overwrite}")
    if not os.access(path if is_stream(path) else folder, os.W_OK):
        raise OutputError(f"{path} cannot be written: {_REASONS[errno.EACCES]}")


def is_tifxyz(path: Path) -> bool:
    """Whether this is a folder with the files of a tifxyz: the one mesh format that is a folder."""
    return all((path / name).is_file() for name in ("meta.json", "x.tif", "y.tif", "z.tif"))


def make_folder(path: str | Path) -> None:
    """Make a folder, and those above it, if there is none.

    Raises
    ------
    OutputError
        If a file stands there, or the system refuses.
    """
    path = Path(path)
    with translate_os_errors(path):
        try:
            path.mkdir(parents=True, exist_ok=True)
        except (FileExistsError, NotADirectoryError):
            raise OutputError(f"{path} cannot be made into a folder: a file stands there; give another name") from None


@contextmanager
def writing(path: str | Path) -> Iterator[Path]:
    """Give a name beside `path` to write to; when the block ends well, that file takes the place of `path`.

    When it does not end well (an error, Ctrl-C), what was written is removed and what stood at `path` still stands.

    Raises
    ------
    OutputError
        For every error of the system, as one sentence.
    """
    path = Path(path)
    check_writable(path)
    if is_stream(path):  # a pipe or /dev/stdout must be written to, not replaced
        with translate_os_errors(path), read_by_somebody(path):
            yield path
        return
    target = path.resolve()  # through a symbolic link
    with translate_os_errors(path):
        part = AtomicFile(target)
    waiting, handed_on = _WAITING.get(), False

    def cleanup() -> None:
        if not handed_on:
            part.drop()

    with cleanup_on_exit(cleanup), translate_os_errors(path):
        yield part.path
        if target.exists():
            shutil.copymode(target, part.path)
        part.sync()
        if waiting is None:
            part.take_place(target)
        else:
            waiting.append((part, target))
            handed_on = True


@contextmanager
def all_or_nothing() -> Iterator[None]:
    """Let the files that are written inside take their places together, at the end; none of them if it ends badly.

    Folders (tifxyz) and pipes are written at once all the same. Within another such block the files wait for its end.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with all_or_nothing():
    ...         write_bytes(f"{folder}/a.txt", b"one")
    ...         write_bytes(f"{folder}/b.txt", b"two")
    ...         before = [path.suffix for path in Path(folder).iterdir()]
    ...     before, sorted(path.name for path in Path(folder).iterdir())
    (['.part', '.part'], ['a.txt', 'b.txt'])
    """
    waiting: list[tuple[AtomicFile, Path]] = []

    def cleanup() -> None:
        for part, _ in waiting:
            part.drop()

    outer = _WAITING.get()
    mark = _WAITING.set(waiting)
    with cleanup_on_exit(cleanup):
        try:
            yield
        finally:
            _WAITING.reset(mark)
        if outer is not None:
            outer += waiting
            waiting.clear()
        with _PLACING:
            for part, target in waiting:
                with translate_os_errors(target):
                    part.take_place(target)


@contextmanager
def writing_folder(path: str | Path) -> Iterator[Path]:
    """Give a folder beside `path` to write a tifxyz to; when the block ends well, it takes the place of `path`.

    Raises
    ------
    OutputError
        If something else than a tifxyz stands there, and for every error of the system.
    """
    path = Path(path)
    check_writable(path)
    target = path.resolve()
    if target.is_file():
        raise OutputError(f"{path} is a file, not a folder; give another name")
    with translate_os_errors(path):
        part = AtomicFile(target, folder=True)
    before = part.path.with_suffix(".before")

    def cleanup() -> None:
        if before.exists() and not target.exists():
            before.rename(target)
        part.drop()
        shutil.rmtree(before, ignore_errors=True)

    with cleanup_on_exit(cleanup), translate_os_errors(path):
        yield part.path
        part.sync()
        shutil.rmtree(before, ignore_errors=True)
        if target.exists():
            target.rename(before)
        part.take_place(target)


def write_bytes(path: str | Path, data: bytes | Iterable[bytes]) -> None:
    """Write a whole file, or none of it.

    Parameters
    ----------
    path : str or Path
    data : bytes, or an iterable of bytes
        An iterable may make its parts while they are written.

    Raises
    ------
    OutputError
        If it cannot be written; a file that stood there still stands.
    """
    with writing(path) as beside, beside.open("wb") as file:
        for part in [data] if isinstance(data, bytes) else data:
            file.write(part)


def write_json(path: str | Path, report: Any) -> None:
    """Write a dataclass or a mapping as JSON, numbers that are not finite as null.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_json(f"{folder}/a.json", {"rms_mm": np.float64(0.5), "max_mm": float("nan")})
    ...     print(Path(f"{folder}/a.json").read_text())
    {
      "rms_mm": 0.5,
      "max_mm": null
    }
    """
    if isinstance(report, Report):
        report = report.to_dict()
    plain = _plain(asdict(report) if is_dataclass(report) and not isinstance(report, type) else report)
    text = json.dumps(plain, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    write_bytes(path, text.encode(errors="backslashreplace"))  # names of files may be no text


@contextmanager
def translate_os_errors(path: Path) -> Iterator[None]:
    """Turn the system's errors into sentences."""
    try:
        yield
    except (BrokenPipeError, OutputError):  # an OutputError is an OSError too
        raise
    except OSError as problem:
        reason = _REASONS.get(problem.errno or 0) or problem.strerror or str(problem)
        raise OutputError(f"{path} cannot be written: {reason}") from problem


def _plain(value: Any) -> Any:
    """Only what JSON knows: dict, list, str, int, float, bool, None."""
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
