"""Noise of every kind: how true the page is, what the program says of it, and what others make of the same mesh.

    python benchmarks/noise.py [--points N] [--sheets NAME ...] [--kinds KIND ...] [--no-peers] [--no-real]

Sheets of the gallery are scanned virtually, with the kinds of noise that real scanners have, and flattened from bare
points and faces, so that the program finds by itself where the scanner stood. rms: every point against the truth after
a rigid fit without scaling; size: of the flat sheet against the true one; noise: standard deviation and length that the
report tells; ratio: expected over true error. Then scans of 20,000 points are flattened by libigl's ARAP and SLIM too
(8 iterations from LSCM; they keep the noisy lengths). Real captures are read from ../shared where it is, and judged by
what is known of them: the size of a flat piece, or two scans of one sheet. Prints Markdown tables; failures stay in
them.
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Callable
from pathlib import Path
from time import perf_counter

import numpy as np

import planish
from flattening import arap, slim
from machine import machine
from planish.gallery import NoiseSpec, sheet, sheet_mesh, virtual_scan
from planish.io import read_scan
from planish.types import Flattening, Mesh, Page
from truth import rigid_rms

SHARED = Path(__file__).parents[2] / "shared"

SEED, PEER_POINTS = 1234, 20_000

KINDS: dict[str, NoiseSpec] = {
    "none": NoiseSpec(),
    "white 0.05": NoiseSpec(white_mm=0.05),
    "white 0.02 to 0.15": NoiseSpec(white_mm=(0.02, 0.15)),
    "shared over 1 point, 0.07": NoiseSpec(correlated_mm=0.07, correlation_px=1),
    "shared over 3 points, 0.07": NoiseSpec(correlated_mm=0.07, correlation_px=3),
    "shared over 10 points, 0.1": NoiseSpec(correlated_mm=0.1, correlation_px=10),
    "ripple 0.12, 7 points": NoiseSpec(ripple_mm=0.12),
    "ripple 0.12, 9 points, across": NoiseSpec(ripple_mm=0.12, ripple_px=9, ripple_deg=84),
    "steps 0.5, white 0.12": NoiseSpec(white_mm=0.12, step_mm=0.5),
    "spikes 0.2 %, white 0.05": NoiseSpec(white_mm=0.05, spikes=0.002),
    "all: ripple, steps 0.2, white, spikes": NoiseSpec(white_mm=0.05, ripple_mm=0.08, step_mm=0.2, spikes=0.002),
    "white 0.05, thinned to 40 %": NoiseSpec(white_mm=0.05, keep=0.4),
}

FLAT_PIECES = {
    "cases/relief-steps/crop_20_0_8.obj": (16.0, 16.0),
    "cases/relief-steps/crop_-60_10_15.obj": (13.6, 30.6),
    "cases/depth-one-frame/whole-mm-plane.obj": (38.94, 38.94),
    "cases/scan-waves/plane.obj": (39.0, 59.0),
    "cases/scan-waves/board-crop.obj": (36.4, 36.4),
}

FAMILIES = {
    "david, two scans of a page": ("data/field/david/Scan_146.obj", "data/field/david/Scan_148.obj"),
    "mat, three poses": tuple(f"data/field/mat/shape_{k:02d}.obj" for k in (0, 24, 48)),
    "hulk, five poses": tuple(f"data/field/hulk/shape_{k:02d}.obj" for k in range(5)),
}


def scanned(name: str, noise: NoiseSpec, points: int) -> tuple[Mesh, np.ndarray]:
    paper = sheet(name)
    shape = round(paper.height_mm), round(paper.width_mm)
    blank = Page(np.full(shape, 255, np.uint8), np.ones(shape, bool), 25.4), ""
    made = virtual_scan(paper, points=points, photo_px=None, printed=blank, noise=noise, rng=SEED)
    return made.scan.mesh, made.truth_xy


def spread(xy: np.ndarray) -> float:
    return float(np.sqrt(((xy - xy.mean(axis=0)) ** 2).sum()))


def told(flat: Flattening) -> str:
    height = "" if flat.noise_mm is None else f"{flat.noise_mm:.3f}"
    length = "" if flat.noise_length_mm is None else f" / {flat.noise_length_mm:.1f}"
    return f"{height}{length} | {flat.spikes or ''}"


def expected(flat: Flattening) -> float:
    return float(np.sqrt((flat.error_mm**2).mean()))


def virtual_row(name: str, kind: str, points: int) -> str:
    mesh, truth = scanned(name, KINDS[kind], points)
    start = perf_counter()
    flat = planish.flatten(mesh)
    seconds = perf_counter() - start
    true = rigid_rms(flat.page_xy, truth)
    return (
        f"| {name} | {kind} | {len(truth):,} | {true:.4f} | {100 * (spread(flat.page_xy) / spread(truth) - 1):+.3f} | "
        f"{told(flat)} | {expected(flat):.4f} | {expected(flat) / max(true, 1e-9):.2f} | {flat.overlaps} | "
        f"{flat.outcome.name.lower()} | {seconds:.1f} |"
    )


def peer_row(name: str, kind: str) -> str:
    mesh, truth = scanned(name, KINDS[kind], PEER_POINTS)
    solvers = (lambda mesh: planish.flatten(mesh).page_xy, arap, slim)
    return f"| {name} | {kind} |" + "".join(f" {by_peer(solve, mesh, truth)} |" for solve in solvers)


def by_peer(solve: Callable[[Mesh], np.ndarray], mesh: Mesh, truth: np.ndarray) -> str:
    start = perf_counter()
    try:
        xy = solve(mesh)
    except (RuntimeError, ValueError) as error:
        return f"failed: {error}"
    return (
        f"{rigid_rms(xy, truth):.3f} ({100 * (spread(xy) / spread(truth) - 1):+.2f} %), {perf_counter() - start:.1f} s"
    )


def flat_piece_row(path: str, size: tuple[float, float]) -> str:
    flat = planish.flatten(read_scan(SHARED / path, units="mm").scan.mesh)
    found = sorted(flat.size_mm)
    worst = max(abs(a / b - 1) for a, b in zip(found, sorted(size), strict=True))
    return (
        f"| {path} | {size[0]} x {size[1]} | {found[0]:.2f} x {found[1]:.2f} | {100 * worst:.1f} % | {told(flat)} | "
        f"{expected(flat):.3f} | {flat.overlaps} | {flat.outcome.name.lower()} |"
    )


def family_row(name: str, paths: tuple[str, ...]) -> str:
    """Poses of one sheet with one mesh must flatten alike: worst rms between two of them. Else only their sizes."""
    flats = [planish.flatten(read_scan(SHARED / path, units="mm").scan.mesh) for path in paths]
    sizes = ", ".join(f"{w:.1f} x {h:.1f}" for w, h in (flat.size_mm for flat in flats))
    apart = ""
    if len({len(flat.page_xy) for flat in flats}) == 1:
        apart = f"{max(rigid_rms(a.page_xy, b.page_xy) for a, b in itertools.combinations(flats, 2)):.2f} mm apart"
    strain = max(flat.strain[0] for flat in flats)
    overlaps = sum(flat.overlaps for flat in flats)
    worst = max(map(expected, flats))
    return f"| {name} | alike | {sizes} | {apart} | {told(flats[0])} | {worst:.3f} | {overlaps} | strain {strain:.2%} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", type=int, default=200_000)
    parser.add_argument("--sheets", nargs="+", default=["book", "letter", "wave"], metavar="NAME")
    parser.add_argument("--kinds", nargs="+", default=list(KINDS), choices=list(KINDS), metavar="KIND")
    parser.add_argument("--no-peers", action="store_true")
    parser.add_argument("--no-real", action="store_true")
    asked = parser.parse_args()
    planish.flatten(*_small())  # compiles the kernels
    print(machine(), "\n")
    print(
        "| sheet | noise, mm | points | rms, mm | size, % | noise found, mm / length | spikes | expected, mm | ratio "
        "| overlaps | outcome | s |"
    )
    print("|" + 12 * "---|")
    for name in asked.sheets:
        for kind in asked.kinds:
            print(virtual_row(name, kind, asked.points), flush=True)
    if not asked.no_peers:
        print(f"\n| {PEER_POINTS:,} points | noise, mm | planish, mm | ARAP, mm | SLIM, mm |\n|---|---|---|---|---|")
        for name in asked.sheets:
            for kind in asked.kinds:
                print(peer_row(name, kind), flush=True)
    if asked.no_real or not SHARED.is_dir():
        return
    print(
        "\n| capture | true, mm | found, mm | off | noise found, mm / length | spikes | expected, mm | overlaps | end |"
    )
    print("|" + 9 * "---|")
    for path, size in FLAT_PIECES.items():
        if (SHARED / path).exists():
            print(flat_piece_row(path, size), flush=True)
    for name, paths in FAMILIES.items():
        if all((SHARED / path).exists() for path in paths):
            print(family_row(name, paths), flush=True)


def _small() -> tuple[np.ndarray, np.ndarray]:
    mesh, _ = sheet_mesh(sheet("wave"), 3000, noise_mm=0.1)
    return mesh.points, mesh.faces


if __name__ == "__main__":
    main()
