"""What is left of a restoration that the world breaks into: killed, on a full disk, read-only, slow, twice at once.

    python benchmarks/faults.py [--moments N] [--only NAME]

A bound page of the gallery is scanned virtually, and `planish restore` and `planish flatten` write over files that
stand there already: page, black-and-white page, flat mesh, report. After every fault each of these must be the old
one or a whole new one, and nothing else may lie beside them, except after kill -9: then unfinished files with names
like .page.tif.0.part may, and the next good run must take them away. Full and read-only disks are small file systems
in memory, for which one must be root; elsewhere those rows are left out.

Prints a Markdown table; ends with 1 if anything was half-written.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter, sleep

import numpy as np
from PIL import Image

from machine import machine
from planish.gallery import sheet, virtual_scan
from planish.io import read_scan, write_scan

OLD = b"the old one"
PAGES, MESH, REPORT = ("page.tif", "bw.png"), "flat.ply", "report.json"


class HalfWrittenError(Exception):
    """A file is neither the old one nor a whole new one, or one lies where none may."""


def restore(scan: Path, folder: Path) -> list[str]:
    page, binary = (str(folder / name) for name in PAGES)
    others = ["--flat", str(folder / MESH), "--report", str(folder / REPORT)]
    return ["restore", str(scan), "-o", page, "--binary", binary, "--dpi", "150", *others]


def flatten(scan: Path, folder: Path) -> list[str]:
    return ["flatten", str(scan), "-o", str(folder / MESH), "--report", str(folder / REPORT)]


COMMANDS: dict[str, Callable[[Path, Path], list[str]]] = {"restore": restore, "flatten": flatten}


def started(arguments: list[str]) -> subprocess.Popen[str]:
    return subprocess.Popen([sys.executable, "-m", "planish", *arguments], stderr=subprocess.PIPE, text=True)


def ended(job: subprocess.Popen[str], *, expected: tuple[int, ...]) -> int:
    """The exit code of the process; a sentence or nothing on stderr, and never a traceback."""
    said = job.communicate(timeout=600)[1]
    if (
        job.returncode not in expected
        or "Traceback" in said
        or not all(line.startswith("planish: ") for line in said.splitlines())
    ):
        raise HalfWrittenError(f"exit code {job.returncode}: {said}")
    return job.returncode


def is_whole(path: Path) -> bool:
    """Whether a new file can be read to its end."""
    try:
        if path.name in PAGES:
            with Image.open(path) as image:
                image.load()
        elif path.name == MESH:
            read_scan(path)
        else:
            json.loads(path.read_text())
    except Exception:  # whatever a reader says of a file that is cut short
        return False
    return True


def lay_old(folder: Path) -> None:
    folder.mkdir(exist_ok=True)
    for name in (*PAGES, MESH, REPORT):
        (folder / name).write_bytes(OLD)


def check(folder: Path, *, parts: bool = False) -> tuple[int, int]:
    """How many files are new, and how many unfinished ones lie beside them."""
    new = unfinished = 0
    for path in folder.iterdir():
        if path.suffix == ".part" and parts:
            unfinished += 1
        elif path.name not in (*PAGES, MESH, REPORT):
            raise HalfWrittenError(f"{path.name} was left behind")
        elif path.read_bytes() != OLD:
            new += 1
            if not is_whole(path):
                raise HalfWrittenError(f"{path.name} is half-written")
    return new, unfinished


def wait(job: subprocess.Popen[str], folder: Path, whole: float, late: bool, rng: np.random.Generator) -> None:
    """To a random moment of a run that takes so many seconds; a late one falls where files are written."""
    if not late:
        sleep(rng.uniform(0, whole))
        return
    while job.poll() is None and not list(folder.glob(".*.part")):
        sleep(0.002)
    sleep(rng.uniform(0, whole / 50))


# The faults


def ended_by(number: signal.Signals, scan: Path, folder: Path, count: int) -> Iterator[tuple[str, str]]:
    rng = np.random.default_rng(number)
    for name, command in COMMANDS.items():
        lay_old(folder)
        start = perf_counter()
        ended(started(command(scan, folder)), expected=(0,))
        whole = perf_counter() - start
        files, _ = check(folder)
        tally: Counter[str] = Counter()
        for k in range(count):
            lay_old(folder)
            job = started(command(scan, folder))
            wait(job, folder, whole, k % 2 == 1, rng)
            job.send_signal(number)
            how = ended(job, expected=(-number, 128 + number, 0))  # -number: before Python had begun
            new, unfinished = check(folder, parts=number == signal.SIGKILL)
            tally["ended by it"] += how != 0
            tally["done before"] += how == 0
            tally["of them with all files new"] += how != 0 and new == files
            tally["with some"] += how != 0 and 0 < new < files
            tally["unfinished files left"] += unfinished
        ended(started(command(scan, folder)), expected=(0,))
        check(folder)
        yield f"{number.name} at {count} moments, {name}", ", ".join(f"{n} {what}" for what, n in tally.items())


def full_disk(scan: Path, folder: Path, count: int) -> Iterator[tuple[str, str]]:
    for name, command in COMMANDS.items():
        tally: Counter[str] = Counter()
        for kilobytes in np.geomspace(16, 40_000, count).astype(int):
            with disk(folder, f"size={kilobytes}k"):
                lay_old(folder)
                tally[f"exit code {ended(started(command(scan, folder)), expected=(0, 4))}"] += 1
                check(folder)
        yield f"disks of 16 kB to 40 MB, {name}", ", ".join(f"{n} x {how}" for how, n in sorted(tally.items()))


def read_only(scan: Path, folder: Path, count: int) -> Iterator[tuple[str, str]]:
    for name, command in COMMANDS.items():
        with disk(folder, "size=40m"):
            lay_old(folder)
            subprocess.run(["mount", "-o", "remount,ro", str(folder)], check=True)
            how = ended(started(command(scan, folder)), expected=(4,))
            check(folder)
        yield f"read-only folder, {name}", f"exit code {how}"


def slow_disk(scan: Path, folder: Path, count: int) -> Iterator[tuple[str, str]]:
    """The scan comes through a pipe, a few kilobytes at a time."""
    lay_old(folder)
    pipe = folder.parent / "pipe.ply"
    os.mkfifo(pipe)
    data = write_scan(folder.parent / "plain.ply", read_scan(scan).scan)[0].read_bytes()
    job = started(flatten(pipe, folder))
    with pipe.open("wb", buffering=0) as file:
        for start in range(0, len(data), 4096):
            file.write(data[start : start + 4096])
            sleep(0.005)
    yield f"{len(data) / 1e6:.1f} MB through a slow pipe, flatten", f"exit code {ended(job, expected=(0,))}"
    check(folder)


def two_at_once(scan: Path, folder: Path, count: int) -> Iterator[tuple[str, str]]:
    for name, command in COMMANDS.items():
        tally: Counter[str] = Counter()
        for _ in range(max(1, count // 5)):
            lay_old(folder)
            jobs = [started(command(scan, folder)) for _ in range(2)]
            tally.update(f"exit code {ended(job, expected=(0,))}" for job in jobs)
            check(folder)
        yield f"two runs into one folder at once, {name}", ", ".join(f"{n} x {how}" for how, n in tally.items())


FAULTS: dict[str, Callable[[Path, Path, int], Iterator[tuple[str, str]]]] = {
    "kill": lambda *rest: ended_by(signal.SIGKILL, *rest),
    "term": lambda *rest: ended_by(signal.SIGTERM, *rest),
    "full": full_disk,
    "read-only": read_only,
    "slow": slow_disk,
    "twice": two_at_once,
}


@contextmanager
def disk(folder: Path, options: str) -> Iterator[None]:
    """A small file system in memory, mounted on the folder."""
    subprocess.run(["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(folder)], check=True)
    try:
        yield
    finally:
        subprocess.run(["umount", "--lazy", str(folder)], check=True)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--moments", type=int, default=20)
    parser.add_argument("--only", choices=FAULTS)
    given = parser.parse_args()
    print(f"{machine()}\n\n| fault | what came of it |\n|---|---|")
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary) / "out"
        made = virtual_scan(sheet("book"), points=20_000, photo_px=(1200, 900))
        scan = write_scan(Path(temporary) / "book.obj", made.scan)[0]
        for name, fault in FAULTS.items():
            if given.only not in (None, name) or (name in ("full", "read-only") and os.geteuid() != 0):
                continue
            folder.mkdir(exist_ok=True)
            try:
                for what, came in fault(scan, folder, given.moments):
                    print(f"| {what} | {came} |", flush=True)
            except HalfWrittenError as problem:
                print(f"| {name} | **FAILED: {problem}** |")
                return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
