"""Stream files as a zip archive without a temporary file."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from pathlib import Path

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


def stream_zip(paths: list[Path]) -> Iterator[bytes]:
    """Yield chunks of a zip of some files, stored without compression: images and PDFs are compressed already.

    Examples
    --------
    >>> import io, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "page.txt"
    ...     _ = path.write_text("flat")
    ...     data = b"".join(stream_zip([path]))
    >>> zipfile.ZipFile(io.BytesIO(data)).read("page.txt")
    b'flat'
    """
    pipe = _StreamBuffer()
    with zipfile.ZipFile(pipe, "w", zipfile.ZIP_STORED) as archive:  # type: ignore[call-overload]
        for path in paths:
            entry = zipfile.ZipInfo.from_file(path, path.name)
            with path.open("rb") as source, archive.open(entry, "w", force_zip64=entry.file_size > 1 << 31) as target:
                while chunk := source.read(_CHUNK_BYTES):
                    target.write(chunk)
                    yield pipe.take()
    yield pipe.take()
