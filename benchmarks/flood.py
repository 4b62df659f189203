"""A hostile upload against `planish serve`: a small zip whose mesh names a material file of 300 million characters.

    python benchmarks/flood.py [--megabytes N]

The zip is as small as the service's limit on compression lets it be. While the job runs, /api/health is asked 20 times
a second. Told are the server's memory, the slowest answer, the size of the job table and the longest warning.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
import zipfile
from contextlib import ExitStack
from pathlib import Path

import httpx
import psutil

from machine import machine
from planish.gallery import sheet, virtual_scan
from planish.io import write_scan

RATIO = 190  # the service refuses zips that are packed 200 times smaller


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--megabytes", type=int, default=300)
    megabytes = options.parse_args().megabytes
    print(machine())
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        flood = hostile_zip(folder, megabytes)
        print(f"a zip of {flood.stat().st_size / 1e6:.1f} MB with a name of {megabytes} MB")
        measure(folder / "data", flood)


def hostile_zip(folder: Path, megabytes: int) -> Path:
    made = virtual_scan(sheet("book", width_mm=74, height_mm=105), points=2000, photo_px=(600, 450))
    write_scan(folder / "scan.obj", made.scan)
    mesh = (folder / "scan.obj").read_bytes().replace(b"mtllib scan.mtl", b"mtllib " + b"m" * (megabytes * 10**6))
    path = folder / "flood.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("scan.obj", mesh)
        archive.write(folder / "scan.jpg", "scan.jpg")
        archive.writestr("padding.txt", os.urandom(max(0, len(mesh) // RATIO - path.stat().st_size)))
    return path


def measure(data: Path, flood: Path) -> None:
    command = [sys.executable, "-m", "planish", "serve", "--port", "0", "--data", str(data), "--jobs", "1"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        server = psutil.Process(process.pid)
        with ExitStack() as ending, httpx.Client(base_url=process.stdout.readline().split()[-1], timeout=600) as client:
            ending.callback(process.terminate)
            while not client.get("/api/health").json()["warm"]:
                time.sleep(0.2)
            before = server.memory_info().rss
            fields = {"dpi": "auto", "formats": "png", "view": "false"}
            answer = client.post("/api/jobs", files=[("scan", (flood.name, flood.read_bytes()))], data=fields)
            answer.raise_for_status()
            job, slowest, most = answer.headers["location"], 0.0, server.memory_info().rss
            state = {"state": "queued"}
            while state["state"] in ("queued", "running"):
                start = time.monotonic()
                client.get("/api/health").raise_for_status()
                slowest = max(slowest, time.monotonic() - start)
                state = client.get(job).json()
                most = max(most, server.memory_info().rss)
                time.sleep(0.05)
    table = sum(path.stat().st_size for path in data.glob("jobs.sqlite*"))
    sentences = [*state["warnings"], state["sentence"]]
    print(f"memory of the server: {before / 1e6:.0f} MB before, {most / 1e6:.0f} MB at most")
    print(f"slowest answer of /api/health: {slowest:.3f} s")
    print(f"job table: {table / 1e3:.0f} KB; longest warning: {max(map(len, sentences))} characters")
    print(f"the job is {state['state']}: {json.dumps(sentences)[:300]}")


if __name__ == "__main__":
    main()
