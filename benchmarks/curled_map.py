"""A printed map curled into two waves, from one photo and blended from six.

    python benchmarks/curled_map.py [FOLDER] [--pages FOLDER]

FOLDER holds curled_map.obj, its photos and cameras.json with a matrix for each photo; ../shared/data/curled_map where
none is given. Prints Markdown tables: the rectangle that the border of the print makes on the page, and how far the
pages of single photos lie apart where two see the same, by correlation of patches. --pages writes the pages.
"""

from __future__ import annotations

import argparse
import itertools
import json
from pathlib import Path

import cv2
import numpy as np
from scipy.interpolate import LinearNDInterpolator

from machine import machine
from planish.io import read_scan, write_page
from planish.pipeline import restore
from planish.render import draw
from planish.settings import RenderSettings, RestoreSettings, ShadingSettings
from planish.types import Mesh, Page, Scan, View

FOLDER = Path(__file__).parents[2] / "shared" / "data" / "curled_map"
PX_PER_MM = 5.0
PATCH_MM, STEP_MM = 16.0, 8.0
LEAST_PPI = 12.0
"""A photo that shows less of a patch tells nothing of its place."""
REACH_MM, SURE = 3.0, 0.8
"""Patches are sought as far away as this, and count where they correlate better than this."""
STRIDE_MM, NEAR_MM = 5.0, 0.8
MARGIN_MM = 18.0
"""The border of the print lies within this of the page's border."""


def grey(page: Page) -> np.ndarray:
    return cv2.cvtColor(page.pixels, cv2.COLOR_RGB2GRAY).astype(np.float32)


def side(picture: np.ndarray, known: np.ndarray) -> tuple[np.ndarray, float]:
    """The print's border at the left of a picture as x = a + b y, in mm, and the rms of its points around it."""
    width = round(MARGIN_MM * PX_PER_MM)
    paper = cv2.GaussianBlur(cv2.dilate(np.where(known, picture, 0), np.ones((61, 61), np.uint8)), (0, 0), 15)
    near = (cv2.GaussianBlur(picture, (0, 0), 1.5) / np.maximum(paper, 1))[:, :width]
    dark = (near < 0.75) & known[:, :width]
    blank = np.cumsum(~dark & known[:, :width], axis=1) >= PX_PER_MM  # print begins behind a millimetre of paper
    ink = cv2.erode((dark & blank).astype(np.uint8), np.ones((1, 5), np.uint8), anchor=(0, 0)) > 0
    rows = np.nonzero(ink.any(axis=1))[0]
    rows = rows[(rows > width) & (rows < len(picture) - width)]
    points = np.c_[ink[rows].argmax(axis=1), rows] / PX_PER_MM
    lines = []
    for seed in range(500):  # streets that run out of the map leave gaps; most points lie on one line all the same
        (xa, ya), (xb, yb) = points[np.random.default_rng(seed).choice(len(points), 2, replace=False)]
        if abs(yb - ya) > 50:
            slope = (xb - xa) / (yb - ya)
            lines.append((xa - slope * ya, slope))
    line = max(lines, key=lambda at: int((np.abs(points[:, 0] - at[0] - at[1] * points[:, 1]) < NEAR_MM).sum()))
    for _ in range(3):
        near_line = np.abs(points[:, 0] - line[0] - line[1] * points[:, 1]) < NEAR_MM
        line = np.polyfit(points[near_line, 1], points[near_line, 0], 1)[::-1]
    off = points[near_line, 0] - line[0] - line[1] * points[near_line, 1]
    return np.asarray(line), float(off.std())


def frame(page: Page) -> tuple[np.ndarray, float]:
    """Corners of the print's border [mm], clockwise from the top left, and its rms distance from straight sides."""
    height, width = (n / PX_PER_MM for n in page.known.shape)
    sides, off = [], []
    for turn in range(4):  # left, top, right, bottom: each is turned to the left, and its line back
        picture, known = (np.ascontiguousarray(np.rot90(part, turn)) for part in (grey(page), page.known))
        (a, b), rms = side(picture, known)
        off.append(rms)
        sides.append([(1, -b, a), (b, 1, a + b * width), (1, -b, width - a - b * height), (b, 1, height - a)][turn])
    corners = [
        np.linalg.solve(np.array([one[:2], two[:2]]), [one[2], two[2]])
        for one, two in ((sides[0], sides[1]), (sides[1], sides[2]), (sides[2], sides[3]), (sides[3], sides[0]))
    ]
    return np.array(corners), float(np.sqrt(np.mean(np.square(off))))


def frame_rows(page: Page, mesh: Mesh, page_xy: np.ndarray) -> str:
    """The border's four sides as they are on the page, and along the scan's surface in space, in steps of 5 mm."""
    corners, off = frame(page)
    in_space = LinearNDInterpolator(page_xy, mesh.points)
    on_page, along = [], []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        on_page.append(float(np.linalg.norm(b - a)))
        walk = in_space(a + (b - a) * np.linspace(0, 1, int(on_page[-1] / STRIDE_MM) + 1)[:, None])
        along.append(float(np.linalg.norm(np.diff(walk, axis=0), axis=1).sum()))
    edges = np.roll(corners, -1, axis=0) - corners
    angles = np.degrees(np.arctan2(edges[:, 1], edges[:, 0]))
    bends = (np.roll(angles, -1) - angles) % 360
    falling, rising = (float(np.linalg.norm(corners[i] - corners[i + 2])) for i in range(2))
    more = f"{100 * (falling / rising - 1):+.2f} | {np.abs(bends - 90).max():.2f} | {off:.2f} |"
    return f"{sides_of('blended page', on_page)} {more}\n{sides_of('scanned surface', along)} | | |"


def sides_of(name: str, lengths: list[float]) -> str:
    top, right, bottom, left = lengths
    return (
        f"| {name} | {top:.1f}, {bottom:.1f} | {left:.1f}, {right:.1f} | {100 * (top / bottom - 1):+.2f} | "
        f"{100 * (left / right - 1):+.2f} | {(left + right) / (top + bottom):.4f} |"
    )


def places(one: Page, two: Page, ppi: np.ndarray) -> np.ndarray:
    """How far two pages lie apart, patch by patch, where both show the print: distances [mm]."""
    size, step, reach = (round(mm * PX_PER_MM) for mm in (PATCH_MM, STEP_MM, REACH_MM))
    pictures = []
    for page in (one, two):
        soft = cv2.GaussianBlur(grey(page), (0, 0), 0.5 * PX_PER_MM)  # as soft as the coarser of two photos
        pictures.append(soft - cv2.GaussianBlur(soft, (0, 0), 3 * PX_PER_MM))
    both = (one.known & two.known)[: len(ppi[0]) * int(PX_PER_MM)]
    apart = []
    for r, q in itertools.product(*(range(reach, n - size - reach, step) for n in both.shape)):
        wide = slice(r - reach, r + size + reach), slice(q - reach, q + size + reach)
        cells = tuple(slice(int(part.start / PX_PER_MM), int(part.stop / PX_PER_MM)) for part in wide)
        if not (both[wide].all() and ppi[(slice(None), *cells)].min() > LEAST_PPI):  # NaN, where not seen, is not more
            continue
        patch = pictures[0][r : r + size, q : q + size]
        alike = cv2.matchTemplate(pictures[1][wide], np.ascontiguousarray(patch), cv2.TM_CCOEFF_NORMED)
        _, most, _, (x, y) = cv2.minMaxLoc(alike)
        if most > SURE and min(x, y) > 0 and max(x, y) < 2 * reach:
            shift = np.array([x - reach + peak(alike[y, x - 1 : x + 2]), y - reach + peak(alike[y - 1 : y + 2, x])])
            apart.append(np.hypot(*shift) / PX_PER_MM)
    return np.array(apart)


def peak(three: np.ndarray) -> float:
    """Where the parabola through three values around the greatest has its top, from the middle one."""
    a, b, c = three.ravel()
    return 0.5 * (a - c) / (a - 2 * b + c)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=Path, default=FOLDER)
    parser.add_argument("--pages", type=Path)
    asked = parser.parse_args()
    cameras = asked.folder / "cameras.json"
    photos = [asked.folder / name for name in sorted(json.loads(cameras.read_text())["P"])]
    scan = read_scan(asked.folder / "curled_map.obj", photo=photos, camera=cameras).scan
    settings = RenderSettings(dpi=PX_PER_MM * 25.4)
    # the geometry once, the same for all: only the photos differ
    done = restore(scan, RestoreSettings(render=settings, shading=ShadingSettings(shading="none"), rotate="0"))
    flat = done.flattening
    assert done.rendered is not None
    views = [View(scan.photo, scan.camera), *scan.others]
    single = {
        path.stem: draw(Scan(scan.mesh, view.photo, camera=view.camera), flat.page_xy, flat.size_mm, settings)
        for path, view in zip(photos, views, strict=True)
    }
    if asked.pages:
        asked.pages.mkdir(exist_ok=True)
        for name, drawn in single.items():
            write_page(asked.pages / f"{name}.png", drawn.page)
        write_page(asked.pages / "blended.png", done.rendered)
    print(machine(), "\n")
    print("| page from | seen, % | photo pixels per inch, median | 10 % quantile |")
    print("|---|---|---|---|")
    for name, drawn in single.items():
        found = drawn.resolution
        print(f"| {name} | {100 * drawn.page.known.mean():.1f} | {found.median_ppi:.0f} | {found.low_ppi:.0f} |")
    told = done.report.page
    print(
        f"| all six, blended | {100 * done.rendered.known.mean():.1f} | {told.effective_ppi_median:.0f} | "
        f"{told.effective_ppi_p10:.0f} |\n"
    )
    print(
        "| border of the print on the | top, bottom, mm | left, right, mm | top / bottom, % | left / right, % | ratio "
        "| diagonals, % | corners off 90 degrees by up to | rms off straight, mm |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    print(frame_rows(done.rendered, scan.mesh, flat.page_xy), "\n")
    print("| two single pages | patches | apart, median mm | 90 % | 99 % |")
    print("|---|---|---|---|---|")
    every = []
    for (a, one), (b, two) in itertools.combinations(single.items(), 2):
        apart = places(one.page, two.page, np.array([one.resolution.ppi, two.resolution.ppi]))
        every.append(apart)
        print(distances_row(f"{a}, {b}", apart))
    print(distances_row("all pairs", np.concatenate(every)))


def distances_row(name: str, apart: np.ndarray) -> str:
    if not len(apart):
        return f"| {name} | 0 | | | |"
    return f"| {name} | {len(apart)} | " + " | ".join(f"{np.quantile(apart, q):.2f}" for q in (0.5, 0.9, 0.99)) + " |"


if __name__ == "__main__":
    main()
