"""Quiet decoders: what C libraries print about a damaged file, planish says itself, in one sentence."""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from threading import Lock

from planish.io.files import cleanup_on_exit

_STDERR = 2

_lock = Lock()
_inside = 0
_kept: int | None = None


@contextmanager
def suppress_stderr() -> Iterator[None]:
    """Let nothing reach stderr inside the block: no warning of Python's, no print of libtiff or libpng.

    Those print to the file descriptor itself, so it is turned away for the whole process while any thread is inside.

    Examples
    --------
    >>> with suppress_stderr():
    ...     _ = os.write(2, b"TIFFFillStrip: Read error on strip 0")
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
        if _inside > 1:
            return
        if sys.stderr is not None:
            sys.stderr.flush()
        with suppress(OSError):  # a process may have no stderr
            _kept = os.dup(_STDERR)
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, _STDERR)
            os.close(nowhere)
