"""Bytes to and from the disk: a finished file or none, and every failure as one sentence."""

from __future__ import annotations

import errno
import json
import os
import secrets
import shutil
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from planish.errors import InputError, OutputError

_REASONS = {
    errno.ENOSPC: "there is no room left on the disk; free some, or write elsewhere",
    errno.EDQUOT: "your disk quota is used up; free some room, or write elsewhere",
    errno.EFBIG: "the file would be larger than this system allows",
    errno.EACCES: "writing there is not permitted; choose another folder",
    errno.EPERM: "writing there is not permitted; choose another folder",
    errno.EROFS: "the file system is read-only; choose another folder",
    errno.ENAMETOOLONG: "its name is too long",
}


_WAITING: ContextVar[list[tuple[Path, Path]] | None] = ContextVar("_WAITING", default=None)
"""Finished files and the names that they shall get, inside `all_or_nothing`."""


_UNFINISHED: dict[int, Callable[[], None]] = {}
"""What takes away the files that are being written just now."""


def drop_unfinished() -> None:
    """Take away all that is half-written, for a process that is about to end in the middle of it."""
    for tidy in list(_UNFINISHED.values()):
        tidy()


@contextmanager
def _tidied(tidy: Callable[[], None]) -> Iterator[None]:
    """Tidy at the end of the block, or when the process ends within."""
    _UNFINISHED[id(tidy)] = tidy
    try:
        yield
    finally:
        tidy()
        del _UNFINISHED[id(tidy)]


def read_bytes(path: str | Path) -> bytes:
    """Read a whole file that must hold something.

    Raises
    ------
    InputError
        If there is no such file, it is a folder, it is empty, or the system refuses.
    """
    path = Path(path)
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        raise InputError(f"{path}: there is no such file") from None
    except IsADirectoryError:
        raise InputError(f"{path} is a folder; the name of a file in it is wanted") from None
    except (OSError, ValueError) as problem:  # ValueError: a null byte in the name
        raise InputError(f"{path} cannot be read: {getattr(problem, 'strerror', None) or problem}") from None
    if not data:
        raise InputError(f"{path} is empty (0 bytes); was it copied or downloaded to its end?")
    return data


def check_writable(path: str | Path, *, overwrite: bool = True) -> None:
    """Refuse now what `writing` would refuse after long work.

    Raises
    ------
    OutputError
        If the folder does not exist or cannot be written to, the name is a folder's, or the file exists and
        `overwrite` is false.
    """
    path = Path(path)
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
        raise OutputError(f"{path} exists already; give another name, or allow overwriting with --overwrite")
    if not os.access(path if _is_stream(path) else folder, os.W_OK):
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
    with _telling(path):
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
    if _is_stream(path):  # a pipe or /dev/stdout must be written to, not replaced
        with _telling(path):
            yield path
        return
    target = path.resolve()  # through a symbolic link
    beside = target.with_name(f".{target.name[:100]}.{secrets.token_hex(4)}.part")
    waiting, finished = _WAITING.get(), False

    def tidy() -> None:
        if not finished:
            beside.unlink(missing_ok=True)

    with _tidied(tidy), _telling(path):
        yield beside
        if target.exists():
            shutil.copymode(target, beside)
        if waiting is None:
            beside.replace(target)
        else:
            waiting.append((beside, target))
            finished = True


@contextmanager
def all_or_nothing() -> Iterator[None]:
    """Let the files that are written inside take their places together, at the end; none of them if it ends badly.

    Folders (tifxyz) and pipes are written at once all the same.

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
    waiting: list[tuple[Path, Path]] = []

    def tidy() -> None:
        for beside, _ in waiting:
            beside.unlink(missing_ok=True)

    mark = _WAITING.set(waiting)
    with _tidied(tidy):
        try:
            yield
        finally:
            _WAITING.reset(mark)
        for beside, target in waiting:
            with _telling(target):
                beside.replace(target)


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
    beside = target.with_name(f".{target.name[:100]}.{secrets.token_hex(4)}.part")
    before = beside.with_suffix(".before")

    def tidy() -> None:
        if before.exists() and not target.exists():
            before.rename(target)
        shutil.rmtree(beside, ignore_errors=True)
        shutil.rmtree(before, ignore_errors=True)

    with _tidied(tidy), _telling(path):
        beside.mkdir()
        yield beside
        if target.exists():
            target.rename(before)
        beside.rename(target)


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
    plain = _plain(asdict(report) if is_dataclass(report) and not isinstance(report, type) else report)
    write_bytes(path, (json.dumps(plain, indent=2, ensure_ascii=False, allow_nan=False) + "\n").encode())


def _is_stream(path: Path) -> bool:
    return path.exists() and not path.is_file() and not path.is_dir()


@contextmanager
def _telling(path: Path) -> Iterator[None]:
    """Turn the system's errors into sentences."""
    try:
        yield
    except BrokenPipeError:
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
