"""The error that the report expects, beside the true one: python benchmarks/expected_error.py [HANDHELD_DIR].

HANDHELD_DIR holds *.obj of one sheet in several shapes and flat_truth_mm.csv, its points held flat. Noise lies along
the scanner's rays, and is taken out of the points where it is known where these come from; on random meshes it goes in
all directions. Prints a Markdown table; the last column is expected / true.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from machine import machine
from planish.flattening import flatten
from planish.gallery import sheet, sheet_mesh
from planish.gallery.meshes import SCANNER_MM
from planish.io import read_scan
from planish.mesh import repair
from planish.settings import FlattenSettings
from planish.types import Scan
from truth import rigid_rms

MULTIGRID, VERLET = FlattenSettings(), FlattenSettings(method="verlet")
KINDS: dict[str, tuple[dict, np.ndarray | None, FlattenSettings]] = {
    "none": ({}, None, MULTIGRID),
    "0.05": ({"noise_mm": 0.05}, None, MULTIGRID),
    "0.05, rays known": ({"noise_mm": 0.05}, SCANNER_MM, MULTIGRID),
    "0.05 over 3 px": ({"noise_mm": 0.05, "noise_correlation_px": 3}, None, MULTIGRID),
    "0.05 over 3 px, rays known": ({"noise_mm": 0.05, "noise_correlation_px": 3}, SCANNER_MM, MULTIGRID),
    "0.2": ({"noise_mm": 0.2}, None, MULTIGRID),
    "0.2, rays known": ({"noise_mm": 0.2}, SCANNER_MM, MULTIGRID),
    "0.05, random mesh": ({"noise_mm": 0.05, "layout": "delaunay"}, None, MULTIGRID),
    "none, 1,000 points": ({}, None, VERLET),
    "0.05, 1,000 points": ({"noise_mm": 0.05}, None, VERLET),
}


def row(
    name: str, kind: str, scan: Scan, truth: np.ndarray, settings: FlattenSettings, eye: np.ndarray | None = None
) -> str:
    prepared = repair(scan)
    flat = flatten(prepared.scan.mesh, prepared.topology, settings, eye=eye)
    kept = prepared.mesh_rows >= 0
    true = rigid_rms(flat.page_xy[prepared.mesh_rows[kept]], truth[kept])
    expected = float(np.sqrt(np.mean(flat.error_mm**2)))
    return (
        f"| {name} | {kind} | {settings.method} | {flat.solved_points:,} | {flat.outcome.name} | {true:.4f} | "
        f"{expected:.4f} | {expected / max(true, 1e-9):.2f} |"
    )


def main() -> None:
    print(machine(), "\n")
    print("| sheet | noise, mm | method | points | outcome | true rms mm | expected | ratio |")
    print("|---|---|---|---|---|---|---|---|")
    for name in ("book", "spread", "letter", "curl", "wave", "miura", "crumpled"):
        for kind, (noise, eye, settings) in KINDS.items():
            mesh, truth = sheet_mesh(sheet(name), points=60_000, **noise)
            print(row(name, kind, Scan(mesh), truth, settings, eye), flush=True)
    for folder in map(Path, sys.argv[1:]):
        truth = np.loadtxt(folder / "flat_truth_mm.csv", delimiter=",", comments="#")
        for path in sorted(folder.glob("*.obj")):
            print(row(path.stem, "real", read_scan(path).scan, truth, MULTIGRID), flush=True)


if __name__ == "__main__":
    main()
