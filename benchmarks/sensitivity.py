"""What hangs on each threshold: benchmarks/sensitivity.py [NAME ...] [--rooms ROOM ...].

Every constant of planish's rooms that something is compared with is halved and doubled, one at a time, and the sheets
of the gallery are restored anew. A share above one half is varied by its distance from one (0.8: 0.6 and 0.9), an angle
whose cosine is compared as an angle, a pair of limits by how far they are apart. Kernels that read the constant are
compiled anew. Rooms of geometry are tried on bare meshes (4,000 points; in rows, as range images, irregular; without
noise, with white noise and with noise alike over three points), rooms that look at the photo on virtual scans of 3,000
points and 2 megapixels, `photo` on photos alone.

rms: of every point against its true place, after the best rigid fit [mm]. size: the greater of width and height against
the true sheet [%]. turn: of the page against the true one [degrees]. What changes by no more than rounding would, and
errors that change by less than a tenth, are not told. Real captures in ../shared/data, or where PLANISH_DATA says, are
restored as well, if there are any, and their long side is compared [mm]. With NAMEs only these constants. Prints
Markdown.
"""

from __future__ import annotations

import argparse
import os
import re
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np

import planish
from constants import Threshold, changed, thresholds
from machine import machine
from planish.gallery import sheet, sheet_mesh, virtual_scan
from planish.photo import find_shape
from planish.settings import RenderSettings, RestoreSettings
from truth import rigid_rms

Seen = dict[str, float | str]
Case = Callable[[], Seen]

DATA = Path(os.environ.get("PLANISH_DATA") or Path(__file__).parents[2] / "shared" / "data")
FACTORS = (0.5, 2.0)
SETTINGS = RestoreSettings(render=RenderSettings(dpi=120.0), pages="auto")
LEAST = {
    "rms": 0.002,
    "size": 0.01,
    "turn": 0.1,
    "spine": 0.3,
    "shade": 0.5,
    "outline": 0.2,
    "creases": 0.05,
    "straightness": 0.002,
    "long side": 0.2,
}
"""Smaller changes are not told: in mm, %, degrees, mm, %, % of the photo, page widths, heights of a letter, mm."""
ERRORS = ("rms", "size", "shade")
"""Nor are changes of these by less than a tenth."""
MESHES = ("book", "letter", "spread", "miura", "crumpled")
NOISES = {"": {}, ", noise": {"noise_mm": 0.07}, ", ripple": {"noise_mm": 0.1, "noise_correlation_px": 3.0}}


def mesh_cases() -> Iterator[tuple[str, Case]]:
    for k, name in enumerate(MESHES):
        for words, noise in NOISES.items():
            layout = ("range", "grid", "delaunay")[k % 3]
            mesh, truth = sheet_mesh(sheet(name), points=4000, layout=layout, **noise)
            yield name + words, partial(restored, planish.Scan(mesh), truth, sheet(name))
    torn, truth = sheet_mesh(sheet("book"), points=4000, cuts=[((-9.0, 150.0), (230.0, 140.0))], holes=3)
    yield "book, torn in two, holes", partial(restored, planish.Scan(torn), truth, sheet("book"))


def scan_cases() -> Iterator[tuple[str, Case]]:
    for name, turn in (("letter", 185.0), ("book", 5.0), ("wave", 95.0), ("spread", 5.0)):
        made = virtual_scan(sheet(name), points=3000, photo_px=(1600, 1200), noise_mm=0.05, turn_deg=turn)
        yield f"{name} lying at {turn:.0f}°", partial(restored, made.scan, made.truth_xy, made.sheet)


def outline_cases() -> Iterator[tuple[str, Case]]:
    for name in ("book", "letter", "curl"):
        photo = virtual_scan(sheet(name), points=3000, photo_px=(800, 600)).scan.photo
        for light in (1.0, 0.5):
            dim = (np.linspace(1.0, light, photo.shape[1])[None, :, None] * photo).astype(np.uint8)
            yield f"photo of a {name}{', half in shade' if light < 1 else ''}", partial(outline, dim)


def photo_cases() -> Iterator[tuple[str, Case]]:
    for name in ("book", "letter", "flat"):
        made = virtual_scan(sheet(name), points=3000, photo_px=(2000, 1500))
        yield f"{name}, photo alone", partial(from_photo, made.scan.photo)


ROOMS = {
    **dict.fromkeys(("geometry", "mesh", "surface", "sticks", "flattening"), (mesh_cases,)),
    "document": (scan_cases, outline_cases),
    **dict.fromkeys(("illumination", "render"), (scan_cases,)),
    "photo": (photo_cases,),
}


def real(room: str) -> Iterator[tuple[str, Case]]:
    """Real captures that suit the room, where there are any: the handheld sheets, and with a photo the curled map."""
    names = {"document": ["curled_map"], "photo": []}.get(room, ["handheld_sheet"])
    for path in (path for name in names for path in sorted((DATA / name).glob("*.obj"))):
        yield f"{path.parent.name}/{path.stem}", partial(restored, planish.read_scan(path).scan)


def restored(scan: planish.Scan, truth: np.ndarray | None = None, bent: object = None) -> Seen:
    """What a user sees of a restoration, and how far it is from the truth."""
    done = planish.restore(scan, SETTINGS)
    report, width, height = done.report, *done.flattening.size_mm
    seen: Seen = {"outcome": report.outcome, "notes": notes(report.warnings), "pages": f"{len(report.pages)} pages"}
    if report.spine:
        seen["spine"] = report.spine.x_mm
    if report.shading:
        seen |= {"light": report.shading.method, "shade": 100 * report.shading.unevenness}
    if truth is None:
        return {**seen, "long side": max(width, height)}
    sides = zip(sorted((width, height)), sorted((bent.width_mm, bent.height_mm)), strict=True)
    seen |= {"rms": rigid_rms(done.flattening.page_xy, truth), "size": max(100 * abs(a / b - 1) for a, b in sides)}
    if scan.photo is not None:
        x, y = (truth - truth.mean(axis=0)).T
        u, v = (done.flattening.page_xy - done.flattening.page_xy.mean(axis=0)).T
        seen["turn"] = float(np.degrees(np.arctan2((x * v - y * u).sum(), (x * u + y * v).sum())))
    return seen


def outline(photo: np.ndarray) -> Seen:
    from planish.document.sheet_outline import find_sheet

    found = find_sheet(photo)
    return {"sheet": "none" if found is None else "found", "outline": 0.0 if found is None else 100 * found.mean()}


def from_photo(photo: np.ndarray) -> Seen:
    shape = find_shape(photo)
    seen: Seen = {"shape": shape.report.shape, "notes": notes(shape.warnings), "creases": shape.report.creases}
    return seen | ({"straightness": shape.report.straightness} if shape.report.straightness else {})


def notes(warnings: object) -> str:
    """Warnings without their figures, so that only other ones count as a change."""
    return f"{len(warnings)} notes " + "".join(
        sorted(re.sub(r"[\d.,]+", "", str(warning))[:40] for warning in warnings)
    )


def watched(case: Case) -> Seen:
    try:
        return case()
    except planish.PlanishError as problem:
        return {"outcome": f"refused: {str(problem)[:60]}"}


def difference(was: Seen, now: Seen) -> list[str]:
    """What a user would notice."""
    told = []
    for key in dict.fromkeys([*was, *now]):
        a, b = was.get(key, "none"), now.get(key, "none")
        if isinstance(a, float) and isinstance(b, float):
            if abs(a - b) > max(LEAST[key], 0.1 * abs(a) if key in ERRORS else 0):
                told.append(f"{key} {a:.3g} → {b:.3g}")
        elif a != b:
            told.append(f"{key} {brief(a)} → {brief(b)}" if key != "notes" else "other notes")
    return told


def brief(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:.3g}"


def row(threshold: Threshold, cases: list[tuple[str, Case]], usual: list[Seen]) -> list[str]:
    cells = []
    for factor in FACTORS:
        with changed(threshold, threshold.times(factor)):
            found = [(name, difference(was, watched(case))) for (name, case), was in zip(cases, usual, strict=True)]
        found = [(name, told) for name, told in found if told]
        shown = "; ".join(f"{name}: {', '.join(told)}" for name, told in found[:3])
        cells.append(shown + (f"; and {len(found) - 3} more" if len(found) > 3 else "") or "-")
    return cells


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument("--rooms", nargs="+", default=list(ROOMS), choices=ROOMS)
    asked = parser.parse_args()
    found = {room: list(thresholds(room)) for room in asked.rooms}
    if unknown := set(asked.names) - {t.name for room in asked.rooms for t in found[room]}:
        parser.error(f"nothing is compared with {', '.join(sorted(unknown))} in these rooms")
    print(f"{machine()}\n\n| threshold | value (half, twice) | halved | doubled |\n|---|---|---|---|", flush=True)
    nothing, made = [], {}
    for room in asked.rooms:
        chosen = [t for t in found[room] if not asked.names or t.name in asked.names]
        for maker in ROOMS[room] if chosen else ():
            made[maker] = made.get(maker) or list(maker())
        cases = [case for maker in ROOMS[room] for case in made.get(maker, ())]
        cases += list(real(room)) if chosen else []
        usual = [watched(case) for _, case in cases] if chosen else []
        for threshold in chosen:
            cells = row(threshold, cases, usual)
            if cells == ["-", "-"]:
                nothing.append(threshold.place)
            else:
                tried = ", ".join(shown(threshold.times(factor)) for factor in FACTORS)
                print(f"| `{threshold.place}` | {shown(threshold.value)} ({tried}) | {' | '.join(cells)} |", flush=True)
    print(f"\nNothing changes with: {', '.join(f'`{place}`' for place in nothing) or 'none'}.")


def shown(value: float | tuple[float, ...]) -> str:
    return " to ".join(f"{v:.4g}" for v in (value if isinstance(value, tuple) else (value,)))


if __name__ == "__main__":
    main()
