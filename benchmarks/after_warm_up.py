"""Kernels that commands still compile after `planish warm-up`: python benchmarks/after_warm_up.py [WORD ...].

In a cache of kernels of its own, `planish warm-up` is run first, then the commands of the documentation on small scans
and virtual devices (those that have one of the words, if any are given), each in a process of its own. Prints a
Markdown table with the kernels that each of them added to the cache.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter

import planish
from machine import machine

COMMANDS = """
planish demo book -o demo
planish restore letter.obj -o p.tif --binary bw.png --flat flat.obj --report r.json --html h.html
planish restore page.glb -o p.png --dpi auto --stages stages
planish restore letter.obj -o p.pdf --certificate c.pdf --shading background
planish restore letter.obj -o p.jpg --shading none --pages 2
planish flatten letter.obj -o f.ply --distortion d.json
planish flatten letter.obj -o grid --as uv
planish flatten letter.obj -o f.obj --method verlet --verlet.max-steps 5
planish flatten letter.obj -o f.obj --method verlet --verlet.max-steps 5 --verlet.self-collision
planish flatten letter.obj -o f.obj --method mass-spring --points 500
planish flatten letter.obj -o f.obj --lengths straight
planish view r.json --no-open
planish photo letter.jpg -o g.png --paper letter
planish batch scans -o pages --dpi 100
planish acquire virtual depth -o vd --small
planish acquire depth vd/depth --photo vd/photo.png --camera vd/depth_camera.json
    --photo-camera vd/photo_camera.json -o vd/scan.ply
planish restore vd/scan.ply -o vd/page.tif
planish acquire virtual grid -o vg --small
planish acquire grid vg/range.ply -o vg/scan.ply
planish acquire virtual points -o vp --small
planish acquire points vp/points.ply --photo vp/photo.png --camera vp/photo_camera.json -o vp/scan.ply
planish acquire virtual gray-code -o vc --small
planish acquire gray-code vc/photos --camera vc/camera.json --projector vc/projector.json -o vc/scan.ply
planish acquire virtual laser-lines -o vl --small
"""


def kernels(cache: Path) -> set[str]:
    return {f"{path.parent.name}/{path.name}" for path in cache.rglob("*.nbc")}


def run(command: str, folder: Path, cache: Path) -> tuple[int, float, int]:
    """New kernels, seconds, exit code."""
    before, start = kernels(cache), perf_counter()
    name, *arguments = command.split()
    assert name == "planish"
    done = subprocess.run(
        [sys.executable, "-m", "planish", *arguments, "-q"],
        cwd=folder,
        env={**os.environ, "NUMBA_CACHE_DIR": str(cache)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    return len(kernels(cache) - before), perf_counter() - start, done.returncode


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("words", nargs="*")
    words = parser.parse_args().words
    print(machine(), "\n")
    print("| command | kernels compiled | seconds | exit code |")
    print("|---|---|---|---|")
    with tempfile.TemporaryDirectory() as room:
        folder, cache = Path(room) / "work", Path(room) / "kernels"
        (folder / "scans").mkdir(parents=True)
        scan = planish.gallery.virtual_scan(planish.gallery.sheet("letter"), points=5000, photo_px=(1000, 750)).scan
        for name in ("letter.obj", "page.glb", "scans/page.glb"):
            planish.write_scan(folder / name, scan)
        commands = COMMANDS.replace("\n    ", " ").strip().splitlines()
        chosen = [one for one in commands if not words or any(word in one for word in words)]
        for command in ["planish warm-up", *chosen]:
            new, seconds, code = run(command, folder, cache)
            print(f"| `{command}` | {new} | {seconds:.1f} | {code} |", flush=True)


if __name__ == "__main__":
    main()
