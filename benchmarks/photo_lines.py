r"""Lines that are not Latin text: staves on photos of music, and virtual pages of Arabic, Hindi, Japanese and music.

    python benchmarks/photo_lines.py [PHOTO ...] [--pages PAGE ...] [--sheets SHEET ...] \
        [--arabic FONT] [--hindi FONT] [--japanese FONT]

- staves, of each PHOTO restored with `planish photo`, or each PAGE that is restored already: rms distance of every
  staff line from the straight line through it, of all lines and of the worst, in distances of staff lines; and how far
  the lines are from level. Pieces of a staff line between two notes are joined first where they go on in each other.
- scripts: sheets of the gallery photographed virtually, mm off the true page (rms, after the best turn, shift and
  scale), beside Latin. A script is skipped where the machine has no font for it.

Prints Markdown tables.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import cv2
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from machine import machine
from photo import mm_off, planish
from planish import InputError, UsageError
from planish.gallery import music_page, script_page, sheet, typeset_page, virtual_scan
from planish.photo import find_shape
from planish.photo.rules import RuleLimits, find_rules
from planish.photo.working_image import ink_mask, working_image
from planish.settings import PhotoSettings

SHEETS = ("flat", "book", "wave", "letter")
SCRIPTS = ("latin", "arabic", "hindi", "japanese", "music")


def staves(page: Path) -> tuple[int, float, float, float]:
    """Number of staff lines; their rms distance from straight lines, of all and of the worst; rms slope [degrees]."""
    grey = working_image(cv2.imread(str(page))).grey
    rules = find_rules(grey, ink_mask(grey), RuleLimits(4, 0.0))
    lines = [rules.pieces.middle[chain] for chain in rules.chains]
    space = _staff_distance(lines)
    lines = [line for line in lines if _in_staff(line, lines, space)]
    near = [(i, j) for i, a in enumerate(lines) for j, b in enumerate(lines) if a is not b and _goes_on(a, b, space)]
    pairs = np.array(near, int).reshape(-1, 2)
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(lines), len(lines)))
    count, which = connected_components(links, directed=False)
    off, slopes = [], []  # squared
    for k in range(count):
        xy = np.concatenate([line for line, at in zip(lines, which, strict=True) if at == k])
        if np.ptp(xy[:, 0]) > 0.5 * grey.shape[1]:
            fit = np.polyfit(xy[:, 0], xy[:, 1], 1)
            off.append(np.mean((xy[:, 1] - np.polyval(fit, xy[:, 0])) ** 2) / space**2)
            slopes.append(np.degrees(np.arctan(fit[0])) ** 2)
    if not off:
        return 0, np.nan, np.nan, np.nan
    return len(off), *(float(np.sqrt(value)) for value in (np.mean(off), max(off), np.mean(slopes)))


def _staff_distance(lines: list[np.ndarray]) -> float:
    """Median distance to the next rule below at the same place [px]."""
    gaps = []
    for a in lines:
        x, y = a[len(a) // 2]
        below = [float(np.interp(x, b[:, 0], b[:, 1])) - y for b in lines if b[0, 0] <= x <= b[-1, 0]]
        gaps += [min(gap for gap in below if gap > 2)] if any(gap > 2 for gap in below) else []
    return float(np.median(gaps)) if gaps else 1.0


def _in_staff(line: np.ndarray, lines: list[np.ndarray], space: float) -> bool:
    """Whether another rule runs a staff distance above or below, as none does along a slur."""
    beside = 0
    for x, y in line[[0, len(line) // 2, -1]]:
        others = [float(np.interp(x, b[:, 0], b[:, 1])) - y for b in lines if b[0, 0] <= x <= b[-1, 0]]
        beside += any(0.65 * space < abs(gap) < 1.35 * space for gap in others)
    return beside >= 2


def _goes_on(a: np.ndarray, b: np.ndarray, space: float) -> bool:
    """Whether rule b begins where a ends, on its line."""
    gap = b[0, 0] - a[-1, 0]
    tail = a[-20:]
    return bool(gap > 0 and abs(np.polyval(np.polyfit(tail[:, 0], tail[:, 1], 1), b[0, 0]) - b[0, 1]) < 0.4 * space)


def real_staves(photos: list[Path], pages: list[Path]) -> None:
    print("| page | staff lines | rms, in staff distances | worst | rms slope, degrees |\n|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for path in (*photos, *pages):
            page = path if path in pages else planish(path, Path(folder))[0]
            count, rms, worst, slope = staves(page) if page.exists() else (0, np.nan, np.nan, np.nan)
            print(f"| {path.stem} | {count} | {rms:.3f} | {worst:.3f} | {slope:.2f} |", flush=True)


def scripts(fonts: dict[str, str | None], sheets: list[str]) -> None:
    print(f"| sheet (auto / text-lines) | {' | '.join(SCRIPTS)} |\n|{'---|' * (1 + len(SCRIPTS))}")
    for name in sheets:
        print(
            f"| {name} | {' | '.join(_one_page(name, script, fonts.get(script)) for script in SCRIPTS)} |", flush=True
        )


def _one_page(name: str, script: str, font: str | None) -> str:
    bent = sheet(name)
    size = (bent.width_mm, bent.height_mm)
    try:
        if script in ("latin", "music"):
            printed = typeset_page(*size) if script == "latin" else music_page(*size)
        else:
            printed = script_page(script, *size, font=font)
    except UsageError:
        return "no font"
    made = virtual_scan(bent, points=3000, photo_px=(4000, 3000), tilt_deg=5.0, printed=printed)
    cells = []
    for shape in ("auto", "text-lines"):
        try:
            found = find_shape(made.scan.photo, PhotoSettings(shape=shape), focal_px=made.scan.camera.matrix[0, 0])
            cells.append(f"{mm_off(made, found.scan):.2f}")
        except InputError:
            cells.append("refused")
    return " / ".join(cells)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("photos", type=Path, nargs="*")
    parser.add_argument("--pages", type=Path, nargs="*", default=[])
    for script in ("arabic", "hindi", "japanese"):
        parser.add_argument(f"--{script}")
    parser.add_argument("--sheets", nargs="*", choices=SHEETS, default=SHEETS)
    asked = parser.parse_args()
    print(machine(), "\n")
    if asked.photos or asked.pages:
        real_staves(asked.photos, asked.pages)
    if not asked.pages:
        print()
        scripts({name: getattr(asked, name) for name in ("arabic", "hindi", "japanese")}, asked.sheets)


if __name__ == "__main__":
    main()
