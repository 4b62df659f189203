"""The error that the report expects, beside the true one: python benchmarks/expected_error.py [HANDHELD_DIR].

HANDHELD_DIR holds *.obj of one sheet in several shapes and flat_truth_mm.csv, its points held flat. Prints a Markdown
table; the last column is expected / true.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from machine import machine
from planish.flattening import flatten
from planish.gallery import sheet, sheet_mesh
from planish.io import read_scan
from planish.mesh import clean
from planish.settings import FlattenSettings
from planish.types import Scan
from truth import rigid_rms

NOISES = ((0.0, 0), (0.05, 0), (0.05, 3), (0.2, 0))


def row(name: str, noise: str, scan: Scan, truth: np.ndarray, settings: FlattenSettings) -> str:
    cleaned = clean(scan)
    flat = flatten(cleaned.scan.mesh, cleaned.topology, settings)
    kept = cleaned.place >= 0
    true = rigid_rms(flat.page_xy[cleaned.place[kept]], truth[kept])
    expected = float(np.sqrt(np.mean(flat.error_mm**2)))
    return (
        f"| {name} | {noise} | {settings.method} | {flat.solved_points:,} | {flat.outcome.name} | {true:.4f} | "
        f"{expected:.4f} | {expected / max(true, 1e-9):.2f} |"
    )


def main() -> None:
    print(machine(), "\n")
    print("| sheet | noise, mm (correlated over px) | method | points | outcome | true rms mm | expected | ratio |")
    print("|---|---|---|---|---|---|---|---|")
    for name in ("book", "spread", "letter", "curl", "wave", "miura", "crumpled"):
        for noise, reach in NOISES:
            mesh, truth = sheet_mesh(sheet(name), points=60_000, noise_mm=noise, noise_correlation_px=reach)
            for settings in (FlattenSettings(), FlattenSettings(method="verlet")):
                print(row(name, f"{noise} ({reach})", Scan(mesh), truth, settings), flush=True)
    for folder in map(Path, sys.argv[1:]):
        truth = np.loadtxt(folder / "flat_truth_mm.csv", delimiter=",", comments="#")
        for path in sorted(folder.glob("*.obj")):
            print(row(path.stem, "real", read_scan(path).scan, truth, FlattenSettings()), flush=True)


if __name__ == "__main__":
    main()
