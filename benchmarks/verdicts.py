"""The verdict on known scans: python benchmarks/verdicts.py [NAME ...].

Sheets of the gallery, alone and on tables, with the faults of real captures put into them; and, where `../shared` is
beside the checkout (or PLANISH_DATA says), captures that nobody here made. What the verdict must be follows from the
truth where there is one: a page whose size is off by more than 2 % must not be "good", one within 0.5 % must not be
"not good". Of the other captures a person has looked at the page; the column
truth says what is on it. Prints a Markdown table, and ends with 1 if a verdict is wrong.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

import surroundings
from machine import machine
from planish.errors import PlanishError
from planish.gallery import sheet, sheet_mesh, virtual_scan
from planish.gallery.scene_view import render_view
from planish.io import read_scan, write_scan
from planish.job import with_file_info
from planish.job.photo_sheet import shapes_of_one
from planish.pipeline import restore
from planish.settings import (
    FlattenSettings,
    PhotoSettings,
    RenderSettings,
    RestoreSettings,
    ShadingSettings,
    VerletSettings,
)
from planish.types import Mesh, Report, Scan

SHARED = Path(os.environ.get("PLANISH_DATA") or Path(__file__).parents[2] / "shared" / "data").parent
COARSE = RenderSettings(dpi=100)
GOOD, LOOK, BAD = "good", "look at it", "not good"
OFF, TRUE = 0.02, 0.005
"""Errors of the page's size that must not be good, and that must not be called not good."""


@dataclass(frozen=True)
class Case:
    """A scan; what is true of it; its page's true size, or the verdicts that a person who saw the page would give."""

    name: str
    truth: str
    make: Callable[[], Report]
    size_mm: tuple[float, float] | None = None
    allowed: tuple[str, ...] = ()


def gallery() -> Iterator[Case]:
    for name, noise in [
        *((name, 0.05) for name in ("book", "letter", "curl", "wave", "spread", "crumpled")),
        *((name, 0.2) for name in ("book", "crumpled")),
    ]:
        yield of_sheet(name, f"{name}, {noise} mm of noise", "alone", lambda s, n=noise: virtual(s, noise_mm=n).scan)
    yield of_sheet("book", "book, a third not seen", "a hole in the middle", with_hole, allowed=(LOOK, BAD))
    yield Case("letter in cm", "its unit is a guess, and right", in_cm, allowed=(LOOK,))
    yield Case("letter, photo mirrored", "text reads backwards", mirrored, allowed=(LOOK, BAD))
    verlet = FlattenSettings(method="verlet", verlet=VerletSettings(max_steps=20))
    settings = RestoreSettings(flatten=verlet, render=COARSE)
    yield of_sheet("letter", "letter, 20 Verlet steps", "stopped while it fell", plain, (BAD,), settings)
    yield Case("dome of 60 degrees", "no paper", dome, allowed=(BAD,))


def tables() -> Iterator[Case]:
    for name, scene in [
        *(("book", s) for s in ("wood", "white table", "thumb")),
        *(("letter", s) for s in ("wood", "white table", "shadow", "second sheet")),
        *(("crumpled", s) for s in ("wood", "white table")),
        ("flat", "wood"),
    ]:
        allowed = (LOOK,) if scene in ("second sheet", "thumb") else ()
        yield of_sheet(name, f"{name}, {scene}", "on a table", lambda s, n=name, c=scene: scene_scan(n, c), allowed)
    for name, scene, corners in (("book", "white table", 7), ("book", "wood", 7), ("letter", "wood", 12)):
        title, truth = f"{name}, {scene}, {corners} corners", "an outline drawn by hand"
        yield of_sheet(name, title, truth, lambda s, n=name, c=scene, k=corners: outlined(n, c, k))
    everything = RestoreSettings(sheet="all", render=COARSE)
    for name in ("book", "letter"):
        truth = "on a table, and all of it asked for"
        yield of_sheet(name, f"{name}, wood, all", truth, lambda s, n=name: scene_scan(n, "wood"), (), everything)


def captures() -> Iterator[Case]:
    field, cases = Path("data/field"), Path("cases")
    letter = (215.9, 279.4)
    for name in ("letter", "book_clean"):
        path = Path("data/virtual_scans") / name / f"{name}.obj"
        yield Case(name, "of another renderer", lambda p=path: of_file(p), size_mm=letter)
    for name in ("146", "148"):
        truth = "a third of its rectangle was not scanned and is blank"
        yield Case(f"david {name}", truth, lambda n=name: of_file(field / f"david/Scan_{n}.obj"), allowed=(LOOK,))
    seen = "the far sides of its waves are not on the photo: a tenth is blank"
    yield Case("curled map", seen, lambda: of_file("data/curled_map/curled_map.obj"), allowed=(LOOK,))
    for name in ("033", "145"):
        truth = "a sheet in the hand, right to 1 mm"
        yield Case(f"handheld {name}", truth, lambda n=name: of_file(f"data/handheld_sheet/{n}.obj"), allowed=(GOOD,))
    truth = "its unit is a guess: 0.95 m are right"
    yield Case("cloth", truth, lambda: of_file(field / "cloth/0_R4_quad.obj"), allowed=(LOOK,))
    yield Case("four textures", "true", lambda: of_file(cases / "multi-texture/scan.obj"), size_mm=(190.0, 250.0))
    for name, units, truth, allowed in (
        ("data/folded_sheet/crumpled_developable.obj", "auto", "its unit is a guess", (LOOK,)),
        ("data/field/hulk/shape_00.obj", "mm", "a bent comic of 73 points", (GOOD, LOOK)),
        ("data/field/mat/shape_00.obj", "mm", "a rubber mat of 1,500 points", (GOOD, LOOK)),
        ("data/field/meshes/curved_fold.obj", "mm", "paper folded along a curve, of 0.7 mm", (LOOK,)),
        ("data/field/meshes/quad.obj", "mm", "panels of glass, no paper", (LOOK, BAD)),
        ("data/field/meshes/hemisphere.obj", "m", "half a sphere", (BAD,)),
        ("data/field/meshes/face.obj", "m", "a face", (BAD,)),
        ("data/field/meshes/camel_b.obj", "mm", "a camel", (BAD,)),
    ):
        yield Case(Path(name).stem, truth, lambda n=name, u=units: of_file(n, u, draw=False), allowed=allowed)
    for name, truth, paper, allowed in (
        ("warped_photos/00411/warped_document_curled_bright.jpg", "one photo, size unknown", "unknown", (LOOK,)),
        ("warped_photos/00411/warped_document_curled_bright.jpg", "one photo of A4", "a4", (GOOD,)),
        ("warped_photos/00411/warped_document_crumpleseasy_bright.jpg", "one photo, crumpled A4", "a4", (LOOK,)),
    ):
        yield Case(
            f"{Path(name).stem.removeprefix('warped_document_')}, {paper}",
            truth,
            lambda n=name, p=paper: of_photo(Path("data") / n, p),
            allowed=allowed,
        )


def of_sheet(name, title, truth, make, allowed=(), settings=None) -> Case:
    made = sheet(name)
    size = None if allowed else (made.width_mm, made.height_mm)
    run = lambda: restore(make(made), settings or RestoreSettings(render=COARSE)).report  # noqa: E731
    return Case(title, truth, run, size, allowed)


def virtual(made, **how):
    return virtual_scan(made, points=40_000, photo_px=(1600, 1200), **how)


def plain(made) -> Scan:
    return virtual(made, noise_mm=0.05).scan


def scene_scan(name: str, scene: str) -> Scan:
    """Of `benchmarks/surroundings.py`, but with a quarter of its points and a sixth of its pixels."""
    surroundings.RANGE_RC, surroundings.ZOOM = (240, 320), 5.0
    return surroundings.scene_scan(name, scene)


def outlined(name: str, scene: str, corners: int) -> Scan:
    """The same with the outline that somebody draws on the photo who sets so many corners."""
    scan = scene_scan(name, scene)
    assert scan.camera is not None
    paper = np.isfinite(render_view(sheet(name), scan.camera).page_xy[..., 0]).astype(np.uint8)
    rim = max(cv2.findContours(paper, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[0], key=len)
    drawn = (cv2.approxPolyDP(rim, off, True) for off in range(1, 1000))
    mask = cv2.fillPoly(np.zeros_like(paper), [next(one for one in drawn if len(one) <= corners)], 1)
    return replace(scan, sheet=mask > 0)


def without(scan: Scan, faces: np.ndarray) -> Scan:
    return replace(scan, mesh=Mesh(scan.mesh.points, scan.mesh.faces[~faces]))


def with_hole(made) -> Scan:
    seen = virtual(made, noise_mm=0.05)
    place = seen.truth_xy[seen.scan.mesh.faces].mean(axis=1) - [made.width_mm / 2, made.height_mm / 2]
    return without(seen.scan, (np.abs(place) < [0.29 * made.width_mm, 0.29 * made.height_mm]).all(axis=1))


def in_cm() -> Report:
    """Of a file with numbers in cm that does not say so."""
    scan = plain(sheet("letter"))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scan.obj"
        write_scan(path, replace(scan, mesh=Mesh(scan.mesh.points / 10, scan.mesh.faces)))
        path.write_text("".join(line for line in path.open() if not line.startswith("#")))
        return of_file(path)


def mirrored() -> Report:
    scan = plain(sheet("letter"))
    assert scan.photo is not None
    assert scan.photo_xy is not None
    xy = scan.photo_xy * [-1, 1] + [scan.photo.shape[1] - 1, 0]
    return restore(Scan(scan.mesh, scan.photo[:, ::-1].copy(), xy), RestoreSettings(render=COARSE)).report


def dome() -> Report:
    mesh, uv = sheet_mesh(sheet("flat"), 4000, layout="grid")
    xy = (uv - uv.mean(axis=0)) / 150
    turn = np.linalg.norm(xy, axis=1, keepdims=True)
    around = xy / np.maximum(turn, 1e-9)
    points = 150 * np.c_[around * np.sin(turn), np.cos(turn)]
    return restore(Scan(Mesh(points, mesh.faces))).report


def of_file(path, units="auto", draw=True) -> Report:
    loaded = read_scan(SHARED / path, units=units)
    done = restore(loaded.scan, RestoreSettings(render=COARSE), draw=draw)
    return with_file_info(done.report, loaded, 0.0, 0.0)


def of_photo(path: Path, paper) -> Report:
    found = shapes_of_one(SHARED / path, PhotoSettings(paper=paper), lambda stage, share: None)[0]
    settings = RestoreSettings(render=COARSE, shading=ShadingSettings(shading="background"))
    return found.completed(restore(found.scan, settings), 0.0)


def off_by(report: Report, size_mm: tuple[float, float]) -> float:
    """Greater relative error of the page's two sides."""
    page = sorted((report.page.width_mm, report.page.height_mm))
    return max(abs(a / b - 1) for a, b in zip(page, sorted(size_mm), strict=True))


def is_right(case: Case, report: Report) -> bool:
    word = report.verdict.word
    if case.size_mm is None:
        return word in case.allowed
    off = off_by(report, case.size_mm)
    return not (off > OFF and word == GOOD) and not (off < TRUE and word == BAD)


def row(case: Case) -> tuple[str, bool]:
    try:
        report = case.make()
    except PlanishError as problem:
        return f"| {case.name} | {case.truth} | | refused | {problem.sentence} | wrong |", False
    right = is_right(case, report)
    page = f"{report.page.width_mm:.1f} x {report.page.height_mm:.1f}"
    size = page if case.size_mm is None else f"{page}, {100 * off_by(report, case.size_mm):.1f} % off"
    reasons = ", ".join(reason.code for reason in report.verdict.reasons)
    return (
        f"| {case.name} | {case.truth} | {size} | {report.verdict.word} | {reasons} | {'' if right else '**wrong**'} |",
        right,
    )


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("names", nargs="*")
    asked = parser.parse_args().names
    print(machine(), "\n")
    print("| scan | truth | page, mm | verdict | reasons | |")
    print("|---|---|---|---|---|---|")
    cases = [*gallery(), *tables(), *(captures() if SHARED.exists() else ())]
    results = []
    for case in cases:
        if not asked or any(word in case.name for word in asked):
            line, right = row(case)
            results.append(right)
            print(line, flush=True)
    print(f"\n{len(results)} scans, {results.count(False)} verdicts wrong.")
    sys.exit(not all(results))


if __name__ == "__main__":
    main()
