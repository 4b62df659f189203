"""Scans restored from start to end by the command line, and the page compared with the truth.

    python benchmarks/restored_pages.py [--method verlet] [CASE_DIR ...]

Without a CASE_DIR, sheets of the gallery are scanned virtually (300,000 points, 0.05 mm of noise, 12 megapixels) and
the true text is known. A CASE_DIR holds NAME.obj with its photo, NAME_page.png, the true page, and case.json with
width_mm and height_mm; there Tesseract's reading of the true page is the truth. Needs Debian's tesseract-ocr.
Prints a Markdown table: size, character error of the raw photo and of the page, seconds of a second run.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from cases import Case, gallery, given
from machine import machine
from truth import character_error, read_text, rigid_rms

SHEETS = ("book", "spread", "letter", "wave", "miura", "curl", "crumpled")


def row(case: Case, folder: Path, options: list[str]) -> str:
    page, flat, report = folder / "page.png", folder / "flat.obj", folder / "report.json"
    command = [sys.executable, "-m", "planish", "restore", str(case.scan), "-o", str(page), "--flat", str(flat)]
    for _ in range(2):  # the second run has its kernels compiled and its files in the cache
        subprocess.run([*command, "--report", str(report), "-q", *options], check=False)
    said = json.loads(report.read_text())
    size = said["page"]["width_mm"], said["page"]["height_mm"]
    off = [100 * (got / true - 1) for got, true in zip(size, case.size_mm, strict=True)]
    places = np.array([line.split()[1:3] for line in flat.read_text().splitlines() if line.startswith("v ")], float)
    true_text = read_text(case.page)
    return (
        f"| {case.name} | {said['flatten']['method']} | {said['flatten']['points']:,} | "
        f"{'yes' if said['settled'] else 'no'} | "
        f"{size[0]:.1f} x {size[1]:.1f} | {off[0]:+.3f}, {off[1]:+.3f} | {rigid_rms(places, case.flat):.3f} | "
        f"{said['flatten']['flipped_faces']} | {character_error(read_text(case.photo), true_text):.3f} | "
        f"{character_error(read_text(page), true_text):.4f} | {said['flatten']['seconds']:.2f} | "
        f"{said['seconds_total']:.1f} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", type=Path)
    parser.add_argument("--method", default="multigrid")
    asked = parser.parse_args()
    print(machine(), "\n")
    print(
        "| scan | method | points solved | settled | page, mm | size off, % | rms mm, every point | flips "
        "| character error, photo | character error, page | flattening, s | all, s |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        cases = map(given, asked.cases) if asked.cases else gallery(Path(folder), SHEETS)
        for case in cases:
            print(row(case, Path(folder), ["--method", asked.method]), flush=True)


if __name__ == "__main__":
    main()
