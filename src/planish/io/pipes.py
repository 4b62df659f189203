"""Pipes and devices in place of files: they cannot be replaced, and need somebody at the other end."""

from __future__ import annotations

import errno
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from planish.errors import OutputError

_READER_SECONDS = 20.0
"""How long a pipe may be without a reader before it counts as forgotten."""


def is_stream(path: Path) -> bool:
    """Whether this is a pipe or a device."""
    return path.exists() and not path.is_file() and not path.is_dir()


@contextmanager
def read_by_somebody(path: Path) -> Iterator[None]:
    """Wait for the reader of a pipe, and say so where it goes away. Of the standard output `head` may go away."""
    opened = _open_once_read(path) if path.is_fifo() else None
    try:
        yield
    except BrokenPipeError:
        if _is_standard_output(path):
            raise
        raise OutputError(f"{path} cannot be written: the program that read it has ended") from None
    finally:
        if opened is not None:
            os.close(opened)


def _open_once_read(pipe: Path) -> int:
    end = time.monotonic() + _READER_SECONDS
    while True:
        try:
            return os.open(pipe, os.O_WRONLY | os.O_NONBLOCK)
        except OSError as problem:
            if problem.errno != errno.ENXIO:
                raise
        if time.monotonic() > end:
            raise OutputError(
                f"{pipe} cannot be written: it is a pipe that no program has read for {_READER_SECONDS:g} s",
                "start its reader first",
            )
        time.sleep(0.05)


def _is_standard_output(path: Path) -> bool:
    with suppress(OSError, ValueError):
        return os.path.samestat(path.stat(), os.fstat(1))
    return False
