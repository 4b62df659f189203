"""What a batch has done so far: a file that only grows, one line an item, each on the disk before the next begins.

Not SQLite: its write-ahead log does not work on network file systems, where shelves of scans stand, and one writer
that only appends needs no more than this. A kill can at most cut the last line short, which is then left out. The
folders of the items hold the same facts once more (`item.json`), so that even a lost journal costs no work.
"""

from __future__ import annotations

import json
import os
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from planish.batch.inputs import FileStamp
from planish.batch.items import Item
from planish.batch.row import Row, row_from_json
from planish.io.files import telling, write_bytes


@dataclass(frozen=True)
class Entry:
    """An item that was done, or that failed.

    Attributes
    ----------
    row : Row
    item_as_json : list
        What the user gave, or what lay beside the scan.
    options, inputs : str
        Fingerprints of the order and of the content of the files: where both are the same, nothing is to be done.
    file_stamps : tuple of FileStamp
        Of these files.
    """

    row: Row
    item: list[Any]
    options: str
    inputs: str
    file_stamps: tuple[FileStamp, ...]

    def is_current(self, item: Item, options: str) -> bool:
        """Whether nothing has changed since, as far as can be seen without reading the files."""
        return (
            self.options == options
            and self.item == item_as_json(item)
            and all(stamp.is_current() for stamp in self.file_stamps)
        )


def item_as_json(item: Item) -> list[Any]:
    """An item's files and unit as plain JSON."""
    near = [None if path is None else os.fspath(path) for path in (item.nearby_photo, item.nearby_camera)]
    return [os.fspath(item.scan), [*map(os.fspath, item.photo)], [*map(os.fspath, item.camera)], *near, item.units]


class Journal:
    """The entries by the names of their items; made from the file, and kept on it.

    Examples
    --------
    >>> import tempfile
    >>> entry = Entry(Row(name="a", status="good"), [], "o", "i", ())
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with Journal(Path(f"{folder}/journal.jsonl")) as journal:
    ...         journal.add(entry)
    ...     with Journal(Path(f"{folder}/journal.jsonl")) as journal:
    ...         journal.entries["a"] == entry
    True
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.entries: dict[str, Entry] = {}

    def __enter__(self) -> Journal:
        lines = self.path.read_bytes().split(b"\n") if self.path.exists() else []
        self.entries = {entry.row.name: entry for line in lines if (entry := _parse_line(line))}
        if len(lines) != len(self.entries) + 1:  # entries that were followed by others, or a line that was cut short
            write_bytes(self.path, (_format_line(entry) for entry in self.entries.values()))
        with telling(self.path):
            self._file = self.path.open("ab")
        return self

    def __exit__(self, *problem: object) -> None:
        self._file.close()

    def add(self, entry: Entry) -> None:
        """Note an entry; when this returns, it is on the disk."""
        with telling(self.path):
            self._file.write(_format_line(entry))
            self._file.flush()
            os.fsync(self._file.fileno())
        self.entries[entry.row.name] = entry


def _format_line(entry: Entry) -> bytes:
    plain = {**asdict(entry), "row": entry.row.plain()}
    return json.dumps(plain, separators=(",", ":"), allow_nan=False).encode() + b"\n"


def _parse_line(line: bytes) -> Entry | None:
    try:
        plain = json.loads(line)
        row = row_from_json(plain["row"])
        file_stamps = tuple(FileStamp(**stamp) for stamp in plain["file_stamps"])
        return None if row is None else Entry(row, plain["item"], plain["options"], plain["inputs"], file_stamps)
    except (ValueError, TypeError, KeyError):
        return None
