"""Atomic writes: a temporary file beside the target, marked as its writer's, then renamed.

Where open files can be locked, the writer locks it: the system drops the lock however the process ends. Elsewhere
(Windows) its name bears the number of the process. So what a killed process left behind is known as such, and taken
away by the next one that writes to the same place; what a living one is writing is left alone.
"""

from __future__ import annotations

import glob
import itertools
import os
import shutil
import time
from contextlib import suppress
from pathlib import Path

from planish.system import OPEN_FILES_CAN_BE_LOCKED, flush_to_disk, is_running, lock_open_file

_LONGEST = 100
"""Bytes of the target's name that an unfinished file bears: systems take 255."""

_PATIENCE = 2.0
"""Seconds that a file which another program holds open (a viewer, a virus scanner; Windows) is waited for."""


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
        start = f".{os.fsencode(target.name)[:_LONGEST].decode(errors='ignore')}."
        kind = _LockedPart if OPEN_FILES_CAN_BE_LOCKED else _NumberedPart
        self._part: _LockedPart | _NumberedPart | None = kind(target.with_name(start), folder)
        self.path = self._part.path

    def sync(self) -> None:
        """Bring what was written to the disk, so that it is whole also if the power goes."""
        assert self._part is not None
        for file in self.path.iterdir() if self.path.is_dir() else ():
            flush_to_disk(file)
        self._part.sync()

    def take_place(self, target: Path) -> None:
        """Become `target`."""
        end = time.monotonic() + _PATIENCE
        while True:
            try:
                self.path.replace(target)
                break
            except PermissionError:
                if OPEN_FILES_CAN_BE_LOCKED or time.monotonic() > end:
                    raise
                time.sleep(0.05)
        self.drop()

    def drop(self) -> None:
        """Take away what was written, unless it has taken its place."""
        if self._part is not None:
            part, self._part = self._part, None
            part.drop()


class _LockedPart:
    """A new file or folder, locked as long as it is being written."""

    def __init__(self, start: Path, folder: bool):
        for number in itertools.count():
            self.path = start.with_name(f"{start.name}{number}.part")
            lock = _locked(self.path, folder)
            if lock is None and _removed_if_left(self.path):
                lock = _locked(self.path, folder)
            if lock is not None:
                self._lock = lock
                break

    def sync(self) -> None:
        os.fsync(self._lock)

    def drop(self) -> None:
        if _is(self.path, self._lock):
            _remove(self.path)
        os.close(self._lock)


class _NumberedPart:
    """A new file or folder with its process's number in its name, for systems that rename nothing that is open."""

    def __init__(self, start: Path, folder: bool):
        for left in start.parent.glob(f"{glob.escape(start.name)}*-*.part"):
            pid = left.name[len(start.name) :].partition("-")[0]
            if pid.isdecimal() and not is_running(int(pid)):
                with suppress(OSError):
                    _remove(left)
        for number in itertools.count():
            self.path = start.with_name(f"{start.name}{os.getpid()}-{number}.part")
            with suppress(FileExistsError):
                self.path.mkdir() if folder else self.path.touch(exist_ok=False)
                break

    def sync(self) -> None:
        if self.path.is_file():
            flush_to_disk(self.path)

    def drop(self) -> None:
        with suppress(FileNotFoundError):
            _remove(self.path)


def _locked(path: Path, folder: bool) -> int | None:
    """A new, locked file or folder; None where there is one, or another process was faster."""
    try:
        if folder:
            path.mkdir()
        lock = os.open(path, os.O_RDONLY if folder else os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o666)
    except (FileExistsError, FileNotFoundError):
        return None
    lock_open_file(lock, wait=True)  # who has it now is just finding out whether this was left behind
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
        if lock_open_file(lock, wait=False) and _is(path, lock):
            _remove(path)
        return not path.exists()
    except OSError:  # it belongs to somebody else
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
