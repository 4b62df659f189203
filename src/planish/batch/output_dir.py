"""Output folder of a batch: locking, and atomic publication of finished items.

    OUT/NAME/page.tif, report.json, item.json ...    one folder per item; NAME may contain subfolders
    OUT/summary.html, summary.csv, summary.jsonl
    OUT/.planish/journal.jsonl                       finished items
    OUT/.planish/lock                                held by the run that writes, whose name is in holder
    OUT/.planish/work/                               unfinished items; cleared by the next run

An item is written in the work folder and published by one rename, so readers of NAME see all of its files or none.
"""

from __future__ import annotations

import json
import os
import secrets
import shutil
import socket
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from planish.batch.items import Item, conflicting_names
from planish.batch.journal import Entry, Journal, item_as_json
from planish.batch.row import row_from_json
from planish.errors import OutputError
from planish.io.files import check_writable, make_folder, translate_os_errors
from planish.system import exclusive_lock, flush_to_disk

RECORD = "item.json"
"""In the folder of every item: fingerprints of its inputs, and its outcome."""


class OutputDir:
    """An output folder locked by this run; created by `open_output_dir`."""

    def __init__(self, folder: Path, journal: Journal) -> None:
        self.folder = folder
        self.work_dir = folder / ".planish" / "work"
        self.journal = journal

    def check_names(self, names: Iterable[str]) -> None:
        """Check that no two items share a folder where the file system takes A for a (Windows, macOS, USB drives).

        Raises
        ------
        OutputError
            With one of the names that are alike but for upper and lower case.
        """
        if not _ignores_case(self.work_dir):
            return
        conflicts = sorted(conflicting_names(name.lower() for name in names))
        if conflicts:
            raise OutputError(
                f"{self.folder} is on a file system that takes A for a, and the scans' names hold {conflicts[0]} in "
                "both ways; rename one of the scans, name it in a list, or choose another folder with -o"
            )

    def is_complete(self, entry: Entry) -> bool:
        """Whether all files of an entry exist."""
        destination = self.folder / entry.row.name
        return all((destination / name).exists() for name in (RECORD, *entry.row.files))

    def previous_entry(self, item: Item) -> Entry | None:
        """Entry of an earlier run with any options, from the journal or else from the item's folder.

        Raises
        ------
        OutputError
            If the folder of the item exists but was not created by a batch.
        """
        destination = self.folder / item.name
        entry = self.journal.entries.get(item.name) or read_record(destination, item)
        if destination.exists() and not (destination / RECORD).exists() and (entry is None or not destination.is_dir()):
            raise OutputError(
                f"{destination} exists and was not made by planish batch; move it, or choose another folder with -o"
            )
        return entry if entry is not None and self.is_complete(entry) else None

    def move_into_place(self, finished: Path, name: str) -> None:
        """Publish a finished folder, replacing an existing one.

        Raises
        ------
        OutputError
            If the file system refuses.
        """
        target = self.folder / name
        make_folder(target.parent)
        with translate_os_errors(target):
            if target.exists():
                target.rename(self.work_dir / f"before-{secrets.token_hex(8)}")
            finished.rename(target)
            flush_to_disk(target.parent)


@contextmanager
def open_output_dir(folder: Path) -> Iterator[OutputDir]:
    """Open and lock an output folder; it is created if it does not exist.

    Raises
    ------
    OutputError
        If another run holds the lock, or the file system refuses.
    """
    state_dir = folder / ".planish"
    make_folder(state_dir)
    check_writable(state_dir / "lock")
    with ExitStack() as stack:
        with translate_os_errors(folder):
            stack.enter_context(_lock(state_dir, folder))
            _clear_folder(state_dir / "work")
            journal = stack.enter_context(Journal(state_dir / "journal.jsonl"))
        stack.callback(_clear_folder, state_dir / "work")
        yield OutputDir(folder, journal)


@contextmanager
def _lock(state_dir: Path, folder: Path) -> Iterator[None]:
    """Hold the folder's lock; who has it stands in a file beside it."""
    holder = state_dir / "holder"
    with exclusive_lock(state_dir / "lock") as held:
        if not held:
            known = holder.read_text(errors="replace").strip() if holder.exists() else "unknown"
            raise OutputError(
                f"{folder} is in use by another planish batch ({known}); wait until it is done, or choose another "
                "folder with -o"
            )
        holder.write_text(f"process {os.getpid()} on {socket.gethostname()}")
        yield


def _ignores_case(folder: Path) -> bool:
    """Whether the file system of a folder finds a file by its name in other letters."""
    probe = folder / "Case"
    with translate_os_errors(folder):
        probe.touch()
        found = (folder / "cASE").exists()
        probe.unlink()
    return found


def _clear_folder(work_dir: Path) -> None:
    """Remove unfinished items of an earlier run."""
    shutil.rmtree(work_dir, ignore_errors=True)
    work_dir.mkdir(exist_ok=True)


def write_record(folder: Path, entry: Entry) -> None:
    """Write `item.json` and flush all files of the folder to disk.

    Only names and digests of the input files are stored, so that the record does not depend on where they are.
    """
    plain = {
        "row": entry.row.plain(),
        "options": entry.options,
        "inputs": entry.inputs,
        "sha256": {Path(stamp.path).name: stamp.sha256 or None for stamp in entry.file_stamps},
    }
    path = folder / RECORD
    with translate_os_errors(path):
        path.write_text(json.dumps(plain, indent=2, ensure_ascii=True) + "\n")
        for file in [*folder.iterdir(), folder]:
            flush_to_disk(file)


def read_record(folder: Path, item: Item) -> Entry | None:
    """Entry from `item.json`, without file stamps, so that the inputs will be hashed; None if there is none."""
    try:
        plain = json.loads((folder / RECORD).read_bytes())
        row = row_from_json(plain["row"])
        if row is None or row.name != item.name:
            return None
        return Entry(row, item_as_json(item), plain["options"], plain["inputs"], ())
    except (OSError, ValueError, TypeError, KeyError):
        return None
