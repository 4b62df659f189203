"""Atomic writes: a temporary file beside the target, locked by the process that writes it, then renamed.

The system drops the lock however the process ends. So what a killed process left behind is known as such, and taken
away by the next one that writes to the same place; what a living one is writing is left alone.
"""

from __future__ import annotations

import fcntl
import itertools
import os
import shutil
from contextlib import suppress
from pathlib import Path

_LONGEST = 100
"""Bytes of the target's name that an unfinished file bears: systems take 255."""


class AtomicFile:
    """A file, or a folder, that is being written beside its place.

    Parameters
    ----------
    target : Path
    folder : bool
        Make a folder instead of a file.

    Attributes
    ----------
    path : Path
        Where to write; there is an empty file, or an empty folder.
    """

    def __init__(self, target: Path, *, folder: bool = False):
        start = os.fsencode(target.name)[:_LONGEST].decode(errors="ignore")
        for number in itertools.count():
            self.path = target.with_name(f".{start}.{number}.part")
            self._lock = _made(self.path, folder)
            if self._lock is None and _removed_if_left(self.path):
                self._lock = _made(self.path, folder)
            if self._lock is not None:
                break

    def sync(self) -> None:
        """Bring what was written to the disk, so that it is whole also if the power goes."""
        assert self._lock is not None
        for inside in self.path.iterdir() if self.path.is_dir() else ():
            with inside.open("rb") as file:
                os.fsync(file.fileno())
        os.fsync(self._lock)

    def take_place(self, target: Path) -> None:
        """Become `target`."""
        self.path.replace(target)
        self.drop()

    def drop(self) -> None:
        """Take away what was written, unless it has taken its place."""
        if self._lock is None:
            return
        lock, self._lock = self._lock, None
        if _is(self.path, lock):
            _remove(self.path)
        os.close(lock)


def _made(path: Path, folder: bool) -> int | None:
    """A new, locked file or folder; None where there is one, or another process was faster."""
    try:
        if folder:
            path.mkdir()
        lock = os.open(path, os.O_RDONLY if folder else os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o666)
    except (FileExistsError, FileNotFoundError):
        return None
    with suppress(OSError):  # some network drives know no locks
        fcntl.flock(lock, fcntl.LOCK_EX)  # who has it now is just finding out whether this was left behind
    if _is(path, lock):
        return lock
    os.close(lock)
    return None


def _removed_if_left(path: Path) -> bool:
    """Whether this was left behind by a process that is no more, and could be taken away."""
    try:
        lock = os.open(path, os.O_RDONLY)
    except OSError:
        return False
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if _is(path, lock):
            _remove(path)
        return not path.exists()
    except OSError:  # it is being written, belongs to somebody else, or there are no locks
        return False
    finally:
        os.close(lock)


def _is(path: Path, opened: int) -> bool:
    """Whether this name still leads to the file that was opened."""
    with suppress(OSError):
        return os.path.samestat(path.stat(), os.fstat(opened))
    return False


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink()
