"""Pages from single photos that nobody took for this program, beside what others make of them.

    python benchmarks/photo_field.py FIELD [--peers BIN ...] [--made NAME=FOLDER ...] [--only docunet|pairs|photos]

FIELD is a folder with photos of DocUNet (docunet/N_1_copy.png, and tess_gt.json: what Tesseract reads on the flat
scans), pairs of photos and flat pages (pairs/NAME_capture.png with NAME_target.png, NAME_origin.jpg with
NAME_target.jpg), and other photos (photos). Peers are those of benchmarks/photo.py. --made adds pages that are there
already, such as those of an earlier version: FOLDER/SET_PHOTO.png. --sheets FOLDER writes contact sheets. Needs
Debian's tesseract-ocr. Prints a Markdown table for each set and its medians:

- words: share of the flat scan's words that are read, whatever their order;
- character error against the flat scan's text, 1 at most;
- kept: share of the sheet on the photo that is on the page. The outline of the sheet is planish's own (look at the
  contact sheets whether it is right); where the page lies on the photo is found by SIFT and a cubic polynomial;
- MS-SSIM against the flat page, as in benchmarks/photo.py;
- seconds from start to end.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import tempfile
from collections import Counter, defaultdict
from pathlib import Path
from time import perf_counter

import cv2
import numpy as np

from machine import machine
from photo import PEERS, character_error, likeness, planish, read_text
from planish.io import read_photo
from planish.photo.page_extent import kept_share
from planish.photo.shape import _detect
from planish.settings import PhotoSettings

SETS = {"docunet": "*_copy.png", "pairs": "*_[co][ar][pi]*", "photos": "*"}
LONG_SIDE = 1600
"""Of photo and page where they are compared [px]."""


def words_of(text: str) -> Counter[str]:
    return Counter(re.findall(r"[a-z0-9]{2,}", text.lower()))


def words_read(read: str, true: str) -> float:
    wanted = words_of(true)
    return sum((wanted & words_of(read)).values()) / max(sum(wanted.values()), 1)


def small(pixels: np.ndarray) -> tuple[np.ndarray, float]:
    scale = min(1.0, LONG_SIDE / max(pixels.shape[:2]))
    grey = pixels if pixels.ndim == 2 else cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY)
    return cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), scale


def cubic(xy: np.ndarray) -> np.ndarray:
    x, y = xy.T
    return np.stack([x**i * y**j for i in range(4) for j in range(4 - i)], axis=1)


def kept(page: np.ndarray, photo: np.ndarray, outline: np.ndarray) -> float:
    """Share of the outlined sheet that a page shows; nan where the page is not found on the photo."""
    (a, _), (b, scale) = small(page), small(photo)
    a = cv2.GaussianBlur(a, (0, 0), max(a.shape) / max(b.shape))  # no finer than the photo, or few letters are alike
    sift = cv2.SIFT_create(8000)
    (places, found), (there, wanted) = (sift.detectAndCompute(x, None) for x in (a, b))
    if found is None or wanted is None or len(found) < 2 or len(wanted) < 2:
        return np.nan
    good = [m for m, n in cv2.BFMatcher().knnMatch(found, wanted, 2) if m.distance < 0.75 * n.distance]
    if len(good) < 30:
        return np.nan
    size = np.array(a.shape[::-1], float)
    xy = np.array([places[m.queryIdx].pt for m in good]) / size
    to = np.array([there[m.trainIdx].pt for m in good])
    _, inlier = cv2.findHomography(xy, to, cv2.RANSAC, 0.04 * max(b.shape))
    weight = inlier.ravel().astype(float)
    for _ in range(8):
        terms = cubic(xy)
        ridge = 1e-3 * np.eye(terms.shape[1])
        fit = np.linalg.solve((terms.T * weight) @ terms + ridge, (terms.T * weight) @ to)
        weight = inlier.ravel() / (1 + (np.linalg.norm(to - terms @ fit, axis=1) / 4.0) ** 2)
    t, zero, one = np.linspace(0, 1, 50), np.zeros(50), np.ones(50)
    rim = np.concatenate([np.c_[t, zero], np.c_[one, t], np.c_[1 - t, one], np.c_[zero, 1 - t]])
    return kept_share(outline, cubic(rim) @ fit / scale)


def sheet_outline(photo: Path) -> np.ndarray | None:
    part = _detect(read_photo(photo, upright=True).pixels, PhotoSettings())[0]
    return None if part.borders is None else part.borders.outline


def contact_sheet(pages: dict[str, Path], height: int = 420) -> np.ndarray:
    tiles = []
    for name, path in pages.items():
        tile = np.full((height, 340, 3), 235, np.uint8)
        image = cv2.imread(str(path)) if path.exists() else None
        if image is not None:
            scale = min(336 / image.shape[1], (height - 22) / image.shape[0])
            image = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
            tile[: image.shape[0], : image.shape[1]] = image
        cv2.putText(tile, f"{name}", (2, height - 6), 0, 0.5, (0, 0, 200), 1)
        tiles.append(tile)
    return np.hstack(tiles)


def one_set(field: Path, name: str, peers: dict[str, str], made: dict[str, Path], folder: Path, sheets: Path | None):
    texts = json.loads((field / "docunet/tess_gt.json").read_text()) if name == "docunet" else {}
    figures: dict[str, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    print(f"| {name} | method | words | character error | kept | MS-SSIM | seconds |\n|---|---|---|---|---|---|---|")
    for photo in sorted((field / name).glob(SETS[name])):
        pages, seconds = {}, {}
        for peer, program in peers.items():
            start = perf_counter()
            pages[peer] = PEERS[peer](program, photo, folder)
            seconds[peer] = perf_counter() - start
        pages |= {who: there / f"{name}_{photo.stem}.png" for who, there in made.items()}
        pages["planish"], seconds["planish"], _ = planish(photo, folder)
        true = texts.get(f"./scan/{photo.stem.split('_')[0]}")
        flat = next(iter(photo.parent.glob(re.sub("_(capture|origin)$", "_target", photo.stem) + ".*")), None)
        flat = flat if name == "pairs" else None
        outline, pixels = sheet_outline(photo), cv2.imread(str(photo))
        for who, page in pages.items():
            row = {"seconds": seconds.get(who, np.nan)}
            if true is not None:
                read = read_text(page) if page.exists() else ""
                row["words"] = words_read(read, true)
                row["character error"] = min(character_error(read, " ".join(true.split())), 1.0)
            if flat is not None:
                row["MS-SSIM"] = likeness(page, flat)[0]
            if outline is not None:
                row["kept"] = kept(cv2.imread(str(page)), pixels, outline) if page.exists() else 0.0
            print(f"| {photo.stem} | {who} | {cells(row)} |", flush=True)
            for what, value in row.items():
                figures[who][what].append(value)
        if sheets is not None:
            cv2.imwrite(str(sheets / f"{name}_{photo.stem}.jpg"), contact_sheet({"photo": photo, **pages}))
        for page in pages.values():
            if page.parent == folder:
                page.unlink(missing_ok=True)
    for who, rows in figures.items():
        medians = {what: float(np.nanmedian(v)) if np.isfinite(v).any() else np.nan for what, v in rows.items()}
        print(f"| median | {who} | {cells(medians)} |")
    print()


def cells(row: dict[str, float]) -> str:
    places = {"words": 3, "character error": 3, "kept": 2, "MS-SSIM": 3, "seconds": 1}
    values = [(row.get(what, np.nan), digits) for what, digits in places.items()]
    return " | ".join("" if np.isnan(value) else f"{value:.{digits}f}" for value, digits in values)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("field", type=Path)
    parser.add_argument("--peers", nargs="*", type=Path, default=[], help="folders with peers' commands")
    parser.add_argument("--made", nargs="*", default=[], metavar="NAME=FOLDER")
    parser.add_argument("--sheets", type=Path)
    parser.add_argument("--only", choices=tuple(SETS))
    asked = parser.parse_args()
    path = os.pathsep.join([*(str(folder.resolve()) for folder in asked.peers), os.environ.get("PATH", "")])
    peers = {name: program for name in PEERS if (program := shutil.which(name, path=path))}
    made = {name: Path(there).resolve() for name, there in (pair.split("=", 1) for pair in asked.made)}
    if asked.sheets is not None:
        asked.sheets.mkdir(parents=True, exist_ok=True)
    print(machine(), "\n")
    for name in SETS:
        if asked.only in (None, name):
            with tempfile.TemporaryDirectory() as folder:
                one_set(asked.field.resolve(), name, peers, made, Path(folder), asked.sheets)


if __name__ == "__main__":
    main()
