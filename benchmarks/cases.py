"""Scans with known pages, as files: those of the gallery, and those that are handed over."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planish.gallery import sheet, virtual_scan
from planish.io import write_page, write_scan


@dataclass
class Case:
    name: str
    scan: Path
    photo: Path
    page: Path
    size_mm: tuple[float, float]
    flat: np.ndarray
    text: str = ""


def gallery(folder: Path, names: Sequence[str]) -> Iterator[Case]:
    """Sheets of the gallery scanned virtually (300,000 points, 0.05 mm of noise, 12 megapixels), one by one."""
    for name in names:
        made = virtual_scan(sheet(name), noise_mm=0.05)
        (folder / name).mkdir()
        scan, page = folder / name / f"{name}.obj", folder / name / "page.png"
        write_scan(scan, made.scan)
        write_page(page, made.page)
        photo = next(p for p in scan.parent.iterdir() if p.suffix in (".jpg", ".png") and p != page)
        size = (made.sheet.width_mm, made.sheet.height_mm)
        yield Case(name, scan, photo, page, size, made.truth_xy, " ".join(made.text.split()))


def given(folder: Path) -> Case:
    """A CASE_DIR: NAME.obj with NAME.jpg, NAME_page.png, NAME_truth.npz, and case.json with the size."""
    meta = json.loads((folder / "case.json").read_text())
    scan, page = next(folder.glob("*.obj")), next(folder.glob("*_page.png"))
    flat = np.load(next(folder.glob("*_truth.npz")))["flat"].astype(float)
    return Case(folder.name, scan, scan.with_suffix(".jpg"), page, (meta["width_mm"], meta["height_mm"]), flat)
