"""Stream files as a zip archive without a temporary file."""

from __future__ import annotations

import os
import zipfile
from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from pathlib import Path
from time import localtime
from typing import BinaryIO
from urllib.parse import quote

from starlette.responses import StreamingResponse
from starlette.types import Receive, Scope, Send

_CHUNK_BYTES = 1 << 18


class _StreamBuffer:
    """Unseekable file object whose bytes are taken out after each write."""

    def __init__(self) -> None:
        self.buffer = bytearray()

    def write(self, data: bytes) -> int:
        self.buffer += data
        return len(data)

    def flush(self) -> None:
        pass

    def take(self) -> bytes:
        data = bytes(self.buffer)
        self.buffer.clear()
        return data


class ZipResponse(StreamingResponse):
    """Response with a zip of some files, which are opened at once: it is whole even if they are deleted meanwhile.

    Raises
    ------
    FileNotFoundError
        When it is created.
    """

    def __init__(self, paths: list[Path], name: str):
        with ExitStack() as opening:
            files = [opening.enter_context(path.open("rb")) for path in paths]
            self._opened = opening.pop_all()
        headers = {"content-disposition": f"attachment; filename*=utf-8''{quote(name)}"}
        super().__init__(stream_zip(files), media_type="application/zip", headers=headers)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send it; the files are closed also when the client leaves."""
        with self._opened:
            await super().__call__(scope, receive, send)


def stream_zip(files: Iterable[BinaryIO]) -> Iterator[bytes]:
    """Yield chunks of a zip of open files, stored without compression: images and PDFs are compressed already.

    Examples
    --------
    >>> import io, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "page.txt"
    ...     _ = path.write_text("flat")
    ...     with path.open("rb") as file:
    ...         data = b"".join(stream_zip([file]))
    >>> zipfile.ZipFile(io.BytesIO(data)).read("page.txt")
    b'flat'
    """
    pipe = _StreamBuffer()
    with zipfile.ZipFile(pipe, "w", zipfile.ZIP_STORED) as archive:  # type: ignore[call-overload]
        for source in files:
            status = os.fstat(source.fileno())
            entry = zipfile.ZipInfo(Path(source.name).name, localtime(status.st_mtime)[:6])
            with archive.open(entry, "w", force_zip64=status.st_size > 1 << 31) as target:
                while chunk := source.read(_CHUNK_BYTES):
                    target.write(chunk)
                    yield pipe.take()
    yield pipe.take()
