"""A thousand restorations over HTTP, fifty at once, on this machine alone; and what is lost when things are killed.

    python benchmarks/serve.py [--scans N] [--at-once N] [--jobs N] [--killed N] [--minutes N]

Cards of known sheets, 2,000 points and half a megapixel each, are scanned virtually and restored once directly. Then
so many clients as are at once each send scan after scan to `planish serve` at a free loopback port, follow the events
to the end, fetch the page and compare its bytes with the direct one's. Told are the seconds from the first byte sent to
the page in hand, and the server's memory after a tenth, half and all of the scans.

Then --killed scans more, while a process at work is killed (kill -9) for every ten scans, and the server
itself in the middle, which is started anew on the same folder. Every scan must get its page, and every page that was
finished before the server was killed must be there afterwards.

Stops by itself after --minutes.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import httpx
import numpy as np

from machine import machine
from planish.gallery import sheet, virtual_scan
from planish.io import write_scan
from planish.job import Job, Outputs, run
from planish.settings import RenderSettings, RestoreSettings, ShadingSettings

CARD_MM = {"width_mm": 74, "height_mm": 105}
SHEETS = ("book", "wave", "curl", "crumpled")
POINTS, PHOTO_PX = 2000, (820, 610)
FIELDS = {"dpi": "auto", "rotate": "0", "shading": "none", "formats": "png", "view": "false"}
KILL_EVERY = 10

Files = list[tuple[str, tuple[str, bytes]]]


class Server:
    """`planish serve` on a folder, at one port also when it is started anew."""

    def __init__(self, folder: Path, jobs: int, queue: int):
        self.flags = ["--data", str(folder), "--jobs", str(jobs), "--queue", str(queue)]
        self.port = "0"
        self.start()

    def start(self) -> None:
        command = [sys.executable, "-m", "planish", "serve", "--port", self.port, *self.flags]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert self.process.stdout is not None
        self.address = self.process.stdout.readline().split()[-1]
        self.port = self.address.rstrip("/").rpartition(":")[2]

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()

    def memory_mb(self) -> float:
        told = Path(f"/proc/{self.process.pid}/status").read_text()
        found = re.search(r"VmRSS:\s+(\d+)", told)
        assert found
        return int(found[1]) / 1000

    def workers(self) -> list[int]:
        return [pid for child in children(self.process.pid) for pid in children(child)]


def children(pid: int) -> list[int]:
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            parent = int(stat.read_text().rpartition(")")[2].split()[1])
        except (FileNotFoundError, ProcessLookupError):
            continue
        if parent == pid:
            found.append(int(stat.parent.name))
    return found


class Clients:
    """So many at once; each sends a scan, waits for its page, and looks whether it is the right one."""

    def __init__(self, server: Server, scans: list[tuple[Files, str]], deadline: float):
        self.server, self.scans, self.deadline = server, scans, deadline
        self.lock = threading.Lock()
        self.seconds: list[float] = []
        self.ends: Counter[str] = Counter()
        self.pages: dict[str, str] = {}  # address of the page: what it should be
        self.memory: dict[int, float] = {}

    def all(self, count: int, at_once: int, look_at: tuple[int, ...] = ()) -> None:
        self.look_at = look_at
        with ThreadPoolExecutor(at_once) as threads:
            list(threads.map(self.one, range(count)))

    def one(self, number: int) -> None:
        files, wanted = self.scans[number % len(self.scans)]
        start, end = time.monotonic(), "not in time"
        with httpx.Client(base_url=self.server.address, timeout=60) as client:
            job = self._send(client, files)
            while job and time.monotonic() < self.deadline:
                try:
                    state = self._follow(client, job)
                    if state in ("done", "failed"):
                        page = f"{job}/files/page.png"
                        right = state == "done" and fingerprint(client.get(page).content) == wanted
                        end = "right" if right else "wrong" if state == "done" else "failed"
                        if state == "done":
                            self.pages[page] = wanted
                        break
                except httpx.TransportError:  # the server was killed
                    time.sleep(0.5)
        with self.lock:
            self.seconds.append(time.monotonic() - start)
            self.ends[end] += 1
            if len(self.seconds) in self.look_at:
                self.memory[len(self.seconds)] = self.server.memory_mb()

    def _send(self, client: httpx.Client, files: Files) -> str | None:
        while time.monotonic() < self.deadline:
            try:
                answer = client.post("/api/jobs", files=files, data=FIELDS)
                if answer.status_code == 201:
                    return answer.headers["location"]
                print(f"  refused: {answer.status_code} {answer.text}")
            except httpx.TransportError:
                pass
            time.sleep(0.5)
        return None

    def _follow(self, client: httpx.Client, job: str) -> str:
        state = ""
        with client.stream("GET", f"{job}/events") as answer:
            answer.raise_for_status()
            for line in answer.iter_lines():
                found = re.search(r'"state":"(\w+)"', line)
                state = found[1] if found else state
        return state


def fingerprint(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def made(folder: Path, name: str, rng: int) -> tuple[Files, str]:
    """A scan as it is sent, and the fingerprint of its page."""
    folder.mkdir()
    card = sheet(name, **CARD_MM)
    write_scan(folder / "scan.obj", virtual_scan(card, points=POINTS, photo_px=PHOTO_PX, noise_mm=0.02, rng=rng).scan)
    settings = RestoreSettings(render=RenderSettings(dpi="auto"), shading=ShadingSettings(shading="none"), rotate="0")
    run(Job(scan=folder / "scan.obj", outputs=Outputs(page=folder / "page.png"), settings=settings))
    files = [("scan", (name, (folder / name).read_bytes())) for name in ("scan.obj", "scan.mtl", "scan.jpg")]
    return files, fingerprint((folder / "page.png").read_bytes())


def kill_now_and_then(server: Server, clients: Clients, over: threading.Event, killed: list[int]) -> None:
    while not over.wait(0.1):
        if len(clients.seconds) < KILL_EVERY * len(killed):
            continue
        for pid in server.workers()[:1]:
            try:
                os.kill(pid, signal.SIGKILL)
                killed.append(pid)
            except ProcessLookupError:
                pass


def with_kills(server: Server, scans: list[tuple[Files, str]], count: int, at_once: int, deadline: float) -> None:
    clients, over, killed = Clients(server, scans, deadline), threading.Event(), []
    killer = threading.Thread(target=kill_now_and_then, args=(server, clients, over, killed))
    work = threading.Thread(target=clients.all, args=(count, at_once))
    work.start()
    killer.start()
    while len(clients.pages) < count // 2 and time.monotonic() < deadline:
        time.sleep(0.2)
    before = dict(clients.pages)
    server.kill()
    server.start()
    kept = sum(
        fingerprint(httpx.get(server.address + page[1:], timeout=60).content) == right for page, right in before.items()
    )
    work.join()
    over.set()
    killer.join()
    print(f"\nWith {len(killed)} processes and the server killed: {count} scans, {told(clients.ends)}.")
    print(f"Finished before the server was killed: {len(before)}; there, and right, afterwards: {kept}.")


def told(ends: Counter[str]) -> str:
    return ", ".join(f"{count} {end}" for end, count in ends.items())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scans", type=int, default=1000)
    parser.add_argument("--at-once", type=int, default=50)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--killed", type=int, default=100)
    parser.add_argument("--minutes", type=float, default=60)
    told_to = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit("ended from outside"))  # and the server with it
    deadline = time.monotonic() + 60 * told_to.minutes
    print(machine())
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        scans = [made(folder / f"{one}-{rng}", one, rng) for one in SHEETS for rng in range(2)]
        server = Server(folder / "served", told_to.jobs, 2 * told_to.at_once)
        try:
            marks = (told_to.scans // 10, told_to.scans // 2, told_to.scans)
            clients = Clients(server, scans, deadline)
            start = time.monotonic()
            clients.all(told_to.scans, told_to.at_once, marks)
            took = time.monotonic() - start
            middle, late, last = np.percentile(clients.seconds, [50, 95, 100])
            print(f"{told_to.scans} scans, {told_to.at_once} at once, {told_to.jobs} at work: {told(clients.ends)}.")
            print(f"{took:.0f} s, {took / told_to.scans:.2f} s a scan; a client waited {middle:.1f} s (median), "
                  f"{late:.1f} s (95 %), {last:.1f} s (longest).")  # fmt: skip
            print("Memory of the server, MB: " + ", ".join(f"{mb:.1f} after {n}" for n, mb in clients.memory.items()))
            with_kills(server, scans, told_to.killed, told_to.at_once, deadline)
        finally:
            server.kill()


if __name__ == "__main__":
    main()
