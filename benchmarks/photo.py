"""Pages from one photo, beside the photo itself and what others make of it.

    python benchmarks/photo.py [PHOTOS] [--peers BIN ...] [--only books|invoices|shapes]

PHOTOS is a folder with photos of book pages, NAME.jpg, and their text, NAME.txt, where it is known; and folders of
invoices: flat_document.png, ground_truth_words.json and warped_document_KIND_LIGHT.jpg (Inv3D, Hertlein et al. 2023).
Without it only the shapes are made. Peers, page-dewarp and docuwarp from PyPI, are looked for on the PATH and in
--peers. Needs Debian's tesseract-ocr. Prints Markdown tables:

- shapes: sheets of the gallery photographed virtually, mm off the true page (rms, after the best scale);
- books: character error, seconds from start to end, how straight the lines of text are (rms distance of their letters
  from straight lines, in heights of letters, measured on the page by planish's own finder of lines);
- invoices, by kind of warp: letters in words that were misread; MS-SSIM (Wang et al. 2003) and local distortion (Ma et
  al. 2018) against the flat page, onto which each page was turned, shifted and scaled first: in grey, 598,400 pixels,
  and the mean flow near print in parts of the page's long side; and which warnings planish gave.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections import Counter, defaultdict
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import cv2
import numpy as np
from scipy.interpolate import LinearNDInterpolator

from likeness import as_docunet, brought_onto, grey, local_distortion
from machine import machine
from planish import InputError, Scan, restore
from planish.gallery import VirtualScan, sheet, typeset_page, virtual_scan
from planish.geometry import project
from planish.photo import find_shape
from planish.photo.lines import find_text_lines
from planish.photo.working_image import working_image
from planish.settings import PhotoSettings
from truth import character_error, read_text

SHEETS = ("flat", "book", "letter", "wave", "curl")
METHODS = ("auto", "text-lines", "shading", "polynomial")
WARNINGS = {"sheet-folded": "folds or crumples", "sides-bent": "bent in more than one direction"}


def planish(photo: Path, folder: Path, *options: str) -> tuple[Path, float, dict]:
    page, report = folder / "planish.png", folder / "planish.json"
    page.unlink(missing_ok=True)
    command = [sys.executable, "-m", "planish", "photo", str(photo), "-o", str(page), "--report", str(report), "-q"]
    start = perf_counter()
    subprocess.run([*command, *options], check=False)
    return page, perf_counter() - start, json.loads(report.read_text()) if page.exists() else {}


def page_dewarp(program: str, photo: Path, folder: Path) -> Path:
    subprocess.run([program, str(photo)], cwd=folder, check=False, capture_output=True)
    return folder / f"{photo.stem}_thresh.png"


def docuwarp(program: str, photo: Path, folder: Path) -> Path:
    copy = shutil.copy(photo, folder)
    subprocess.run([program, copy], cwd=folder, check=False, capture_output=True)
    return folder / f"{photo.stem}_unwarp{photo.suffix}"


PEERS = {"page-dewarp": page_dewarp, "docuwarp": docuwarp}


def error(page: Path, text: str) -> float:
    return min(character_error(read_text(page), text), 1.0) if page.exists() else 1.0


def crookedness(page: Path) -> float:
    """Rms distance of letters from the straight line through each line of 8 letters or more, in heights of letters."""
    if not page.exists():
        return np.nan
    pixels = cv2.imread(str(page))
    lines = find_text_lines(working_image(pixels))
    if lines is None:
        return np.nan
    off = []
    for k in range(len(lines.height)):
        xy = lines.photo_xy[lines.line == k]
        if len(xy) >= 8:
            fit = np.polyfit(xy[:, 0], xy[:, 1], 1)
            off.append((xy[:, 1] - np.polyval(fit, xy[:, 0])) / lines.height[k])
    return float(np.sqrt(np.mean(np.concatenate(off) ** 2))) if off else np.nan


def likeness(page: Path, flat: Path) -> tuple[float, float]:
    """MS-SSIM and local distortion; as bad as can be, and nothing, where nothing of the flat page is found on it."""
    true = grey(flat)
    moved = brought_onto(grey(page), true) if page.exists() else None
    return (0.0, np.nan) if moved is None else (as_docunet(moved, true), local_distortion(moved, true))


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


def books(photos: Path, peers: dict[str, str], folder: Path) -> None:
    names = ["photo", *peers, "planish"]
    heads = [f"{what}: {' | '.join(who)}" for what, who in
             (("character error", names), ("seconds", names[1:]), ("crookedness", names))]  # fmt: skip
    print(f"| photo | {' | '.join(heads)} |")
    print(f"|---{'|---' * (3 * len(names) - 1)}|")
    for photo in sorted(photos.glob("*.jpg")):
        known = photo.with_suffix(".txt")
        text = " ".join(known.read_text().split()) if known.exists() else None
        planish(photo, folder)  # the first run may compile
        pages, seconds = {"photo": photo}, []
        for name, program in peers.items():
            start = perf_counter()
            pages[name] = PEERS[name](program, photo, folder)
            seconds.append(perf_counter() - start)
        pages["planish"], ours, _ = planish(photo, folder)
        cells = [f"{error(page, text):.4f}" if text else "" for page in pages.values()]
        cells += [f"{value:.1f}" for value in (*seconds, ours)]
        cells += [f"{crookedness(page):.3f}" for page in pages.values()]
        print(f"| {photo.stem} | {' | '.join(cells)} |", flush=True)


def invoices(photos: Path, peers: dict[str, str], folder: Path) -> None:
    table: dict[tuple[str, str], list[tuple[float, float, float]]] = defaultdict(list)
    said: dict[str, list[str]] = defaultdict(list)
    for flat in sorted(photos.glob("*/flat_document.png")):
        true = words(flat.parent / "ground_truth_words.json")
        print(f"{flat.parent.name}: {word_error(flat, true):.3f} misread on the flat page", file=sys.stderr, flush=True)
        for photo in sorted(flat.parent.glob("warped_document_*.jpg")):
            kind = photo.stem.split("_")[2]
            pages = {"photo": photo, **{name: PEERS[name](program, photo, folder) for name, program in peers.items()}}
            pages["planish"], _, report = planish(photo, folder)
            for name, page in pages.items():
                table[kind, name].append((word_error(page, true), *likeness(page, flat)))
                if page.parent == folder:
                    page.unlink(missing_ok=True)
            codes = report.get("warning_codes", [])
            said[kind].append(next((short for code, short in WARNINGS.items() if code in codes), "neither"))
            print(f"{flat.parent.name} {photo.stem}: {table[kind, 'planish'][-1]}, {said[kind][-1]}", file=sys.stderr)
    print("| kind | method | photos | letters misread | MS-SSIM | local distortion, % |\n|---|---|---|---|---|---|")
    for (kind, name), figures in table.items():
        misread, similar, moved = np.nanmean(figures, axis=0)
        print(f"| {kind} | {name} | {len(figures)} | {misread:.3f} | {similar:.3f} | {100 * moved:.2f} |")
    print(f"\n| kind | photos | {' | '.join(f'warned: {short}' for short in WARNINGS.values())} |\n|---|---|---|---|")
    for kind, short in said.items():
        counts = Counter(short)
        print(f"| {kind} | {len(short)} | {' | '.join(str(counts[which]) for which in WARNINGS.values())} |")


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


def shapes(photos: Path, peers: dict[str, str], folder: Path) -> None:
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
    warned = any(warning.code in WARNINGS for warning in found.warnings)
    return f"{mm_off(made, found.scan):.2f}{', warned' if warned else ''}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("photos", type=Path, nargs="?")
    parser.add_argument("--peers", nargs="*", type=Path, default=[], help="folders with peers' commands")
    parser.add_argument("--only", choices=("books", "invoices", "shapes"))
    asked = parser.parse_args()
    path = os.pathsep.join([*(str(folder.resolve()) for folder in asked.peers), os.environ.get("PATH", "")])
    peers = {name: program for name in PEERS if (program := shutil.which(name, path=path))}
    print(machine(), "\n")
    for name, part in (("shapes", shapes), ("books", books), ("invoices", invoices)):
        if asked.only in (None, name) and (asked.photos or part is shapes):
            with tempfile.TemporaryDirectory() as folder:
                part(asked.photos and asked.photos.resolve(), peers, Path(folder))
            print()


if __name__ == "__main__":
    main()
