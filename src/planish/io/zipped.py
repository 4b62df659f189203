"""Files inside a ZIP, as 3MF and USDZ are, with a limit on what they unpack to."""

from __future__ import annotations

import io
import zipfile
import zlib
from pathlib import Path, PurePosixPath

from planish.errors import InputError
from planish.memory import check_memory

_MOST_PACKED = 1100
"""Deflate packs into a thousandth at best."""


class Zip:
    """A ZIP in memory.

    Raises
    ------
    InputError
        If it is damaged, or would unpack to more than fits into the memory.
    """

    def __init__(self, path: Path, data: bytes):
        self.path = path
        try:
            self._zip = zipfile.ZipFile(io.BytesIO(data))
            self.names = [info.filename for info in self._zip.infolist()]
            total = sum(info.file_size for info in self._zip.infolist())
        except (zipfile.BadZipFile, ValueError, OSError, NotImplementedError) as problem:
            raise InputError(f"{path} is a ZIP that cannot be read ({problem}); was it cut short?") from None
        if total > _MOST_PACKED * len(data) + 1_000_000:
            raise InputError(f"{path} says that it unpacks to {total:,} bytes from {len(data):,}; it is damaged")
        check_memory(2.0 * total, f"unpacking {path}", "let the scanner's software reduce it")

    def read(self, name: str) -> bytes:
        """The bytes of a file in it."""
        try:
            return self._zip.read(name)
        except (zipfile.BadZipFile, zlib.error, KeyError, ValueError, OSError, EOFError, RuntimeError) as problem:
            # RuntimeError: it wants a password; NotImplementedError, one of those: packed in another way
            raise InputError(f"{self.path}: {name[:80]} in it cannot be read ({problem}); was it damaged?") from None

    def find(self, name: str) -> str | None:
        """The full name of a file that another file in the ZIP refers to."""
        wanted = PurePosixPath(name.replace("\\", "/").lstrip("/")).as_posix().removeprefix("./")
        exact = [entry for entry in self.names if entry == wanted]
        ends = [entry for entry in self.names if entry.casefold().endswith("/" + wanted.casefold())]
        same = [entry for entry in self.names if entry.casefold() == wanted.casefold()]
        found = exact or same or ends
        return found[0] if found else None
