"""How sharp a page is beside its photo, and whether the mesh shows on it.

    python benchmarks/sharpness.py

A slanted edge (ISO 12233), softened by a pixel's area and a lens, is photographed and drawn through a bent mesh at the
photo's resolution, at twice and at half of it. MTF50 is the spatial frequency at which the contrast has fallen to half;
at half the resolution it is compared with the photo averaged over the page's pixels. A photo of one grey is drawn
through random meshes. Prints Markdown tables.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter

from machine import machine
from planish.color import code_values, linear_light
from planish.render import draw
from planish.settings import RenderSettings
from planish.types import Mesh, Scan

SIZE_MM, PHOTO_PX_PER_MM, SLOPE = 24.0, 10.0, 0.09
FINE = 8
"""Samples across a photo pixel."""


def print_() -> np.ndarray:
    """Light of a dark and a bright half with a slanted edge between them, FINE samples a photo pixel."""
    side = round(SIZE_MM * PHOTO_PX_PER_MM) * FINE
    at = (np.arange(side) + 0.5) / FINE - 0.5
    x, y = np.meshgrid(at, at)
    middle = SIZE_MM * PHOTO_PX_PER_MM / 2
    return gaussian_filter((x - middle - SLOPE * (y - middle) > 0).astype(np.float32), 0.5 * FINE) * 0.8 + 0.1


def averaged(light: np.ndarray, times: int) -> np.ndarray:
    side = len(light) // times
    return light.reshape(side, times, side, times).mean(axis=(1, 3))


def mtf50(light: np.ndarray, px_per_mm: float) -> float:
    """Line pairs per mm at which the contrast of the edge has fallen to half."""
    y, x = np.mgrid[0 : len(light), 0 : len(light)] / px_per_mm
    middle = SIZE_MM / 2 - 0.5 / px_per_mm
    across = (x - middle - SLOPE * (y - middle)) / np.hypot(1, SLOPE)
    rows = np.abs(y - middle) < SIZE_MM / 3
    near = (np.abs(across) < 2) & rows
    step = 0.25 / px_per_mm
    bins = np.floor((across[near] + 2) / step).astype(int)
    edge = np.bincount(bins, light[near]) / np.maximum(np.bincount(bins), 1)
    contrast = np.abs(np.fft.rfft(np.diff(edge) * np.hanning(len(edge) - 1), 1 << 14))
    below = int(np.argmax(contrast < 0.5 * contrast[0]))
    return float(np.fft.rfftfreq(1 << 14, step)[below])


def sheet(cell_mm: float, jitter: float, half_px: float) -> tuple[Mesh, np.ndarray, np.ndarray]:
    """A flat sheet as a random mesh: mesh, page_xy, photo_xy moved by so many photo pixels."""
    rng = np.random.default_rng(0)
    n = round(SIZE_MM / cell_mm)
    x, y = np.meshgrid(np.linspace(0, SIZE_MM, n + 1), np.linspace(0, SIZE_MM, n + 1))
    page = np.c_[x.ravel(), y.ravel()]
    inner = ((page > 0) & (page < SIZE_MM)).all(axis=1)
    page = page + inner[:, None] * rng.normal(0, jitter * SIZE_MM / n, page.shape)
    i = np.arange((n + 1) * n).reshape(n, n + 1)[:, :-1].ravel()
    faces = np.concatenate([np.c_[i, i + n + 1, i + 1], np.c_[i + 1, i + n + 1, i + n + 2]]).astype(np.int32)
    return Mesh(np.c_[page * [1, -1], 0 * page[:, 0]], faces), page, page * PHOTO_PX_PER_MM - 0.5 + half_px


def coded(light: np.ndarray, dtype: type) -> np.ndarray:
    codes = code_values(np.dtype(dtype))[np.rint(np.clip(light, 0, 1) * 65535).astype(int)]
    return np.repeat(codes[..., None], 3, axis=2)


def edges() -> None:
    print("| photo | page pixels to a photo pixel | falls | MTF50 of the photo, lp/mm | of the page | kept, % |")
    print("|---|---|---|---|---|---|")
    fine = print_()
    for dtype, times, half_px in (
        (np.uint8, 1, 0.0), (np.uint8, 1, 0.5), (np.uint16, 1, 0.5), (np.uint8, 2, 0.5), (np.uint8, 0.5, 0.5)
    ):  # fmt: skip
        photo = averaged(fine, FINE)
        mesh, page_xy, photo_xy = sheet(0.5, 0.2, 0.0)
        moved = np.roll(fine, (round(half_px * FINE),) * 2, (0, 1))  # the photo's pixels lie elsewhere on the print
        scan = Scan(mesh, coded(averaged(moved, FINE), dtype), photo_xy + half_px)
        per_mm = PHOTO_PX_PER_MM * times
        page = draw(scan, page_xy, (SIZE_MM, SIZE_MM), RenderSettings(dpi=25.4 * per_mm)).page
        drawn = linear_light(np.iinfo(dtype).max + 1)[page.pixels[..., 1]]
        best = mtf50(averaged(fine, round(FINE / times)) if times < 1 else photo, min(per_mm, PHOTO_PX_PER_MM))
        found = mtf50(drawn, per_mm)
        where = "on photo pixels" if half_px == 0 else "between photo pixels"
        print(
            f"| {np.iinfo(dtype).bits} bit | {times:g} | {where} | {best:.2f} | {found:.2f} | "
            f"{100 * found / best:.1f} |"
        )


def greys() -> None:
    print("| one grey of | mesh, mm a side | page, dpi | standard deviation of the page, code values | levels in all |")
    print("|---|---|---|---|---|")
    side = round(SIZE_MM * PHOTO_PX_PER_MM)
    for value, dtype, cell_mm, dpi in (
        (173, np.uint8, 0.5, 300), (173, np.uint8, 4.0, 300), (61, np.uint8, 0.5, 600), (217, np.uint8, 2.0, 72),
        (40_000, np.uint16, 0.5, 300)
    ):  # fmt: skip
        mesh, page_xy, photo_xy = sheet(cell_mm, 0.25, 0.0)
        photo_xy = photo_xy + 2 * np.sin(page_xy[:, ::-1])  # bent, so that filters differ from place to place
        scan = Scan(mesh, np.full((side, side, 3), value, dtype), np.clip(photo_xy, 0, side - 1))
        page = draw(scan, page_xy, (SIZE_MM, SIZE_MM), RenderSettings(dpi=dpi)).page
        some = page.pixels[page.known].astype(float)
        print(f"| {value} of {np.iinfo(dtype).max} | {cell_mm:g} | {dpi} | {some.std():.3f} | {len(np.unique(some))} |")


if __name__ == "__main__":
    print(machine(), "\n")
    edges()
    print()
    greys()
