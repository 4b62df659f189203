"""A batch of scans, ten of them bad: uninterrupted; killed again and again; on a Dask cluster.

python benchmarks/batch.py [--scans 200] [--bad 10] [--kills 20] [--large 8]

Each row tells what is equal, byte for byte apart from times, to the uninterrupted run.
"""

import argparse
import contextlib
import json
import os
import random
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from hashlib import sha256
from pathlib import Path

from batch_scans import make_scans
from machine import machine
from planish.batch.row import VARYING_FIELDS

PLANISH = [sys.executable, "-m", "planish"]
SMALL = {"points": 5000, "photo_px": (1200, 900)}
SMALL_FLAGS = ["--dpi", "50", "--rotate", "0", "--binary", "--flat"]
LARGE = {"points": 300_000, "photo_px": (4000, 3000)}


def main() -> None:
    asked = _arguments()
    print(f"{machine()}\n")
    print("| run | pages | failed | scans an hour | CPU s a page | peak memory of a page, MB | result |")
    print("|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory(dir=asked.folder) as made:
        folder = Path(made)
        make_scans(folder / "in", asked.scans, asked.bad, **SMALL)
        whole = folder / "whole"
        seconds = run(folder / "in", whole, *SMALL_FLAGS)
        row("uninterrupted", whole, seconds, "the reference")
        seconds = run(folder / "in", whole, *SMALL_FLAGS)
        row("resumed", whole, seconds, "nothing was done")
        said = killed(folder / "in", folder / "killed", asked.kills, random.Random(1))
        row(f"killed {asked.kills} times", folder / "killed", None, f"{said}; {compared(folder / 'killed', whole)}")
        said = by_cluster(folder / "in", folder / "cluster")
        row("Dask, 2 workers", folder / "cluster", None, f"{said}; {compared(folder / 'cluster', whole)}")
        if asked.large:
            make_scans(folder / "large", asked.large, 0, **LARGE)
            seconds = run(folder / "large", folder / "large-out", "--format", "tif")
            row("300,000 points, 12 megapixels, 300 dpi", folder / "large-out", seconds, sizes(folder))


def run(scans: Path, out: Path, *flags: str) -> float:
    start = time.perf_counter()
    subprocess.run([*PLANISH, "batch", scans, "-o", out, "-q", *flags], stderr=subprocess.DEVNULL, check=False)
    return time.perf_counter() - start


def killed(scans: Path, out: Path, kills: int, rng: random.Random) -> str:
    """Kill the run at random moments, look at what is there each time, and let the last run finish."""
    command = [*PLANISH, "batch", scans, "-o", out, "-q", *SMALL_FLAGS]
    total = len(list(scans.rglob("scan.mtl")))
    seen: dict[str, int] = {}
    for _ in range(kills):
        process = subprocess.Popen(command, stderr=subprocess.DEVNULL, start_new_session=True)
        goal = len(seen) + rng.randrange(2 * total // (kills + 1))
        while process.poll() is None and len(places(out)) < goal:
            time.sleep(0.05)
        time.sleep(rng.uniform(0, 1.5))
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        now = places(out)
        for name in now:
            record = json.loads((out / name / "item.json").read_text())
            assert all((out / name / file).exists() for file in record["row"]["files"]), f"{name} is half there"
        assert all(now.get(name) == place for name, place in seen.items()), "something was lost or done twice"
        seen = now
    subprocess.run(command, stderr=subprocess.DEVNULL, check=False)
    assert all(places(out)[name] == place for name, place in seen.items()), "something was lost or done twice"
    return f"after each kill nothing was half there, lost or done twice ({len(seen)} were done at the last one)"


def by_cluster(scans: Path, out: Path) -> str:
    """A scheduler and two workers of one thread; one of them is killed in the middle."""
    with cluster() as (address, workers):
        command = [*PLANISH, "batch", scans, "-o", out, "-q", "--dask", address, *SMALL_FLAGS]
        process = subprocess.Popen(command, stderr=subprocess.DEVNULL)
        half = len(list(scans.rglob("scan.mtl"))) // 2
        while process.poll() is None and len(places(out)) < half:
            time.sleep(0.1)
        workers[0].kill()
        process.wait()
    return "one worker killed in the middle"


@contextlib.contextmanager
def cluster() -> Iterator[tuple[str, list[subprocess.Popen]]]:
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with tempfile.TemporaryDirectory() as folder:
        told = Path(folder, "scheduler.json")
        ours = ["--scheduler-file", told]
        dask = [sys.executable, "-m", "distributed.cli.dask_scheduler"]
        scheduler = subprocess.Popen([*dask, *ours, "--host", "127.0.0.1", "--port", "0", "--no-dashboard"], **quiet)
        dask = [sys.executable, "-m", "distributed.cli.dask_worker"]
        flags = ["--nthreads", "1", "--no-dashboard", "--no-nanny", "--local-directory", folder]
        while not told.exists() or not told.stat().st_size:
            time.sleep(0.1)
        workers = [subprocess.Popen([*dask, *ours, *flags], **quiet) for _ in range(2)]
        time.sleep(5)
        try:
            yield json.loads(told.read_text())["address"], workers
        finally:
            for process in (*workers, scheduler):
                process.kill()
                process.wait()


def places(out: Path) -> dict[str, int]:
    """The items that are there, by name, with a number that changes when one is put in place anew."""
    return {str(path.parent.relative_to(out)): path.parent.stat().st_ino for path in out.glob("box-*/*/item.json")}


def compared(out: Path, whole: Path) -> str:
    ours, theirs = digests(out), digests(whole)
    assert ours.keys() == theirs.keys(), sorted(ours.keys() ^ theirs.keys())[:5]
    other = [name for name in theirs if ours[name] != theirs[name]]
    assert not other, other[:5]
    return f"{len(theirs):,} files the same"


def digests(out: Path) -> dict[str, str]:
    """SHA-256 of every file, times left out."""
    files = [path for path in out.rglob("*") if path.is_file() and ".planish" not in path.parts]
    return {str(path.relative_to(out)): sha256(timeless(path)).hexdigest() for path in files}


def timeless(path: Path) -> bytes:
    data = path.read_bytes()
    if path.suffix == ".json":
        data = json.dumps(_without_times(json.loads(data))).encode()
    elif path.name == "summary.jsonl":
        data = "\n".join(json.dumps(_without_times(json.loads(line))) for line in data.splitlines()).encode()
    elif path.name == "summary.csv":
        data = re.sub(rb"(,[0-9.]*){3}\r\n", b"\r\n", data)
    elif path.name == "summary.html":
        data = re.sub(
            rb'<td class="number" data-label="Seconds"[^\n]*?</td>|<h1>.*?</h1>|<title>.*?</title>', b"", data
        )
    return data


def _without_times(value: object) -> object:
    if isinstance(value, dict):
        return {key: _without_times(v) for key, v in value.items() if key not in (*VARYING_FIELDS, "seconds_total")}
    return [_without_times(item) for item in value] if isinstance(value, list) else value


def row(name: str, out: Path, seconds: float | None, said: str) -> None:
    rows = [json.loads(line) for line in (out / "summary.jsonl").read_text().splitlines()]
    done = [r for r in rows if r["status"] != "failed"]
    rate = "" if seconds is None else f"{3600 * len(rows) / seconds:,.0f}"
    cpu = sum(r["cpu_seconds"] for r in done) / len(done)
    peak = max(r["peak_mb"] for r in done)
    print(f"| {name} | {len(done)} | {len(rows) - len(done)} | {rate} | {cpu:.2f} | {peak:.0f} | {said} |", flush=True)


def sizes(folder: Path) -> str:
    scans = len(list((folder / "large").rglob("scan.mtl")))
    read = sum(path.stat().st_size for path in (folder / "large").rglob("*") if path.is_file())
    written = sum(path.stat().st_size for path in (folder / "large-out").rglob("box*/**/*") if path.is_file())
    return f"{read / scans / 1e6:.1f} MB read and {written / scans / 1e6:.1f} MB written a page"


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    parser.add_argument("--scans", type=int, default=200)
    parser.add_argument("--bad", type=int, default=10)
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--large", type=int, default=8)
    parser.add_argument("--folder", type=Path, help="for all that is made; by default the system's for such things")
    return parser.parse_args()


if __name__ == "__main__":
    main()
