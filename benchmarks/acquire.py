"""Virtual devices before the book page: how true their scans are, and the pages restored from them.

    python benchmarks/acquire.py [--small]

Surface: distance of the scan's points from the bent sheet, along its normal. Page: the restored page's size, distance
of every point from its true place on the page after the best turn and shift, and Tesseract's character error against
the text that was printed. Needs Debian's tesseract-ocr. Prints a Markdown table.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable, Iterator
from itertools import chain
from pathlib import Path
from time import perf_counter

import numpy as np
from scipy.spatial import cKDTree

from machine import machine
from planish.acquire.grid_mesh import AcquiredScan
from planish.acquire.points.scan import from_points
from planish.acquire.range_image.depth import from_depth
from planish.acquire.range_image.grid import from_grid, grid_photo
from planish.acquire.structured_light.phase import all_patterns
from planish.acquire.structured_light.scan import from_gray_code
from planish.gallery import Sheet, sheet, typeset_sheet
from planish.gallery.clouds import photogrammetry_cloud, range_image
from planish.gallery.devices import SMALL_RIG, depth_capture, projector_rig, structured_light
from planish.gallery.sheets import normals
from planish.io import write_page
from planish.pipeline import restore
from truth import character_error, read_text, rigid_rms

SPOT_MM = 0.2
STEP_MM = 0.05


def depth_camera(book: Sheet, small: bool, frames: int) -> Callable[[], AcquiredScan]:
    size = {"shape_rc": (240, 320)} if small else {}
    made = depth_capture(book, frames=frames, **size)
    return lambda: from_depth(made.frames, made.camera, made.photo, made.photo_camera)


def gray_code(book: Sheet, small: bool, steps: int, sizes: tuple = ()) -> Callable[[], AcquiredScan]:
    camera, projector = projector_rig(book, *(SMALL_RIG if small else sizes))
    made = structured_light(book, camera, projector, all_patterns(projector.shape_rc, steps), typeset_sheet(book)[0])
    return lambda: from_gray_code(made.frames, camera, projector, made.photo)


def devices(book: Sheet, small: bool) -> Iterator[tuple[str, Callable[[], AcquiredScan]]]:
    yield "depth camera, 1 mm of noise, 1 frame", depth_camera(book, small, 1)
    yield "depth camera, 1 mm of noise, 30 frames", depth_camera(book, small, 30)
    yield "Gray code", gray_code(book, small, 0)
    yield "Gray code with 8 steps of phase", gray_code(book, small, 8)
    coarse = SMALL_RIG[0], projector_rig(book)[1].shape_rc
    yield "Gray code, camera of 640 x 512", gray_code(book, False, 0, coarse)
    yield "the same with 8 steps of phase", gray_code(book, False, 8, coarse)


def range_scanner(book: Sheet, small: bool) -> Callable[[], AcquiredScan]:
    made = range_image(book, shape_rc=(320, 240) if small else None)
    eye = -made.camera.rotation.T @ made.camera.translation
    on_table = made.points @ made.camera.rotation + eye
    return lambda: from_grid(on_table, grid_photo(made.points, made.colours), seen_from=eye)


def photogrammetry(book: Sheet, small: bool, *, photo: bool) -> Callable[[], AcquiredScan]:
    made = photogrammetry_cloud(book, points=75_000 if small else 300_000)
    seen = (made.photo, made.camera) if photo else (None, None)
    return lambda: from_points(made.points, made.colours, made.normals, *seen)


def clouds(book: Sheet, small: bool) -> Iterator[tuple[str, Callable[[], AcquiredScan]]]:
    yield "range image, 0.05 mm of noise, its own colours", range_scanner(book, small)
    yield "photogrammetry, 0.1 mm of noise, the points' colours", photogrammetry(book, small, photo=False)
    yield "the same with a photo", photogrammetry(book, small, photo=True)


def nearest_places(book: Sheet, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Place on the page nearest to each point, and the point's height over the sheet there."""
    axes = (np.arange(0, n, SPOT_MM) for n in (book.width_mm, book.height_mm))
    spots = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    places = book.bend(spots)
    xy = spots[cKDTree(places).query(points)[1]]
    for _ in range(2):  # from the grid's spot to the place itself, along the sheet's tangents
        tangents = [(book.bend(xy + step) - book.bend(xy - step)) / (2 * STEP_MM) for step in STEP_MM * np.eye(2)]
        off = points - book.bend(xy)
        xy = xy + np.stack([(off * t).sum(axis=1) / (t * t).sum(axis=1) for t in tangents], axis=1).clip(
            -SPOT_MM, SPOT_MM
        )
    return xy, ((points - book.bend(xy)) * normals(book, xy)).sum(axis=1)


def row(name: str, acquire: Callable[[], AcquiredScan], book: Sheet, text: str, folder: Path) -> str:
    acquire()  # kernels compile
    start = perf_counter()
    made = acquire()
    seconds = perf_counter() - start
    true_xy, height = nearest_places(book, np.asarray(made.scan.mesh.points))
    done = restore(made.scan)
    page = done.unshaded or done.rendered
    assert page is not None
    write_page(folder / "page.png", page)
    off = character_error(read_text(folder / "page.png"), " ".join(text.split()))
    size = done.report.page
    return (
        f"| {name} | {len(height):,} | {np.sqrt((height**2).mean()):.3f} | {np.quantile(np.abs(height), 0.99):.3f} | "
        f"{size.width_mm:.1f} x {size.height_mm:.1f} | {rigid_rms(done.flattening.page_xy, true_xy):.3f} | {off:.4f} | "
        f"{seconds:.1f} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--small", action="store_true", help="half the pixels each way")
    asked = parser.parse_args()
    book = sheet("book")
    _, text = typeset_sheet(book)
    print(machine(), f"\n\nThe page is {book.width_mm} x {book.height_mm} mm.\n")
    print(
        "| device | points | surface, rms mm | 99 % within, mm | page, mm | rms mm, every point | character error "
        "| seconds to the scan |"
    )
    print("|---|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for name, acquire in chain(devices(book, asked.small), clouds(book, asked.small)):
            print(row(name, acquire, book, text, Path(folder)), flush=True)
        letter = sheet("letter")
        text = typeset_sheet(letter)[1]
        for name, acquire in clouds(letter, asked.small):
            print(row(f"letter folded in three: {name}", acquire, letter, text, Path(folder)), flush=True)


if __name__ == "__main__":
    main()
