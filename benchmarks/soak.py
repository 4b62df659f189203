"""An hour of everything in turn: the service, batches that are killed and resumed, readers fed with damaged files.

    python benchmarks/soak.py [--minutes N] [--seed N]

Each round sends the service right scans, whose pages must be right to the byte, damaged ones, which must get an answer,
and one that is deleted while it is being restored; kills a batch again and again and compares what it has written in
the end, byte for byte, with a run that nobody killed; and reads some hundred damaged files in one long-lived process,
which must refuse them in a sentence or read them. A line a round tells memory and open files of the server, of the
process that its workers are forked from, and of the reader. It ends with 1 if anything was wrong, or memory or open
files of one of them grew from the first quarter to the end by more than a third.
"""

from __future__ import annotations

import argparse
import json
import random
import shutil
import subprocess
import sys
import tempfile
import time
import traceback
from collections import Counter
from pathlib import Path

import httpx
import psutil

import batch
from batch_scans import make_scans
from machine import machine
from planish.errors import PlanishError
from planish.gallery import sheet, virtual_scan
from planish.io import read_camera, read_photo, read_scan, write_scan
from planish.io.cameras import camera_as_json
from serve import CARD_MM, FIELDS, Clients, Files, Server, made

SCANS, BAD, KILLS = 6, 2, 2
DAMAGED = 6  # uploads a round
READER_SECONDS = 20.0
GROWTH = 1.33
SLOWEST_S = 5.0  # of an answer about health, on a machine that is busy with other things


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--reader", action="store_true", help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.reader:
        read_damaged_files(random.Random(asked.seed))
        return
    print(machine(), flush=True)
    with tempfile.TemporaryDirectory() as name:
        sys.exit(soak(Path(name), asked.minutes, asked.seed))


def soak(folder: Path, minutes: float, seed: int) -> int:
    rng = random.Random(seed)
    scans = [made(folder / name, name, 0) for name in ("book", "crumpled")]
    make_scans(folder / "in", SCANS, BAD, **batch.SMALL)
    batch.run(folder / "in", folder / "whole", *batch.SMALL_FLAGS)
    faults: list[str] = []
    rows: list[dict[str, float]] = []
    total: Counter[str] = Counter()
    reader = Reader(seed)
    server = Server(folder / "served", 1, 20)
    start = time.monotonic()
    deadline = start + 60 * minutes
    try:
        while time.monotonic() < deadline:
            total.update(use_service(server, scans, rng, deadline + 600, faults))
            total.update(kill_batches(folder, rng, faults))
            total.update(reader.run(READER_SECONDS, faults))
            rows.append(watched(server, reader))
            minute = (time.monotonic() - start) / 60
            print(f"{minute:.0f} min: " + ", ".join(f"{k} {v:.0f}" for k, v in rows[-1].items()), flush=True)
    finally:
        server.process.terminate()
        ended = server.process.wait(60)
        reader.end()
    faults += [f"the server ended with {ended}"] if ended else []
    faults += grown(rows)
    print(f"{(time.monotonic() - start) / 60:.0f} minutes, {len(rows)} rounds: "
          + ", ".join(f"{count} {what}" for what, count in sorted(total.items())))  # fmt: skip
    print("\n".join(faults) or "nothing was wrong")
    return bool(faults)


def use_service(
    server: Server, scans: list[tuple[Files, str]], rng: random.Random, deadline: float, faults: list[str]
) -> Counter[str]:
    clients = Clients(server, scans, deadline)
    clients.all(4, 2)
    ends = Counter({f"pages {end}": count for end, count in clients.ends.items()})
    faults += [f"{count} {end}" for end, count in ends.items() if end != "pages right"]
    with httpx.Client(base_url=server.address, timeout=300) as client:
        for _ in range(DAMAGED):
            files = [(field, (name, damaged(data, rng))) for field, (name, data) in rng.choice(scans)[0]]
            answer = client.post("/api/jobs", files=files, data=FIELDS)
            if answer.status_code == 201:
                state = followed(client, answer.headers["location"])
                ends[f"damaged uploads {state}"] += 1
            else:
                ends["damaged uploads refused"] += 1
                if answer.status_code >= 500 or "\n" in answer.json()["detail"]:
                    faults.append(f"{answer.status_code} {answer.text[:300]}")
        job = client.post("/api/jobs", files=scans[0][0], data=FIELDS).headers["location"]
        time.sleep(rng.uniform(0, 1))
        start = time.monotonic()
        client.get("/api/health").raise_for_status()
        if time.monotonic() - start > SLOWEST_S:
            faults.append(f"health took {time.monotonic() - start:.1f} s")
        client.delete(job).raise_for_status()
        ends["jobs deleted"] += 1
    return ends


def followed(client: httpx.Client, job: str) -> str:
    while (state := client.get(job).json()["state"]) in ("queued", "running"):
        time.sleep(0.1)
    return str(state)


def kill_batches(folder: Path, rng: random.Random, faults: list[str]) -> Counter[str]:
    out = folder / "killed"
    try:
        batch.killed(folder / "in", out, KILLS, rng)
        batch.compared(out, folder / "whole")
    except AssertionError as problem:
        faults.append(f"batch: {problem}")
    shutil.rmtree(out, ignore_errors=True)
    return Counter({"batches resumed": 1, "batches killed": KILLS})


class Reader:
    """A process that reads damaged files when it is asked to."""

    def __init__(self, seed: int):
        command = [sys.executable, __file__, "--reader", "--seed", str(seed)]
        pipe = subprocess.PIPE
        self.process = subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True)

    def run(self, seconds: float, faults: list[str]) -> Counter[str]:
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write(f"{seconds}\n")
        self.process.stdin.flush()
        answer = self.process.stdout.readline()
        if not answer:
            faults.append(f"the reader ended with {self.process.wait()}")
            return Counter()
        told = json.loads(answer)
        faults += told["faults"]
        return Counter(told["files"])

    def end(self) -> None:
        assert self.process.stdin is not None
        self.process.stdin.close()
        self.process.wait(60)


def read_damaged_files(rng: random.Random) -> None:
    """For every line on the standard input, so many seconds, damaged files; then a line of JSON on what came of it."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        seeds = written(folder)
        for line in sys.stdin:
            files: Counter[str] = Counter()
            faults: list[str] = []
            end = time.monotonic() + float(line)
            while time.monotonic() < end:
                victim = rng.choice(sorted(seeds))
                (folder / victim).write_bytes(damaged(seeds[victim], rng))
                files[one_read(folder, victim, faults)] += 1
                (folder / victim).write_bytes(seeds[victim])
            print(json.dumps({"files": files, "faults": faults[:5]}), flush=True)


def written(folder: Path) -> dict[str, bytes]:
    """Files of one scan in several formats, by name."""
    scan = virtual_scan(sheet("book", **CARD_MM), points=500, photo_px=(160, 120)).scan
    for suffix in ("obj", "ply", "glb"):
        write_scan(folder / f"scan.{suffix}", scan)
    assert scan.camera is not None
    (folder / "camera.json").write_text(json.dumps(camera_as_json(scan.camera)))
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def one_read(folder: Path, victim: str, faults: list[str]) -> str:
    try:
        if victim.endswith(".json"):
            read_camera(folder / victim)
        elif victim.endswith((".jpg", ".png")):
            read_photo(folder / victim)
        else:
            read_scan(folder / ("scan.obj" if victim.endswith(".mtl") else victim))
    except PlanishError as problem:
        if "\n" in str(problem):
            faults.append(f"{victim}: more than a line: {problem}")
        return "damaged files refused"
    except Exception:
        faults.append(f"{victim}: {' / '.join(traceback.format_exc().splitlines()[-3:])}")
        return "damaged files that failed"
    return "damaged files read"


def damaged(data: bytes, rng: random.Random) -> bytes:
    """Some bytes changed, a part taken out, repeated or set to zero, or the end cut off; sometimes nothing."""
    part = bytearray(data)
    for _ in range(rng.choice((0, 1, 1, 2, 5))):
        at = rng.randrange(len(part) + 1)
        size = rng.choice((1, 4, 64, 1000))
        how = rng.randrange(5)
        if how == 0:
            part[at : at + size] = rng.randbytes(len(part[at : at + size]))
        elif how == 1:
            del part[at : at + size]
        elif how == 2:
            part[at:at] = part[at : at + size]
        elif how == 3:
            part[at : at + size] = bytes(len(part[at : at + size]))
        else:
            del part[at:]
    return bytes(part)


def watched(server: Server, reader: Reader) -> dict[str, float]:
    row = {}
    serving = psutil.Process(server.process.pid)
    forking = [child for child in serving.children() if "forkserver" in " ".join(child.cmdline())]
    for name, process in (("server", serving), *(("fork server", each) for each in forking),
                          ("reader", psutil.Process(reader.process.pid))):  # fmt: skip
        row[f"{name} MB"] = process.memory_info().rss / 1e6
        row[f"{name} files"] = process.num_fds()
    return row


def grown(rows: list[dict[str, float]]) -> list[str]:
    """What is larger at the end than it ever was in the first quarter."""
    early = rows[: max(1, len(rows) // 4)]
    return [
        f"{name} grew from {max(row[name] for row in early):.0f} to {last:.0f}"
        for name, last in rows[-1].items()
        if all(name in row for row in early) and last > GROWTH * max(row[name] for row in early) + 10
    ]


if __name__ == "__main__":
    main()
