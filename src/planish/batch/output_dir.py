"""The output folder: who may write to it, and how a finished item takes its place.

    OUT/NAME/page.tif, report.json, item.json ...    one folder an item; NAME is the item's, with its sub-folders
    OUT/summary.html, summary.csv, summary.jsonl
    OUT/.planish/journal.jsonl                       what is done
    OUT/.planish/lock                                held by the one run that may write
    OUT/.planish/work/                               items in the making; cleared by the next run

An item is written in `work_dir` and moved to its place by one rename: whoever looks at NAME sees all of it or nothing.
"""

from __future__ import annotations

import fcntl
import json
import os
import secrets
import shutil
import socket
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import IO

from planish.batch.items import Item
from planish.batch.journal import Entry, Journal, item_as_json
from planish.batch.row import row_from_json
from planish.errors import OutputError
from planish.io.files import check_writable, make_folder, telling

RECORD = "item.json"
"""In every item's folder: what it was made from, and how it ended."""


class OutputDir:
    """An output folder that this run alone writes to. Made by `open_output_dir`."""

    def __init__(self, folder: Path, journal: Journal) -> None:
        self.folder = folder
        self.work_dir = folder / ".planish" / "work"
        self.journal = journal

    def is_complete(self, entry: Entry) -> bool:
        """Whether all files of an entry are where they belong."""
        destination = self.folder / entry.row.name
        return all((destination / name).exists() for name in (RECORD, *entry.row.files))

    def previous_entry(self, item: Item) -> Entry | None:
        """What was done of an item, in this order or another: from the journal, or else from the item's folder.

        Raises
        ------
        OutputError
            Where something else than an item stands in its place.
        """
        destination = self.folder / item.name
        entry = self.journal.entries.get(item.name) or read_record(destination, item)
        if destination.exists() and not (destination / RECORD).exists() and (entry is None or not destination.is_dir()):
            raise OutputError(
                f"{destination} exists and was not made by planish batch; move it, or choose another folder with -o"
            )
        return entry if entry is not None and self.is_complete(entry) else None

    def move_into_place(self, finished: Path, name: str) -> None:
        """Move a finished folder to its place, instead of what stands there.

        Raises
        ------
        OutputError
            Where the system refuses.
        """
        target = self.folder / name
        make_folder(target.parent)
        with telling(target):
            if target.exists():
                target.rename(self.work_dir / f"before-{secrets.token_hex(8)}")
            finished.rename(target)
            fsync_path(target.parent)


@contextmanager
def open_output_dir(folder: Path) -> Iterator[OutputDir]:
    """Open an output folder for this run alone; it is made if there is none.

    Raises
    ------
    OutputError
        Where another run writes to it, or the system refuses.
    """
    state_dir = folder / ".planish"
    make_folder(state_dir)
    check_writable(state_dir / "lock")
    with ExitStack() as stack:
        with telling(folder):
            lock = stack.enter_context((state_dir / "lock").open("a+"))
            _acquire_lock(lock, folder)
            _clear_folder(state_dir / "work")
            journal = stack.enter_context(Journal(state_dir / "journal.jsonl"))
        stack.callback(_clear_folder, state_dir / "work")
        yield OutputDir(folder, journal)


def _acquire_lock(lock: IO[str], folder: Path) -> None:
    """Hold the lock until the file is closed, which the system does however the process ends."""
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        lock.seek(0)
        raise OutputError(
            f"{folder} is being written to by another planish batch ({lock.read().strip()}); wait until it is done, or "
            "choose another folder with -o"
        ) from None
    lock.truncate(0)
    lock.write(f"process {os.getpid()} on {socket.gethostname()}")
    lock.flush()


def _clear_folder(work_dir: Path) -> None:
    """Take away what an earlier run was making when it ended."""
    shutil.rmtree(work_dir, ignore_errors=True)
    work_dir.mkdir(exist_ok=True)


def write_record(folder: Path, entry: Entry) -> None:
    """Write `item.json` and see to it that the folder's files are on the disk.

    Of the stamps only names and fingerprints: the record is the same wherever the scans lie.
    """
    plain = {
        "row": entry.row.plain(),
        "options": entry.options,
        "inputs": entry.inputs,
        "sha256": {Path(stamp.path).name: stamp.sha256 or None for stamp in entry.file_stamps},
    }
    path = folder / RECORD
    with telling(path):
        path.write_text(json.dumps(plain, indent=2, ensure_ascii=True) + "\n")
        for file in [*folder.iterdir(), folder]:
            fsync_path(file)


def read_record(folder: Path, item: Item) -> Entry | None:
    """The entry of an item's folder, without stamps, so that its files will be looked at; None where there is none."""
    try:
        plain = json.loads((folder / RECORD).read_bytes())
        row = row_from_json(plain["row"])
        if row is None or row.name != item.name:
            return None
        return Entry(row, item_as_json(item), plain["options"], plain["inputs"], ())
    except (OSError, ValueError, TypeError, KeyError):
        return None


def fsync_path(path: Path) -> None:
    """Have the system put a file or a folder on the disk before anything that follows."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
