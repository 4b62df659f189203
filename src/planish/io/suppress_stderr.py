"""Quiet decoders: what C libraries print about a damaged file, planish reports itself, in one sentence."""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from threading import Lock

from planish.io.files import cleanup_on_exit

_STDERR = 2

OWN_PROCESS = "PLANISH_OWN_PROCESS"
"""Environment variable that the command line sets; worker processes inherit it."""

_lock = Lock()
_inside = 0
_kept: int | None = None


@contextmanager
def suppress_stderr() -> Iterator[None]:
    """Let nothing reach stderr inside the block: no warning of Python's, no print of libtiff or libpng.

    Those print to the file descriptor itself. It is redirected only in processes that are planish's own, the command
    line and its workers (`OWN_PROCESS` in the environment): in a program that uses planish as a library, other threads
    may print meanwhile.

    Examples
    --------
    >>> os.environ[OWN_PROCESS] = "1"
    >>> with suppress_stderr():
    ...     _ = os.write(2, b"TIFFFillStrip: Read error on strip 0")
    >>> del os.environ[OWN_PROCESS]
    """

    def turn_back() -> None:
        global _inside, _kept
        with _lock:
            _inside -= 1
            if _inside == 0 and _kept is not None:
                os.dup2(_kept, _STDERR)
                os.close(_kept)
                _kept = None

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        _turn_away()
        with cleanup_on_exit(turn_back):
            yield


def _turn_away() -> None:
    global _inside, _kept
    with _lock:
        _inside += 1
        if _inside > 1 or OWN_PROCESS not in os.environ:
            return
        if sys.stderr is not None:
            sys.stderr.flush()
        with suppress(OSError):  # a process may have no stderr
            _kept = os.dup(_STDERR)
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, _STDERR)
            os.close(nowhere)
