"""Sheets in their surroundings: python benchmarks/surroundings.py [SHEET ...] [--scenes SCENE ...] [--forms FORM ...].

Virtual range images (640 x 480 pixels of about 0.8 mm, 0.05 mm of noise) with a photo of 12 megapixels, on a table of
wood or of white paper, under a shadow, beside a second sheet, held by a thumb; as the device gives them, as a mesh with
four texture images, and with colours of points alone. Each is restored with default settings; the page's size is
compared with the true one, and its words with those that the same sheet has without its table. Words are Tesseract's
(Debian's tesseract-ocr). Prints a Markdown table.
"""

from __future__ import annotations

import argparse
import tempfile
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy import ndimage

import planish
from machine import machine
from planish.acquire.grid_mesh import grid_mesh
from planish.gallery import sheet, typeset_sheet
from planish.gallery.scene_view import aim_camera, reflectance, render_view
from planish.geometry import depths, project
from planish.io import write_page
from planish.mesh import rasterize
from planish.types import Camera, Scan, Texture
from truth import read_text

EYE = (0.0, -60.0, 620.0)
VIEW_MM = {"spread": 560.0}
RANGE_RC = (480, 640)
ZOOM = 6.25
"""Photo pixels to one of the range image."""

NOISE_MM = 0.05
LAMP = np.array([-350.0, 250.0, 700.0])
WOOD, WHITE, SKIN = np.array([0.16, 0.09, 0.05]), np.array([1.0, 0.985, 0.94]), np.array([0.52, 0.30, 0.22])
DARK_SKIN = np.array([0.13, 0.07, 0.05])
SCENES = ("bare", "wood", "second sheet", "thumb", "dark thumb", "shadow", "white table")
FORMS = ("photo", "textures", "colours")


@dataclass
class Seen:
    """What every pixel of a camera sees: points, normals and linear reflectance; further things go before it."""

    camera: Camera
    points: np.ndarray
    normals: np.ndarray
    reflect: np.ndarray
    paper: np.ndarray

    def add(self, points: np.ndarray, normals: np.ndarray, reflect: np.ndarray, paper: bool = False) -> None:
        there = np.isfinite(points[..., 0])
        mine, other = (
            depths(self.camera, p.reshape(-1, 3)).reshape(there.shape) for p in (self.points, np.nan_to_num(points))
        )
        nearer = there & ~(mine <= other)
        self.points[nearer], self.normals[nearer] = points[nearer], normals[nearer]
        self.reflect[nearer] = np.broadcast_to(reflect, points.shape)[nearer]
        self.paper[nearer] = paper


def view(name: str, camera: Camera, table: np.ndarray, printed) -> Seen:
    shown = render_view(sheet(name), camera)
    paper = np.isfinite(shown.page_xy[..., 0])
    reflect = reflectance(shown, printed)
    grain = 1 + 0.2 * np.sin(shown.points[..., :1] / 3 + 2 * np.sin(shown.points[..., 1:2] / 40))
    wooden = table is WOOD
    reflect = np.where(paper[..., None], reflect, table * (grain if wooden else 1))
    return Seen(camera, shown.points.copy(), shown.normals.copy(), reflect, paper)


def second_sheet(seen: Seen) -> None:
    """Another sheet, a wave 20 mm to the right of the first, upside down."""
    right = float(np.nanmax(seen.points[..., 0][seen.paper]))
    other = sheet("wave")
    shift = np.array([right + 20 + 110, 0.0, 0.0])
    moved = replace(seen.camera, translation=seen.camera.translation + seen.camera.rotation @ shift)
    shown = render_view(other, moved)
    points = np.where(np.isfinite(shown.page_xy[..., :1]), shown.points + shift, np.nan)
    seen.add(points, shown.normals, WHITE)


def thumb(seen: Seen, skin: np.ndarray) -> None:
    """A thumb 18 mm wide that reaches 15 mm over the right side of the sheet, its hand and arm beside it."""
    inside = seen.points[seen.paper]
    x, y = float(inside[:, 0].max()), float(np.median(inside[:, 1])) - 30
    near = inside[(np.abs(inside[:, 1] - y) < 12) & (inside[:, 0] > x - 25)]
    z = float(near[:, 2].max())
    parts = [
        ((x - 6, y, z + 6), (x + 30, y - 8, z + 6), 9.0),
        ((x + 30, y - 8, z + 8), (x + 75, y - 40, max(z, 20) + 8), 22.0),
        ((x + 75, y - 40, max(z, 20) + 8), (x + 260, y - 160, max(z, 25) + 10), 32.0),
    ]
    for start, end, radius in parts:
        points, normals, faces = capsule(np.array(start), np.array(end), radius)
        pixel_xy, depth = project(seen.camera, points), depths(seen.camera, points)
        face, w = rasterize(pixel_xy, faces, seen.camera.shape_rc, nearness=1 / depth, perspective=True)
        weights = np.concatenate([1 - w.sum(axis=2, keepdims=True), w], axis=2)
        at, up = (np.einsum("rck,rckd->rcd", weights, v[faces[np.maximum(face, 0)]]) for v in (points, normals))
        seen.add(np.where((face >= 0)[..., None], at, np.nan), up, skin)


def capsule(start: np.ndarray, end: np.ndarray, radius: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    axis = (end - start) / np.linalg.norm(end - start)
    across = np.cross(axis, [0, 0, 1.0])
    across /= np.linalg.norm(across)
    up = np.cross(across, axis)
    turn, lift = np.meshgrid(np.linspace(0, 2 * np.pi, 49), np.linspace(-np.pi / 2, np.pi / 2, 41), indexing="ij")
    unit = (
        np.cos(lift)[..., None] * (np.cos(turn)[..., None] * across + np.sin(turn)[..., None] * up)
        + np.sin(lift)[..., None] * axis
    )
    points = unit * radius + np.where(lift[..., None] > 0, end, start)
    k = np.arange(49 * 41, dtype=np.int32).reshape(49, 41)
    a, b, c, d = (v.ravel() for v in (k[:-1, :-1], k[:-1, 1:], k[1:, :-1], k[1:, 1:]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([c, b, d], axis=1)])
    return points.reshape(-1, 3), unit.reshape(-1, 3), faces


def lit(seen: Seen, scene: str, rng: np.random.Generator) -> np.ndarray:
    """The photo: a lamp near by, a little light from all around, the shadow of a hand across sheet and table."""
    towards = LAMP - seen.points
    distance = np.linalg.norm(towards, axis=-1, keepdims=True)
    light = np.clip((seen.normals * towards).sum(axis=-1, keepdims=True) / distance, 0, None) * (800 / distance) ** 2
    if scene == "shadow":
        x, y = seen.points[..., :1], seen.points[..., 1:2]
        light = light * (1 - 0.75 / (1 + np.exp((x - 0.6 * y - 60) / -6)))
    linear = seen.reflect * (0.15 + 0.85 * light)
    linear = 0.8 * linear / np.nanquantile(linear[seen.paper], 0.98)
    levels = 255 * np.clip(np.nan_to_num(linear), 0, 1) ** (1 / 2.2) + rng.normal(0, 1.5, linear.shape)
    return np.clip(np.rint(levels), 0, 255).astype(np.uint8)


def scene_scan(name: str, scene: str) -> Scan:
    """What the device gives: a range image, and a photo of the same view."""
    rng = np.random.default_rng(0)
    coarse = aim_camera(EYE, (0, 0, 0), VIEW_MM.get(name, 500.0), RANGE_RC)
    fine = zoomed(coarse)
    printed, _ = typeset_sheet(sheet(name))
    views = []
    for camera in (coarse, fine):
        seen = view(name, camera, WHITE if scene == "white table" else WOOD, printed)
        if scene == "second sheet":
            second_sheet(seen)
        if "thumb" in scene:
            thumb(seen, DARK_SKIN if "dark" in scene else SKIN)
        views.append(seen)
    points, photo = views[0].points, lit(views[1], scene, rng)
    rays = points - np.asarray(EYE)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    points = points + rays * rng.normal(0, NOISE_MM, (*rays.shape[:2], 1))
    if scene == "bare":
        points = np.where(views[0].paper[..., None], points, np.nan)
    mesh, range_xy = grid_mesh(points, coarse)
    return Scan(mesh, photo, (range_xy + 0.5) * ZOOM - 0.5, fine)


def as_form(scan: Scan, form: str) -> Scan:
    """The same with its photo as four textures, a quarter of the view each, or as colours of its points."""
    assert scan.photo is not None
    assert scan.photo_xy is not None
    if form == "photo":
        return scan
    if form == "colours":
        mean = np.stack([ndimage.uniform_filter(scan.photo[..., k], 6, float) for k in range(3)], axis=-1)
        col, row = np.rint(scan.photo_xy).astype(int).T
        return Scan(scan.mesh, colours=np.rint(mean[row, col]).astype(np.uint8))
    places = scan.photo_xy[scan.mesh.faces]
    middle = places.mean(axis=1)
    rows, cols = scan.photo.shape[:2]
    number = (middle[:, 0] > cols / 2) + 2 * (middle[:, 1] > rows / 2)
    images = tuple(Texture((rows, cols), 8, lambda: scan.photo) for _ in range(4))
    return Scan(scan.mesh, photo_xy=places, textures=images, texture_of_face=number.astype(np.int32))


def zoomed(camera: Camera) -> Camera:
    matrix = camera.matrix.copy()
    matrix[:2] *= ZOOM
    matrix[:2, 2] += (ZOOM - 1) / 2
    rows, cols = camera.shape_rc
    return replace(camera, matrix=matrix, shape_rc=(round(rows * ZOOM), round(cols * ZOOM)))


def words_of(page) -> list[str]:
    with tempfile.TemporaryDirectory() as folder:
        write_page(Path(folder) / "page.png", page)
        return read_text(Path(folder) / "page.png").split()


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("sheets", nargs="*", default=["book", "letter", "spread", "crumpled"])
    parser.add_argument("--scenes", nargs="*", default=SCENES)
    parser.add_argument("--forms", nargs="*", default=FORMS)
    parser.add_argument("--no-text", action="store_true")
    parser.add_argument("--keep", type=Path)
    asked = parser.parse_args()
    print(machine(), "\n")
    print("| sheet | scene | form | size off, % | words missing more than bare, % | warnings |")
    print("|---|---|---|---|---|---|")
    for name in asked.sheets:
        made = sheet(name)
        true = np.array([made.width_mm, made.height_mm])
        bare: dict[str, Counter[str]] = {}
        for scene in asked.scenes:
            scan = scene_scan(name, scene)
            for form in asked.forms:
                done = planish.restore(as_form(scan, form), draw=not asked.no_text)
                size = np.array(done.flattening.size_mm)
                turned = (size[0] > size[1]) != (true[0] > true[1])
                off = 100 * (size / (true[::-1] if turned else true) - 1)
                missing = ""
                if done.page is not None:
                    words = Counter(words_of(done.page))
                    bare.setdefault(form, words)
                    missing = f"{100 * (bare[form] - words).total() / max(bare[form].total(), 1):.1f}"
                    if asked.keep:
                        asked.keep.mkdir(parents=True, exist_ok=True)
                        write_page(asked.keep / f"{name}-{scene}-{form}.png".replace(" ", "-"), done.page)
                codes = ", ".join(w.code for w in done.prepared.warnings)
                cells = name, scene, form, ", ".join(f"{o:+.2f}" for o in off), missing, codes
                print("| " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
