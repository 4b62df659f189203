"""Which threshold finds the ink: python benchmarks/binarized.py.

Pages of the gallery, the lower half of them with fainter print, are scanned virtually, drawn through the true geometry,
and binarized with and without their shade. F1 of ink: a pixel is ink where the true page is darker than half way
between paper and its print. Prints a Markdown table.
"""

from __future__ import annotations

from dataclasses import replace
from typing import get_args

import cv2
import numpy as np

from machine import machine
from planish.binarize import binarize
from planish.gallery import sheet, typeset_page, virtual_scan
from planish.illumination import remove_shading
from planish.mesh import point_normals
from planish.render import draw
from planish.settings import Binarization, BinarizeSettings, RenderSettings
from planish.types import Page

CONTRASTS = (1.0, 0.5, 0.3)
SLOW = ("su",)


def printed(contrast: float) -> tuple[Page, str]:
    """A page whose lower half is printed as faintly as that."""
    page, text = typeset_page()
    pixels = np.array(page.pixels, float)
    half = len(pixels) // 2
    pixels[half:] = 255 - contrast * (255 - pixels[half:])
    return replace(page, pixels=pixels.round().astype(np.uint8)), text


def f1(found: Page, true: Page, contrast: float) -> float:
    """Harmonic mean of precision and recall of ink pixels."""
    grey = np.asarray(true.pixels, np.float32)
    grey = grey.mean(axis=2) if grey.ndim == 3 else grey
    rows, cols = found.pixels.shape
    grey = cv2.resize(grey, (cols, rows), interpolation=cv2.INTER_AREA)
    ink = grey < np.where(np.arange(rows) < rows // 2, 127, 255 - 128 * contrast)[:, None]
    got = ~np.asarray(found.pixels)
    return float(2 * (got & ink).sum() / max(got.sum() + ink.sum(), 1))


def main() -> None:
    print(machine(), "\n")
    print("| sheet | method | " + " | ".join(f"half at {c:g}, shaded | half at {c:g}, even" for c in CONTRASTS) + " |")
    print("|---|---|" + "---|" * (2 * len(CONTRASTS)))
    for name in ("book", "letter"):
        pages = []
        for contrast in CONTRASTS:
            made = virtual_scan(sheet(name), points=150_000, printed=printed(contrast))
            size = made.sheet.width_mm, made.sheet.height_mm
            shaded = draw(made.scan, made.truth_xy, size, RenderSettings(dpi=300.0)).page
            normals = point_normals(made.scan.mesh.points, made.scan.mesh.faces)
            even = remove_shading(shaded, made.scan, made.truth_xy, normals).page
            pages.append((contrast, made.page, shaded, even))
        for method in get_args(Binarization):
            if method == "none" or method in SLOW:
                continue
            settings = BinarizeSettings(binarize=method)
            scores = [f1(binarize(p, settings), true, c) for c, true, *both in pages for p in both]
            print(f"| {name} | {method} | " + " | ".join(f"{score:.3f}" for score in scores) + " |", flush=True)


if __name__ == "__main__":
    main()
