"""Work of the coordinating process of a large batch, without the restorations: search, publishing, journal, summary.

python benchmarks/batch_of_ten_thousand.py [--scans 10000]

Instead of a restoration, every item gets the same small files.
"""

import argparse
import resource
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import TypeVar

import numpy as np
from PIL import Image

from machine import machine
from planish.batch import Row, batch, find_items
from planish.batch.inputs import find_inputs
from planish.batch.journal import Entry, item_as_json
from planish.batch.task import Task, TaskResult

T = TypeVar("T")


class CopyPool:
    """A pool that copies files instead of restoring scans."""

    slots, memory = 4, float("inf")

    def __init__(self, preview: bytes) -> None:
        self.preview = preview
        self.count = 0

    def submit(self, task: Task) -> Future[TaskResult]:
        self.count += 1
        folder = task.work_dir / str(self.count)
        folder.mkdir()
        for name, data in {"item.json": b"{}", "page.tif": b"a page", "preview.jpg": self.preview}.items():
            (folder / name).write_bytes(data)
        row = Row(name=task.item.name, status="good", sentence="done", files=["page.tif", "preview.jpg"])
        inputs = find_inputs(task.item)
        entry = Entry(
            row, item_as_json(task.item), task.options.fingerprint(), inputs.fingerprint(), inputs.file_stamps
        )
        future: Future[TaskResult] = Future()
        future.set_result(TaskResult(entry, folder))
        return future

    def close(self) -> None:
        pass

    def kill(self) -> None:
        pass


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--scans", type=int, default=10_000)
    count = parser.parse_args().scans
    print(f"{machine()}\n\n| {count:,} items | CPU s | s | memory so far, MB |\n|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder_name:
        scans, pages = Path(folder_name, "in"), Path(folder_name, "out")
        for k in range(count):
            at = scans / f"box-{k // 100:04d}" / f"scan-{k:06d}"
            at.mkdir(parents=True)
            (at / "scan.obj").write_text(f"# {k}\n")
        preview = Path(folder_name, "preview.jpg")
        Image.fromarray(np.random.default_rng(0).integers(200, 256, (480, 370), np.uint8)).save(preview)
        found = clocked("find the scans", lambda: find_items(scans))
        clocked("place, note and sum up", lambda: batch(found, pages, lambda: CopyPool(preview.read_bytes())))
        clocked("see that nothing is to be done", lambda: batch(found, pages, lambda: CopyPool(b"")))
        sizes = {name: (pages / name).stat().st_size / 1e6 for name in (".planish/journal.jsonl", "summary.html")}
        print("\n" + ", ".join(f"{name} has {size:.1f} MB" for name, size in sizes.items()) + ".")


def clocked(what: str, work_dir: Callable[[], T]) -> T:
    cpu, start = time.process_time(), time.perf_counter()
    result = work_dir()
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6
    print(f"| {what} | {time.process_time() - cpu:.1f} | {time.perf_counter() - start:.1f} | {peak:.0f} |", flush=True)
    return result


if __name__ == "__main__":
    main()
