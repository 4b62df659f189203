"""Pages from one photo, beside the photo itself and page-dewarp.

    python benchmarks/photo.py PHOTOS [--page-dewarp PROGRAM] [--only books|invoices|shapes]

PHOTOS is a folder with photos of book pages, NAME.jpg, and their text, NAME.txt, where it is known; and folders of
invoices: flat_document.png, ground_truth_words.json and warped_document_KIND_LIGHT.jpg (Inv3D, Hertlein et al. 2023).
Needs Debian's tesseract-ocr. Prints Markdown tables:

- books: character error, seconds from start to end, how straight the lines of text are (rms distance of their letters
  from straight lines, in heights of letters, measured on the page by planish's own finder of lines);
- invoices, by kind of warp: letters in words that were misread, MS-SSIM against the flat page (Wang et al. 2003, both
  grey and of 598,400 pixels, as in the DocUNet protocol), and how many got a warning of folds;
- shapes: sheets of the gallery photographed virtually, mm off the true page (rms, after the best scale).
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections import defaultdict
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import cv2
import numpy as np
from scipy.interpolate import LinearNDInterpolator

from likeness import as_docunet, grey
from machine import machine
from planish import InputError, Scan, restore
from planish.gallery import VirtualScan, sheet, typeset_page, virtual_scan
from planish.mesh import project
from planish.photo import find_shape
from planish.photo.lines import text_lines
from planish.photo.look import look_at
from planish.settings import PhotoSettings
from truth import character_error, read_text

SHEETS = ("flat", "book", "letter", "wave", "curl")
METHODS = ("auto", "text-lines", "shading", "polynomial")


def planish(photo: Path, folder: Path, *options: str) -> tuple[Path, float, dict]:
    page, report = folder / "planish.png", folder / "planish.json"
    page.unlink(missing_ok=True)
    command = [sys.executable, "-m", "planish", "photo", str(photo), "-o", str(page), "--report", str(report), "-q"]
    start = perf_counter()
    subprocess.run([*command, *options], check=False)
    return page, perf_counter() - start, json.loads(report.read_text()) if page.exists() else {}


def page_dewarp(program: str, photo: Path, folder: Path) -> tuple[Path, float]:
    start = perf_counter()
    subprocess.run([program, str(photo)], cwd=folder, check=False, capture_output=True)
    return folder / f"{photo.stem}_thresh.png", perf_counter() - start


def error(page: Path, text: str) -> float:
    return min(character_error(read_text(page), text), 1.0) if page.exists() else 1.0


def crookedness(page: Path) -> float:
    """Rms distance of letters from the straight line through each line of 8 letters or more, in heights of letters."""
    if not page.exists():
        return np.nan
    pixels = cv2.imread(str(page))
    lines = text_lines(look_at(pixels))
    if lines is None:
        return np.nan
    off = []
    for k in range(len(lines.height)):
        xy = lines.photo_xy[lines.line == k]
        if len(xy) >= 8:
            fit = np.polyfit(xy[:, 0], xy[:, 1], 1)
            off.append((xy[:, 1] - np.polyval(fit, xy[:, 0])) / lines.height[k])
    return float(np.sqrt(np.mean(np.concatenate(off) ** 2))) if off else np.nan


def ms_ssim(page: Path, flat: Path) -> float:
    return as_docunet(grey(page), grey(flat)) if page.exists() else 0.0


def words(path: Path) -> str:
    """The words in order of lines: those whose middles are level are one line."""
    found = json.loads(path.read_text())
    found.sort(key=lambda w: w["top"] + w["height"] / 2)
    lines: list[list[dict]] = []
    for word in found:
        middle = word["top"] + word["height"] / 2
        if lines and abs(middle - np.mean([w["top"] + w["height"] / 2 for w in lines[-1]])) < 15:
            lines[-1].append(word)
        else:
            lines.append([word])
    return " ".join(w["text"] for line in lines for w in sorted(line, key=lambda w: w["left"]))


def word_error(page: Path, true: str) -> float:
    """Part of the true words' letters in words that were not read: the order of a form's words is anybody's guess."""
    if not page.exists():
        return 1.0
    read = read_text(page).split()
    missed = 0
    for word in true.split():
        best = min((character_error(r, word) for r in read if abs(len(r) - len(word)) <= len(word)), default=1.0)
        missed += min(best, 1.0) * len(word)
    return missed / max(len(true.replace(" ", "")), 1)


def books(photos: Path, rival: str | None, folder: Path) -> None:
    print("| photo | character error: photo | page-dewarp | planish | seconds: page-dewarp | planish "
          "| crookedness: photo | page-dewarp | planish |")  # fmt: skip
    print("|---|---|---|---|---|---|---|---|---|")
    for photo in sorted(photos.glob("*.jpg")):
        known = photo.with_suffix(".txt")
        text = " ".join(known.read_text().split()) if known.exists() else None
        planish(photo, folder)  # the first run may compile
        theirs, their_seconds = page_dewarp(rival, photo, folder) if rival else (folder / "none", np.nan)
        ours, seconds, _ = planish(photo, folder)
        errors = [f"{error(page, text):.4f}" if text else "" for page in (photo, theirs, ours)]
        crooked = [f"{crookedness(page):.3f}" for page in (photo, theirs, ours)]
        print(f"| {photo.stem} | {' | '.join(errors)} | {their_seconds:.1f} | {seconds:.1f} | {' | '.join(crooked)} |")


def invoices(photos: Path, rival: str | None, folder: Path) -> None:
    table: dict[str, list[list[float]]] = defaultdict(list)
    for case in sorted(path.parent for path in photos.glob("*/flat_document.png")):
        true = words(case / "ground_truth_words.json")
        for photo in sorted(case.glob("warped_document_*.jpg")):
            kind = photo.stem.split("_")[2]
            theirs = page_dewarp(rival, photo, folder)[0] if rival else folder / "none"
            ours, _, said = planish(photo, folder)
            flat = case / "flat_document.png"
            pages = (photo, theirs, ours)
            folded = any("folded or crumpled" in warning for warning in said.get("warnings", []))
            table[kind].append(
                [*(word_error(page, true) for page in (*pages, flat)), *(ms_ssim(page, flat) for page in pages), folded]
            )
            theirs.unlink(missing_ok=True)
    print("| kind | photos | letters misread: photo | page-dewarp | planish | flat original "
          "| MS-SSIM: photo | page-dewarp | planish | warned of folds |")  # fmt: skip
    print("|---|---|---|---|---|---|---|---|---|---|")
    for kind, rows in table.items():
        mean = np.mean(rows, axis=0)
        values = " | ".join(f"{value:.3f}" for value in mean[:7])
        print(f"| {kind} | {len(rows)} | {values} | {round(mean[7] * len(rows))} |", flush=True)


def mm_off(made: VirtualScan, scan: Scan) -> float:
    """Rms distance [mm] on the page from the true place, after the best turn, shift and scale: of what is drawn."""
    width, height = made.sheet.width_mm, made.sheet.height_mm
    x, y = np.meshgrid(np.linspace(3, width - 3, 40), np.linspace(3, height - 3, 50))
    true = np.stack([x.ravel(), y.ravel()], axis=1)
    flat = restore(replace(scan, photo=None)).flattening.page_xy
    got = LinearNDInterpolator(scan.photo_xy, flat)(project(made.scan.camera, made.sheet.bend(true)))
    seen = np.isfinite(got).all(axis=1)
    a, b = got[seen] - got[seen].mean(0), true[seen] - true[seen].mean(0)
    u, s, vt = np.linalg.svd(a.T @ b)
    return float(np.sqrt(((a @ u @ vt * s.sum() / (a**2).sum() - b) ** 2).sum(1).mean()))


def shapes(photos: Path, rival: str | None, folder: Path) -> None:
    print(f"| sheet | {' | '.join(METHODS)} |\n|{'---|' * (1 + len(METHODS))}")
    for name in SHEETS:
        bent = sheet(name)
        printed = typeset_page(bent.width_mm, bent.height_mm, picture=True) if name == "book" else None
        for what, print_ in ((name, None), *([(f"{name}, with a picture", printed)] if printed else [])):
            made = virtual_scan(bent, points=3000, photo_px=(4000, 3000), tilt_deg=5.0, printed=print_)
            print(f"| {what} | {' | '.join(_one_shape(made, method) for method in METHODS)} |", flush=True)


def _one_shape(made: VirtualScan, method: str) -> str:
    try:
        found = find_shape(made.scan.photo, PhotoSettings(shape=method), focal_px=float(made.scan.camera.matrix[0, 0]))
    except InputError:
        return "refused"
    warned = any("folded or crumpled" in warning for warning in found.warnings)
    return f"{mm_off(made, found.scan):.2f}{', warned' if warned else ''}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("photos", type=Path)
    parser.add_argument("--page-dewarp", dest="rival")
    parser.add_argument("--only", choices=("books", "invoices", "shapes"))
    asked = parser.parse_args()
    rival = str(Path(asked.rival).resolve()) if asked.rival else None
    print(machine(), "\n")
    for name, part in (("shapes", shapes), ("books", books), ("invoices", invoices)):
        if asked.only in (None, name):
            with tempfile.TemporaryDirectory() as folder:
                part(asked.photos.resolve(), rival, Path(folder))
            print()


if __name__ == "__main__":
    main()
