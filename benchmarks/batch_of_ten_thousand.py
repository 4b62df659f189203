"""What one process has to do for a shelf of many scans, beside restoring them: finding, placing, noting, summing up.

python benchmarks/batch_of_ten_thousand.py [--scans 10000]

The restorations are left out: every item gets the same small files.
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
from planish.batch.inputs import inputs_of
from planish.batch.journal import Entry, given
from planish.batch.task import Made, Task

T = TypeVar("T")


class Copies:
    """A pool that restores nothing."""

    slots, memory = 4, float("inf")

    def __init__(self, preview: bytes) -> None:
        self.preview = preview
        self.count = 0

    def submit(self, task: Task) -> Future[Made]:
        self.count += 1
        folder = task.work / str(self.count)
        folder.mkdir()
        for name, data in {"item.json": b"{}", "page.tif": b"a page", "preview.jpg": self.preview}.items():
            (folder / name).write_bytes(data)
        row = Row(name=task.item.name, status="good", sentence="done", files=["page.tif", "preview.jpg"])
        inputs = inputs_of(task.item)
        entry = Entry(row, given(task.item), task.order.fingerprint(), inputs.fingerprint(), inputs.stamps)
        answer: Future[Made] = Future()
        answer.set_result(Made(entry, folder))
        return answer

    def close(self) -> None:
        pass

    def abandon(self) -> None:
        pass


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--scans", type=int, default=10_000)
    count = parser.parse_args().scans
    print(f"{machine()}\n\n| {count:,} items | CPU s | s | memory so far, MB |\n|---|---|---|---|")
    with tempfile.TemporaryDirectory() as made:
        scans, pages = Path(made, "in"), Path(made, "out")
        for k in range(count):
            at = scans / f"box-{k // 100:04d}" / f"scan-{k:06d}"
            at.mkdir(parents=True)
            (at / "scan.obj").write_text(f"# {k}\n")
        preview = Path(made, "preview.jpg")
        Image.fromarray(np.random.default_rng(0).integers(200, 256, (480, 370), np.uint8)).save(preview)
        found = clocked("find the scans", lambda: find_items(scans))
        clocked("place, note and sum up", lambda: batch(found, pages, lambda: Copies(preview.read_bytes())))
        clocked("see that nothing is to be done", lambda: batch(found, pages, lambda: Copies(b"")))
        sizes = {name: (pages / name).stat().st_size / 1e6 for name in (".planish/journal.jsonl", "summary.html")}
        print("\n" + ", ".join(f"{name} has {size:.1f} MB" for name, size in sizes.items()) + ".")


def clocked(what: str, work: Callable[[], T]) -> T:
    cpu, start = time.process_time(), time.perf_counter()
    result = work()
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6
    print(f"| {what} | {time.process_time() - cpu:.1f} | {time.perf_counter() - start:.1f} | {peak:.0f} |", flush=True)
    return result


if __name__ == "__main__":
    main()
