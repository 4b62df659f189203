"""Texture coordinates of a mesh, from file to file, beside libigl's SLIM: time and memory per million points.

    python benchmarks/unwrapping.py [--points N ...] [--slim N ...] [--noise MM ...]
    python benchmarks/unwrapping.py --segment PATH [--units 7.91um]

Each run is a process of its own that reads an OBJ (a random mesh of a book page) and writes one with texture
coordinates: `planish flatten --as uv`, and libigl's SLIM (symmetric Dirichlet, 8 iterations from its LSCM, as in
benchmarks/flattening.py). Seconds of the clock and of all processors and the greatest memory are those of the whole
process, Python's start included; planish's kernels are compiled before. rms mm: every point against the truth, after a
rigid fit without scaling. Of a real segment there is no truth: its distortion is printed instead, of its largest piece.
Prints a Markdown table.
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
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from flattening import slim
from machine import machine
from planish.gallery import sheet, sheet_mesh
from planish.geometry.distances import distances
from planish.io import read_scan
from planish.mesh import area_vectors, topology
from planish.pipeline import prepare
from planish.report import flipped_faces
from planish.sticks import face_distortion, strain
from planish.types import Mesh, Scan
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
    if process.returncode not in (0, 5):  # 5: "not good", but written
        raise SystemExit(f"{' '.join(command)} ended with {process.returncode}")
    return perf_counter() - start, used.ru_utime + used.ru_stime, used.ru_maxrss * UNITS_OF_MAXRSS / GB


def coordinates(path: Path) -> np.ndarray:
    """The texture coordinates of an OBJ in the order of its points, v down."""
    with path.open() as lines:
        uv = np.array([line.split()[1:3] for line in lines if line.startswith("vt ")], np.float64)
    return uv * [1, -1]


def write_obj(path: Path, mesh: Mesh) -> None:
    with path.open("w") as file:
        np.savetxt(file, mesh.points, "v %.6f %.6f %.6f")
        np.savetxt(file, mesh.faces + 1, "f %d %d %d")


def built(points: list[int], peer: list[int], noises: list[float], ways: dict[str, list[str]], folder: Path) -> None:
    """A table of book pages whose truth is known."""
    print("| method | points | noise, mm | s | s of processors | GB | s a million points | GB a million | rms mm |")
    print("|---|---|---|---|---|---|---|---|---|")
    for count in sorted({*points, *peer}):
        for noise in noises:
            mesh, truth = sheet_mesh(sheet("book"), count, layout="delaunay", noise_mm=noise)
            write_obj(folder / "mesh.obj", mesh)
            for name, counts in (("planish", points), ("libigl SLIM", peer)):
                if count not in counts:
                    continue
                clock, work, memory = measured(ways[name])
                off = rigid_rms(coordinates(folder / "flat.obj"), truth)
                million = len(mesh.points) / 1e6
                print(
                    f"| {name} | {len(mesh.points):,} | {noise:g} | {clock:.1f} | {work:.1f} | {memory:.2f} | "
                    f"{clock / million:.0f} | {memory / million:.2f} | {off:.3f} |",
                    flush=True,
                )


def segment(path: Path, units: str, ways: dict[str, list[str]], folder: Path) -> None:
    """A table of a real segment: mean / 99 % of the surface of each distortion, against the surface as it is."""
    mesh = largest_piece(read_scan(path, units=units).scan.mesh)
    write_obj(folder / "mesh.obj", mesh)
    edges = topology(mesh.faces, len(mesh.points)).edges
    lengths = distances(mesh.points, edges)
    print(
        "| method | points | s | s of processors | GB | edges, rms % | area, % | angle, degrees | length, % | flips |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|")
    ways = {**ways, "planish, lengths of the file": [*ways["planish"], "--lengths", "unfolded"]}
    for name, command in ways.items():
        clock, work, memory = measured(command)
        page_xy = coordinates(folder / "flat.obj")
        values = np.abs(face_distortion(mesh.points, mesh.faces, page_xy)) * [100, 1, 100]
        known = np.isfinite(values[:, 0])
        weights = np.linalg.norm(area_vectors(mesh.points, mesh.faces), axis=1)[known]
        cells = [f"{np.average(v, weights=weights):.2g} / {quantile(v, weights):.2g}" for v in values[known].T]
        cells = [f"{100 * strain(page_xy, edges, lengths)[0]:.2f}", *cells, str(flipped_faces(mesh.faces, page_xy))]
        print(
            f"| {name} | {len(mesh.points):,} | {clock:.1f} | {work:.1f} | {memory:.2f} | {' | '.join(cells)} |",
            flush=True,
        )


def largest_piece(mesh: Mesh) -> Mesh:
    """SLIM takes one disc."""
    prepared = prepare(Scan(mesh))
    mesh = prepared.scan.mesh
    piece = np.asarray(connected_components(_neighbours(mesh))[1])
    kept = piece[mesh.faces[:, 0]] == np.bincount(piece).argmax()
    used, faces = np.unique(mesh.faces[kept], return_inverse=True)
    return Mesh(mesh.points[used], faces.reshape(-1, 3))


def _neighbours(mesh: Mesh) -> coo_array:
    a, b = mesh.faces.ravel(), np.roll(mesh.faces, 1, axis=1).ravel()
    return coo_array((np.ones(len(a), bool), (a, b)), shape=(len(mesh.points),) * 2)


def quantile(values: np.ndarray, weights: np.ndarray) -> float:
    order = np.argsort(values)
    share = np.cumsum(weights[order])
    return float(values[order[np.searchsorted(share, 0.99 * share[-1])]])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", nargs="*", type=int, default=[100_000, 300_000, 1_000_000])
    parser.add_argument("--slim", nargs="*", type=int, default=[100_000])
    parser.add_argument("--noise", nargs="*", type=float, default=[0.0, 0.05])
    parser.add_argument("--segment", type=Path, help="a real segment instead, OBJ or tifxyz")
    parser.add_argument("--units", default="7.91um", help="of the segment")
    parser.add_argument("--peer", nargs=2, type=Path, help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.peer:
        run_slim(*asked.peer)
        return
    with TemporaryDirectory() as made:
        source, target = str(Path(made) / "mesh.obj"), str(Path(made) / "flat.obj")
        ours = [sys.executable, "-m", "planish", "flatten", source, "-o", target, "--as", "uv", "--units", "mm", "-q"]
        ways = {
            "planish": [*ours, "--sheet", "all", "--distortion", str(Path(made) / "distortion.json")],
            "libigl SLIM": [sys.executable, __file__, "--peer", source, target],
        }
        write_obj(Path(source), sheet_mesh(sheet("book"), 3000, layout="delaunay", noise_mm=0.05)[0])
        measured(ways["planish"])  # compiles
        print(machine(), "\n")
        if asked.segment:
            segment(asked.segment, asked.units, ways, Path(made))
        else:
            built(asked.points, asked.slim, asked.noise, ways, Path(made))


if __name__ == "__main__":
    main()
