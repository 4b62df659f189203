"""Journal of a batch: an append-only file, one JSON line per finished item, flushed to disk before the next.

SQLite is not used because its write-ahead log does not work on network file systems, where collections of scans are
often stored, and a single appending writer needs no database. A kill can truncate at most the last line, which is then
ignored. `item.json` in the folder of each item holds the same data, so a lost journal costs no work.
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
from planish.io.files import translate_os_errors, write_bytes


@dataclass(frozen=True)
class Entry:
    """A finished or failed item.

    Attributes
    ----------
    row : Row
    item_as_json : list
        Files and unit of the item, see `item_as_json`.
    options, inputs : str
        Fingerprints of the options and of the input files; if both are unchanged, the item is up to date.
    file_stamps : tuple of FileStamp
        Of the input files.
    """

    row: Row
    item: list[Any]
    options: str
    inputs: str
    file_stamps: tuple[FileStamp, ...]

    def is_current(self, item: Item, options: str) -> bool:
        """Whether options, item and files are unchanged, judged without reading the files."""
        return (
            self.options == options
            and self.item == item_as_json(item)
            and all(stamp.is_current() for stamp in self.file_stamps)
        )


def item_as_json(item: Item) -> list[Any]:
    """Files and unit of an item as JSON values."""
    near = [None if path is None else os.fspath(path) for path in (item.nearby_photo, item.nearby_camera)]
    return [os.fspath(item.scan), [*map(os.fspath, item.photo)], [*map(os.fspath, item.camera)], *near, item.units]


class Journal:
    """Entries by item name, backed by the journal file.

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
        if len(lines) != len(self.entries) + 1:  # superseded entries, or a truncated line
            write_bytes(self.path, (_format_line(entry) for entry in self.entries.values()))
        with translate_os_errors(self.path):
            self._file = self.path.open("ab")
        return self

    def __exit__(self, *problem: object) -> None:
        self._file.close()

    def add(self, entry: Entry) -> None:
        """Append an entry; it is on disk when this returns."""
        with translate_os_errors(self.path):
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
