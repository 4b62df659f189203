"""Where the page ends, which way up it is, where a book is split, what writing costs: python benchmarks/page_sense.py.

Sheets of the gallery are scanned virtually (100,000 points, 0.05 mm of noise), each lying four ways under the camera,
and restored with `--pages auto`. Size: of the worst of the four. Askew: the page's rows against the true ones. Stray
points: the size once more after 1 % of the border's points were moved outward by 1 to 10 mm. Writing: best of three, a
page of letter size at 300 dpi (8.4 megapixels), with even paper and as grainy as the photo. Prints Markdown tables.
"""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import numpy as np

from machine import machine
from planish.flattening import to_page_frame
from planish.gallery import VirtualScan, sheet, virtual_scan
from planish.io import write_page
from planish.pipeline import restore
from planish.settings import RenderSettings, RestoreSettings
from planish.types import Restoration

SHEETS = ("flat", "book", "spread", "letter", "curl", "wave", "miura", "crumpled")
SETTINGS = RestoreSettings(render=RenderSettings(dpi=120.0), pages="auto")
SUFFIXES = ("tif", "png", "jpg", "pdf")


def main() -> None:
    print(f"{machine()}\n")
    print("| sheet | size, width | size, height | askew | upright | size with stray points | pages | spine |")
    print("|---|---|---|---|---|---|---|---|")
    pictures = {}
    for name in SHEETS:
        worst = np.zeros(5)
        upright, pages, spine = 0, set(), ""
        for turn in (5.0, 95.0, 185.0, 275.0):
            made = virtual_scan(sheet(name), points=100_000, photo_px=(2400, 1800), noise_mm=0.05, turn_deg=turn)
            done = restore(made.scan, SETTINGS)
            angle = turned_by(done.flattening.page_xy, made.truth_xy)
            upright += abs(angle) < 45
            off = (angle + 45) % 90 - 45
            worst = np.maximum(worst, np.abs([*size_off(done, made), off, *stray_size_off(done, made)]))
            pages.add(len(done.report.pages))
            if done.report.spine:
                spine = f"{done.report.spine.x_mm - made.sheet.width_mm / 2:+.2f} mm"
        sizes = [f"{100 * part:.3f} %" for part in worst[:2]]
        stray = f"{100 * worst[3:].max():.3f} %"
        counts = " or ".join(map(str, sorted(pages)))
        print(
            f"| {name} | {' | '.join(sizes)} | {worst[2]:.3f}° | {upright} of 4 | {stray} | {counts} | {spine} |",
            flush=True,
        )
        if name == "book":
            pictures = restore(
                virtual_scan(sheet(name), points=100_000, noise_mm=0.05).scan,
                replace(SETTINGS, render=RenderSettings(dpi=300.0)),
            )
    writing(pictures)


def size_off(done: Restoration, made: VirtualScan) -> tuple[float, float]:
    width, height = done.flattening.size_mm
    return width / made.sheet.width_mm - 1, height / made.sheet.height_mm - 1


def stray_size_off(done: Restoration, made: VirtualScan) -> tuple[float, float]:
    """Parts by which the page would be too large or too small if its border had stray points."""
    rng = np.random.default_rng(0)
    xy = done.flattening.page_xy.copy()
    size = np.array(done.flattening.size_mm)
    rim = np.flatnonzero(((xy < 0.5) | (xy > size - 0.5)).any(axis=1))
    some = rng.choice(rim, len(rim) // 100, replace=False)
    middle = size / 2
    outward = np.sign(xy[some] - middle) * (np.abs(xy[some] - middle) > middle - 0.5)
    xy[some] += outward * rng.uniform(1, 10, (len(some), 1))
    _, (width, height) = to_page_frame(xy, np.array([0.0, -1.0]), long_side_upright=False)
    return width / made.sheet.width_mm - 1, height / made.sheet.height_mm - 1


def turned_by(page_xy: np.ndarray, truth_xy: np.ndarray) -> float:
    """Degrees between the page and the true one, after the best rigid fit."""
    u, _, vt = np.linalg.svd((page_xy - page_xy.mean(axis=0)).T @ (truth_xy - truth_xy.mean(axis=0)))
    turn = u @ np.diag([1, np.sign(np.linalg.det(u @ vt))]) @ vt
    return float(np.degrees(np.arctan2(turn[0, 1], turn[0, 0])))


def writing(done: Restoration) -> None:
    print(f"\n| page | {' | '.join('.' + suffix for suffix in SUFFIXES)} |")
    print("|---|" + "---|" * len(SUFFIXES))
    for name, page in (("even paper", done.unshaded), ("grainy", done.rendered), ("black and white", done.binary)):
        cells = []
        with tempfile.TemporaryDirectory() as folder:
            for suffix in SUFFIXES:
                path = Path(folder) / f"page.{suffix}"
                seconds = []
                for _ in range(3):
                    start = perf_counter()
                    write_page(path, page)
                    seconds.append(perf_counter() - start)
                cells.append(f"{min(seconds):.2f} s, {path.stat().st_size / 1e6:.2f} MB")
        print(f"| {name} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
