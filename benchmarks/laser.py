"""A laser swept over a book page, and two fixed laser lines on it: python benchmarks/laser.py [--frames N].

The page of the gallery is photographed virtually (2000 x 1500 pixels, 1 level of noise, speckle of 10 %), scanned, and
restored. surface: rms distance of the scan's points from the true surface along its normal. page: rms distance of every
point of the scan from its true place on the flat page, rigid fit. `print left in` is the same sweep with the print not
divided out. `squared paper` is the laser-lines row with the lasers found from a photo of squared paper in the same rig.
Prints a Markdown table.

    python benchmarks/laser.py --stream

takes 500 frames of 12 megapixels (one virtual photo, laid over itself) and prints the peak of the memory and the time.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter

import numpy as np

from machine import machine
from planish.acquire.grid_mesh import AcquiredScan
from planish.acquire.laser.lines import from_laser_lines
from planish.acquire.laser.rig import calibrate_laser_rig
from planish.acquire.laser.sweep import from_laser, sweep_stripes
from planish.gallery import sheet
from planish.gallery.laser import VirtualSweep, ground_truth, squared_paper, virtual_lines, virtual_sweep
from planish.gallery.sheets import normals
from planish.io import read_photo, write_page
from planish.pipeline import restore
from planish.settings import RestoreSettings, ShadingSettings
from planish.types import Page
from truth import character_error, read_text, rigid_rms


def row(name: str, made: VirtualSweep, acquired: AcquiredScan, seconds: float) -> str:
    scan = acquired.scan
    page_xy, true = ground_truth(made, scan.photo_xy)
    known = np.isfinite(page_xy[:, 0])
    miss = scan.mesh.points[known] - true[known]
    off = (miss * normals(made.sheet, page_xy[known])).sum(axis=1)
    done = restore(scan, RestoreSettings(shading=ShadingSettings(shading="background")))
    page = rigid_rms(done.flattening.page_xy[known], page_xy[known])
    with tempfile.TemporaryDirectory() as folder:
        image, printed = Path(folder) / "page.png", Path(folder) / "true.png"
        write_page(image, done.unshaded or done.rendered)
        write_page(printed, made.page)
        wrong = character_error(read_text(image), read_text(printed))
    size = done.report.page
    rms, most = np.sqrt((off**2).mean()), np.quantile(np.abs(off), 0.99)
    return (
        f"| {name} | {len(scan.mesh.points):,} | {rms:.4f} | {most:.3f} | {page:.3f} | "
        f"{size.width_mm:.1f} x {size.height_mm:.1f} | {wrong:.4f} | {seconds:.1f} |"
    )


def table(count: int) -> None:
    print(machine(), "\n")
    print(
        "| device | points | surface, rms mm | 99 % below, mm | page, rms mm | page, mm | character error | seconds |\n"
        "|---|---|---|---|---|---|---|---|"
    )
    made = virtual_sweep(sheet("book"), frames=count)
    frames = [made.frame(k) for k in range(count)]
    names = [f"frame {k + 1}" for k in range(count)]
    for name, divide in ((f"laser sweep, {count} photos", True), ("the same, print left in", False)):
        start = perf_counter()
        sweep = sweep_stripes(frames.__getitem__, names, made.photo, divide=divide)
        acquired = from_laser(sweep, names, made.photo, made.camera, made.planes)
        print(row(name, made, acquired, perf_counter() - start), flush=True)
    made = virtual_lines(sheet("book"))
    lit = made.frame(0)
    paper = virtual_lines(made.sheet, printed=squared_paper(made.sheet), camera=made.camera)
    rig = calibrate_laser_rig(paper.frame(0), paper.photo, paper.camera, 8.0)
    for name, planes in (("laser lines", made.planes[0]), ("the same, lasers from squared paper", rig.planes)):
        start = perf_counter()
        acquired = from_laser_lines(lit, made.photo, made.camera, planes)
        print(row(name, made, acquired, perf_counter() - start), flush=True)


def stream(frames: int = 500) -> None:
    """In a process of its own, so that the virtual camera's memory is not counted."""
    with tempfile.TemporaryDirectory() as folder:
        made = virtual_sweep(sheet("book"), frames=5, photo_px=(1000, 750))
        for name, pixels in (("off", made.photo), ("on", made.frame(2))):
            large = np.repeat(np.repeat(pixels, 4, axis=0), 4, axis=1)
            write_page(f"{folder}/{name}.jpg", Page(large, np.ones(large.shape[:2], bool), 300.0))
        subprocess.run([sys.executable, __file__, "--streamed", folder, "--frames", str(frames)], check=True)


def streamed(folder: str, frames: int) -> None:
    start = perf_counter()
    off = read_photo(f"{folder}/off.jpg").pixels
    names = [f"{k}" for k in range(frames)]
    sweep_stripes(lambda k: read_photo(f"{folder}/on.jpg").pixels, names, off)
    # getrusage would count the parent's memory from before the fork
    lines = Path("/proc/self/status").read_text().splitlines()
    peak = next(int(line.split()[1]) for line in lines if line.startswith("VmHWM")) / 2**20
    print(
        f"{frames} frames of {off.shape[1]} x {off.shape[0]} pixels: {perf_counter() - start:.0f} s with reading, "
        f"{peak:.2f} GB at most"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=200)
    parser.add_argument("--stream", action="store_true")
    parser.add_argument("--streamed", help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.streamed:
        streamed(asked.streamed, asked.frames)
    elif asked.stream:
        stream()
    else:
        table(asked.frames)


if __name__ == "__main__":
    main()
