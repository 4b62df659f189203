"""Restored pages beside the true ones, with the field's own measures: python benchmarks/pages.py [CASE_DIR ...].

Sheets of the gallery are scanned virtually (300,000 points, 0.05 mm of noise, 12 megapixels), and so is what CASE_DIRs
hold (NAME.obj with its photo, NAME_page.png, NAME_truth.npz with the flat places, case.json with width_mm and
height_mm). `planish restore` runs with default settings; its page is compared with what was printed. Cells with three
figures read page / the same drawn through the true geometry / the raw photo, so that what no geometry can mend shows.

words missing: words of the true page, with their counts, that Tesseract does not find, in whatever order. character
error: edits per character; it jumps where columns are read in another order. The truth is Tesseract's reading of the
true page. MS-SSIM: Wang et al. 2003, in grey, both pages scaled to 598,400 pixels (the protocol of DocUNet). local
distortion: dense optical flow (DIS) from the true page to the restored one near its ink, rules left out, after the best
turn and shift without scaling. Needs Debian's tesseract-ocr. Prints a Markdown table.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from cases import Case, gallery, given
from likeness import as_docunet, grey
from machine import machine
from planish.illumination import remove_shading
from planish.io import read_scan, write_page
from planish.mesh import repair
from planish.render import draw
from planish.surface import smooth_normals
from truth import character_error, read_text

SHEETS = ("book", "spread", "wave", "miura", "curl", "letter")
DPI = 300.0
RULE = 0.1
"""Surroundings that change the other way by less than so much of what is usual are a rule's."""


def drawn_through_truth(case: Case, path: Path) -> None:
    """The page as the same drawing and removal of shade make it when every point lies where it truly does."""
    scan = read_scan(case.scan).scan
    shaded = draw(scan, case.flat, case.size_mm).page
    write_page(path, remove_shading(shaded, scan, case.flat, smooth_normals(scan.mesh, repair(scan).topology)).page)


# --- measures -------------------------------------------------------------------------------------------------------


def words_missing(text: str, true: str) -> float:
    """Part of the true words that are not there, in whatever order."""
    words = Counter(true.split())
    return (words - Counter(text.split())).total() / max(words.total(), 1)


def quarter_turns(page: np.ndarray, true: np.ndarray) -> int:
    """By how many quarter turns the page must be turned to read as the true one: 0 is upright."""
    size = (true.shape[1] // 12, true.shape[0] // 12)
    small = cv2.resize(true, size, interpolation=cv2.INTER_AREA).astype(float)
    ways = [cv2.resize(np.rot90(page, k), size, interpolation=cv2.INTER_AREA).astype(float) for k in range(4)]
    return int(np.argmax([np.corrcoef(small.ravel(), way.ravel())[0, 1] for way in ways]))


def distortion(page: np.ndarray, true: np.ndarray) -> tuple[np.ndarray, tuple[float, float]]:
    """The page moved rigidly onto the true one, and what is left: mean and 99 % quantile [mm] near ink."""
    moved = cv2.warpAffine(page, np.eye(2, 3), true.shape[::-1], borderValue=255)
    near = _print(_half(true))
    motion = np.eye(3)
    for _ in range(3):
        rows, cols = np.nonzero(near)
        flow = _flow(true, moved)[rows, cols]
        at = 2 * np.stack([cols, rows], axis=1).astype(float)
        motion = motion @ _rigid(at, at + 2 * flow)
        moved = cv2.warpAffine(
            page, motion[:2], true.shape[::-1], flags=cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP, borderValue=255
        )
    left = np.linalg.norm(_flow(true, moved)[near], axis=1) * 2 * 25.4 / DPI
    return moved, (float(left.mean()), float(np.quantile(left, 0.99)))


def _print(page: np.ndarray) -> np.ndarray:
    """Pixels near ink whose surroundings change both ways: along a rule nobody can see how far it slid."""
    near = cv2.dilate((page < 128).astype(np.uint8), np.ones((5, 5))) > 0
    lesser = cv2.cornerMinEigenVal(page, 15, 3)
    return near & (lesser > RULE * np.median(lesser[near]))


def _half(x: np.ndarray) -> np.ndarray:
    return cv2.resize(x, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)


def _flow(true: np.ndarray, moved: np.ndarray) -> np.ndarray:
    return cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM).calc(_half(true), _half(moved), None)


def _rigid(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The turn and shift, (3, 3), that bring places a closest to b; far ones count less."""
    turn, weight = np.eye(2), np.ones((len(a), 1))
    for _ in range(5):
        middle_a, middle_b = ((weight * x).sum(axis=0) / weight.sum() for x in (a, b))
        u, _, vt = np.linalg.svd((weight * (b - middle_b)).T @ (a - middle_a))
        turn = u @ np.diag([1, np.sign(np.linalg.det(u @ vt))]) @ vt
        off = np.linalg.norm((a - middle_a) @ turn.T - (b - middle_b), axis=1, keepdims=True)
        weight = 1 / (1 + (off / max(np.median(off), 1e-3)) ** 2)
    out = np.eye(3)
    out[:2, :2], out[:2, 2] = turn, middle_b - turn @ middle_a
    return out


# --- the table ------------------------------------------------------------------------------------------------------


def row(case: Case, folder: Path) -> str:
    page, report, best = folder / "page.png", folder / "report.json", folder / "true.png"
    command = [sys.executable, "-m", "planish", "restore", str(case.scan), "-o", str(page), "--report", str(report)]
    subprocess.run([*command, "-q"], check=False)
    drawn_through_truth(case, best)
    said = json.loads(report.read_text())["page"]
    off = [100 * (said[key] / true - 1) for key, true in zip(("width_mm", "height_mm"), case.size_mm, strict=True)]
    true, true_text = grey(case.page), read_text(case.page)
    texts = [read_text(path) for path in (page, best, case.photo)]
    turns = quarter_turns(grey(page), true)
    moved, left = distortion(np.ascontiguousarray(np.rot90(grey(page), turns)), true)
    similar = [as_docunet(x, true) for x in (moved, distortion(grey(best), true)[0], grey(case.photo))]
    return (
        f"| {case.name} | {_three(100 * words_missing(text, true_text) for text in texts)} | "
        f"{_three((character_error(text, true_text) for text in texts), 4)} | {_three(similar, 4)} | "
        f"{left[0]:.3f}, {left[1]:.2f} | {off[0]:+.3f}, {off[1]:+.3f} | {'no' if turns else 'yes'} |"
    )


def _three(figures: Iterator[float] | list[float], digits: int = 1) -> str:
    return " / ".join(f"{figure:.{digits}f}" for figure in figures)


def main() -> None:
    print(machine(), "\n")
    print(
        "| scan | words missing, % | character error | MS-SSIM | local distortion, mm (mean, 99 %) | size off, % "
        "| upright |"
    )
    print("|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        made = (replace(case, name=f"{case.name} (gallery)") for case in gallery(Path(folder), SHEETS))
        for case in (*made, *map(given, map(Path, sys.argv[1:]))):
            print(row(case, Path(folder)), flush=True)


if __name__ == "__main__":
    main()
