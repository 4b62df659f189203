"""Texture coordinates of a mesh, from file to file, beside libigl's SLIM: time and memory per million points.

    python benchmarks/unwrapping.py [--points N ...] [--slim N ...] [--noise MM ...]

Each run is a process of its own that reads an OBJ (a random mesh of a book page) and writes one with texture
coordinates: `planish flatten --as uv`, and libigl's SLIM (symmetric Dirichlet, 8 iterations from its LSCM, as in
benchmarks/flattening.py). Seconds of the clock and of all processors and the greatest memory are those of the whole
process, Python's start included; planish's kernels are compiled before. rms mm: every point against the truth, after a
rigid fit without scaling. Prints a Markdown table.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

import numpy as np

from flattening import slim
from machine import machine
from planish.gallery import sheet, sheet_mesh
from planish.types import Mesh
from truth import rigid_rms

GB = 1e9
UNITS_OF_MAXRSS = 1 if sys.platform == "darwin" else 1024


def run_slim(source: Path, target: Path) -> None:
    """What the process of the peer does."""
    import igl

    points, faces = igl.read_triangle_mesh(str(source))
    uv = slim(Mesh(points, faces))
    with target.open("w") as file:
        np.savetxt(file, points, "v %.6f %.6f %.6f")
        np.savetxt(file, uv, "vt %.6f %.6f")
        np.savetxt(file, np.repeat(faces + 1, 2, axis=1), "f %d/%d %d/%d %d/%d")


def measured(command: list[str]) -> tuple[float, float, float]:
    """Seconds of the clock and of the processors, and greatest memory [GB], of a process."""
    start = perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"{' '.join(command)} ended with {process.returncode}")
    return perf_counter() - start, used.ru_utime + used.ru_stime, used.ru_maxrss * UNITS_OF_MAXRSS / GB


def coordinates(path: Path) -> np.ndarray:
    """The texture coordinates of an OBJ in the order of its points, v down."""
    with path.open() as lines:
        uv = np.array([line.split()[1:3] for line in lines if line.startswith("vt ")], np.float64)
    return uv * [1, -1]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", nargs="*", type=int, default=[100_000, 300_000, 1_000_000])
    parser.add_argument("--slim", nargs="*", type=int, default=[100_000])
    parser.add_argument("--noise", nargs="*", type=float, default=[0.0, 0.05])
    parser.add_argument("--peer", nargs=2, type=Path, help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.peer:
        run_slim(*asked.peer)
        return
    print(machine(), "\n")
    print("| method | points | noise, mm | s | s of processors | GB | s a million points | GB a million | rms mm |")
    print("|---|---|---|---|---|---|---|---|---|")
    with TemporaryDirectory() as made:
        source, target = Path(made) / "mesh.obj", Path(made) / "flat.obj"
        ours = [sys.executable, "-m", "planish", "flatten", str(source), "-o", str(target), "--as", "uv", "-q"]
        ways = {
            "planish": (
                [*ours, "--units", "mm", "--distortion", str(Path(made) / "d.json")],
                asked.points,
            ),
            "libigl SLIM": ([sys.executable, __file__, "--peer", str(source), str(target)], asked.slim),
        }
        warm = False
        for count in sorted({*asked.points, *asked.slim}):
            for noise in asked.noise:
                mesh, truth = sheet_mesh(sheet("book"), count, layout="delaunay", noise_mm=noise)
                with source.open("w") as file:
                    np.savetxt(file, mesh.points, "v %.6f %.6f %.6f")
                    np.savetxt(file, mesh.faces + 1, "f %d %d %d")
                for name, (command, counts) in ways.items():
                    if count not in counts:
                        continue
                    if not warm:
                        measured(ways["planish"][0])
                        warm = True
                    clock, work, memory = measured(command)
                    off = rigid_rms(coordinates(target), truth)
                    million = len(mesh.points) / 1e6
                    print(
                        f"| {name} | {len(mesh.points):,} | {noise:g} | {clock:.1f} | {work:.1f} | {memory:.2f} | "
                        f"{clock / million:.0f} | {memory / million:.2f} | {off:.3f} |",
                        flush=True,
                    )


if __name__ == "__main__":
    main()
