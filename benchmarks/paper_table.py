"""The paper's Table 1 with this program: the particle system at 1,000, 4,000, 16,000 and all points.

    python benchmarks/paper_table.py [CASE_DIR ...] [--all-points-steps N]

Without arguments two virtual scans of the gallery are used (a thick book's page, a letter folded in three with
0.05 mm of noise). A CASE_DIR holds NAME.obj and NAME_truth.npz, whose `flat` is the true place (n, 2) of every point.
Prints a Markdown table. Times are of the second run, after compiling.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from time import perf_counter

import numpy as np

from machine import machine
from planish.flattening import simulate_verlet
from planish.gallery import sheet, virtual_scan
from planish.io import read_scan
from planish.mesh import onto_support_plane, prolongate, repair, subsample, topology
from planish.report import flipped_faces
from planish.settings import VerletSettings
from planish.sticks import make_sticks
from planish.types import Mesh, Scan
from truth import rigid_rms


def cases(folders: list[Path]):
    for folder in folders:
        obj = next(folder.glob("*.obj"))
        yield folder.name, read_scan(obj).scan, np.load(next(folder.glob("*_truth.npz")))["flat"]
    if not folders:
        for name, noise in (("book", 0.0), ("letter", 0.05)):
            made = virtual_scan(sheet(name), noise_mm=noise)
            yield name, made.scan, made.truth_xy


def rows(name: str, scan: Scan, truth: np.ndarray, lengths: str, all_steps: int):
    prepared = repair(scan)
    mesh = prepared.scan.mesh
    points, _, _ = onto_support_plane(mesh)
    standing = Mesh(points, mesh.faces)
    truth = truth[prepared.mesh_rows.argsort(kind="stable")[(prepared.mesh_rows < 0).sum() :]]
    for count in (1_000, 4_000, 16_000, len(points)):
        coarse = subsample(standing, prepared.topology, count) if count < len(points) else None
        solved = coarse.mesh if coarse else standing
        topo = topology(solved.faces, len(solved.points))
        settings = VerletSettings() if coarse else VerletSettings(max_steps=all_steps)
        for _ in range(2 if coarse else 1):  # the kernels are compiled by then
            start = perf_counter()
            sticks = make_sticks(solved, topo, lengths)
            made = perf_counter()
            settled = simulate_verlet(solved, sticks, settings)
            done = perf_counter()
        x = settled.points[:, :2]
        flat = prolongate(coarse, points, x) if coarse else x
        flips = flipped_faces(mesh.faces, flat * [1, -1])
        yield (
            f"| {name} | {lengths} | {len(x):,} | {len(sticks.rest):,} | {made - start:.3f} | {done - made:.2f} | "
            f"{len(settled.heights)} | {settled.outcome.name} | {settled.heights[-1]:.2f} | "
            f"{settled.residuals[-1]:.1e} | {rigid_rms(flat, truth):.3f} | {flips:,} |"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", type=Path)
    parser.add_argument("--all-points-steps", type=int, default=100, help="limit where no point is left out")
    asked = parser.parse_args()
    print(machine(), "\n")
    print(
        "| scan | bending sticks | points | sticks | making sticks, s | flattening, s | steps | outcome | height, mm "
        "| rms stick error | rms mm, every point | flips |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|---|---|")
    for name, scan, truth in cases(asked.cases):
        for lengths in ("straight", "unfolded"):
            for row in rows(name, scan, truth, lengths, asked.all_points_steps):
                print(row, flush=True)


if __name__ == "__main__":
    main()
